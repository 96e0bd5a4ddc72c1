//! A folder that stands in for sysfs with one of AMD's cards, and a thread that does what amdgpu does
//! when its files are written.

use std::fs::{self, File, Permissions};
use std::os::unix::fs::{FileExt, PermissionsExt, symlink};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// PCI address of the card.
pub const ADDRESS: &str = "0000:03:00.0";

/// Its graphics clocks in MHz, by index.
pub const GRAPHICS: [u32; 5] = [500, 800, 1200, 1900, 2400];

/// Its memory clocks in MHz, by index.
pub const MEMORY: [u32; 3] = [96, 1000, 1250];

const LEVEL: &str = "power_dpm_force_performance_level";

/// A user that owns nothing.
const NOBODY: u32 = 65534;

/// Which of the card's clocks something is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// `pp_dpm_sclk`.
    Graphics,
    /// `pp_dpm_mclk`.
    Memory,
}

/// The card, until it is dropped. What is written to its files takes effect within a few milliseconds.
pub struct StandIn {
    root: PathBuf,
    driver: Arc<Mutex<Driver>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

struct Driver {
    device: PathBuf,
    /// The level that the clocks have followed.
    level: String,
    tables: [Table; 2],
    ignores: bool,
    unplugged: bool,
}

struct Table {
    path: PathBuf,
    sensor: PathBuf,
    mhz: &'static [u32],
    /// A bit for each index that may be used.
    allowed: u32,
    current: usize,
    now: Sheet,
    /// The file that was there before: somebody may have opened it just before it was replaced.
    before: Option<Sheet>,
}

/// A file and the text that was last seen in it.
struct Sheet {
    file: File,
    text: String,
}

impl StandIn {
    /// Makes the folder's contents and starts. The folder must be there; the card is at level `auto`.
    pub fn new(folder: &Path) -> StandIn {
        let device = card(folder, 1, ADDRESS, "0x1002");
        for (file, text) in [("product_name", ""), ("unique_id", "1234567890abcdef"), (LEVEL, "auto")] {
            fs::write(device.join(file), format!("{text}\n")).unwrap();
        }
        let sensors = device.join("hwmon/hwmon3");
        fs::create_dir_all(&sensors).unwrap();
        for (file, text) in [("name", "amdgpu"), ("temp1_input", "61000"), ("power1_average", "142500000")] {
            fs::write(sensors.join(file), format!("{text}\n")).unwrap();
        }
        let module = folder.join("module/amdgpu");
        fs::create_dir_all(&module).unwrap();
        fs::write(module.join("version"), "6.10.5\n").unwrap();

        let driver = Driver {
            tables: [
                Table::new(device.join("pp_dpm_sclk"), sensors.join("freq1_input"), &GRAPHICS),
                Table::new(device.join("pp_dpm_mclk"), sensors.join("freq2_input"), &MEMORY),
            ],
            device,
            level: "auto".into(),
            ignores: false,
            unplugged: false,
        };
        let driver = Arc::new(Mutex::new(driver));
        let stop = Arc::new(AtomicBool::new(false));
        let thread = thread::spawn({
            let (driver, stop) = (Arc::clone(&driver), Arc::clone(&stop));
            move || {
                while !stop.load(Ordering::Relaxed) {
                    lock(&driver).follow();
                    thread::sleep(Duration::from_millis(1));
                }
            }
        });
        StandIn { root: folder.into(), driver, stop, thread: Some(thread) }
    }

    /// What stands in for `/sys`.
    pub fn root(&self) -> PathBuf {
        self.root.clone()
    }

    /// The card's folder.
    pub fn device(&self) -> PathBuf {
        lock(&self.driver).device.clone()
    }

    /// The performance level in force.
    pub fn level(&self) -> String {
        let driver = self.settled();
        driver.level.clone()
    }

    /// The index that a clock is locked to; nothing if it is free to use several.
    pub fn locked(&self, clock: Clock) -> Option<u32> {
        let driver = self.settled();
        let allowed = driver.tables[clock as usize].allowed;
        (driver.level == "manual" && allowed.count_ones() == 1).then(|| allowed.trailing_zeros())
    }

    /// Writes a file of the card, as another program would.
    pub fn write(&self, file: &str, text: &str) {
        let path = self.device().join(file);
        fs::OpenOptions::new().write(true).open(path).unwrap().write_all_at(text.as_bytes(), 0).unwrap();
        self.settle();
    }

    /// Returns when everything that was written before has taken effect.
    pub fn settle(&self) {
        drop(self.settled());
    }

