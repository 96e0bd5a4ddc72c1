//! AMD's GPUs, through amdgpu's files in sysfs.

#[cfg(test)]
mod tests;

use super::{Answer, Change, Domain, Gpu, Identity, Trouble, Vendor};
use nix::errno::Errno;
use record::{Reading, Telemetry, ThrottleTimes, Timestamp};
use std::cell::Cell;
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// Where sysfs is, unless the tests have a folder that stands in for it.
const SYSFS: &str = "/sys";

/// The environment variable that names such a folder.
const STAND_IN: &str = "STABILIZE_SYSFS";

/// PCI's number of AMD, as sysfs writes it.
const AMD: &str = "0x1002";

/// The file that says how clocks are chosen.
const LEVEL: &str = "power_dpm_force_performance_level";

/// The level at which the tables of clocks can be written.
const MANUAL: &str = "manual";

/// The level of accelerators that keeps the clock below a limit of somebody's own.
const DETERMINISM: &str = "perf_determinism";

/// One of them.
pub struct Amd {
    /// Its folder in sysfs, without links: a card's number can go to another one.
    device: PathBuf,
    identity: Identity,
    /// Whether it was this program that made the level manual.
    made_manual: Cell<bool>,
}

/// A line of a table of clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Row {
    /// What is written to lock it; nothing for a state of sleep, which cannot be asked for.
    index: Option<u32>,
    mhz: u32,
    /// Whether it has the star.
    current: bool,
}

/// Where sysfs is.
///
/// # Errors
/// `STABILIZE_SYSFS` names something that is no folder, or one that other users can write: it would
/// be they who say what root writes where.
pub fn root() -> Result<PathBuf, String> {
    root_from(std::env::var_os(STAND_IN))
}

fn root_from(stand_in: Option<OsString>) -> Result<PathBuf, String> {
    let Some(folder) = stand_in else { return Ok(SYSFS.into()) };
    let refuse = |why: &str| Err(format!("{STAND_IN}: {}: {why}", Path::new(&folder).display()));
    // Without links, so that what is looked at is what is used.
    let found = fs::canonicalize(&folder).and_then(|path| Ok((fs::symlink_metadata(&path)?, path)));
    match found {
        Err(error) => refuse(&error.to_string()),
        Ok((metadata, _)) if !metadata.is_dir() => refuse("not a folder"),
        Ok((metadata, _)) if metadata.uid() != nix::unistd::geteuid().as_raw() => {
            refuse("belongs to another user")
        }
        Ok((metadata, _)) if metadata.mode() & 0o022 != 0 => refuse("others can write to it"),
        Ok((_, path)) => Ok(path),
    }
}

/// All that sysfs below `root` knows, by their PCI addresses.
///
/// # Errors
/// There is no folder of graphics cards, or it cannot be read.
pub fn find(root: &Path) -> Result<Vec<Amd>, String> {
    let folder = root.join("class/drm");
    let cards = fs::read_dir(&folder).map_err(|error| format!("amdgpu: {}: {error}", folder.display()))?;
    let driver = driver(root);
    let mut gpus: Vec<Amd> = cards
        .filter_map(|card| card.ok())
        .filter(|card| card.file_name().to_str().is_some_and(is_card))
        .filter_map(|card| Amd::open(&card.path(), &driver))
        .collect();
    gpus.sort_by(|a, b| (&a.identity.pci, &a.device).cmp(&(&b.identity.pci, &b.device)));
    Ok(gpus)
}

