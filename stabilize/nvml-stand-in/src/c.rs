//! NVML's functions, as in `nvml.h`.
//!
//! Every function goes through [`call`]: it takes the state, lets the faults have their way, and does
//! what the function is for.

use crate::{Gpu, STATE_VARIABLE, State, fault};
use nvml_wrapper_sys::bindings::field_id::*;
use nvml_wrapper_sys::bindings::*;
use std::ffi::{CStr, CString, c_char, c_int, c_uint, c_ulonglong};
use std::io::ErrorKind;
use std::mem::MaybeUninit;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};
use std::{env, ptr, slice, thread};

/// CUDA's version, for the two functions that ask for it: 13.0.
const CUDA_VERSION: c_int = 13_000;

/// PCI's numbers of the chip and of the board.
const PCI_DEVICE_ID: c_uint = 0x2330_10de;
const PCI_SUBSYSTEM_ID: c_uint = 0x16c1_10de;

/// How often the library was initialized and not yet shut down.
static CLIENTS: AtomicU32 = AtomicU32::new(0);

/// What a function does: nothing more to say, or NVML's number of an error.
type Outcome = Result<(), nvmlReturn_t>;

/// Where a caller wants a result; `None` for a null pointer.
type Out<'a, T> = Option<&'a mut MaybeUninit<T>>;

const INVALID_ARGUMENT: Outcome = Err(nvmlReturn_enum_NVML_ERROR_INVALID_ARGUMENT);
const NOT_FOUND: Outcome = Err(nvmlReturn_enum_NVML_ERROR_NOT_FOUND);
const NOT_SUPPORTED: Outcome = Err(nvmlReturn_enum_NVML_ERROR_NOT_SUPPORTED);
const INSUFFICIENT_SIZE: Outcome = Err(nvmlReturn_enum_NVML_ERROR_INSUFFICIENT_SIZE);

/// Exports functions under their own names, each with its name as `FUNCTION`, and lists them.
///
/// All are unsafe to call: pointers have to point to what `nvml.h` says, or be null where they are an
/// [`Out`].
macro_rules! export {
    ($(fn $name:ident($($argument:ident: $type:ty),*) $body:block)*) => {
        /// The functions that the stand-in has and that can fail, by their names in C.
        pub const FUNCTIONS: &[&str] = &[$(stringify!($name)),*];

        $(
            #[unsafe(no_mangle)]
            unsafe extern "C" fn $name($($argument: $type),*) -> nvmlReturn_t {
                const FUNCTION: &str = stringify!($name);
                $body
            }
        )*
    };
}

