//! A GPU that is held: every change goes through here, so that each is in the journal before it is made, and all
//! are taken back however this ends.

use crate::gpu::{Change, Domain, Found, Gpu, Trouble};
use crate::journal::{Contents, Entry, Holder, Journal};
use record::Restoration;
use std::time::Duration;

/// A GPU that this process holds.
pub struct Held<'a> {
    gpu: &'a dyn Gpu,
    journal: Journal,
    /// What clocks are locked to at the end, instead of being left to the driver.
    to: RestoreTo,
    /// Clocks that are locked without being in the journal, because another change's undoing frees them.
    unlisted: Vec<Domain>,
    restored: bool,
}

/// Clocks in MHz that somebody else had locked, and that are locked again at the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RestoreTo {
    /// The graphics clock.
    pub graphics: Option<u32>,
    /// The memory clock.
    pub memory: Option<u32>,
}

impl RestoreTo {
    fn of(self, domain: Domain) -> Option<u32> {
        match domain {
            Domain::Graphics => self.graphics,
            Domain::Memory => self.memory,
        }
    }

    /// What takes a lock back.
    fn instead_of(self, undo: Change) -> Change {
        match undo {
            Change::Unlock { domain } => match self.of(domain) {
                Some(mhz) => Change::Lock { domain, mhz },
                None => Change::Unlock { domain },
            },
            undo => undo,
        }
    }
}

impl<'a> Held<'a> {
    /// Holds a GPU whose journal has been begun.
    pub fn new(gpu: &'a dyn Gpu, journal: Journal, to: RestoreTo) -> Self {
        Self { gpu, journal, to, unlisted: Vec::new(), restored: false }
    }

    /// The GPU.
    pub fn gpu(&self) -> &'a dyn Gpu {
        self.gpu
    }

    /// Its journal.
    pub fn journal(&self) -> &Journal {
        &self.journal
    }

    /// Changes something, with a way back: what was in force before the first change of its kind.
    ///
    /// # Errors
    /// The GPU refuses, or the journal cannot be written; then nothing has been changed.
    pub fn change(&mut self, change: &Change) -> Result<(), Trouble> {
        let broken = |error: &dyn std::fmt::Display| Trouble::Other(format!("the journal: {error}"));
        let contents = self.journal.contents().map_err(|error| broken(&error))?;
        let undo = self.gpu.undo_of(change)?.map(|undo| self.to.instead_of(undo));
        // The way back from a second lock of the same clock is that of the first, as long as that is still to go.
        let pending = || contents.iter().flat_map(Contents::pending);
        let known = undo.as_ref().is_none_or(|undo| pending().any(|(_, entry)| entry.undo == *undo));
        let listed = undo.is_some();
        if let (false, Some(undo)) = (known, undo) {
            let entry = Entry { change: change.clone(), undo };
            self.journal.announce(&entry).map_err(|error| broken(&error))?;
        }
        let done = self.gpu.apply(change);
        match (&done, change) {
            // These say that nothing has been done, so nothing is to be undone.
            (Err(Trouble::NoPermission | Trouble::NotSupported | Trouble::Missing(_)), _) if !known => {
                let number = contents.map_or(0, |contents| contents.entries.len());
                self.journal.undone(number).map_err(|error| broken(&error))?;
            }
            (Ok(()), Change::Lock { domain, .. }) if !listed => self.unlisted.push(*domain),
            _ => {}
        }
        done
    }

    /// Takes back the lock of one clock.
    ///
    /// # Errors
    /// The GPU refuses; it will be tried again at the end.
    pub fn release(&mut self, domain: Domain) -> Result<(), Trouble> {
        if self.unlisted.contains(&domain) {
            self.gpu.apply(&Change::Unlock { domain })?;
            self.unlisted.retain(|unlisted| *unlisted != domain);
        }
        let contents = self.journal.contents().map_err(|error| Trouble::Other(error.to_string()))?;
        let Some(contents) = contents else { return Ok(()) };
        for (number, entry) in contents.pending() {
            if matches!(entry.change, Change::Lock { domain: locked, .. } if locked == domain) {
                self.gpu.apply(&entry.undo)?;
                self.journal.undone(number).map_err(|error| Trouble::Other(error.to_string()))?;
            }
        }
        Ok(())
    }

    /// Takes everything back, and says what came of it.
    pub fn restore(&mut self) -> Vec<Restoration> {
        self.restored = true;
        restore(self.gpu, &mut self.journal, RestoreTo::default())
    }
}