    /// Makes the card's files read-only. Modes do not bind root: as root, they stay root's alone, and
    /// whom that is to hold up is run by [`unprivileged`] or with [`as_unprivileged`].
    pub fn deny(&self) {
        let driver = self.settled();
        if nix::unistd::geteuid().is_root() {
            // The whole folder must be the user's own to be trusted.
            std::os::unix::fs::chown(&self.root, Some(NOBODY), None).unwrap();
            return;
        }
        for file in [LEVEL, "pp_dpm_sclk", "pp_dpm_mclk"] {
            // Some right to write is left, as there is on a real card, if not for the owner.
            fs::set_permissions(driver.device.join(file), Permissions::from_mode(0o464)).unwrap();
        }
    }

    /// Whether writes are accepted without any clock following them.
    pub fn ignore_writes(&self, ignores: bool) {
        self.settled().ignores = ignores;
    }

    /// Takes the card out.
    pub fn unplug(&self) {
        let mut driver = self.settled();
        driver.unplugged = true;
        fs::remove_dir_all(&driver.device).unwrap();
    }

    fn settled(&self) -> MutexGuard<'_, Driver> {
        let mut driver = lock(&self.driver);
        driver.follow();
        driver
    }
}

impl Drop for StandIn {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // Its panic has been printed, and a second one would hide the test's own.
            let _ = thread.join();
        }
    }
}

impl Driver {
    fn follow(&mut self) {
        if self.unplugged {
            return;
        }
        // Before the level: who writes a table has written the level before that.
        let requests = self.tables.each_mut().map(Table::request);
        let text = fs::read_to_string(self.device.join(LEVEL)).unwrap();
        // Another program may just be between emptying and writing it.
        let level = text.lines().next().filter(|level| !level.is_empty()).unwrap_or(&self.level).to_owned();
        let changed = level != self.level;
        self.level = level;
        for (table, request) in self.tables.iter_mut().zip(requests) {
            let all = (1 << table.mhz.len()) - 1;
            let last = table.mhz.len() - 1;
            if changed && !self.ignores && self.level != "manual" {
                table.allowed = all;
                table.current = match self.level.as_str() {
                    "high" | "profile_peak" => last,
                    "profile_standard" => last / 2,
                    _ => 0,
                };
            }
            let Some(indices) = request else {
                table.show(false);
                continue;
            };
            let asked = indices.iter().fold(0, |bits, index| bits | 1 << index) & all;
            if self.level == "manual" && !self.ignores && asked != 0 {
                table.allowed = asked;
                table.current = asked.trailing_zeros() as usize;
            }
            table.show(true);
        }
    }
}

impl Table {
    fn new(path: PathBuf, sensor: PathBuf, mhz: &'static [u32]) -> Table {
        fs::write(&path, "").unwrap();
        let now = Sheet { file: File::open(&path).unwrap(), text: String::new() };
        let mut table =
            Table { path, sensor, mhz, allowed: (1 << mhz.len()) - 1, current: 0, now, before: None };
        table.show(true);
        table
    }

    /// The indices that somebody wrote.
    fn request(&mut self) -> Option<Vec<u32>> {
        let sheets = [Some(&mut self.now), self.before.as_mut()];
        sheets.into_iter().flatten().find_map(|sheet| {
            let text = sheet.read();
            if text == sheet.text {
                return None;
            }
            sheet.text = text;
            let first = sheet.text.lines().next()?;
            first.split_whitespace().map(|index| index.parse().ok().filter(|index| *index < 32)).collect()
        })
    }

    /// Writes the table, if it is not there or has changed.
    fn show(&mut self, overwritten: bool) {
        let star = |index| if index == self.current { " *" } else { "" };
        let text: String =
            (0..).zip(self.mhz).map(|(i, mhz)| format!("{i}: {mhz}Mhz{}\n", star(i))).collect();
        if text == self.now.text && !overwritten {
            return;
        }
        // By another name first, so that nobody reads half of it.
        let replace = |path: &Path, text: &str| {
            let new = path.with_extension("new");
            fs::write(&new, text).unwrap();
            let mode = fs::metadata(path).map_or(0o644, |metadata| metadata.permissions().mode());
            fs::set_permissions(&new, Permissions::from_mode(mode)).unwrap();
            let file = File::open(&new).unwrap();
            fs::rename(&new, path).unwrap();
            file
        };
        replace(&self.sensor, &format!("{}\n", u64::from(self.mhz[self.current]) * 1_000_000));
        let now = Sheet { file: replace(&self.path, &text), text };
        self.before = Some(std::mem::replace(&mut self.now, now));
    }
}