export! {
    fn nvmlInit_v2() {
        init(FUNCTION)
    }
    fn nvmlInitWithFlags(_flags: c_uint) {
        init(FUNCTION)
    }
    fn nvmlShutdown() {
        call(FUNCTION, None, |_, _| {
            CLIENTS.fetch_sub(1, Ordering::Relaxed);
            Ok(())
        })
    }

    fn nvmlSystemGetDriverVersion(version: *mut c_char, length: c_uint) {
        // SAFETY: `version` has room for `length` bytes, as the caller of an exported function promises.
        call(FUNCTION, None, |state, _| unsafe { put_text(&state.driver, version, length) })
    }
    fn nvmlSystemGetNVMLVersion(version: *mut c_char, length: c_uint) {
        // SAFETY: as above.
        call(FUNCTION, None, |state, _| unsafe {
            put_text(&format!("{}.{}", CUDA_VERSION / 1000, state.driver), version, length)
        })
    }
    fn nvmlSystemGetCudaDriverVersion(version: Out<'_, c_int>) {
        call(FUNCTION, None, |_, _| put(version, CUDA_VERSION))
    }
    fn nvmlSystemGetCudaDriverVersion_v2(version: Out<'_, c_int>) {
        call(FUNCTION, None, |_, _| put(version, CUDA_VERSION))
    }

    fn nvmlDeviceGetCount_v2(count: Out<'_, c_uint>) {
        call(FUNCTION, None, |state, _| put(count, state.gpus.len() as c_uint))
    }
    fn nvmlDeviceGetHandleByIndex_v2(index: c_uint, device: Out<'_, nvmlDevice_t>) {
        call(FUNCTION, None, |state, _| match state.gpus.get(index as usize) {
            Some(_) => put(device, handle(index as usize)),
            None => INVALID_ARGUMENT,
        })
    }
    fn nvmlDeviceGetHandleByUUID(uuid: *const c_char, device: Out<'_, nvmlDevice_t>) {
        // SAFETY: `uuid` is null or a string, as the caller of an exported function promises.
        let uuid = unsafe { text(uuid) };
        find(FUNCTION, device, uuid, |gpu, uuid| gpu.uuid == uuid)
    }
    fn nvmlDeviceGetHandleByPciBusId_v2(bus: *const c_char, device: Out<'_, nvmlDevice_t>) {
        // SAFETY: `bus` is null or a string, as the caller of an exported function promises.
        let bus = unsafe { text(bus) };
        find(FUNCTION, device, bus, |gpu, bus| pci(bus).is_some_and(|bus| pci(&gpu.pci_bus_id) == Some(bus)))
    }

    fn nvmlDeviceGetIndex(device: nvmlDevice_t, index: Out<'_, c_uint>) {
        call(FUNCTION, Some(device), |_, at| put(index, at as c_uint))
    }
    fn nvmlDeviceGetName(device: nvmlDevice_t, name: *mut c_char, length: c_uint) {
        // SAFETY: `name` has room for `length` bytes, as the caller of an exported function promises.
        answer(FUNCTION, device, |gpu| unsafe { put_text(&gpu.name, name, length) })
    }
    fn nvmlDeviceGetUUID(device: nvmlDevice_t, uuid: *mut c_char, length: c_uint) {
        // SAFETY: as above.
        answer(FUNCTION, device, |gpu| unsafe { put_text(&gpu.uuid, uuid, length) })
    }
    fn nvmlDeviceGetPciInfo_v3(device: nvmlDevice_t, info: Out<'_, nvmlPciInfo_t>) {
        answer(FUNCTION, device, |gpu| pci_info(gpu).map_or(NOT_SUPPORTED, |pci| put(info, pci)))
    }
    fn nvmlDeviceGetArchitecture(device: nvmlDevice_t, architecture: Out<'_, nvmlDeviceArchitecture_t>) {
        answer(FUNCTION, device, |gpu| put(architecture, gpu.architecture))
    }

    fn nvmlDeviceGetClockInfo(device: nvmlDevice_t, domain: nvmlClockType_t, mhz: Out<'_, c_uint>) {
        answer(FUNCTION, device, |gpu| current_clock(gpu, domain, mhz))
    }
    fn nvmlDeviceGetMaxClockInfo(device: nvmlDevice_t, domain: nvmlClockType_t, mhz: Out<'_, c_uint>) {
        answer(FUNCTION, device, |gpu| max_clock(gpu, domain, mhz))
    }
    fn nvmlDeviceGetClock(
        device: nvmlDevice_t, domain: nvmlClockType_t, which: nvmlClockId_t, mhz: Out<'_, c_uint>
    ) {
        answer(FUNCTION, device, |gpu| match which {
            nvmlClockId_enum_NVML_CLOCK_ID_CURRENT => current_clock(gpu, domain, mhz),
            nvmlClockId_enum_NVML_CLOCK_ID_CUSTOMER_BOOST_MAX => max_clock(gpu, domain, mhz),
            nvmlClockId_enum_NVML_CLOCK_ID_APP_CLOCK_TARGET
            | nvmlClockId_enum_NVML_CLOCK_ID_APP_CLOCK_DEFAULT => base_clock(gpu, domain, mhz),
            _ => INVALID_ARGUMENT,
        })
    }
    fn nvmlDeviceGetSupportedMemoryClocks(device: nvmlDevice_t, count: *mut c_uint, mhz: *mut c_uint) {
        // SAFETY: `count` is null or says for how many `mhz` has room, as the caller of an exported
        // function promises.
        answer(FUNCTION, device, |gpu| unsafe { put_list(&gpu.memory_steps, count, mhz) })
    }
    fn nvmlDeviceGetSupportedGraphicsClocks(
        device: nvmlDevice_t, memory_mhz: c_uint, count: *mut c_uint, mhz: *mut c_uint
    ) {
        answer(FUNCTION, device, |gpu| match gpu.memory_steps.contains(&memory_mhz) {
            // SAFETY: as above.
            true => unsafe { put_list(&gpu.graphics_steps, count, mhz) },
            false => NOT_FOUND,
        })
    }

    fn nvmlDeviceGetPersistenceMode(device: nvmlDevice_t, mode: Out<'_, nvmlEnableState_t>) {
        answer(FUNCTION, device, |gpu| put(mode, gpu.persistence.into()))
    }
    fn nvmlDeviceSetPersistenceMode(device: nvmlDevice_t, mode: nvmlEnableState_t) {
        answer(FUNCTION, device, |gpu| {
            gpu.persistence = match mode {
                nvmlEnableState_enum_NVML_FEATURE_DISABLED => false,
                nvmlEnableState_enum_NVML_FEATURE_ENABLED => true,
                _ => return INVALID_ARGUMENT,
            };
            Ok(())
        })
    }
    fn nvmlDeviceSetGpuLockedClocks(device: nvmlDevice_t, low_mhz: c_uint, high_mhz: c_uint) {
        answer(FUNCTION, device, |gpu| lock_graphics(gpu, Some((low_mhz, high_mhz))))
    }
    fn nvmlDeviceResetGpuLockedClocks(device: nvmlDevice_t) {
        answer(FUNCTION, device, |gpu| lock_graphics(gpu, None))
    }
    fn nvmlDeviceSetMemoryLockedClocks(device: nvmlDevice_t, low_mhz: c_uint, high_mhz: c_uint) {
        answer(FUNCTION, device, |gpu| lock_memory(gpu, Some((low_mhz, high_mhz))))
    }
    fn nvmlDeviceResetMemoryLockedClocks(device: nvmlDevice_t) {
        answer(FUNCTION, device, |gpu| lock_memory(gpu, None))
    }

    fn nvmlDeviceGetViolationStatus(
        device: nvmlDevice_t, policy: nvmlPerfPolicyType_t, time: Out<'_, nvmlViolationTime_t>
    ) {
        answer(FUNCTION, device, |gpu| {
            let counter = match policy {
                nvmlPerfPolicyType_enum_NVML_PERF_POLICY_POWER => gpu.counter("power"),
                nvmlPerfPolicyType_enum_NVML_PERF_POLICY_THERMAL => gpu.counter("thermal"),
                nvmlPerfPolicyType_enum_NVML_PERF_POLICY_COUNT.. => return INVALID_ARGUMENT,
                _ => None,
            };
            counter.map_or(NOT_SUPPORTED, |nanoseconds| {
                put(time, nvmlViolationTime_t { referenceTime: now_us(), violationTime: nanoseconds })
            })
        })
    }
    fn nvmlDeviceGetFieldValues(device: nvmlDevice_t, count: c_int, values: *mut nvmlFieldValue_t) {
        call(FUNCTION, Some(device), |state, at| {
            if count <= 0 || values.is_null() {
                return INVALID_ARGUMENT;
            }
            // SAFETY: `values` points to `count` of them with their IDs filled in, as the caller of an
            // exported function promises.
            let values = unsafe { slice::from_raw_parts_mut(values, count as usize) };
            for value in values {
                let counter = field(state, value.fieldId).and_then(|name| state.gpus[at].counter(name));
                fill_in(value, counter);
            }
            Ok(())
        })
    }
    fn nvmlDeviceGetCurrentClocksThrottleReasons(device: nvmlDevice_t, reasons: Out<'_, c_ulonglong>) {
        answer(FUNCTION, device, |gpu| put(reasons, gpu.throttle_reasons))
    }
    fn nvmlDeviceGetCurrentClocksEventReasons(device: nvmlDevice_t, reasons: Out<'_, c_ulonglong>) {
        answer(FUNCTION, device, |gpu| put(reasons, gpu.throttle_reasons))
    }
    fn nvmlDeviceGetTemperature(
        device: nvmlDevice_t, sensor: nvmlTemperatureSensors_t, celsius: Out<'_, c_uint>
    ) {
        answer(FUNCTION, device, |gpu| match sensor {
            nvmlTemperatureSensors_enum_NVML_TEMPERATURE_GPU => put(celsius, gpu.read_celsius()),
            _ => INVALID_ARGUMENT,
        })
    }
    fn nvmlDeviceGetPowerUsage(device: nvmlDevice_t, milliwatts: Out<'_, c_uint>) {
        answer(FUNCTION, device, |gpu| put(milliwatts, gpu.power_milliwatts))
    }
    fn nvmlDeviceGetPerformanceState(device: nvmlDevice_t, state: Out<'_, nvmlPstates_t>) {
        answer(FUNCTION, device, |gpu| match gpu.locked_graphics {
            Some(_) => put(state, nvmlPStates_enum_NVML_PSTATE_0),
            None => put(state, nvmlPStates_enum_NVML_PSTATE_8),
        })
    }
}