impl Drop for Held<'_> {
    /// On every way out that is not the usual one, a panic included.
    fn drop(&mut self) {
        if !self.restored {
            self.restore();
        }
    }
}

fn failed(what: String, why: String) -> Restoration {
    Restoration { what, failed: Some(why) }
}

/// Takes back what a journal says is still to be taken back, the last change first. What fails stays in the
/// journal. Clocks are locked to what `to` says, instead of being left free.
pub fn restore(gpu: &dyn Gpu, journal: &mut Journal, to: RestoreTo) -> Vec<Restoration> {
    let contents = match journal.contents() {
        Ok(Some(contents)) => contents,
        Ok(None) => return Vec::new(),
        Err(error) => return vec![failed("all that the journal held".into(), format!("{error:#}"))],
    };
    let mut done = Vec::new();
    for (number, entry) in contents.pending() {
        let undo = to.instead_of(entry.undo.clone());
        let what = undo.to_string();
        done.push(match insist(gpu, &undo) {
            Ok(()) => match journal.undone(number) {
                Ok(()) => Restoration { what, failed: None },
                Err(error) => failed(what, format!("done, but the journal cannot be written: {error}")),
            },
            Err(trouble) => failed(what, trouble.to_string()),
        });
    }
    if done.iter().all(|restoration| restoration.failed.is_none())
        && let Err(error) = journal.clear()
    {
        done.push(failed("the journal emptied".into(), error.to_string()));
    }
    done
}

/// The same for a journal whose GPU is still to be found.
pub fn repair(found: &Found, journal: &mut Journal, to: RestoreTo) -> Vec<Restoration> {
    let gone = |holder: &Holder| Restoration {
        what: format!("{} ({})", holder.gpu.name, holder.gpu.uuid),
        failed: Some(match found.missing.first() {
            Some(why) => format!("it cannot be found: {why}"),
            None => "it cannot be found".into(),
        }),
    };
    let holder = match journal.contents() {
        Ok(Some(contents)) if !contents.pending().is_empty() => contents.holder,
        // Nothing had been changed yet, or all had been put back.
        Ok(_) => {
            let emptied = journal.clear().err();
            return emptied
                .map(|error| failed("the journal emptied".into(), error.to_string()))
                .into_iter()
                .collect();
        }
        Err(error) => return vec![failed("all that the journal held".into(), format!("{error:#}"))],
    };
    let same = |gpu: &&dyn Gpu| {
        let (one, other) = (gpu.identity(), &holder.gpu);
        (one.vendor, &one.uuid) == (other.vendor, &other.uuid)
    };
    match found.gpus.iter().map(AsRef::as_ref).find(same) {
        Some(gpu) => restore(gpu, journal, to),
        None => vec![gone(&holder)],
    }
}

/// What came of putting something back, in words.
pub fn put_back(restoration: &Restoration) -> String {
    match &restoration.failed {
        None => format!("put back: {}", restoration.what),
        Some(why) => {
            format!("NOT put back: {}: {why}. Once that is mended: sudo stabilize restore", restoration.what)
        }
    }
}

