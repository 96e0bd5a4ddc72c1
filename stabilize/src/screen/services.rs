//! What the services are asked, in the words of D-Bus.

use super::Presence;
use super::words::{self, Stage};
use std::os::fd::{AsFd, OwnedFd};
use zbus::names::OwnedUniqueName;
use zbus::{Connection, Message};

/// What services are told about who asks.
const APPLICATION: &str = "stabilize";

/// Where screen savers are found, and where they were before there was a specification.
const SAVER_PATH: &str = "/org/freedesktop/ScreenSaver";
const OLDER_SAVER_PATH: &str = "/ScreenSaver";

/// A service that is asked, and the bus it is on.
pub(super) struct Service {
    pub(super) what: &'static str,
    pub(super) bus: &'static str,
    pub(super) name: &'static str,
}

pub(super) const SAVER: Service =
    Service { what: "screen saver", bus: "session bus", name: "org.freedesktop.ScreenSaver" };
pub(super) const LOGIN: Service =
    Service { what: "idle and sleep", bus: "system bus", name: "org.freedesktop.login1" };

/// The screen saver's promise to hold off. It ends with the connection, too.
pub(super) struct Saver {
    bus: Connection,
    /// The connection that gave the promise. The service's name might start another service.
    owner: OwnedUniqueName,
    path: &'static str,
    cookie: u32,
}

/// Has the screen saver hold off.
pub(super) async fn inhibit_saver(bus: Connection, reason: &str) -> Result<Saver, String> {
    let (name, arguments) = (Some(SAVER.name), (APPLICATION, reason));
    let inhibit = async |path| bus.call_method(name, path, name, "Inhibit", &arguments).await;
    let (path, reply) = match inhibit(SAVER_PATH).await {
        Err(error) if words::is_unknown_object(&error) => (OLDER_SAVER_PATH, inhibit(OLDER_SAVER_PATH).await),
        reply => (SAVER_PATH, reply),
    };
    let (owner, cookie) = reply
        .and_then(|reply| cookie(&reply))
        .map_err(|error| words::refusal(&SAVER, Stage::Asking, &error))?;
    Ok(Saver { bus, owner, path, cookie })
}

fn cookie(reply: &Message) -> zbus::Result<(OwnedUniqueName, u32)> {
    let header = reply.header();
    let owner = header.sender().ok_or(zbus::Error::MissingField)?;
    Ok((owner.to_owned().into(), reply.body().deserialize()?))
}

impl Saver {
    /// Tells the screen saver to carry on.
    pub(super) async fn release(self) {
        let Saver { bus, owner, path, cookie } = self;
        let _ = bus.call_method(Some(owner), path, Some(SAVER.name), "UnInhibit", &(cookie,)).await;
        let _ = bus.close().await;
    }
}

/// Has logind hold off idleness and sleep, for as long as the file is open.
pub(super) async fn inhibit_idle(bus: Connection, reason: &str) -> Result<OwnedFd, String> {
    let arguments = ("idle:sleep", APPLICATION, reason, "block");
    let interface = Some("org.freedesktop.login1.Manager");
    let file = bus
        .call_method(Some(LOGIN.name), "/org/freedesktop/login1", interface, "Inhibit", &arguments)
        .await
        .and_then(|reply| reply.body().deserialize::<zbus::OwnedFd>())
        .map_err(|error| words::refusal(&LOGIN, Stage::Asking, &error))?;
    // A command that is started inherits the files that zbus receives. It must not hold on to this
    // one after us, and a copy made by the standard library is not inherited.
    file.as_fd().try_clone_to_owned().map_err(|error| format!("no file left for {}: {error}", LOGIN.name))
}

/// What the bus knows about a service.
pub(super) async fn presence(bus: &Connection, service: &Service) -> Result<Presence, String> {
    let name = Some("org.freedesktop.DBus");
    let running = bus
        .call_method(name, "/org/freedesktop/DBus", name, "NameHasOwner", &(service.name,))
        .await
        .and_then(|reply| reply.body().deserialize::<bool>());
    if running.map_err(|error| words::refusal(service, Stage::Asking, &error))? {
        return Ok(Presence::Running);
    }
    let startable = bus
        .call_method(name, "/org/freedesktop/DBus", name, "ListActivatableNames", &())
        .await
        .and_then(|reply| reply.body().deserialize::<Vec<String>>());
    let startable = startable.map_err(|error| words::refusal(service, Stage::Asking, &error))?;
    let found = startable.iter().any(|name| name == service.name);
    Ok(if found { Presence::Startable } else { Presence::Missing })
}
