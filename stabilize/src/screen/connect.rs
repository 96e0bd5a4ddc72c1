//! Sockets to the buses, where need be opened as another user.

use super::address::Place;
use crate::user::{Rights, acting};
use nix::errno::Errno;
use nix::sys::socket::{AddressFamily, SockFlag, SockType, UnixAddr, connect as connect_socket, socket};
use nix::unistd::geteuid;
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;

/// A socket to a bus that has not been greeted yet.
pub(super) struct Connected {
    pub(super) stream: UnixStream,
    /// The user that the other side sees at its end of the socket.
    pub(super) uid: u32,
}

/// Connects to the first of `places` that takes connections, as `user` if one is given, or says on
/// one line why there is none. Never waits.
pub(super) fn connect(places: &[Place], user: Option<&Rights>, bus: &str) -> Result<Connected, String> {
    let opened = acting(user, || open_first(places, bus))
        .map_err(|error| format!("cannot act as another user: {}", error.desc()))?;
    let uid = user.map_or_else(geteuid, |user| user.uid).as_raw();
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
