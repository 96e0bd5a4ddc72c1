//! A real D-Bus daemon in a temporary folder, with stand-ins for the services that hold off screen
//! saver and sleep. They let go when whoever asked is gone, as the real ones do.

use std::fs::{self, File};
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use zbus::connection::Builder;
use zbus::message::Header;
use zbus::names::OwnedUniqueName;
use zbus::{Connection, Message, fdo};

/// A bus of its own, which ends with this value.
pub struct Bus {
    daemon: Child,
    folder: TempDir,
    address: String,
}

impl Bus {
    /// Starts a bus that nobody is on.
    pub fn start() -> Bus {
        Bus::start_with(None, OWNER_ONLY)
    }

    /// Starts a bus that runs as another user, for which the caller must be root. It lets everybody
    /// in, so that stand-ins can be put on it, until [`Bus::shut_others_out`].
    pub fn start_as(uid: u32, gid: u32) -> Bus {
        Bus::start_with(Some((uid, gid)), EVERYBODY)
    }

    fn start_with(user: Option<(u32, u32)>, entry: &str) -> Bus {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::create_dir(folder.path().join("services")).expect("a folder for services");
        let config = configure(folder.path(), entry);
        let mut command = Command::new("dbus-daemon");
        command.arg(format!("--config-file={config}"));
        command.args(["--nofork", "--nopidfile", "--print-address"]).stdout(Stdio::piped());
        // It complains a little where it may not raise its limits.
        let log = folder.path().join("log");
        command.stderr(File::create(&log).expect("a log"));
        if let Some((uid, gid)) = user {
            fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).expect("rights");
            chown(folder.path(), Some(uid), Some(gid)).expect("the folder is given to the user");
            command.uid(uid).gid(gid);
        }
        let mut daemon = command.spawn().unwrap_or_else(|error| match error.kind() {
            ErrorKind::NotFound => panic!("dbus-daemon is missing: install the package `dbus`"),
            _ => panic!("dbus-daemon does not start: {error}"),
        });
        let mut address = String::new();
        let output = daemon.stdout.take().expect("it is piped");
        BufReader::new(output).read_line(&mut address).expect("the bus says where it is");
        assert!(!address.is_empty(), "dbus-daemon: {}", fs::read_to_string(log).unwrap_or_default());
        Bus { daemon, folder, address: address.trim().to_owned() }
    }

    /// The address, in the form of `DBUS_SESSION_BUS_ADDRESS`.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Lets in nobody but the owner from now on. Who is on the bus may stay.
    pub fn shut_others_out(&self) {
        configure(self.folder.path(), OWNER_ONLY);
        self.ask_the_bus("ReloadConfig");
    }

    /// Makes the bus believe that it can start a service. It cannot.
    pub fn make_startable(&self, name: &str) {
        let service = format!("[D-BUS Service]\nName={name}\nExec=/bin/false\n");
        let file = self.folder.path().join(format!("services/{name}.service"));
        fs::write(file, service).expect("a file for the service");
        self.ask_the_bus("ReloadConfig");
    }

    /// Puts a screen saver on the bus, at `/org/freedesktop/ScreenSaver` or another path.
    pub fn screen_saver(&self, path: &str) -> StandIn {
        let kept = Arc::new(Kept::default());
        let builder = self.builder().serve_at(path, ScreenSaver(kept.clone()));
        StandIn::start(builder.name("org.freedesktop.ScreenSaver"), kept)
    }

    /// Puts logind on the bus.
    pub fn logind(&self) -> StandIn {
        let kept = Arc::new(Kept::default());
        let builder = self.builder().serve_at("/org/freedesktop/login1", Logind(kept.clone()));
        StandIn::start(builder.name("org.freedesktop.login1"), kept)
    }

    fn builder(&self) -> Builder<'static> {
        Builder::address(self.address.as_str())
    }

    fn ask_the_bus(&self, method: &str) {
        zbus::block_on(async {
            let bus = self.builder().build().await.expect("the bus lets its owner in");
            ask_bus(&bus, method, None).await.expect("the bus does as it is told");
        });
    }
}

impl Drop for Bus {
    fn drop(&mut self) {
        let _ = self.daemon.kill();
        let _ = self.daemon.wait();
    }
}

const OWNER_ONLY: &str = "";
const EVERYBODY: &str = r#"<allow user="*"/>"#;

/// Writes the daemon's configuration, and returns the path of it.
fn configure(folder: &Path, entry: &str) -> String {
    let path = folder.join("bus.conf");
    let folder = folder.to_str().expect("a folder that can be written into a file");
    let config = format!(
        r#"<!DOCTYPE busconfig PUBLIC "-//freedesktop//DTD D-Bus Bus Configuration 1.0//EN"
 "http://www.freedesktop.org/standards/dbus/1.0/busconfig.dtd">
<busconfig>
  <type>session</type>
  <listen>unix:path={folder}/bus</listen>
  <auth>EXTERNAL</auth>
  <servicedir>{folder}/services</servicedir>
  <policy context="default">
    {entry}
    <allow send_destination="*" eavesdrop="true"/>
    <allow eavesdrop="true"/>
    <allow own="*"/>
  </policy>
</busconfig>
"#
    );
    fs::write(&path, config).expect("a configuration for the bus");
    path.into_os_string().into_string().expect("as the folder")
}

