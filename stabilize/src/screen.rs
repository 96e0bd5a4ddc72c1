//! Keeps the screen awake and the machine from sleeping, over D-Bus.
//!
//! Two services are asked, at the same time: the desktop's screen saver on the session bus, and
//! logind on the system bus. Neither has to be there: what cannot be had is a refusal with a reason,
//! and never an error. Both let go when this process ends, however it ends, because the one watches
//! the connection and the other the file that it handed out.

mod address;
mod connect;
mod services;
mod words;

#[cfg(test)]
mod tests;

use crate::user::Rights;
use address::Addresses;
use connect::connect;
use record::Inhibition;
use services::{LOGIN, SAVER, Saver, Service, inhibit_idle, inhibit_saver, presence};
use std::cell::Cell;
use std::env;
use std::future::poll_fn;
use std::os::fd::OwnedFd;
use std::pin::pin;
use std::task::Poll;
use std::time::Duration;
use words::Stage;
use zbus::Connection;
use zbus::connection::Builder;
use zruntime::SharedRuntime;

/// How long a screen saver may take to let go. Closing the connection ends the inhibition anyway.
const RELEASE_LIMIT: Duration = Duration::from_millis(200);

/// Keeps the screen on and the machine awake for as long as it lives, as far as it was let.
pub struct Screen {
    outcomes: [Inhibition; 2],
    saver: Option<Saver>,
    /// logind holds off idleness and sleep until this is closed. Its connection is of no more use.
    _idle: Option<OwnedFd>,
}

/// Whether a service could be asked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reach {
    /// What the service would hold off: `screen saver`, or `idle and sleep`.
    pub what: &'static str,
    /// The bus: `session bus`, or `system bus`.
    pub bus: &'static str,
    /// The service's name on D-Bus.
    pub service: &'static str,
    /// What the bus says of the service, or why the bus cannot be asked, on one line.
    pub presence: Result<Presence, String>,
}

/// What a bus knows about a service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// It runs.
    Running,
    /// It does not run; the bus starts it when it is asked for something.
    Startable,
    /// It neither runs nor can be started.
    Missing,
}

impl Screen {
    /// Asks the screen saver and logind to hold off, telling them the `reason`, and waits up to
    /// `limit` for the slower one. Returns at once where there is no bus. Never fails: see
    /// [`Screen::outcomes`].
    ///
    /// With a `bus_user` the process must be root; the session bus is then that user's, and the
    /// process has the user's effective ids while it connects. Ids belong to the whole process, so
    /// call this before there are threads that open or create something. One thread stays behind
    /// while the screen saver is held off; it takes over the caller's signal mask.
    ///
    /// Neither this nor the drop may be called from within an asynchronous task.
    pub fn awake(bus_user: Option<&Rights>, reason: &str, limit: Duration) -> Screen {
        let addresses = Addresses::find(bus_user, |name| env::var_os(name));
        Screen::awake_at(&addresses, bus_user, reason, limit)
    }

    fn awake_at(addresses: &Addresses, bus_user: Option<&Rights>, reason: &str, limit: Duration) -> Screen {
        let (saver, idle) = ask_both(
            addresses,
            bus_user,
            limit,
            async |bus| inhibit_saver(bus, reason).await,
            async |bus| inhibit_idle(bus, reason).await,
        );
        let (saver, saver_refusal) = apart(saver);
        let (idle, idle_refusal) = apart(idle);
        let outcome = |service: &Service, refusal| Inhibition {
            what: service.what.into(),
            service: service.name.into(),
            refusal,
        };
        Screen {
            outcomes: [outcome(&SAVER, saver_refusal), outcome(&LOGIN, idle_refusal)],
            saver,
            _idle: idle,
        }
    }

    /// What became of each request: the screen saver's, then logind's.
    pub fn outcomes(&self) -> &[Inhibition] {
        &self.outcomes
    }
}

impl Drop for Screen {
    /// Tells the screen saver to carry on, and waits a fifth of a second at most for it.
    fn drop(&mut self) {
        if let Some(saver) = self.saver.take() {
            zbus::block_on(async {
                // A screen saver that does not answer notices that the connection is gone.
                let _ = within(RELEASE_LIMIT, saver.release()).await;
            });
        }
    }
}

