#[path = "../../../tests/support/amd.rs"]
mod support;

use super::*;
use crate::hold::{Held, RestoreTo};
use crate::journal::{Holder, Journal};
use crate::state::Folder;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::process::Command;
use support::{ADDRESS, Clock, GRAPHICS, MEMORY, StandIn, as_unprivileged, card, unprivileged};
use tempfile::TempDir;

/// A running card and what is found of it.
struct Bench {
    gpu: Amd,
    card: StandIn,
    _folder: TempDir,
}

impl Bench {
    fn at(level: &str) -> Bench {
        let folder = tempfile::tempdir().unwrap();
        let card = StandIn::new(folder.path());
        card.write(LEVEL, &format!("{level}\n"));
        let gpu = find(&card.root()).unwrap().pop().unwrap();
        Bench { gpu, card, _folder: folder }
    }

    /// Makes a change and waits for it; returns what takes it back.
    fn make(&self, change: &Change) -> Answer<Option<Change>> {
        let undo = self.gpu.undo_of(change)?;
        self.gpu.apply(change)?;
        self.card.settle();
        Ok(undo)
    }

    /// Takes changes back, the last one first.
    fn take_back(&self, undos: Vec<Change>) {
        for undo in undos.iter().rev() {
            self.make(undo).unwrap();
        }
    }
}

fn level(level: &str) -> Change {
    Change::Level { level: level.into() }
}

fn lock(domain: Domain, mhz: u32) -> Change {
    Change::Lock { domain, mhz }
}

/// A card that stands still, with a table of graphics clocks.
fn still(table: &str) -> (TempDir, Amd) {
    let folder = tempfile::tempdir().unwrap();
    let device = card(folder.path(), 0, ADDRESS, AMD);
    fs::write(device.join("pp_dpm_sclk"), table).unwrap();
    let gpu = find(folder.path()).unwrap().pop().unwrap();
    (folder, gpu)
}

#[test]
fn finds_amds_cards_by_their_addresses() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    card(root, 0, "0000:00:02.0", "0x8086");
    card(root, 1, "0000:43:00.0", AMD);
    let named = card(root, 10, "0000:03:00.0", AMD);
    fs::write(named.join("product_name"), "Radeon Pro W7900\n").unwrap();
    fs::write(named.join("unique_id"), "1234567890abcdef\n").unwrap();
    // Not cards: a connector, another way to a card, and one whose device is not there.
    for (other, device) in [("card1-DP-1", "../card1"), ("renderD128", "../card1/device"), ("card7", "gone")]
    {
        fs::create_dir(root.join("class/drm").join(other)).unwrap();
        symlink(device, root.join("class/drm").join(other).join("device")).unwrap();
    }
    let found: Vec<Identity> = find(root).unwrap().iter().map(|gpu| gpu.identity().clone()).collect();
    let driver = format!("kernel {}", fs::read_to_string("/proc/sys/kernel/osrelease").unwrap().trim());
    let identity = |name: &str, uuid: &str, pci: &str| Identity {
        vendor: Vendor::Amd,
        name: name.into(),
        uuid: uuid.into(),
        pci: Some(pci.into()),
        driver: driver.clone(),
    };
    let expected = [
        identity("Radeon Pro W7900", "1234567890abcdef", "0000:03:00.0"),
        identity("AMD GPU 1002:744c", "0000:43:00.0", "0000:43:00.0"),
    ];
    assert_eq!(found, expected);
}

#[test]
fn without_a_folder_of_cards_it_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let reason = find(folder.path()).err().unwrap();
    assert!(reason.contains("class/drm"), "{reason}");
}

#[test]
fn the_stand_in_must_be_the_users_own() {
    assert_eq!(root_from(None), Ok("/sys".into()));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    assert_eq!(root_from(Some(path.into())), Ok(path.canonicalize().unwrap()));
    // A link is as good as what it leads to.
    symlink(path, path.join("link")).unwrap();
    assert_eq!(root_from(Some(path.join("link").into())), Ok(path.canonicalize().unwrap()));
    let refused = |path: &Path, part: &str| {
        let reason = root_from(Some(path.into())).unwrap_err();
        assert!(reason.contains(STAND_IN) && reason.contains(part), "{reason}");
    };
    refused(&path.join("nothing"), "No such file");
    fs::write(path.join("file"), "").unwrap();
    refused(&path.join("file"), "not a folder");
    fs::set_permissions(path, fs::Permissions::from_mode(0o777)).unwrap();
    refused(path, "others can write");
    let strangers = if nix::unistd::geteuid().is_root() {
        std::os::unix::fs::chown(path, Some(1), None).unwrap();
        path
    } else {
        Path::new("/")
    };
    refused(strangers, "another user");
}