/// The one function that asks nothing, and so cannot fail.
#[unsafe(no_mangle)]
extern "C" fn nvmlErrorString(code: nvmlReturn_t) -> *const c_char {
    let text = match code {
        nvmlReturn_enum_NVML_SUCCESS => c"The operation was successful",
        nvmlReturn_enum_NVML_ERROR_UNINITIALIZED => c"Uninitialized",
        nvmlReturn_enum_NVML_ERROR_INVALID_ARGUMENT => c"Invalid Argument",
        nvmlReturn_enum_NVML_ERROR_NOT_SUPPORTED => c"Not Supported",
        nvmlReturn_enum_NVML_ERROR_NO_PERMISSION => c"Insufficient Permissions",
        nvmlReturn_enum_NVML_ERROR_NOT_FOUND => c"Not Found",
        nvmlReturn_enum_NVML_ERROR_INSUFFICIENT_SIZE => c"Insufficient Size",
        nvmlReturn_enum_NVML_ERROR_DRIVER_NOT_LOADED => c"Driver Not Loaded",
        nvmlReturn_enum_NVML_ERROR_TIMEOUT => c"Timeout",
        nvmlReturn_enum_NVML_ERROR_GPU_IS_LOST => c"GPU is lost",
        _ => c"Unknown Error",
    };
    text.as_ptr()
}

