//! The stand-in as `stabilize` meets it: loaded by nvml-wrapper under the driver's name.

use nvml_stand_in::{
    COUNTERS, ErrorCode, FUNCTIONS, Fault, FaultKind, Gpu, STATE_VARIABLE, Settings, State, install,
    install_without, library,
};
use nvml_wrapper::enum_wrappers::device::{Clock, ClockId, PerformancePolicy, TemperatureSensor};
use nvml_wrapper::enums::device::{DeviceArchitecture, GpuLockedClocksSetting, SampleValue};
use nvml_wrapper::error::NvmlError;
use nvml_wrapper::structs::device::FieldId;
use nvml_wrapper::sys_exports::field_id::*;
use nvml_wrapper::{Device, Nvml};
use nvml_wrapper_sys::bindings::{
    nvmlReturn_enum_NVML_ERROR_INSUFFICIENT_SIZE, nvmlReturn_enum_NVML_ERROR_NO_PERMISSION,
    nvmlReturn_enum_NVML_SUCCESS,
};
use std::collections::BTreeMap;
use std::ffi::{CStr, OsStr};
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::{Duration, Instant};
use std::{env, fs, ptr, thread};

/// Runs a test's body in a process of its own, where `LD_LIBRARY_PATH` has `installed` and the
/// environment names a state. For that the test program starts itself with the test's name.
fn alone(test: &str, state: &State, installed: impl FnOnce(&Path) -> PathBuf, body: impl FnOnce(&Path)) {
    if let Some(path) = env::var_os(STATE_VARIABLE) {
        return body(Path::new(&path));
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state.json");
    state.write(&path).unwrap();
    installed(folder.path());
    let output = Command::new(env::current_exe().unwrap())
        .args([test, "--exact", "--nocapture"])
        .env(STATE_VARIABLE, &path)
        .env("LD_LIBRARY_PATH", folder.path())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
    assert!(output.status.success() && text.contains("1 passed"), "{text}");
}

/// A state that anybody may change, with this GPU.
fn one(gpu: Gpu) -> State {
    State { gpus: vec![gpu], root_only: false, ..State::default() }
}

fn example() -> State {
    one(Gpu::default())
}

fn faulty(faults: &[Fault]) -> State {
    State { faults: faults.to_vec(), ..example() }
}

fn fault(function: &str, skip: u32, times: Option<u32>, kind: FaultKind) -> Fault {
    Fault { function: function.into(), skip, times, kind }
}

fn load() -> Result<Nvml, NvmlError> {
    Nvml::builder().lib_path(OsStr::new("libnvidia-ml.so.1")).init()
}

fn lock(device: &mut Device, low: u32, high: u32) -> Result<(), NvmlError> {
    let setting = GpuLockedClocksSetting::Numeric { min_clock_mhz: low, max_clock_mhz: high };
    device.set_gpu_locked_clocks(setting)
}

fn settings(path: &Path) -> Settings {
    State::read(path).unwrap().gpus[0].settings()
}

fn graphics(device: &Device) -> u32 {
    device.clock_info(Clock::Graphics).unwrap()
}

#[test]
fn tells_what_the_state_says() {
    let other = Gpu {
        uuid: "GPU-00000000-0000-0000-0000-000000000001".into(),
        pci_bus_id: "00000001:4C:00.0".into(),
        // More than nvml-wrapper has room for at first, for memory.
        graphics_steps: (1..=100).rev().collect(),
        memory_steps: (1..=40).rev().collect(),
        base_graphics_mhz: None,
        ..Gpu::default()
    };
    let state = State { gpus: vec![Gpu::default(), other.clone()], ..State::default() };
    alone("tells_what_the_state_says", &state, install, |_| {
        let nvml = load().unwrap();
        assert_eq!(nvml.sys_driver_version().unwrap(), "580.65.06");
        assert_eq!(nvml.sys_nvml_version().unwrap(), "13.580.65.06");
        assert_eq!(nvml.sys_cuda_driver_version().unwrap(), 13_000);
        assert_eq!(nvml.device_count().unwrap(), 2);
        assert!(matches!(nvml.device_by_index(2), Err(NvmlError::InvalidArg)));

        let gpu = Gpu::default();
        let device = nvml.device_by_index(0).unwrap();
        assert_eq!(device.name().unwrap(), gpu.name);
        assert_eq!(device.uuid().unwrap(), gpu.uuid);
        assert_eq!(device.architecture().unwrap(), DeviceArchitecture::Hopper);
        assert_eq!(device.pci_info().unwrap().bus_id, gpu.pci_bus_id);
        assert_eq!(device.supported_memory_clocks().unwrap(), [2619, 1593]);
        assert_eq!(device.supported_graphics_clocks(2619).unwrap(), gpu.graphics_steps);
        assert!(matches!(device.supported_graphics_clocks(2000), Err(NvmlError::NotFound)));
        assert_eq!(device.max_clock_info(Clock::SM).unwrap(), 1980);
        assert_eq!(device.max_clock_info(Clock::Memory).unwrap(), 2619);
        assert_eq!(device.clock(Clock::Graphics, ClockId::DefaultAppClock).unwrap(), 1590);
        assert_eq!(device.clock(Clock::SM, ClockId::Current).unwrap(), 345);
        assert_eq!(device.power_usage().unwrap(), 71_500);
        assert!(device.current_throttle_reasons_strict().unwrap().is_empty());
        device.performance_state().unwrap();

        for device in [nvml.device_by_uuid(&*other.uuid), nvml.device_by_pci_bus_id("0001:4c:00.0")] {
            let device = device.unwrap();
            assert_eq!(device.index().unwrap(), 1);
            assert_eq!(device.supported_graphics_clocks(40).unwrap(), other.graphics_steps);
            assert_eq!(device.supported_memory_clocks().unwrap(), other.memory_steps);
            let base = device.clock(Clock::Graphics, ClockId::DefaultAppClock);
            assert!(matches!(base, Err(NvmlError::NotSupported)));
        }
        assert!(matches!(nvml.device_by_uuid("GPU-"), Err(NvmlError::NotFound)));
        assert!(matches!(nvml.device_by_pci_bus_id("0000:02:00.0"), Err(NvmlError::NotFound)));
    });
}

/// nvml-wrapper's own call takes the first answer for the list, and gives zeros where there are more
/// than 128.
#[test]
fn long_lists_are_given_in_two_calls() {
    let gpu = Gpu { graphics_steps: (1..=300).rev().collect(), ..Gpu::default() };
    alone("long_lists_are_given_in_two_calls", &one(gpu), install, |_| {
        let nvml = load().unwrap();
        let device = nvml.device_by_index(0).unwrap();
        let list = nvml.lib().nvmlDeviceGetSupportedGraphicsClocks.as_ref().unwrap();
        let mut count = 0;
        // SAFETY: the handle is used while `device` lives, and `count` says that there is no list.
        let code = unsafe { list(device.handle(), 2619, &mut count, ptr::null_mut()) };
        assert_eq!((code, count), (nvmlReturn_enum_NVML_ERROR_INSUFFICIENT_SIZE, 300));
        let mut clocks = vec![0; count as usize];
        // SAFETY: as above, and `clocks` has room for `count`.
        let code = unsafe { list(device.handle(), 2619, &mut count, clocks.as_mut_ptr()) };
        assert_eq!((code, count), (nvmlReturn_enum_NVML_SUCCESS, 300));
        assert!(clocks.into_iter().eq((1..=300).rev()));
    });
}

#[test]
fn errors_have_names() {
    alone("errors_have_names", &example(), install, |_| {
        let nvml = load().unwrap();
        let name = nvml.lib().nvmlErrorString.as_ref().unwrap();
        // SAFETY: any number may be asked for, and the text stays for good.
        let name = unsafe { CStr::from_ptr(name(nvmlReturn_enum_NVML_ERROR_NO_PERMISSION)) };
        assert_eq!(name, c"Insufficient Permissions");
    });
}

#[test]
fn locks_are_read_back_and_reset() {
    alone("locks_are_read_back_and_reset", &example(), install, |path| {
        let first = settings(path);
        let nvml = load().unwrap();
        let mut device = nvml.device_by_index(0).unwrap();
        assert!(!device.is_in_persistent_mode().unwrap());
        device.set_persistent(true).unwrap();
        assert!(device.is_in_persistent_mode().unwrap());

        for (asked, delivered) in [(1500, 1500), (1507, 1500), (1980, 1935), (100, 210)] {
            lock(&mut device, asked, asked).unwrap();
            assert_eq!(graphics(&device), delivered, "{asked}");
        }
        lock(&mut device, 210, 1410).unwrap();
        device.set_mem_locked_clocks(2619, 2619).unwrap();
        assert_eq!(graphics(&device), 1410);
        assert_eq!(device.clock_info(Clock::Memory).unwrap(), 2619);
        assert!(matches!(lock(&mut device, 1500, 1400), Err(NvmlError::InvalidArg)));
        let locked = settings(path);
        assert_eq!(
            locked,
            Settings {
                persistence: true,
                locked_graphics: Some((210, 1410)),
                locked_memory: Some((2619, 2619))
            }
        );

        device.reset_gpu_locked_clocks().unwrap();
        device.reset_mem_locked_clocks().unwrap();
        device.set_persistent(false).unwrap();
        assert_eq!(graphics(&device), 345);
        assert_eq!(device.clock_info(Clock::Memory).unwrap(), 1593);
        assert_eq!(settings(path), first);

        let calls = [
            ("DeviceResetGpuLockedClocks", 1),
            ("DeviceResetMemoryLockedClocks", 1),
            ("DeviceSetGpuLockedClocks", 6),
            ("DeviceSetMemoryLockedClocks", 1),
            ("DeviceSetPersistenceMode", 2),
        ];
        let calls = BTreeMap::from(calls.map(|(function, count)| (function.to_owned(), count)));
        assert_eq!(State::read(path).unwrap().calls, calls);
    });
}

#[test]
fn clocks_take_their_time() {
    let gpu = Gpu { settling_reads: 3, idle_graphics_mhz: 300, ..Gpu::default() };
    alone("clocks_take_their_time", &one(gpu), install, |_| {
        let nvml = load().unwrap();
        let mut device = nvml.device_by_index(0).unwrap();
        let reads = |device: &Device| [(); 5].map(|()| graphics(device));
        assert_eq!(reads(&device), [300; 5]);
        lock(&mut device, 1500, 1500).unwrap();
        assert_eq!(reads(&device), [300, 700, 1100, 1500, 1500]);
        device.reset_gpu_locked_clocks().unwrap();
        assert_eq!([graphics(&device), graphics(&device)], [1500, 1100]);
        // Another lock on the way sets out from there.
        lock(&mut device, 1410, 1410).unwrap();
        assert_eq!(reads(&device), [700, 936, 1173, 1410, 1410]);
    });
}

#[test]
fn some_clocks_do_not_obey() {
    let stuck = Gpu { graphics_clock_follows: false, stuck_graphics_mhz: Some(1200), ..Gpu::default() };
    let moved = Gpu { memory_lock_moves_graphics_mhz: Some(1305), ..Gpu::default() };
    let fixed = Gpu { memory_lock_supported: false, ..Gpu::default() };
    let old = Gpu { architecture: 6, ..Gpu::default() };
    let older = Gpu { architecture: 4, ..Gpu::default() };
    let state = State { gpus: vec![stuck, moved, fixed, old, older], ..example() };
    alone("some_clocks_do_not_obey", &state, install, |_| {
        let nvml = load().unwrap();
        let device = |index| nvml.device_by_index(index).unwrap();
        for (index, before, after) in
            [(0, 1200, Some(1200)), (1, 1500, Some(1305)), (2, 1500, None), (3, 1500, None)]
        {
            let mut device = device(index);
            lock(&mut device, 1500, 1500).unwrap();
            assert_eq!(graphics(&device), before);
            let memory = device.set_mem_locked_clocks(2619, 2619);
            match after {
                Some(after) => assert_eq!(graphics(&device), after),
                None => assert!(matches!(memory, Err(NvmlError::NotSupported))),
            }
        }
        assert!(matches!(lock(&mut device(4), 1500, 1500), Err(NvmlError::NotSupported)));
    });
}

#[test]
fn cools_down_while_it_is_read() {
    let gpu = Gpu { temperature_celsius: 50, cooling_celsius_per_read: 8, ..Gpu::default() };
    alone("cools_down_while_it_is_read", &one(gpu), install, |_| {
        let nvml = load().unwrap();
        let device = nvml.device_by_index(0).unwrap();
        let reads = [(); 5].map(|()| device.temperature(TemperatureSensor::Gpu).unwrap());
        assert_eq!(reads, [50, 42, 34, 30, 30]);
    });
}

fn fields(device: &Device, ids: &[u32]) -> Vec<Option<u64>> {
    let ids: Vec<FieldId> = ids.iter().map(|&id| FieldId(id)).collect();
    let values = device.field_values_for(&ids).unwrap();
    let value = |sample: Result<_, _>| -> Option<u64> {
        let sample: nvml_wrapper::struct_wrappers::device::FieldValueSample = sample.unwrap();
        match sample.value {
            Ok(SampleValue::U64(value)) => Some(value),
            Err(NvmlError::NotSupported) => None,
            other => panic!("{other:?}"),
        }
    };
    values.into_iter().map(value).collect()
}

/// The fields of [`COUNTERS`] from the third on, and one that is not served.
const FIELDS: &[u32] = &[
    NVML_FI_DEV_CLOCKS_EVENT_REASON_SW_POWER_CAP,
    NVML_FI_DEV_CLOCKS_EVENT_REASON_SYNC_BOOST,
    NVML_FI_DEV_CLOCKS_EVENT_REASON_SW_THERM_SLOWDOWN,
    NVML_FI_DEV_CLOCKS_EVENT_REASON_HW_THERM_SLOWDOWN,
    NVML_FI_DEV_CLOCKS_EVENT_REASON_HW_POWER_BRAKE_SLOWDOWN,
    NVML_FI_PWR_SMOOTHING_ENABLED,
];

fn counting(driver: &str) -> State {
    let counters = (1..).zip(COUNTERS).map(|(value, name)| ((*name).to_owned(), value)).collect();
    let missing_counters = vec!["thermal".to_owned(), "hw_thermal".to_owned()];
    State { driver: driver.into(), ..one(Gpu { counters, missing_counters, ..Gpu::default() }) }
}

fn counters_are_told() {
    let nvml = load().unwrap();
    let device = nvml.device_by_index(0).unwrap();
    assert_eq!(device.violation_status(PerformancePolicy::Power).unwrap().violation_time, 1);
    for policy in [PerformancePolicy::Thermal, PerformancePolicy::Reliability] {
        assert!(matches!(device.violation_status(policy), Err(NvmlError::NotSupported)));
    }
    assert_eq!(fields(&device, FIELDS), [Some(3), Some(4), Some(5), None, Some(7), None]);
}

#[test]
fn counters_with_an_old_driver() {
    alone("counters_with_an_old_driver", &counting("575.51.03"), install, |_| counters_are_told());
}

#[test]
fn counters_with_a_new_driver() {
    alone("counters_with_a_new_driver", &counting("580.95.05"), install, |_| counters_are_told());
}

#[test]
fn throttling_raises_a_counter() {
    let throttle = FaultKind::Throttle { counter: "sw_power_cap".into(), nanoseconds: 500 };
    let state = faulty(&[fault("DeviceGetPowerUsage", 1, Some(2), throttle)]);
    alone("throttling_raises_a_counter", &state, install, |_| {
        let nvml = load().unwrap();
        let device = nvml.device_by_index(0).unwrap();
        let after = [(); 4].map(|()| {
            device.power_usage().unwrap();
            fields(&device, &FIELDS[..1])[0].unwrap()
        });
        assert_eq!(after, [0, 500, 1000, 1000]);
    });
}

#[test]
fn faults_skip_and_end() {
    let no = FaultKind::Error(ErrorCode::NoPermission);
    let state = faulty(&[fault("DeviceSetGpuLockedClocks", 1, Some(2), no)]);
    alone("faults_skip_and_end", &state, install, |path| {
        let nvml = load().unwrap();
        let mut device = nvml.device_by_index(0).unwrap();
        let results = [1005, 1110, 1200, 1305].map(|mhz| lock(&mut device, mhz, mhz));
        assert!(
            matches!(results, [Ok(()), Err(NvmlError::NoPermission), Err(NvmlError::NoPermission), Ok(())]),
            "{results:?}"
        );
        assert_eq!(settings(path).locked_graphics, Some((1305, 1305)));
        assert_eq!(State::read(path).unwrap().calls["DeviceSetGpuLockedClocks"], 4);
    });
}

#[test]
fn a_gpu_is_lost_midway() {
    let lost = fault("*", 3, None, FaultKind::Error(ErrorCode::GpuIsLost));
    alone("a_gpu_is_lost_midway", &faulty(&[lost]), install, |path| {
        let nvml = load().unwrap();
        let mut device = nvml.device_by_index(0).unwrap();
        lock(&mut device, 1500, 1500).unwrap();
        assert_eq!(graphics(&device), 1500);
        assert!(matches!(device.clock_info(Clock::Graphics), Err(NvmlError::GpuLost)));
        assert!(matches!(device.reset_gpu_locked_clocks(), Err(NvmlError::GpuLost)));
        assert!(matches!(nvml.device_by_index(0), Err(NvmlError::GpuLost)));
        assert_eq!(nvml.device_count().unwrap(), 1);
        assert_eq!(settings(path).locked_graphics, Some((1500, 1500)));
    });
}

#[test]
fn slow_calls_work_first_and_block_nobody() {
    let slow = fault("DeviceSetPersistenceMode", 0, Some(1), FaultKind::Slow { milliseconds: 400 });
    alone("slow_calls_work_first_and_block_nobody", &faulty(&[slow]), install, |path| {
        let nvml = load().unwrap();
        let start = Instant::now();
        thread::scope(|scope| {
            let slow = scope.spawn(|| {
                nvml.device_by_index(0).unwrap().set_persistent(true).unwrap();
                start.elapsed()
            });
            while !settings(path).persistence {
                thread::sleep(Duration::from_millis(5));
            }
            nvml.device_by_index(0).unwrap().power_usage().unwrap();
            let others = start.elapsed();
            let slow = slow.join().unwrap();
            assert!(slow >= Duration::from_millis(400) && others < slow, "{others:?} {slow:?}");
        });
    });
}

#[test]
fn a_silent_call_does_nothing() {
    let state = faulty(&[Fault::always("DeviceSetMemoryLockedClocks", FaultKind::Silent)]);
    alone("a_silent_call_does_nothing", &state, install, |path| {
        let nvml = load().unwrap();
        nvml.device_by_index(0).unwrap().set_mem_locked_clocks(2619, 2619).unwrap();
        assert_eq!(settings(path).locked_memory, None);
        assert_eq!(State::read(path).unwrap().calls["DeviceSetMemoryLockedClocks"], 1);
    });
}

#[test]
fn only_root_may_set() {
    alone("only_root_may_set", &State::example(), install, |path| {
        let nvml = load().unwrap();
        let mut device = nvml.device_by_index(0).unwrap();
        // What is right depends on who runs this.
        let root = match lock(&mut device, 1500, 1500) {
            Ok(()) => true,
            Err(NvmlError::NoPermission) => false,
            Err(other) => panic!("{other}"),
        };
        assert_eq!(settings(path).locked_graphics.is_some(), root);
        assert_eq!(State::read(path).unwrap().calls["DeviceSetGpuLockedClocks"], 1);
    });
}

#[test]
fn without_a_state_there_is_no_driver() {
    alone("without_a_state_there_is_no_driver", &example(), install, |path| {
        for text in ["", "{", r#"{"gpu":[]}"#, r#"{"faults":[{"function":"X","kind":"Silent"}]}"#] {
            fs::write(path, text).unwrap();
            assert!(matches!(load(), Err(NvmlError::DriverNotLoaded)), "{text}");
        }
        fs::remove_file(path).unwrap();
        assert!(matches!(load(), Err(NvmlError::DriverNotLoaded)));
        fs::write(path, "{}").unwrap();
        assert_eq!(load().unwrap().device_count().unwrap(), 0);
    });
}

#[test]
fn the_driver_can_fail_at_the_start() {
    let missing = fault("Init_v2", 0, Some(1), FaultKind::Error(ErrorCode::DriverNotLoaded));
    alone("the_driver_can_fail_at_the_start", &faulty(&[missing]), install, |_| {
        assert!(matches!(load(), Err(NvmlError::DriverNotLoaded)));
        let nvml = load().unwrap();
        let other = load().unwrap();
        // One client is left, and with it the library.
        drop(nvml);
        assert_eq!(other.device_count().unwrap(), 1);
    });
}

#[test]
fn old_drivers_lack_functions() {
    const MISSING: &[&str] = &["nvmlDeviceGetViolationStatus", "nvmlDeviceGetClock"];
    let without = |folder: &Path| install_without(folder, MISSING);
    alone("old_drivers_lack_functions", &example(), without, |_| {
        let nvml = load().unwrap();
        let device = nvml.device_by_index(0).unwrap();
        let missing = [
            device.violation_status(PerformancePolicy::Power).map(|_| ()),
            device.clock(Clock::SM, ClockId::Current).map(|_| ()),
        ];
        for result in missing {
            assert!(matches!(result, Err(NvmlError::FailedToLoadSymbol(_))), "{result:?}");
        }
        assert_eq!(graphics(&device), 345);
    });
}

#[test]
fn every_function_is_exported_by_name() {
    let bytes = fs::read(library()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for function in FUNCTIONS {
        let whole = format!("\0{function}\0");
        assert!(bytes.windows(whole.len()).any(|text| text == whole.as_bytes()), "{function}");
    }
    let copy = install_without(folder.path(), FUNCTIONS);
    assert_eq!(copy, folder.path().join("libnvidia-ml.so.1"));
}

#[test]
#[should_panic(expected = "has no nvmlDeviceGetNothing")]
fn what_is_not_there_cannot_be_left_out() {
    install_without(tempfile::tempdir().unwrap().path(), &["nvmlDeviceGetNothing"]);
}

#[test]
fn names_that_nothing_asks_for_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state.json");
    let throttle = FaultKind::Throttle { counter: "heat".into(), nanoseconds: 1 };
    let wrong = [
        faulty(&[Fault::always("nvmlInit_v2", FaultKind::Silent)]),
        faulty(&[Fault::always("*", throttle)]),
        one(Gpu { missing_counters: vec!["heat".into()], ..Gpu::default() }),
        one(Gpu { counters: BTreeMap::from([("heat".to_owned(), 1)]), ..Gpu::default() }),
    ];
    for state in wrong {
        assert!(state.write(&path).is_err(), "{state:?}");
    }
    assert!(!path.exists());
}

/// A process that does not outlive its test, even one that fails.
struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }
}