#[test]
fn reads_what_the_card_tells() {
    let bench = Bench::at("high");
    let gpu = &bench.gpu;
    assert_eq!(gpu.identity().driver, "6.10.5");
    assert_eq!(gpu.steps(Domain::Graphics), Ok(GRAPHICS.to_vec()));
    // All three, though the middle one will be the current one below.
    assert_eq!(gpu.steps(Domain::Memory), Ok(MEMORY.to_vec()));
    assert_eq!((gpu.highest(Domain::Graphics), gpu.highest(Domain::Memory)), (Ok(2400), Ok(1250)));
    assert_eq!((gpu.clock(Domain::Graphics), gpu.clock(Domain::Memory)), (Ok(2400), Ok(1250)));
    assert_eq!(gpu.base(Domain::Graphics), Err(Trouble::NotSupported));
    assert_eq!(gpu.persistence(), Ok(None));
    assert_eq!(gpu.throttle_times(), ThrottleTimes::default());
    let Telemetry::Available(reading) = gpu.reading() else { panic!("unavailable") };
    assert_eq!((reading.graphics_clock_mhz, reading.memory_clock_mhz), (Some(2400), Some(1250)));
    assert_eq!((reading.temperature_celsius, reading.power_watts), (Some(61), Some(142.5)));
    assert_eq!(reading.throttle_reasons, None);

    // Without sensors the stars tell; newer chips have another file for power.
    let sensors = bench.card.device().join("hwmon/hwmon3");
    fs::rename(sensors.join("power1_average"), sensors.join("power1_input")).unwrap();
    bench.card.write(LEVEL, "profile_standard\n");
    fs::remove_file(sensors.join("freq2_input")).unwrap();
    assert_eq!((gpu.clock(Domain::Graphics), gpu.clock(Domain::Memory)), (Ok(1200), Ok(1000)));
    assert_eq!(gpu.steps(Domain::Memory), Ok(MEMORY.to_vec()));
    let Telemetry::Available(reading) = gpu.reading() else { panic!("unavailable") };
    assert_eq!(reading.power_watts, Some(142.5));
}

#[test]
fn a_card_without_tables_can_only_be_named() {
    let (folder, gpu) = still("");
    for domain in [Domain::Graphics, Domain::Memory] {
        assert_eq!(gpu.clock(domain), Err(Trouble::NotSupported));
        assert_eq!(gpu.highest(domain), Err(Trouble::NotSupported));
        assert_eq!(gpu.steps(domain), Ok(Vec::new()));
        assert_eq!(gpu.obstacle(domain), Some(Trouble::NotSupported));
        assert_eq!(gpu.apply(&lock(domain, 500)), Err(Trouble::NotSupported));
    }
    assert_eq!(gpu.preparations(), Err(Trouble::NotSupported));
    assert!(matches!(gpu.reading(), Telemetry::Unavailable { .. }));
    // None of its files was made by trying.
    assert!(!folder.path().join("class/drm/card0/device").join(LEVEL).exists());
}

#[test]
fn reads_rows_and_nothing_else() {
    let some = |index, mhz, current| Some(Row { index, mhz, current });
    for (line, expected) in [
        ("0: 500Mhz", some(Some(0), 500, false)),
        ("0: 500MHz ", some(Some(0), 500, false)),
        ("1: 1900Mhz *", some(Some(1), 1900, true)),
        ("12: 96Mhz*", some(Some(12), 96, true)),
        ("S: 19Mhz *", some(None, 19, true)),
        ("", None),
        (" 500Mhz", None),
        ("1: ", None),
        ("1: 19", None),
        ("1: 1900M", None),
        ("1: Mhz", None),
        ("1: 99999999999Mhz", None),
        ("1: 8.0GT/s, x16 *", None),
        ("32: 500Mhz", None),
        ("-1: 500Mhz", None),
        ("T: 500Mhz", None),
        ("OD_SCLK:", None),
    ] {
        assert_eq!(row(line), expected, "{line}");
    }
}