/// Asks the bus itself, about the connection of this name if there is one.
async fn ask_bus(bus: &Connection, method: &str, about: Option<&str>) -> zbus::Result<Message> {
    let (name, path) = (Some("org.freedesktop.DBus"), "/org/freedesktop/DBus");
    match about {
        Some(connection) => bus.call_method(name, path, name, method, &(connection,)).await,
        None => bus.call_method(name, path, name, method, &()).await,
    }
}

/// What a service does when it is asked to hold something off.
#[derive(Clone, Copy, Debug, Default)]
pub enum Answer {
    /// It does.
    #[default]
    Grant,
    /// It fails, with `AccessDenied` and this text.
    Refuse(&'static str),
    /// It says nothing, ever.
    Hang,
}

/// Something that a service holds off now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Held {
    /// What is held off: `idle:sleep`; empty for a screen saver.
    pub what: String,
    /// The application that asked.
    pub who: String,
    /// The reason that it gave.
    pub why: String,
    /// `block` or `delay`; empty for a screen saver.
    pub mode: String,
    /// The user as whom the application is on the bus.
    pub uid: u32,
}

/// A service on a bus, until it is dropped.
pub struct StandIn {
    bus: Connection,
    kept: Arc<Kept>,
}

impl StandIn {
    fn start(builder: Builder<'_>, kept: Arc<Kept>) -> StandIn {
        let bus = zbus::block_on(builder.build()).expect("the stand-in gets on the bus");
        StandIn { bus, kept }
    }

    /// Answers so from now on.
    pub fn answer(&self, answer: Answer) {
        *self.kept.answer.lock().unwrap() = answer;
    }

    /// How often it was asked to hold something off, whatever it answered.
    pub fn asked(&self) -> u32 {
        self.kept.asked.load(Ordering::Relaxed)
    }

    /// What is held off now.
    pub fn held(&self) -> Vec<Held> {
        // The service itself may want the list while the bus is asked, so it is not locked then.
        let owners: Vec<_> = self.kept.promises.lock().unwrap().iter().filter_map(Promise::owner).collect();
        let gone: Vec<_> = owners.into_iter().filter(|owner| !self.is_on_the_bus(owner)).collect();

        let mut promises = self.kept.promises.lock().unwrap();
        promises.retain(|promise| match &promise.until {
            Until::Released { owner, .. } => !gone.contains(owner),
            Until::Closed(stream) => match (&mut &*stream).read(&mut [0]) {
                Ok(count) => count > 0,
                Err(error) => error.kind() == ErrorKind::WouldBlock,
            },
        });
        promises.iter().map(|promise| promise.held.clone()).collect()
    }

    fn is_on_the_bus(&self, owner: &OwnedUniqueName) -> bool {
        zbus::block_on(async {
            let reply = ask_bus(&self.bus, "NameHasOwner", Some(owner)).await;
            reply.and_then(|reply| reply.body().deserialize()).expect("the bus knows who is on it")
        })
    }

    /// Waits until as many are held off, for ten seconds at most, and says whether they are.
    pub fn comes_to_hold(&self, count: usize) -> bool {
        let start = Instant::now();
        while self.held().len() != count {
            if start.elapsed() > Duration::from_secs(10) {
                return false;
            }
            sleep(Duration::from_millis(5));
        }
        true
    }
}

/// What a service has to remember.
#[derive(Default)]
struct Kept {
    asked: AtomicU32,
    answer: Mutex<Answer>,
    promises: Mutex<Vec<Promise>>,
}

struct Promise {
    held: Held,
    until: Until,
}

/// What ends a promise.
enum Until {
    /// The word of the owner, or its leaving the bus.
    Released { owner: OwnedUniqueName, cookie: u32 },
    /// That all copies of the other end are closed.
    Closed(UnixStream),
}

impl Promise {
    fn owner(&self) -> Option<OwnedUniqueName> {
        match &self.until {
            Until::Released { owner, .. } => Some(owner.clone()),
            Until::Closed(_) => None,
        }
    }
}

impl Kept {
    /// Makes a promise, if the service is to do so.
    async fn promise(&self, held: Held, until: Until) -> fdo::Result<()> {
        self.asked.fetch_add(1, Ordering::Relaxed);
        self.hang_if_told().await;
        let answer = *self.answer.lock().unwrap();
        if let Answer::Refuse(text) = answer {
            return Err(fdo::Error::AccessDenied(text.into()));
        }
        self.promises.lock().unwrap().push(Promise { held, until });
        Ok(())
    }

    async fn hang_if_told(&self) {
        let answer = *self.answer.lock().unwrap();
        if let Answer::Hang = answer {
            std::future::pending().await
        }
    }
}

fn sender(header: &Header<'_>) -> OwnedUniqueName {
    header.sender().expect("the bus adds it").to_owned().into()
}