#[test]
fn a_killed_process_leaves_a_whole_state() {
    // So large that a write takes a while.
    let large = one(Gpu { graphics_steps: (210..60_000).rev().collect(), ..Gpu::default() });
    alone("a_killed_process_leaves_a_whole_state", &large, install, |path| {
        const WRITER: &str = "NVML_STAND_IN_TEST_WRITER";
        if env::var_os(WRITER).is_some() {
            let nvml = load().unwrap();
            let mut device = nvml.device_by_index(0).unwrap();
            for mhz in (300..1900).cycle() {
                lock(&mut device, mhz, mhz).unwrap();
            }
        }
        let calls = || State::read(path).unwrap().calls.values().sum::<u64>();
        for round in 0..25 {
            let before = calls();
            let writer = Command::new(env::current_exe().unwrap())
                .args(["a_killed_process_leaves_a_whole_state", "--exact", "--nocapture"])
                .env(WRITER, "")
                .spawn();
            let writer = Killed(writer.unwrap());
            while calls() == before {
                thread::sleep(Duration::from_micros(200));
            }
            thread::sleep(Duration::from_micros(370 * round));
            drop(writer);
            // Whole, and neither the lock nor a half-written file is in the way.
            let after = calls();
            State::edit(path, |state| state.gpus[0].locked_graphics = None).unwrap();
            assert_eq!(calls(), after);
            assert_eq!(State::read(path).unwrap().gpus[0].graphics_steps.len(), 59_790);
        }
    });
}