#[test]
fn a_clock_between_the_ends_is_no_step() {
    for (table, steps) in [
        ("0: 500Mhz *\n1: 2400Mhz\n", &[500, 2400][..]),
        ("0: 500Mhz\n1: 1337Mhz *\n2: 2400Mhz\n", &[500, 2400]),
        // In processors the middle one is fixed while it has no star.
        ("0: 200Mhz *\n1: 700Mhz\n2: 1750Mhz\n", &[200, 700, 1750]),
        ("0: 200Mhz\n1: 700Mhz\n2: 1750Mhz *\n", &[200, 700, 1750]),
        ("0: 300Mhz\n1: 600Mhz *\n2: 900Mhz\n3: 1200Mhz\n", &[300, 600, 900, 1200]),
        ("S: 19Mhz *\n0: 500Mhz\n1: 2400Mhz\n", &[500, 2400]),
        ("0: 1600Mhz\n1: 400Mhz\n2: 400Mhz *\n", &[400, 1600]),
        ("2\n500Mhz\n1: 1900Mhz\n2: 24", &[1900]),
    ] {
        let (_folder, gpu) = still(table);
        assert_eq!(gpu.steps(Domain::Graphics).as_deref(), Ok(steps), "{table}");
        assert_eq!(gpu.highest(Domain::Graphics).ok(), steps.last().copied(), "{table}");
    }
    let (_folder, sleeps) = still("S: 19Mhz *\n0: 500Mhz\n1: 2400Mhz\n");
    assert_eq!(sleeps.clock(Domain::Graphics), Ok(19));
}

#[test]
fn what_is_locked_goes_by_the_table_of_that_moment() {
    let (folder, gpu) = still("0: 500Mhz\n1: 1337Mhz *\n2: 2400Mhz\n");
    let device = folder.path().join("class/drm/card0/device");
    fs::write(device.join(LEVEL), "manual\n").unwrap();
    let Err(Trouble::Other(reason)) = gpu.apply(&lock(Domain::Graphics, 1337)) else { panic!("locked") };
    assert!(reason.contains("1337 MHz"), "{reason}");
    gpu.apply(&lock(Domain::Graphics, 2400)).unwrap();
    assert!(fs::read_to_string(device.join("pp_dpm_sclk")).unwrap().starts_with("2\n"));
    fs::write(device.join("pp_dpm_sclk"), "0: 500Mhz\n1: 2400Mhz *\n").unwrap();
    gpu.apply(&lock(Domain::Graphics, 2400)).unwrap();
    assert!(fs::read_to_string(device.join("pp_dpm_sclk")).unwrap().starts_with("1\n"));
}

#[test]
fn locks_and_puts_the_level_back() {
    for before in ["auto", "high", "low", "profile_standard", "profile_peak"] {
        let bench = Bench::at(before);
        let (gpu, card) = (&bench.gpu, &bench.card);
        assert_eq!(gpu.obstacle(Domain::Graphics), None);
        assert_eq!(gpu.preparations(), Ok(vec![level("manual")]));
        let undo = bench.make(&level("manual")).unwrap();
        assert_eq!(undo, Some(level(before)));
        assert_eq!(gpu.preparations(), Ok(Vec::new()));
        for (graphics, memory) in [(2, 1), (4, 0)] {
            let (fast, far) = (GRAPHICS[graphics], MEMORY[memory]);
            assert_eq!(bench.make(&lock(Domain::Graphics, fast)), Ok(None));
            assert_eq!(bench.make(&lock(Domain::Memory, far)), Ok(None));
            assert_eq!((gpu.clock(Domain::Graphics), gpu.clock(Domain::Memory)), (Ok(fast), Ok(far)));
            assert_eq!(card.locked(Clock::Graphics), Some(graphics as u32));
            assert_eq!(card.locked(Clock::Memory), Some(memory as u32));
        }
        bench.take_back(undo.into_iter().collect());
        assert_eq!((card.level().as_str(), card.locked(Clock::Graphics)), (before, None));
    }
}

