//! The user behind `sudo`, as whom the command runs, the report is written and the session's bus is spoken to.

use crate::voice::say;
use anyhow::Context;
use nix::unistd::{Gid, Uid, User, getegid, geteuid, getgrouplist, getgroups, setegid, seteuid, setgroups};
use std::ffi::{CString, OsString};
use std::path::PathBuf;

/// What a user may do is what these may.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rights {
    /// The user's number.
    pub uid: Uid,
    /// The user's own group.
    pub gid: Gid,
    /// All groups.
    pub groups: Vec<Gid>,
}

/// A user who called `sudo`.
#[derive(Clone, Debug)]
pub struct Invoker {
    /// The user's rights.
    pub rights: Rights,
    /// The user's name.
    pub name: String,
    home: PathBuf,
    shell: PathBuf,
}

impl Invoker {
    /// Who called `sudo`; nobody where this is not root, or root itself called.
    ///
    /// # Errors
    /// `sudo`'s variables make no sense.
    pub fn find() -> anyhow::Result<Option<Invoker>> {
        let number = |name: &str| std::env::var(name).ok();
        let Some(uid) = number("SUDO_UID").filter(|_| geteuid().is_root()) else { return Ok(None) };
        let uid: u32 = uid.parse().context("SUDO_UID is no number")?;
        if uid == 0 {
            return Ok(None);
        }
        let uid = Uid::from_raw(uid);
        if let Some(user) = User::from_uid(uid).context("cannot ask for the user who called sudo")? {
            let name = CString::new(user.name.clone())?;
            let groups = getgrouplist(&name, user.gid).context("cannot ask for the user's groups")?;
            let User { gid, name, dir: home, shell, .. } = user;
            return Ok(Some(Invoker { rights: Rights { uid, gid, groups }, name, home, shell }));
        }
        // One without an entry, as in some containers.
        let gid: u32 = number("SUDO_GID").context("SUDO_GID is missing")?.parse()?;
        let gid = Gid::from_raw(gid);
        let name = number("SUDO_USER").unwrap_or_else(|| uid.to_string());
        let rights = Rights { uid, gid, groups: vec![gid] };
        Ok(Some(Invoker { rights, name, home: "/".into(), shell: "/bin/sh".into() }))
    }

    /// What the user's environment has and root's has not: names and values, or no value for what goes.
    pub fn environment(&self) -> Vec<(&'static str, Option<OsString>)> {
        let runtime = PathBuf::from(format!("/run/user/{}", self.rights.uid));
        let bus = runtime.join("bus");
        let mut address = OsString::from("unix:path=");
        address.push(&bus);
        vec![
            ("HOME", Some(self.home.clone().into())),
            ("USER", Some(self.name.clone().into())),
            ("LOGNAME", Some(self.name.clone().into())),
            ("SHELL", Some(self.shell.clone().into())),
            ("XDG_RUNTIME_DIR", runtime.is_dir().then(|| runtime.into())),
            ("DBUS_SESSION_BUS_ADDRESS", bus.exists().then_some(address)),
            ("SUDO_UID", None),
            ("SUDO_GID", None),
            ("SUDO_USER", None),
            ("SUDO_COMMAND", None),
        ]
    }
}

/// The name of the user who started this process, through `sudo` or not.
pub fn name(invoker: Option<&Invoker>) -> String {
    let uid = nix::unistd::getuid();
    invoker.map(|invoker| invoker.name.clone()).unwrap_or_else(|| {
        User::from_uid(uid).ok().flatten().map_or_else(|| uid.to_string(), |user| user.name)
    })
}

/// Does something with somebody's rights, and no other, or with this process's own where nobody is given.
///
/// Rights belong to the whole process, so no other thread should open or create anything meanwhile. If it cannot
/// have its own back, the process ends at once: it must not go on as somebody else, and the watchdog can do what is
/// left to do.
///
/// # Errors
/// The rights cannot be changed; for that the process must be root.
pub fn acting<T>(rights: Option<&Rights>, work: impl FnOnce() -> T) -> nix::Result<T> {
    let Some(Rights { uid, gid, groups }) = rights else { return Ok(work()) };
    // Undone in the opposite order. The user goes last and comes back first, because only root may change the
    // others.
    let own_groups = getgroups()?;
    setgroups(groups)?;
    let _groups = Undo(|| setgroups(&own_groups));
    let own_gid = getegid();
    setegid(*gid)?;
    let _gid = Undo(|| setegid(own_gid));
    let own_uid = geteuid();
    seteuid(*uid)?;
    let _uid = Undo(|| seteuid(own_uid));
    Ok(work())
}

/// Takes back a change of rights when it is dropped, also when that is because of an error or a panic.
struct Undo<F: Fn() -> nix::Result<()>>(F);

impl<F: Fn() -> nix::Result<()>> Drop for Undo<F> {
    fn drop(&mut self) {
        if let Err(error) = (self.0)() {
            say(format_args!("cannot become root again: {}", error.desc()));
            std::process::abort();
        }
    }
}