/// Whether it is a card's name: `card0`, but neither its connector `card0-DP-1` nor `renderD128`.
fn is_card(name: &str) -> bool {
    name.strip_prefix("card")
        .is_some_and(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
}

/// The driver's own version, or where it comes with the kernel, the kernel's.
fn driver(root: &Path) -> String {
    let kernel = || Some(format!("kernel {}", line(Path::new("/proc/sys/kernel/osrelease"))?));
    line(&root.join("module/amdgpu/version")).or_else(kernel).unwrap_or_default()
}

/// The first line of a file, unless that is empty.
fn line(path: &Path) -> Option<String> {
    let text = fs::read_to_string(path).ok()?;
    let line = text.lines().next()?.trim();
    (!line.is_empty()).then(|| line.into())
}

impl Amd {
    /// The GPU of a card, if it is AMD's.
    fn open(card: &Path, driver: &str) -> Option<Amd> {
        let device = fs::canonicalize(card.join("device")).ok()?;
        if line(&device.join("vendor"))? != AMD {
            return None;
        }
        let uevent = fs::read_to_string(device.join("uevent")).unwrap_or_default();
        let slot = uevent.lines().find_map(|line| line.strip_prefix("PCI_SLOT_NAME="));
        let address = slot.or_else(|| device.file_name()?.to_str())?.to_owned();
        let number = |file| line(&device.join(file)).unwrap_or_default().replace("0x", "");
        let name = line(&device.join("product_name"))
            .unwrap_or_else(|| format!("AMD GPU {}:{}", number("vendor"), number("device")));
        let unique = line(&device.join("unique_id"))
            // Chips without one have zeros.
            .filter(|id| id.bytes().any(|byte| byte != b'0'));
        let identity = Identity {
            vendor: Vendor::Amd,
            name,
            uuid: unique.unwrap_or_else(|| address.clone()),
            pci: Some(address),
            driver: driver.into(),
        };
        Some(Amd { device, identity, made_manual: Cell::new(false) })
    }

    fn read(&self, file: &str) -> Answer<String> {
        fs::read_to_string(self.device.join(file)).map_err(|error| self.trouble(&error))
    }

    fn open_to_write(&self, file: &str) -> Answer<File> {
        let path = self.device.join(file);
        let opened = OpenOptions::new().write(true).custom_flags(nix::libc::O_NOFOLLOW).open(&path);
        opened.map_err(|error| match self.trouble(&error) {
            // The driver takes the right to write from everybody, root too, where nothing can be set.
            Trouble::NoPermission if fs::metadata(&path).is_ok_and(|file| file.mode() & 0o222 == 0) => {
                Trouble::NotSupported
            }
            trouble => trouble,
        })
    }

    fn write(&self, file: &str, words: &str) -> Answer<()> {
        // Some kernels crash over indices without an end of line.
        let words = format!("{words}\n");
        self.open_to_write(file)?.write_all(words.as_bytes()).map_err(|error| self.trouble(&error))
    }

    fn trouble(&self, error: &io::Error) -> Trouble {
        match trouble(error) {
            // Its whole folder goes when it is unplugged.
            Trouble::NotSupported if !self.device.exists() => Trouble::Lost,
            trouble => trouble,
        }
    }

    fn level(&self) -> Answer<String> {
        Ok(self.read(LEVEL)?.lines().next().unwrap_or_default().trim().into())
    }

    /// The table of a clock, with at least one row that can be locked.
    fn rows(&self, domain: Domain) -> Answer<Vec<Row>> {
        let rows: Vec<Row> = self.read(table(domain))?.lines().filter_map(row).collect();
        // A virtual GPU may have a file with nothing in it.
        if rows.iter().all(|row| row.index.is_none()) { Err(Trouble::NotSupported) } else { Ok(rows) }
    }

    /// Index and MHz of what can be locked.
    fn levels(&self, domain: Domain) -> Answer<Vec<(u32, u32)>> {
        let rows = self.rows(domain)?;
        let rows: Vec<&Row> = rows.iter().filter(|row| row.index.is_some()).collect();
        // Since RDNA, and in processors with a GPU, the graphics clock has no steps: the driver lists
        // the lowest and the highest, and while the clock is between them a third line with the clock
        // of that moment. Who writes its index gets the highest clock, or one that the driver has
        // fixed. Chips with real steps have more than three of them. Memory has real steps everywhere,
        // and there may well be three.
        let made_up = domain == Domain::Graphics && matches!(rows[..], [_, Row { current: true, .. }, _]);
        let real = rows.iter().enumerate().filter(|(at, _)| !(made_up && *at == 1));
        Ok(real.filter_map(|(_, row)| Some((row.index?, row.mhz))).collect())
    }

    /// A number that the chip's sensors tell, in their unit.
    fn sensor(&self, file: &str) -> Option<i64> {
        let folders = fs::read_dir(self.device.join("hwmon")).ok()?;
        folders.filter_map(|folder| line(&folder.ok()?.path().join(file))?.parse().ok()).next()
    }

    /// Whether the level in force can be put back.
    ///
    /// # Errors
    /// It cannot.
    fn can_be_put_back(&self) -> Answer<String> {
        let level = self.level()?;
        if level == DETERMINISM {
            // Another level forgets the limit, and the driver has no file that told it.
            let why = format!("the performance level is {DETERMINISM}, whose limit could not be put back");
            return Err(Trouble::Other(why));
        }
        Ok(level)
    }
}

impl Gpu for Amd {
    fn identity(&self) -> &Identity {
        &self.identity
    }

    fn clock(&self, domain: Domain) -> Answer<u32> {
        let hertz = match domain {
            Domain::Graphics => self.sensor("freq1_input"),
            Domain::Memory => self.sensor("freq2_input"),
        };
        if let Some(mhz) = hertz.and_then(|hertz| u32::try_from((hertz + 500_000) / 1_000_000).ok()) {
            return Ok(mhz);
        }
        let rows = self.rows(domain)?;
        rows.iter().find(|row| row.current).map(|row| row.mhz).ok_or(Trouble::NotSupported)
    }

    fn highest(&self, domain: Domain) -> Answer<u32> {
        // The last one, but for the memory of some processors, whose table falls.
        self.levels(domain)?.iter().map(|(_, mhz)| *mhz).max().ok_or(Trouble::NotSupported)
    }

    fn base(&self, _: Domain) -> Answer<u32> {
        Err(Trouble::NotSupported)
    }

    fn steps(&self, domain: Domain) -> Answer<Vec<u32>> {
        let mut steps: Vec<u32> = match self.levels(domain) {
            Ok(levels) => levels.into_iter().map(|(_, mhz)| mhz).collect(),
            Err(Trouble::NotSupported) => Vec::new(),
            Err(trouble) => return Err(trouble),
        };
        steps.sort_unstable();
        steps.dedup();
        Ok(steps)
    }

    fn reading(&self) -> Telemetry {
        let graphics = self.clock(Domain::Graphics);
        let reading = Reading {
            time: Timestamp::now(),
            graphics_clock_mhz: graphics.as_ref().ok().copied(),
            sm_clock_mhz: None,
            memory_clock_mhz: self.clock(Domain::Memory).ok(),
            temperature_celsius: self
                .sensor("temp1_input")
                .and_then(|thousandths| u32::try_from(thousandths / 1000).ok()),
            power_watts: self
                .sensor("power1_average")
                .or_else(|| self.sensor("power1_input"))
                .map(|microwatts| microwatts as f64 / 1e6),
            performance_state: None,
            // The driver's bits of it differ from chip to chip.
            throttle_reasons: None,
        };
        match graphics {
            Err(trouble)
                if reading.memory_clock_mhz.is_none()
                    && reading.temperature_celsius.is_none()
                    && reading.power_watts.is_none() =>
            {
                Telemetry::unavailable(trouble.to_string())
            }
            _ => Telemetry::Available(reading),
        }
    }

    fn throttle_times(&self) -> ThrottleTimes {
        // The driver has no counters that mean the same on all chips.
        ThrottleTimes::default()
    }

    fn persistence(&self) -> Answer<Option<bool>> {
        Ok(None)
    }

    fn preparations(&self) -> Answer<Vec<Change>> {
        let manual = self.can_be_put_back()? == MANUAL;
        Ok(if manual { Vec::new() } else { vec![Change::Level { level: MANUAL.into() }] })
    }

    fn undo_of(&self, change: &Change) -> Answer<Option<Change>> {
        Ok(match change {
            Change::Level { .. } => Some(Change::Level { level: self.level()? }),
            // Every other level frees the clocks, so putting that back does. If it was manual before,
            // somebody may have locked clocks of their own, and the driver does not tell which.
            Change::Lock { domain, .. } => (self.level()? == MANUAL && !self.made_manual.get())
                .then_some(Change::Unlock { domain: *domain }),
            Change::Unlock { .. } | Change::Persistence { .. } => None,
        })
    }

    fn apply(&self, change: &Change) -> Answer<()> {
        match change {
            Change::Level { level } => {
                let before = self.level()?;
                self.write(LEVEL, level)?;
                // What was manual already stays whose it was.
                self.made_manual.set(level == MANUAL && (before != MANUAL || self.made_manual.get()));
                Ok(())
            }
            Change::Lock { domain, mhz } => {
                if self.level()? != MANUAL {
                    return Err(Trouble::Other(format!("the performance level is not {MANUAL}")));
                }
                let levels = self.levels(*domain)?;
                let (index, _) = levels
                    .iter()
                    .find(|(_, step)| step == mhz)
                    .ok_or_else(|| Trouble::Other(format!("{mhz} MHz is not a step of the {domain}")))?;
                self.write(table(*domain), &index.to_string())
            }
            // At another level the clocks are free, and the table cannot be written.
            Change::Unlock { .. } if self.level()? != MANUAL => Ok(()),
            Change::Unlock { domain } => {
                let rows = self.rows(*domain)?;
                let all: Vec<String> =
                    rows.iter().filter_map(|row| row.index).map(|index| index.to_string()).collect();
                self.write(table(*domain), &all.join(" "))
            }
            Change::Persistence { .. } => Err(Trouble::NotSupported),
        }
    }

    fn obstacle(&self, domain: Domain) -> Option<Trouble> {
        // To open a file changes nothing, and asks whoever else may forbid it besides the mode.
        self.levels(domain)
            .and_then(|_| self.can_be_put_back())
            .and_then(|_| self.open_to_write(table(domain)))
            .and_then(|_| self.open_to_write(LEVEL))
            .err()
    }
}

/// The file with the table of a clock.
fn table(domain: Domain) -> &'static str {
    match domain {
        Domain::Graphics => "pp_dpm_sclk",
        Domain::Memory => "pp_dpm_mclk",
    }
}