impl Sheet {
    fn read(&self) -> String {
        let mut text = [0; 4096];
        let length = self.file.read_at(&mut text, 0).unwrap();
        String::from_utf8_lossy(&text[..length]).into_owned()
    }
}

/// Lays out a card of a vendor (`0x1002`) as far as every vendor's looks alike, without starting
/// anything; returns its folder.
pub fn card(root: &Path, number: u32, address: &str, vendor: &str) -> PathBuf {
    let device = root.join("devices/pci0000:00").join(address);
    fs::create_dir_all(&device).unwrap();
    fs::write(device.join("vendor"), format!("{vendor}\n")).unwrap();
    fs::write(device.join("device"), "0x744c\n").unwrap();
    fs::write(device.join("uevent"), format!("PCI_CLASS=30000\nPCI_SLOT_NAME={address}\n")).unwrap();
    let card = root.join(format!("class/drm/card{number}"));
    fs::create_dir_all(&card).unwrap();
    symlink(format!("../../../devices/pci0000:00/{address}"), card.join("device")).unwrap();
    device
}

/// Lets a command run as somebody whom [`StandIn::deny`] holds up.
pub fn unprivileged(command: &mut Command) -> &mut Command {
    if nix::unistd::geteuid().is_root() { command.uid(NOBODY).gid(NOBODY) } else { command }
}

/// Runs something in this thread as somebody whom [`StandIn::deny`] holds up. The stand-in itself must
/// not be asked meanwhile: it writes its files as whoever asks.
pub fn as_unprivileged<T>(run: impl FnOnce() -> T) -> T {
    use nix::unistd::{Uid, geteuid, setfsuid};
    struct Back(Uid);
    impl Drop for Back {
        fn drop(&mut self) {
            setfsuid(self.0);
        }
    }
    let _back = geteuid().is_root().then(|| Back(setfsuid(Uid::from_raw(NOBODY))));
    run()
}

fn lock(driver: &Mutex<Driver>) -> MutexGuard<'_, Driver> {
    // A panic in the thread has been printed; the test's own should be about what it saw.
    driver.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Every test that includes this file runs this, so that what it relies on is known to be right, and
/// that nothing here is unused.
#[test]
fn stand_in_behaves_like_a_card() {
    let folder = tempfile::tempdir().unwrap();
    // Others must come so far to be held up by the card alone.
    fs::set_permissions(folder.path(), Permissions::from_mode(0o755)).unwrap();
    card(folder.path(), 0, "0000:00:02.0", "0x8086");
    let card = StandIn::new(folder.path());
    let device = card.device();
    assert_eq!(fs::canonicalize(card.root().join("class/drm/card1/device")).unwrap(), device);
    let read = |file: &str| fs::read_to_string(device.join(file)).unwrap();

    // Tables cannot be written at a level that does not say so.
    card.write("pp_dpm_sclk", "3\n");
    assert_eq!((card.level().as_str(), card.locked(Clock::Graphics)), ("auto", None));
    card.write(LEVEL, "manual\n");
    card.write("pp_dpm_sclk", "3\n");
    card.write("pp_dpm_mclk", "1\n");
    assert_eq!((card.locked(Clock::Graphics), card.locked(Clock::Memory)), (Some(3), Some(1)));
    assert!(read("pp_dpm_sclk").contains(&format!("3: {}Mhz *\n", GRAPHICS[3])));
    assert_eq!(read("hwmon/hwmon3/freq2_input"), format!("{}000000\n", MEMORY[1]));
    card.ignore_writes(true);
    card.write("pp_dpm_sclk", "0\n");
    assert_eq!(card.locked(Clock::Graphics), Some(3));
    card.ignore_writes(false);
    card.write(LEVEL, "high\n");
    assert_eq!((card.locked(Clock::Graphics), card.locked(Clock::Memory)), (None, None));

    card.deny();
    let path = device.join(LEVEL);
    let denied = as_unprivileged(|| fs::OpenOptions::new().write(true).open(&path)).unwrap_err();
    assert_eq!(denied.kind(), std::io::ErrorKind::PermissionDenied);
    let mut writer = Command::new("sh");
    writer.args(["-c", "echo low > \"$0\""]).arg(&path).stderr(std::process::Stdio::null());
    assert!(!unprivileged(&mut writer).status().unwrap().success());
    assert_eq!(card.level(), "high");

    assert_eq!(device, fs::canonicalize(folder.path().join("devices/pci0000:00").join(ADDRESS)).unwrap());
    card.unplug();
    assert!(!device.exists());
}