/// Makes a change, and looks whether it is in force where that can be seen; a few times where the trouble may pass.
fn insist(gpu: &dyn Gpu, change: &Change) -> Result<(), Trouble> {
    const TRIES: u32 = 3;
    let mut tries = 1;
    loop {
        let done = gpu.apply(change).and_then(|()| match gpu.undo_of(change) {
            // What would take it back is what is in force. A lock's is not: no driver tells what is locked.
            Ok(Some(now @ (Change::Persistence { .. } | Change::Level { .. }))) if now != *change => {
                Err(Trouble::Other(format!("the driver accepted it, but {now} is in force")))
            }
            // What cannot be looked at is not known to be back.
            Err(trouble) if matches!(change, Change::Persistence { .. } | Change::Level { .. }) => {
                Err(trouble)
            }
            _ => Ok(()),
        });
        match done {
            Err(Trouble::Other(_)) if tries < TRIES => {
                std::thread::sleep(Duration::from_millis(50));
                tries += 1;
            }
            answer => return answer,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{Answer, Identity, Vendor};
    use crate::state::Folder;
    use record::{Telemetry, ThrottleTimes};
    use std::cell::{Cell, RefCell};
    use std::panic::{AssertUnwindSafe, catch_unwind};

    /// A GPU that remembers what is in force.
    struct Plain {
        identity: Identity,
        persistence: Cell<bool>,
        locks: RefCell<Vec<(Domain, u32)>>,
    }

    impl Plain {
        fn new() -> Plain {
            let (name, uuid) = ("GPU".into(), "GPU-1".into());
            let identity = Identity { vendor: Vendor::Nvidia, name, uuid, pci: None, driver: String::new() };
            Plain { identity, persistence: Cell::new(false), locks: RefCell::default() }
        }

        fn is_as_before(&self) -> bool {
            !self.persistence.get() && self.locks.borrow().is_empty()
        }
    }

    impl Gpu for Plain {
        fn identity(&self) -> &Identity {
            &self.identity
        }
        fn clock(&self, _: Domain) -> Answer<u32> {
            Ok(1000)
        }
        fn highest(&self, _: Domain) -> Answer<u32> {
            Ok(1000)
        }
        fn base(&self, _: Domain) -> Answer<u32> {
            Ok(1000)
        }
        fn steps(&self, _: Domain) -> Answer<Vec<u32>> {
            Ok(Vec::new())
        }
        fn reading(&self) -> Telemetry {
            Telemetry::unavailable("there is none")
        }
        fn throttle_times(&self) -> ThrottleTimes {
            ThrottleTimes::default()
        }
        fn persistence(&self) -> Answer<Option<bool>> {
            Ok(Some(self.persistence.get()))
        }
        fn preparations(&self) -> Answer<Vec<Change>> {
            Ok(Vec::new())
        }
        fn undo_of(&self, change: &Change) -> Answer<Option<Change>> {
            Ok(match change {
                Change::Persistence { .. } => Some(Change::Persistence { on: self.persistence.get() }),
                Change::Lock { domain, .. } => Some(Change::Unlock { domain: *domain }),
                _ => None,
            })
        }
        fn apply(&self, change: &Change) -> Answer<()> {
            match *change {
                Change::Persistence { on } => self.persistence.set(on),
                Change::Lock { domain, mhz } => {
                    self.locks.borrow_mut().retain(|&(locked, _)| locked != domain);
                    self.locks.borrow_mut().push((domain, mhz));
                }
                Change::Unlock { domain } => self.locks.borrow_mut().retain(|&(locked, _)| locked != domain),
                Change::Level { .. } => return Err(Trouble::NotSupported),
            }
            Ok(())
        }
        fn obstacle(&self, _: Domain) -> Option<Trouble> {
            None
        }
    }

    fn held<'a>(gpu: &'a Plain, folder: &Folder, to: RestoreTo) -> Held<'a> {
        let mut journal = Journal::lock(folder, gpu.identity()).unwrap().ok().unwrap();
        journal.begin(&Holder::this(gpu.identity(), 0, "me", &[])).unwrap();
        Held::new(gpu, journal, to)
    }

    const LOCK: Change = Change::Lock { domain: Domain::Graphics, mhz: 900 };

    #[test]
    fn a_panic_puts_everything_back() {
        let path = tempfile::tempdir().unwrap();
        let folder = Folder::open(path.path()).unwrap();
        let gpu = Plain::new();
        let ended = catch_unwind(AssertUnwindSafe(|| {
            let mut held = held(&gpu, &folder, RestoreTo::default());
            held.change(&Change::Persistence { on: true }).unwrap();
            held.change(&LOCK).unwrap();
            assert!(!gpu.is_as_before());
            panic!("on purpose");
        }));
        assert!(ended.is_err() && gpu.is_as_before());
        let journal = Journal::lock(&folder, gpu.identity()).unwrap().ok().unwrap();
        assert_eq!(journal.contents().unwrap(), None);
    }

    #[test]
    fn the_way_back_is_that_of_the_first_change() {
        let path = tempfile::tempdir().unwrap();
        let folder = Folder::open(path.path()).unwrap();
        let gpu = Plain::new();
        let mut held = held(&gpu, &folder, RestoreTo { graphics: Some(700), memory: None });
        held.change(&LOCK).unwrap();
        held.change(&Change::Lock { domain: Domain::Graphics, mhz: 800 }).unwrap();
        held.change(&Change::Lock { domain: Domain::Memory, mhz: 500 }).unwrap();
        let restored: Vec<String> = held.restore().iter().map(put_back).collect();
        assert_eq!(
            restored,
            ["put back: memory clock unlocked", "put back: graphics clock locked to 700 MHz"]
        );
        assert_eq!(*gpu.locks.borrow(), [(Domain::Graphics, 700)]);
    }
}