fn path() -> Option<PathBuf> {
    env::var_os(STATE_VARIABLE).map(PathBuf::from)
}

fn init(function: &str) -> nvmlReturn_t {
    let readable = path().ok_or(None).and_then(|path| State::read(&path).map_err(Some));
    if let Err(error) = readable {
        // Not having a driver is what a test may want, a mistake in the file is not.
        if let Some(error) = error.filter(|error| error.kind() != ErrorKind::NotFound) {
            eprintln!("{STATE_VARIABLE}: {error}");
        }
        return nvmlReturn_enum_NVML_ERROR_DRIVER_NOT_LOADED;
    }
    CLIENTS.fetch_add(1, Ordering::Relaxed);
    let code = call(function, None, |_, _| Ok(()));
    if code != nvmlReturn_enum_NVML_SUCCESS {
        CLIENTS.fetch_sub(1, Ordering::Relaxed);
    }
    code
}

/// Does what a function does, for a device if it is for one. `act` gets the place of its GPU.
fn call(
    function: &str,
    device: Option<nvmlDevice_t>,
    act: impl FnOnce(&mut State, usize) -> Outcome,
) -> nvmlReturn_t {
    if CLIENTS.load(Ordering::Relaxed) == 0 {
        return nvmlReturn_enum_NVML_ERROR_UNINITIALIZED;
    }
    let Some(path) = path() else { return nvmlReturn_enum_NVML_ERROR_UNKNOWN };
    let function = function.strip_prefix("nvml").unwrap_or(function);
    let sets = function.starts_with("DeviceSet") || function.starts_with("DeviceReset");
    let mut outcome = Err(nvmlReturn_enum_NVML_ERROR_UNKNOWN);
    let mut met = fault::Met::default();
    let edited = State::edit(&path, |state| {
        if sets {
            *state.calls.entry(function.into()).or_default() += 1;
        }
        // A handle is one more than the place, so that none is null.
        let index = device.map(|device| device.addr().wrapping_sub(1));
        met = fault::meet(state, function, index);
        outcome = if let Some(outcome) = met.outcome {
            outcome
        } else if index.is_some_and(|index| index >= state.gpus.len()) {
            INVALID_ARGUMENT
        } else if sets && state.root_only && !is_root() {
            Err(nvmlReturn_enum_NVML_ERROR_NO_PERMISSION)
        } else {
            act(state, index.unwrap_or(0))
        };
    });
    // The lock is released: others need not wait.
    thread::sleep(met.pause);
    match (outcome, edited) {
        (Err(code), _) => code,
        (Ok(()), Ok(())) => nvmlReturn_enum_NVML_SUCCESS,
        (Ok(()), Err(_)) => nvmlReturn_enum_NVML_ERROR_UNKNOWN,
    }
}

/// Does what a function does for a GPU.
fn answer(function: &str, device: nvmlDevice_t, act: impl FnOnce(&mut Gpu) -> Outcome) -> nvmlReturn_t {
    call(function, Some(device), |state, at| act(&mut state.gpus[at]))
}