/// Asks both buses about the two services, within `limit`, without holding anything off: the screen
/// saver, then logind. What [`Screen::awake`] says about `bus_user` and threads holds here too.
pub fn probe(bus_user: Option<&Rights>, limit: Duration) -> [Reach; 2] {
    probe_at(&Addresses::find(bus_user, |name| env::var_os(name)), bus_user, limit)
}

fn probe_at(addresses: &Addresses, bus_user: Option<&Rights>, limit: Duration) -> [Reach; 2] {
    let (saver, login) = ask_both(
        addresses,
        bus_user,
        limit,
        async |bus| presence(&bus, &SAVER).await,
        async |bus| presence(&bus, &LOGIN).await,
    );
    [(SAVER, saver), (LOGIN, login)].map(|(service, presence)| Reach {
        what: service.what,
        bus: service.bus,
        service: service.name,
        presence,
    })
}

/// Connects to both buses, and has both asked at once. `limit` is for each, from the handshake on.
fn ask_both<S, L>(
    addresses: &Addresses,
    bus_user: Option<&Rights>,
    limit: Duration,
    saver: impl AsyncFnOnce(Connection) -> Result<S, String>,
    login: impl AsyncFnOnce(Connection) -> Result<L, String>,
) -> (Result<S, String>, Result<L, String>) {
    // Here and not later, because ids are switched: zbus may start a thread from its first poll on.
    let session = connect(&addresses.session, bus_user, SAVER.bus);
    let system = connect(&addresses.system, None, LOGIN.bus);
    match (session, system) {
        (Err(session), Err(system)) => (Err(session), Err(system)),
        (session, system) => {
            zbus::block_on(both(ask(&SAVER, session, limit, saver), ask(&LOGIN, system, limit, login)))
        }
    }
}

async fn ask<T>(
    service: &Service,
    connected: Result<connect::Connected, String>,
    limit: Duration,
    question: impl AsyncFnOnce(Connection) -> Result<T, String>,
) -> Result<T, String> {
    let connected = connected?;
    let entered = Cell::new(false);
    let answer = async {
        let bus = Builder::unix_stream(connected.stream).user_id(connected.uid).build().await;
        let bus = bus.map_err(|error| words::refusal(service, Stage::Entering(connected.uid), &error))?;
        entered.set(true);
        question(bus).await
    };
    // Whatever was asked for and is granted too late ends with the connection, which is dropped.
    within(limit, answer).await.unwrap_or_else(|| {
        let silent = if entered.get() { service.name.to_owned() } else { format!("the {}", service.bus) };
        Err(format!("{silent} does not answer within {limit:?}"))
    })
}

/// What the future gives, or nothing if it takes longer than `limit`.
async fn within<T>(limit: Duration, future: impl Future<Output = T>) -> Option<T> {
    // Without a runtime zbus could not have connected, and there would be nothing to wait for.
    SharedRuntime::current().ok()?.timeout(limit, future).await.ok()
}

/// Runs two futures side by side on one thread.
async fn both<A, B>(left: impl Future<Output = A>, right: impl Future<Output = B>) -> (A, B) {
    let (mut left, mut right) = (pin!(left), pin!(right));
    let mut done = (None, None);
    poll_fn(|context| {
        if done.0.is_none()
            && let Poll::Ready(value) = left.as_mut().poll(context)
        {
            done.0 = Some(value);
        }
        if done.1.is_none()
            && let Poll::Ready(value) = right.as_mut().poll(context)
        {
            done.1 = Some(value);
        }
        match (done.0.take(), done.1.take()) {
            (Some(left), Some(right)) => Poll::Ready((left, right)),
            unfinished => {
                done = unfinished;
                Poll::Pending
            }
        }
    })
    .await
}

fn apart<T>(outcome: Result<T, String>) -> (Option<T>, Option<String>) {
    match outcome {
        Ok(value) => (Some(value), None),
        Err(refusal) => (None, Some(refusal)),
    }
}