#[test]
fn frees_the_clocks_where_the_level_was_manual() {
    let bench = Bench::at("manual");
    bench.card.write("pp_dpm_sclk", "1 2\n");
    assert_eq!(bench.gpu.preparations(), Ok(Vec::new()));
    let undo = bench.make(&lock(Domain::Graphics, 1900)).unwrap();
    assert_eq!(undo, Some(Change::Unlock { domain: Domain::Graphics }));
    assert_eq!(bench.card.locked(Clock::Graphics), Some(3));
    bench.take_back(vec![undo.unwrap()]);
    assert_eq!((bench.card.level().as_str(), bench.card.locked(Clock::Graphics)), ("manual", None));

    // Somebody may have changed the level meanwhile: the clocks are free then.
    bench.card.write(LEVEL, "low\n");
    assert_eq!(bench.gpu.apply(&Change::Unlock { domain: Domain::Graphics }), Ok(()));
    assert_eq!(bench.gpu.clock(Domain::Graphics), Ok(500));
    assert!(matches!(bench.gpu.apply(&lock(Domain::Graphics, 1900)), Err(Trouble::Other(_))));
}

#[test]
fn a_lock_that_is_given_up_frees_the_clock_at_once() {
    for before in ["auto", "manual"] {
        let bench = Bench::at(before);
        let folder = tempfile::tempdir().unwrap();
        let journals = Folder::open(folder.path()).unwrap();
        let mut journal = Journal::lock(&journals, bench.gpu.identity()).unwrap().ok().unwrap();
        journal.begin(&Holder::this(bench.gpu.identity(), 0, "me", &[])).unwrap();
        let mut held = Held::new(&bench.gpu, journal, RestoreTo::default());
        bench.gpu.preparations().unwrap().iter().for_each(|change| held.change(change).unwrap());
        let locked = || {
            bench.card.settle();
            (bench.card.locked(Clock::Graphics), bench.card.locked(Clock::Memory))
        };
        held.change(&lock(Domain::Graphics, GRAPHICS[2])).unwrap();
        held.change(&lock(Domain::Memory, MEMORY[1])).unwrap();
        assert_eq!(locked(), (Some(2), Some(1)));
        held.release(Domain::Memory).unwrap();
        assert_eq!(locked(), (Some(2), None));
        // That its first lock has been taken back says nothing about its second.
        held.change(&lock(Domain::Memory, MEMORY[0])).unwrap();
        assert_eq!(locked(), (Some(2), Some(0)));
        assert!(held.restore().iter().all(|restoration| restoration.failed.is_none()));
        assert_eq!((locked(), bench.card.level().as_str()), ((None, None), before));
    }
}

#[test]
fn whatever_was_changed_the_undos_give_the_first_level_back() {
    let changes = [
        level("auto"),
        level("high"),
        level("manual"),
        lock(Domain::Graphics, 500),
        lock(Domain::Graphics, 1900),
        lock(Domain::Memory, 1000),
        Change::Unlock { domain: Domain::Graphics },
    ];
    for before in ["auto", "high", "manual"] {
        // All sequences of three of them: the digits of a number.
        for number in 0..changes.len().pow(3) {
            let sequence = (0..3).map(|place| &changes[number / changes.len().pow(place) % changes.len()]);
            let bench = Bench::at(before);
            // What the driver refuses has changed nothing, and needs no undoing.
            let undos = sequence.clone().filter_map(|change| bench.make(change).ok().flatten()).collect();
            bench.take_back(undos);
            let after =
                (bench.card.level(), bench.card.locked(Clock::Graphics), bench.card.locked(Clock::Memory));
            assert_eq!(after, (before.into(), None, None), "{:?}", sequence.collect::<Vec<_>>());
        }
    }
}

#[test]
fn a_limit_that_could_not_be_put_back_is_an_obstacle() {
    let bench = Bench::at(DETERMINISM);
    for trouble in [bench.gpu.obstacle(Domain::Graphics), bench.gpu.preparations().err()] {
        let Some(Trouble::Other(reason)) = trouble else { panic!("{trouble:?}") };
        assert!(reason.contains(DETERMINISM), "{reason}");
    }
}

