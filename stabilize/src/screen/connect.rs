//! Sockets to the buses, where need be opened as another user.

use super::address::Place;
use nix::errno::Errno;
use nix::sys::socket::{AddressFamily, SockFlag, SockType, UnixAddr, connect as connect_socket, socket};
use nix::unistd::{Gid, Uid, getegid, geteuid, getgroups, setegid, seteuid, setgroups};
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;

/// The user whose session bus is meant, where that is not the one this process runs as: the one who
/// called `sudo`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusUser {
    /// The user's number.
    pub uid: u32,
    /// The number of the user's own group.
    pub gid: u32,
}

/// A socket to a bus that has not been greeted yet.
pub(super) struct Connected {
    pub(super) stream: UnixStream,
    /// The user that the other side sees at its end of the socket.
    pub(super) uid: u32,
}

/// Connects to the first of `places` that takes connections, as `user` if one is given, or says on
/// one line why there is none. Never waits.
pub(super) fn connect(places: &[Place], user: Option<&BusUser>, bus: &str) -> Result<Connected, String> {
    let opened = match user {
        Some(user) => acting_as(user, || open_first(places, bus))
            .map_err(|error| format!("cannot act as user {}: {}", user.uid, error.desc()))?,
        None => open_first(places, bus),
    };
    let uid = user.map_or_else(|| geteuid().as_raw(), |user| user.uid);
    opened.map(|stream| Connected { stream, uid })
}

fn open_first(places: &[Place], bus: &str) -> Result<UnixStream, String> {
    let mut refusal = None;
    for place in places {
        match open(place) {
            Ok(stream) => return Ok(stream),
            // The first is where the bus should be.
            Err(error) => _ = refusal.get_or_insert_with(|| describe(place, bus, error)),
        }
    }
    Err(refusal.unwrap_or_else(|| format!("there is no {bus}")))
}

fn open(place: &Place) -> nix::Result<UnixStream> {
    let address = match place {
        Place::Path(path) => UnixAddr::new(path)?,
        Place::Abstract(name) => UnixAddr::new_abstract(name)?,
        Place::Other(_) => return Err(Errno::EPROTONOSUPPORT),
    };
    // Without blocking, so that a server that takes no connections cannot hold this up.
    let flags = SockFlag::SOCK_CLOEXEC | SockFlag::SOCK_NONBLOCK;
    let socket = socket(AddressFamily::Unix, SockType::Stream, flags, None)?;
    connect_socket(socket.as_raw_fd(), &address)?;
    Ok(UnixStream::from(socket))
}

fn describe(place: &Place, bus: &str, error: Errno) -> String {
    match error {
        Errno::ENOENT | Errno::ENOTDIR if bus == super::SAVER.bus => {
            format!("there is no {bus} at {place}; a desktop session has one")
        }
        Errno::ENOENT | Errno::ENOTDIR => format!("there is no {bus} at {place}"),
        Errno::ECONNREFUSED => format!("there is no {bus}: nobody listens at {place}"),
        Errno::EAGAIN => format!("the {bus} at {place} takes no connections"),
        Errno::EPROTONOSUPPORT => {
            format!("the {bus} is at {place}, and only unix:path= and unix:abstract= are supported")
        }
        _ => format!("cannot connect to the {bus} at {place}: {}", error.desc()),
    }
}

/// Does something with the effective ids of `user`, and nothing but that user's rights.
///
/// Effective ids belong to the whole process, so no other thread should open or create anything
/// meanwhile. If they cannot be restored the process is aborted: it must not go on as somebody else.
fn acting_as<T>(user: &BusUser, work: impl FnOnce() -> T) -> nix::Result<T> {
    let (uid, gid) = (Uid::from_raw(user.uid), Gid::from_raw(user.gid));
    // Undone in the opposite order. The user goes last and comes back first, because only root may
    // change the others.
    let groups = getgroups()?;
    setgroups(&[gid])?;
    let _groups = Undo(|| setgroups(&groups));
    let own_gid = getegid();
    setegid(gid)?;
    let _gid = Undo(|| setegid(own_gid));
    let own_uid = geteuid();
    seteuid(uid)?;
    let _uid = Undo(|| seteuid(own_uid));
    Ok(work())
}

/// Takes back a change of ids when it is dropped, also when that is because of an error or a panic.
struct Undo<F: Fn() -> nix::Result<()>>(F);

impl<F: Fn() -> nix::Result<()>> Drop for Undo<F> {
    fn drop(&mut self) {
        if let Err(error) = (self.0)() {
            eprintln!("stabilize: cannot become root again: {}", error.desc());
            std::process::abort();
        }
    }
}
