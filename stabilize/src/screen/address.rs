//! Where the buses are.

use crate::user::Rights;
use std::ffi::{OsStr, OsString};
use std::fmt;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};

/// Where each bus may be, in the order in which to try.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Addresses {
    pub(super) session: Vec<Place>,
    pub(super) system: Vec<Place>,
}

/// One address out of a list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// A socket in the file system.
    Path(PathBuf),
    /// A socket with a name that is no file.
    Abstract(Vec<u8>),
    /// Anything else, as it was written. It is not followed: some transports run a program or
    /// connect to another machine, and no desktop uses them.
    Other(String),
}

impl Addresses {
    /// What the environment says, asked by name, and else where the buses usually are.
    ///
    /// For a `bus_user` this process is root and the environment the user's, in part: then only
    /// the session bus is taken from it, and only a socket.
    pub(super) fn find(bus_user: Option<&Rights>, get: impl Fn(&str) -> Option<OsString>) -> Addresses {
        let get = |name| get(name).filter(|value| !value.is_empty());
        let list = |name| get(name).map(|list| parse(&list.to_string_lossy())).unwrap_or_default();

        let mut session = list("DBUS_SESSION_BUS_ADDRESS");
        let mut system = Vec::new();
        let runtime_folder = match bus_user {
            Some(user) => {
                session.retain(|place| !matches!(place, Place::Other(_)));
                format!("/run/user/{}", user.uid).into()
            }
            None => {
                system = list("DBUS_SYSTEM_BUS_ADDRESS");
                get("XDG_RUNTIME_DIR")
                    .map(PathBuf::from)
                    .unwrap_or_else(|| format!("/run/user/{}", nix::unistd::geteuid()).into())
            }
        };
        if session.is_empty() {
            session.push(Place::Path(runtime_folder.join("bus")));
        }
        if system.is_empty() {
            for run in ["/run", "/var/run"] {
                system.push(Place::Path(Path::new(run).join("dbus/system_bus_socket")));
            }
        }
        Addresses { session, system }
    }
}

/// Reads a list of addresses in the form of the D-Bus specification.
pub(super) fn parse(list: &str) -> Vec<Place> {
    let entries = list.split(';').filter(|entry| !entry.is_empty());
    entries.map(|entry| socket(entry).unwrap_or_else(|| Place::Other(entry.to_owned()))).collect()
}

fn socket(entry: &str) -> Option<Place> {
    let pairs = entry.strip_prefix("unix:")?;
    pairs.split(',').find_map(|pair| match pair.split_once('=')? {
        ("path", value) => Some(Place::Path(OsString::from_vec(unescape(value)?).into())),
        ("abstract", value) => Some(Place::Abstract(unescape(value)?)),
        _ => None,
    })
}

/// The bytes of a value, in which `%20` stands for a space. None if what follows a `%` is no byte.
fn unescape(value: &str) -> Option<Vec<u8>> {
    let mut parts = value.split('%');
    let mut bytes = parts.next()?.as_bytes().to_vec();
    for part in parts {
        let (digits, rest) = part.split_at_checked(2)?;
        bytes.push(u8::from_str_radix(digits, 16).ok()?);
        bytes.extend_from_slice(rest.as_bytes());
    }
    Some(bytes)
}

impl fmt::Display for Place {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Path(path) => write!(formatter, "{}", path.display()),
            Place::Abstract(name) => write!(formatter, "@{}", OsStr::from_bytes(name).display()),
            Place::Other(entry) => formatter.write_str(entry),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn find(bus_user: Option<u32>, variables: &[(&str, &str)]) -> Addresses {
        let user = bus_user.map(|uid| Rights { uid: uid.into(), gid: uid.into(), groups: Vec::new() });
        Addresses::find(user.as_ref(), |name| {
            variables.iter().find(|(known, _)| *known == name).map(|(_, value)| value.into())
        })
    }

    fn path(path: &str) -> Place {
        Place::Path(path.into())
    }

    #[test]
    fn addresses_are_read_as_the_specification_writes_them() {
        assert_eq!(parse("unix:path=/run/bus,guid=0123"), [path("/run/bus")]);
        assert_eq!(parse("unix:guid=0123,path=/a%20b%2C"), [path("/a b,")]);
        assert_eq!(
            parse("unix:abstract=/tmp/x;unix:path=/y"),
            [Place::Abstract(b"/tmp/x".to_vec()), path("/y")]
        );
        for other in
            ["tcp:host=localhost,port=1", "unixexec:path=/bin/sh", "unix:tmpdir=/tmp", "unix:path=%2", "x"]
        {
            assert_eq!(parse(other), [Place::Other(other.into())]);
        }
        assert_eq!(parse(""), []);
    }

    #[test]
    fn the_environment_goes_before_the_usual_places() {
        let mine = format!("/run/user/{}/bus", nix::unistd::geteuid());
        let usual = [path("/run/dbus/system_bus_socket"), path("/var/run/dbus/system_bus_socket")];
        let none = find(None, &[("DBUS_SESSION_BUS_ADDRESS", ""), ("XDG_RUNTIME_DIR", "")]);
        assert_eq!((none.session, none.system), (vec![path(&mine)], usual.to_vec()));

        let folder = find(None, &[("XDG_RUNTIME_DIR", "/folder")]);
        assert_eq!(folder.session, [path("/folder/bus")]);

        let both = find(
            None,
            &[
                ("DBUS_SESSION_BUS_ADDRESS", "unix:path=/a"),
                ("DBUS_SYSTEM_BUS_ADDRESS", "tcp:host=b"),
                ("XDG_RUNTIME_DIR", "/folder"),
            ],
        );
        assert_eq!(both.session, [path("/a")]);
        assert_eq!(both.system, [Place::Other("tcp:host=b".into())]);
    }

    #[test]
    fn root_takes_nothing_but_a_socket_of_the_session_from_a_user() {
        for variables in [
            &[][..],
            &[("XDG_RUNTIME_DIR", "/x"), ("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/x")],
            &[("DBUS_SESSION_BUS_ADDRESS", "unixexec:path=/x;tcp:host=x")],
        ] {
            let found = find(Some(1000), variables);
            assert_eq!(found.session, [path("/run/user/1000/bus")]);
            assert_eq!(found.system[0], path("/run/dbus/system_bus_socket"));
        }
        let found = find(Some(1000), &[("DBUS_SESSION_BUS_ADDRESS", "unixexec:path=/x;unix:path=/y")]);
        assert_eq!(found.session, [path("/y")]);
    }
}