#[test]
fn without_the_right_nothing_changes() {
    let bench = Bench::at("auto");
    bench.card.deny();
    as_unprivileged(|| {
        for domain in [Domain::Graphics, Domain::Memory] {
            assert_eq!(bench.gpu.obstacle(domain), Some(Trouble::NoPermission));
        }
        assert_eq!(bench.gpu.apply(&level("manual")), Err(Trouble::NoPermission));
        // Reading goes on.
        assert_eq!(bench.gpu.clock(Domain::Graphics), Ok(500));
    });
    let mut shell = Command::new("sh");
    shell.args(["-c", "cat \"$0\" > \"$1\""]);
    shell.args([bench.card.root().join("module/amdgpu/version"), bench.card.device().join(LEVEL)]);
    assert!(!unprivileged(&mut shell).output().unwrap().status.success());
    assert_eq!(bench.card.level(), "auto");
}

#[test]
fn a_table_that_nobody_can_write_is_not_supported() {
    let bench = Bench::at("manual");
    bench.card.deny();
    let table = bench.card.device().join("pp_dpm_mclk");
    fs::set_permissions(&table, fs::Permissions::from_mode(0o444)).unwrap();
    as_unprivileged(|| {
        assert_eq!(bench.gpu.obstacle(Domain::Memory), Some(Trouble::NotSupported));
        assert_eq!(bench.gpu.obstacle(Domain::Graphics), Some(Trouble::NoPermission));
    });
}

#[test]
fn does_not_write_through_links() {
    let bench = Bench::at("manual");
    let table = bench.card.device().join("pp_dpm_sclk");
    let elsewhere = bench.card.root().join("elsewhere");
    fs::rename(&table, &elsewhere).unwrap();
    symlink(&elsewhere, &table).unwrap();
    let before = fs::read_to_string(&elsewhere).unwrap();
    assert!(matches!(bench.gpu.obstacle(Domain::Graphics), Some(Trouble::Other(_))));
    assert!(bench.gpu.apply(&lock(Domain::Graphics, 1900)).is_err());
    assert_eq!(fs::read_to_string(&elsewhere).unwrap(), before);
}

#[test]
fn a_driver_that_takes_no_notice_shows_in_the_clock() {
    let bench = Bench::at("manual");
    bench.card.ignore_writes(true);
    bench.make(&lock(Domain::Graphics, 1900)).unwrap();
    assert_eq!((bench.gpu.clock(Domain::Graphics), bench.card.locked(Clock::Graphics)), (Ok(500), None));
    bench.card.ignore_writes(false);
    bench.make(&lock(Domain::Graphics, 1900)).unwrap();
    assert_eq!(bench.gpu.clock(Domain::Graphics), Ok(1900));
}

#[test]
fn the_stand_in_follows_by_itself() {
    let bench = Bench::at("manual");
    bench.gpu.apply(&lock(Domain::Memory, 1250)).unwrap();
    let late = std::time::Instant::now() + std::time::Duration::from_secs(10);
    while bench.gpu.clock(Domain::Memory) != Ok(1250) {
        assert!(std::time::Instant::now() < late);
        std::thread::yield_now();
    }
}

#[test]
fn an_unplugged_card_is_lost() {
    let bench = Bench::at("auto");
    bench.card.unplug();
    assert_eq!(bench.gpu.clock(Domain::Graphics), Err(Trouble::Lost));
    assert_eq!(bench.gpu.steps(Domain::Graphics), Err(Trouble::Lost));
    assert_eq!(bench.gpu.obstacle(Domain::Graphics), Some(Trouble::Lost));
    assert_eq!(bench.gpu.apply(&level("manual")), Err(Trouble::Lost));
    assert_eq!(bench.gpu.reading(), Telemetry::unavailable(Trouble::Lost.to_string()));
    assert!(find(&bench.card.root()).unwrap().is_empty());
}

#[test]
fn the_kernels_errors_have_their_meaning() {
    let of = |errno: Errno| trouble(&io::Error::from_raw_os_error(errno as i32));
    assert_eq!(of(Errno::EACCES), Trouble::NoPermission);
    assert_eq!(of(Errno::ENOENT), Trouble::NotSupported);
    assert_eq!(of(Errno::EOPNOTSUPP), Trouble::NotSupported);
    assert_eq!(of(Errno::ENODEV), Trouble::Lost);
    assert_eq!(of(Errno::EIO), Trouble::Lost);
    assert_eq!(of(Errno::EPERM), Trouble::Other("the GPU is asleep or being reset".into()));
    assert_eq!(of(Errno::EINVAL), Trouble::Other("Invalid argument (os error 22)".into()));
}