/// Finds a GPU by a text.
fn find(
    function: &str,
    device: Out<'_, nvmlDevice_t>,
    text: Option<&str>,
    is_it: impl Fn(&Gpu, &str) -> bool,
) -> nvmlReturn_t {
    call(function, None, |state, _| {
        let Some(text) = text else { return INVALID_ARGUMENT };
        let place = state.gpus.iter().position(|gpu| is_it(gpu, text));
        place.map_or(NOT_FOUND, |place| put(device, handle(place)))
    })
}

fn handle(place: usize) -> nvmlDevice_t {
    ptr::without_provenance_mut(place + 1)
}

#[cfg(unix)]
fn is_root() -> bool {
    rustix::process::geteuid().is_root()
}

/// Elsewhere it takes more than a user's number to tell.
#[cfg(not(unix))]
fn is_root() -> bool {
    true
}

fn put<T>(to: Out<'_, T>, value: T) -> Outcome {
    let Some(to) = to else { return INVALID_ARGUMENT };
    to.write(value);
    Ok(())
}

/// Writes a text and its end.
///
/// # Safety
///
/// `to` is null or has room for `length` bytes.
unsafe fn put_text(text: &str, to: *mut c_char, length: c_uint) -> Outcome {
    let text = CString::new(text).map_err(|_| nvmlReturn_enum_NVML_ERROR_UNKNOWN)?;
    let bytes = text.as_bytes_with_nul();
    if to.is_null() {
        return INVALID_ARGUMENT;
    }
    if bytes.len() > length as usize {
        return INSUFFICIENT_SIZE;
    }
    // SAFETY: there is room for `length` bytes, and these are no more.
    unsafe { ptr::copy_nonoverlapping(bytes.as_ptr().cast(), to, bytes.len()) };
    Ok(())
}

/// Writes a list and its length; the length alone where there is no room.
///
/// # Safety
///
/// `count` is null or says for how many numbers `to` has room.
unsafe fn put_list(list: &[u32], count: *mut c_uint, to: *mut c_uint) -> Outcome {
    // SAFETY: `count` is null or points to a number.
    let Some(count) = (unsafe { count.as_mut() }) else { return INVALID_ARGUMENT };
    if list.is_empty() {
        return NOT_SUPPORTED;
    }
    let room = *count as usize;
    *count = list.len() as c_uint;
    if room < list.len() {
        return INSUFFICIENT_SIZE;
    }
    if to.is_null() {
        return INVALID_ARGUMENT;
    }
    // SAFETY: there is room for `room` numbers, and these are no more.
    unsafe { ptr::copy_nonoverlapping(list.as_ptr(), to, list.len()) };
    Ok(())
}

/// A caller's string.
///
/// # Safety
///
/// `text` is null, or a string that stays as it is while the result is used.
unsafe fn text<'a>(text: *const c_char) -> Option<&'a str> {
    if text.is_null() {
        return None;
    }
    // SAFETY: it is a string, and stays one.
    unsafe { CStr::from_ptr(text) }.to_str().ok()
}

fn current_clock(gpu: &mut Gpu, domain: nvmlClockType_t, mhz: Out<'_, c_uint>) -> Outcome {
    match domain {
        nvmlClockType_enum_NVML_CLOCK_GRAPHICS | nvmlClockType_enum_NVML_CLOCK_SM => {
            put(mhz, gpu.read_graphics_mhz())
        }
        nvmlClockType_enum_NVML_CLOCK_MEM => put(mhz, gpu.read_memory_mhz()),
        nvmlClockType_enum_NVML_CLOCK_VIDEO => NOT_SUPPORTED,
        _ => INVALID_ARGUMENT,
    }
}

fn max_clock(gpu: &Gpu, domain: nvmlClockType_t, mhz: Out<'_, c_uint>) -> Outcome {
    fixed_clock(domain, mhz, Some(gpu.max_graphics_mhz), Some(gpu.max_memory_mhz))
}

fn base_clock(gpu: &Gpu, domain: nvmlClockType_t, mhz: Out<'_, c_uint>) -> Outcome {
    let graphics = gpu.base_graphics_mhz;
    fixed_clock(domain, mhz, graphics, graphics.map(|_| gpu.max_memory_mhz))
}

fn fixed_clock(
    domain: nvmlClockType_t,
    mhz: Out<'_, c_uint>,
    graphics: Option<u32>,
    memory: Option<u32>,
) -> Outcome {
    let clock = match domain {
        nvmlClockType_enum_NVML_CLOCK_GRAPHICS | nvmlClockType_enum_NVML_CLOCK_SM => graphics,
        nvmlClockType_enum_NVML_CLOCK_MEM => memory,
        nvmlClockType_enum_NVML_CLOCK_VIDEO => None,
        _ => return INVALID_ARGUMENT,
    };
    clock.map_or(NOT_SUPPORTED, |clock| put(mhz, clock))
}