async fn sender_uid(bus: &Connection, header: &Header<'_>) -> zbus::Result<u32> {
    ask_bus(bus, "GetConnectionUnixUser", Some(&sender(header))).await?.body().deserialize()
}

struct ScreenSaver(Arc<Kept>);

#[zbus::interface(name = "org.freedesktop.ScreenSaver")]
impl ScreenSaver {
    async fn inhibit(
        &self,
        who: String,
        why: String,
        #[zbus(header)] header: Header<'_>,
        #[zbus(connection)] bus: &Connection,
    ) -> fdo::Result<u32> {
        let uid = sender_uid(bus, &header).await?;
        // Cookies are small numbers in practice; zero is none.
        let cookie = header.primary().serial_num().get();
        let held = Held { what: String::new(), who, why, mode: String::new(), uid };
        self.0.promise(held, Until::Released { owner: sender(&header), cookie }).await?;
        Ok(cookie)
    }

    async fn un_inhibit(&self, cookie: u32, #[zbus(header)] header: Header<'_>) -> fdo::Result<()> {
        self.0.hang_if_told().await;
        let caller = sender(&header);
        self.0.promises.lock().unwrap().retain(|promise| match &promise.until {
            Until::Released { owner, cookie: granted } => *owner != caller || *granted != cookie,
            Until::Closed(_) => true,
        });
        Ok(())
    }
}

struct Logind(Arc<Kept>);

#[zbus::interface(name = "org.freedesktop.login1.Manager")]
impl Logind {
    async fn inhibit(
        &self,
        what: String,
        who: String,
        why: String,
        mode: String,
        #[zbus(header)] header: Header<'_>,
        #[zbus(connection)] bus: &Connection,
    ) -> fdo::Result<zbus::OwnedFd> {
        let uid = sender_uid(bus, &header).await?;
        let pair = UnixStream::pair().and_then(|(ours, theirs)| {
            ours.set_nonblocking(true)?;
            Ok((ours, theirs))
        });
        let (ours, theirs) = pair.map_err(|error| fdo::Error::Failed(error.to_string()))?;
        self.0.promise(Held { what, who, why, mode, uid }, Until::Closed(ours)).await?;
        Ok(std::os::fd::OwnedFd::from(theirs).into())
    }
}

/// Two buses with both services, as a desktop has them.
pub struct Desktop {
    /// Where the screen saver is.
    pub session: Bus,
    /// Where logind is.
    pub system: Bus,
    /// The screen saver.
    pub saver: StandIn,
    /// logind.
    pub logind: StandIn,
}

impl Desktop {
    /// Starts all of it.
    pub fn start() -> Desktop {
        let (session, system) = (Bus::start(), Bus::start());
        let saver = session.screen_saver("/org/freedesktop/ScreenSaver");
        let logind = system.logind();
        Desktop { session, system, saver, logind }
    }
}

/// Every test that includes this file runs this, so that what it relies on is known to be right, and
/// that nothing here is unused.
#[test]
fn stand_ins_behave_like_the_services() {
    let Desktop { session, system, saver, logind } = Desktop::start();
    session.make_startable("org.example.Service");
    let open = |bus: &Bus| {
        let builder = Builder::address(bus.address()).method_timeout(Duration::from_secs(1));
        zbus::block_on(builder.build())
    };
    let (client, other) = (open(&session).unwrap(), open(&system).unwrap());
    let inhibit_saver = || {
        let (name, path) = (Some("org.freedesktop.ScreenSaver"), "/org/freedesktop/ScreenSaver");
        zbus::block_on(client.call_method(name, path, name, "Inhibit", &("me", "tests")))
    };
    let inhibit_idle = || {
        let (name, path) = (Some("org.freedesktop.login1"), "/org/freedesktop/login1");
        let interface = Some("org.freedesktop.login1.Manager");
        let arguments = ("idle", "me", "tests", "block");
        zbus::block_on(other.call_method(name, path, interface, "Inhibit", &arguments))
    };

    saver.answer(Answer::Refuse("not now"));
    assert!(inhibit_saver().unwrap_err().to_string().contains("not now"));
    saver.answer(Answer::Hang);
    assert!(inhibit_saver().unwrap_err().to_string().contains("timed out"));
    assert_eq!(saver.held(), []);
    saver.answer(Answer::Grant);
    inhibit_saver().unwrap();
    let idle = inhibit_idle().unwrap();
    assert!(saver.comes_to_hold(1) && logind.comes_to_hold(1));
    assert_eq!((saver.asked(), logind.asked()), (3, 1));
    assert_eq!((saver.held()[0].why.as_str(), logind.held()[0].what.as_str()), ("tests", "idle"));
    drop(idle);
    assert!(logind.comes_to_hold(0));
    zbus::block_on(client.close()).unwrap();
    assert!(saver.comes_to_hold(0));

    if nix::unistd::geteuid().is_root() {
        let bus = Bus::start_as(65534, 65534);
        assert!(open(&bus).is_ok());
        bus.shut_others_out();
        assert!(open(&bus).is_err());
    }
}