/// Reads a line such as `1: 1900Mhz *`, or `S: 19Mhz *` of a GPU that sleeps; nothing if it is no such
/// line.
fn row(line: &str) -> Option<Row> {
    let (index, rest) = line.split_once(':')?;
    let rest = rest.trim();
    let (rest, current) = match rest.strip_suffix('*') {
        Some(rest) => (rest.trim_end(), true),
        None => (rest, false),
    };
    let (mhz, unit) = rest.split_at(rest.find(|letter: char| !letter.is_ascii_digit())?);
    if !unit.trim_start().eq_ignore_ascii_case("mhz") {
        return None;
    }
    // The driver takes the indices for bits of a word.
    let index = match index.trim() {
        "S" => None,
        index => Some(index.parse().ok().filter(|index| *index < u32::BITS)?),
    };
    Some(Row { index, mhz: mhz.parse().ok()?, current })
}

fn trouble(error: &io::Error) -> Trouble {
    match error.raw_os_error().map(Errno::from_raw) {
        Some(Errno::EACCES) => Trouble::NoPermission,
        // Not a matter of rights: those are looked at when a file is opened, with the answer above.
        Some(Errno::EPERM) => Trouble::Other("the GPU is asleep or being reset".into()),
        Some(Errno::ENOENT | Errno::EOPNOTSUPP) => Trouble::NotSupported,
        Some(Errno::ENODEV | Errno::EIO) => Trouble::Lost,
        _ => Trouble::Other(error.to_string()),
    }
}