fn lock_graphics(gpu: &mut Gpu, clocks: Option<(u32, u32)>) -> Outcome {
    if gpu.architecture < NVML_DEVICE_ARCH_VOLTA {
        return NOT_SUPPORTED;
    }
    refuse_nonsense(clocks)?;
    gpu.lock(|gpu| gpu.locked_graphics = clocks);
    Ok(())
}

fn lock_memory(gpu: &mut Gpu, clocks: Option<(u32, u32)>) -> Outcome {
    if gpu.architecture < NVML_DEVICE_ARCH_AMPERE || !gpu.memory_lock_supported {
        return NOT_SUPPORTED;
    }
    refuse_nonsense(clocks)?;
    gpu.lock(|gpu| gpu.locked_memory = clocks);
    Ok(())
}

fn refuse_nonsense(clocks: Option<(u32, u32)>) -> Outcome {
    match clocks {
        Some((low, high)) if low > high => INVALID_ARGUMENT,
        // From here on they are not MHz, but names for clocks.
        Some((_, nvmlClockLimitId_enum_NVML_CLOCK_LIMIT_ID_RANGE_START..)) => INVALID_ARGUMENT,
        _ => Ok(()),
    }
}

/// The counter that a field value's number stands for.
fn field(state: &State, id: c_uint) -> Option<&'static str> {
    // Driver 580.82 put these behind others, which had stood from 256 on.
    let moved = if state.has_new_fields() { 18 } else { 0 };
    match id {
        NVML_FI_DEV_CLOCKS_EVENT_REASON_SW_POWER_CAP => return Some("sw_power_cap"),
        NVML_FI_DEV_CLOCKS_EVENT_REASON_SYNC_BOOST => return Some("sync_boost"),
        _ => {}
    }
    match id.checked_sub(moved)? {
        NVML_FI_DEV_CLOCKS_EVENT_REASON_SW_THERM_SLOWDOWN => Some("sw_thermal"),
        NVML_FI_DEV_CLOCKS_EVENT_REASON_HW_THERM_SLOWDOWN => Some("hw_thermal"),
        NVML_FI_DEV_CLOCKS_EVENT_REASON_HW_POWER_BRAKE_SLOWDOWN => Some("hw_power_brake"),
        _ => None,
    }
}

/// Fills in what was asked for; each value has an error of its own.
fn fill_in(value: &mut nvmlFieldValue_t, counter: Option<u64>) {
    value.timestamp = now_us() as i64;
    value.latencyUsec = 0;
    value.valueType = nvmlValueType_enum_NVML_VALUE_TYPE_UNSIGNED_LONG_LONG;
    value.value = nvmlValue_t { ullVal: counter.unwrap_or(0) };
    value.nvmlReturn = match counter {
        Some(_) => nvmlReturn_enum_NVML_SUCCESS,
        None => nvmlReturn_enum_NVML_ERROR_NOT_SUPPORTED,
    };
}

/// Microseconds since 1970.
fn now_us() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_micros() as u64)
}

/// Domain, bus and device of an address with a function at its end, as `00000000:01:00.0`.
fn pci(address: &str) -> Option<(u32, u32, u32)> {
    let mut parts = address.split(':').map(|part| u32::from_str_radix(part.split('.').next()?, 16).ok());
    let address = (parts.next()??, parts.next()??, parts.next()??);
    parts.next().is_none().then_some(address)
}

fn pci_info(gpu: &Gpu) -> Option<nvmlPciInfo_t> {
    let (domain, bus, device) = pci(&gpu.pci_bus_id)?;
    Some(nvmlPciInfo_t {
        busIdLegacy: chars(&format!("{domain:04X}:{bus:02X}:{device:02X}.0")),
        domain,
        bus,
        device,
        pciDeviceId: PCI_DEVICE_ID,
        pciSubSystemId: PCI_SUBSYSTEM_ID,
        busId: chars(&format!("{domain:08X}:{bus:02X}:{device:02X}.0")),
    })
}

/// As much of the text as leaves room for its end.
fn chars<const N: usize>(text: &str) -> [c_char; N] {
    let mut chars = [0; N];
    for (char, byte) in chars[..N - 1].iter_mut().zip(text.bytes()) {
        *char = byte as c_char;
    }
    chars
}
