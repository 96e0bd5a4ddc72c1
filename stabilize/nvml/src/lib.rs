//! What NVIDIA's management library (NVML) says about a GPU, in the record's words. It only reads: `runner` and
//! `stabilize` share it, and locking clocks is the latter's business.

use nvml_wrapper::bitmasks::device::ThrottleReasons;
use nvml_wrapper::enum_wrappers::device::{Clock, PerformancePolicy, PerformanceState, TemperatureSensor};
use nvml_wrapper::enums::device::SampleValue;
use nvml_wrapper::error::{Bits, NvmlError, nvml_try};
use nvml_wrapper::structs::device::FieldId;
use nvml_wrapper::sys_exports::field_id;
use nvml_wrapper::{Device, Nvml};
use record::{Reading, Telemetry, ThrottleReason, ThrottleTimes, Timestamp};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;

/// Names of NVML's library. The bare name belongs to the development package; a driver alone brings
/// the numbered one.
const LIBRARIES: &[&str] =
    if cfg!(windows) { &["nvml.dll"] } else { &["libnvidia-ml.so.1", "libnvidia-ml.so"] };

/// Loads the library that came with the driver.
///
/// # Errors
/// There is none, or it does not work, for the reason that is told.
pub fn load() -> Result<Nvml, String> {
    load_one_of(LIBRARIES)
}

fn load_one_of(libraries: &[&str]) -> Result<Nvml, String> {
    let mut reason = String::new();
    for library in libraries {
        match Nvml::builder().lib_path(OsStr::new(library)).init() {
            Ok(nvml) => return Ok(nvml),
            Err(NvmlError::LibloadingError(_)) => {
                reason = format!("no NVML library ({})", libraries.join(", "));
            }
            // The library is there, and says what is wrong.
            Err(error) => return Err(format!("NVML: {error}")),
        }
    }
    Err(reason)
}

/// NVML's number of the device with Vulkan's UUID, or else with the PCI address. It stays the same while the
/// library is loaded.
///
/// # Errors
/// NVML knows neither.
pub fn find(nvml: &Nvml, uuid: [u8; 16], pci: Option<&str>) -> Result<u32, NvmlError> {
    let device = match (nvml.device_by_uuid(nvml_uuid(uuid)), pci) {
        (Err(_), Some(pci)) => nvml.device_by_pci_bus_id(pci)?,
        (device, _) => device?,
    };
    device.index()
}

/// Vulkan's device UUID as NVML writes it.
fn nvml_uuid(uuid: [u8; 16]) -> String {
    let hex: String = uuid.iter().map(|byte| format!("{byte:02x}")).collect();
    let parts = [&hex[..8], &hex[8..12], &hex[12..16], &hex[16..20], &hex[20..]];
    format!("GPU-{}", parts.join("-"))
}

/// The device's PCI address as everybody else writes it, such as `0000:01:00.0`: NVML gives the domain eight
/// digits.
pub fn pci_address(device: &Device) -> Option<String> {
    device.pci_info().ok().map(|pci| short_address(&pci.bus_id))
}

fn short_address(address: &str) -> String {
    let short = match address.split_once(':') {
        Some((domain, rest)) if domain.len() == 8 && domain.starts_with("0000") => {
            format!("{}:{rest}", &domain[4..])
        }
        _ => address.to_owned(),
    };
    short.to_lowercase()
}

/// What the device says now.
pub fn reading(device: &Device) -> Telemetry {
    telemetry(answers(device), Timestamp::now())
}

/// Why the device's clocks are not higher now, where it tells.
pub fn throttle_reasons(device: &Device) -> Option<BTreeSet<ThrottleReason>> {
    let answer = match device.current_throttle_reasons_strict() {
        Err(NvmlError::FailedToLoadSymbol(_)) => event_reasons(device),
        answer => answer,
    };
    match answer {
        Ok(reasons) => Some(reasons_of(reasons.bits())),
        // A newer driver has reasons that the wrapper does not know.
        Err(NvmlError::IncorrectBits(Bits::U64(bits))) => Some(reasons_of(bits)),
        Err(_) => None,
    }
}

/// The same under the name that newer drivers have for it, which the wrapper lacks.
fn event_reasons(device: &Device) -> Result<ThrottleReasons, NvmlError> {
    let function = device
        .nvml()
        .lib()
        .nvmlDeviceGetCurrentClocksEventReasons
        .as_ref()
        .map_err(|error| NvmlError::FailedToLoadSymbol(error.to_string()))?;
    let mut bits = 0;
    // SAFETY: the handle belongs to the library that the function comes from, both outlive the call, and `bits`
    // is where one number is written.
    nvml_try(unsafe { function(device.handle(), &mut bits) })?;
    ThrottleReasons::from_bits(bits).ok_or(NvmlError::IncorrectBits(Bits::U64(bits)))
}

/// How long the device has been slowed down since its driver was loaded, by each reason that it counts.
///
/// Newer drivers count each reason apart, as field values. Older ones have violation times for power and heat;
/// they stand in where a field is missing.
pub fn throttle_times(device: &Device) -> ThrottleTimes {
    const FIELDS: [(u32, ThrottleReason); 5] = [
        (field_id::NVML_FI_DEV_CLOCKS_EVENT_REASON_SW_POWER_CAP, ThrottleReason::SoftwarePowerCap),
        (field_id::NVML_FI_DEV_CLOCKS_EVENT_REASON_SYNC_BOOST, ThrottleReason::SyncBoost),
        (
            field_id::NVML_FI_DEV_CLOCKS_EVENT_REASON_SW_THERM_SLOWDOWN,
            ThrottleReason::SoftwareThermalSlowdown,
        ),
        (
            field_id::NVML_FI_DEV_CLOCKS_EVENT_REASON_HW_THERM_SLOWDOWN,
            ThrottleReason::HardwareThermalSlowdown,
        ),
        (
            field_id::NVML_FI_DEV_CLOCKS_EVENT_REASON_HW_POWER_BRAKE_SLOWDOWN,
            ThrottleReason::HardwarePowerBrake,
        ),
    ];
    let milliseconds = |nanoseconds: u64| nanoseconds as f64 / 1e6;
    let mut times = BTreeMap::new();
    let values = device.field_values_for(&FIELDS.map(|(field, _)| FieldId(field))).unwrap_or_default();
    for (value, (_, reason)) in values.into_iter().zip(FIELDS) {
        match value.and_then(|sample| sample.value) {
            Ok(SampleValue::U64(nanoseconds)) => _ = times.insert(reason, milliseconds(nanoseconds)),
            Ok(SampleValue::U32(nanoseconds)) => _ = times.insert(reason, milliseconds(nanoseconds.into())),
            _ => {}
        }
    }
    // Each question takes the driver a millisecond or more, so none is asked in vain.
    for (policy, reason) in [
        (PerformancePolicy::Power, ThrottleReason::SoftwarePowerCap),
        (PerformancePolicy::Thermal, ThrottleReason::SoftwareThermalSlowdown),
    ] {
        if !times.contains_key(&reason)
            && let Ok(violation) = device.violation_status(policy)
        {
            times.insert(reason, milliseconds(violation.violation_time));
        }
    }
    ThrottleTimes(times)
}

/// NVML's answers, one by one: most devices leave some out.
struct Answers {
    graphics_clock: Result<u32, NvmlError>,
    sm_clock: Result<u32, NvmlError>,
    memory_clock: Result<u32, NvmlError>,
    temperature: Result<u32, NvmlError>,
    milliwatts: Result<u32, NvmlError>,
    performance_state: Result<PerformanceState, NvmlError>,
    throttle_reasons: Option<BTreeSet<ThrottleReason>>,
}

fn answers(device: &Device) -> Answers {
    Answers {
        graphics_clock: device.clock_info(Clock::Graphics),
        sm_clock: device.clock_info(Clock::SM),
        memory_clock: device.clock_info(Clock::Memory),
        temperature: device.temperature(TemperatureSensor::Gpu),
        milliwatts: device.power_usage(),
        performance_state: device.performance_state(),
        throttle_reasons: throttle_reasons(device),
    }
}

fn telemetry(answers: Answers, time: Timestamp) -> Telemetry {
    // A device without any clock tells nothing worth keeping: it is lost, or we may not ask.
    if let (Err(error), Err(_), Err(_)) = (&answers.graphics_clock, &answers.sm_clock, &answers.memory_clock)
    {
        return Telemetry::unavailable(format!("NVML reads no clock: {error}"));
    }
    Telemetry::Available(Reading {
        time,
        graphics_clock_mhz: answers.graphics_clock.ok(),
        sm_clock_mhz: answers.sm_clock.ok(),
        memory_clock_mhz: answers.memory_clock.ok(),
        temperature_celsius: answers.temperature.ok(),
        power_watts: answers.milliwatts.ok().map(|power| f64::from(power) / 1e3),
        performance_state: answers.performance_state.ok().and_then(performance_state),
        throttle_reasons: answers.throttle_reasons,
    })
}

fn performance_state(state: PerformanceState) -> Option<u32> {
    (state != PerformanceState::Unknown).then_some(state as u32)
}

fn reasons_of(bits: u64) -> BTreeSet<ThrottleReason> {
    let names = [
        (ThrottleReasons::GPU_IDLE, ThrottleReason::GpuIdle),
        (ThrottleReasons::APPLICATIONS_CLOCKS_SETTING, ThrottleReason::ApplicationsClocksSetting),
        (ThrottleReasons::SW_POWER_CAP, ThrottleReason::SoftwarePowerCap),
        (ThrottleReasons::HW_SLOWDOWN, ThrottleReason::HardwareSlowdown),
        (ThrottleReasons::SYNC_BOOST, ThrottleReason::SyncBoost),
        (ThrottleReasons::SW_THERMAL_SLOWDOWN, ThrottleReason::SoftwareThermalSlowdown),
        (ThrottleReasons::HW_THERMAL_SLOWDOWN, ThrottleReason::HardwareThermalSlowdown),
        (ThrottleReasons::HW_POWER_BRAKE_SLOWDOWN, ThrottleReason::HardwarePowerBrake),
        (ThrottleReasons::DISPLAY_CLOCK_SETTING, ThrottleReason::DisplayClockSetting),
    ];
    let mut unknown = bits;
    let mut reasons = BTreeSet::new();
    for (bit, reason) in names {
        if bits & bit.bits() != 0 {
            reasons.insert(reason);
            unknown &= !bit.bits();
        }
    }
    if unknown != 0 {
        reasons.insert(ThrottleReason::Other);
    }
    reasons
}

#[cfg(test)]
mod tests {
    use super::*;

    fn full() -> Answers {
        Answers {
            graphics_clock: Ok(1980),
            sm_clock: Ok(1975),
            memory_clock: Ok(2619),
            temperature: Ok(41),
            milliwatts: Ok(121_500),
            performance_state: Ok(PerformanceState::Two),
            throttle_reasons: Some([ThrottleReason::SoftwarePowerCap, ThrottleReason::SyncBoost].into()),
        }
    }

    #[test]
    fn every_answer_finds_its_field() {
        let time = Timestamp::now();
        let expected = Reading {
            time,
            graphics_clock_mhz: Some(1980),
            sm_clock_mhz: Some(1975),
            memory_clock_mhz: Some(2619),
            temperature_celsius: Some(41),
            power_watts: Some(121.5),
            performance_state: Some(2),
            throttle_reasons: Some([ThrottleReason::SoftwarePowerCap, ThrottleReason::SyncBoost].into()),
        };
        assert_eq!(telemetry(full(), time), Telemetry::Available(expected));
    }

    #[test]
    fn what_a_device_leaves_out_is_absent() {
        let answers = Answers {
            sm_clock: Err(NvmlError::NotSupported),
            temperature: Err(NvmlError::NoPermission),
            milliwatts: Err(NvmlError::FailedToLoadSymbol("symbol".into())),
            performance_state: Ok(PerformanceState::Unknown),
            throttle_reasons: None,
            ..full()
        };
        let telemetry = telemetry(answers, Timestamp::now());
        let reading = telemetry.reading().unwrap();
        assert_eq!(reading.graphics_clock_mhz, Some(1980));
        assert_eq!(reading.sm_clock_mhz, None);
        assert_eq!(reading.temperature_celsius, None);
        assert_eq!(reading.power_watts, None);
        assert_eq!(reading.performance_state, None);
        assert_eq!(reading.throttle_reasons, None);
    }

    #[test]
    fn a_lost_device_is_unavailable() {
        let answers = Answers {
            graphics_clock: Err(NvmlError::GpuLost),
            sm_clock: Err(NvmlError::GpuLost),
            memory_clock: Err(NvmlError::GpuLost),
            ..full()
        };
        let Telemetry::Unavailable { reason } = telemetry(answers, Timestamp::now()) else {
            panic!("a lost device has no clock");
        };
        assert!(reason.contains(&NvmlError::GpuLost.to_string()), "{reason}");
    }

    #[test]
    fn each_bit_is_one_reason() {
        assert_eq!(reasons_of(0), [].into());
        let all: BTreeSet<_> = (0..9).flat_map(|bit| reasons_of(1 << bit)).collect();
        assert_eq!(all.len(), 9, "{all:?}");
        assert!(!all.contains(&ThrottleReason::Other));
        assert_eq!(reasons_of(1 << 40), [ThrottleReason::Other].into());
    }

    #[test]
    fn performance_states_count_from_the_fastest() {
        assert_eq!(performance_state(PerformanceState::Zero), Some(0));
        assert_eq!(performance_state(PerformanceState::Fifteen), Some(15));
        assert_eq!(performance_state(PerformanceState::Unknown), None);
    }

    #[test]
    fn uuids_are_written_as_nvml_does() {
        let uuid = std::array::from_fn(|byte| byte as u8 * 0x11);
        assert_eq!(nvml_uuid(uuid), "GPU-00112233-4455-6677-8899-aabbccddeeff");
    }

    #[test]
    fn addresses_have_a_domain_of_four_digits() {
        assert_eq!(short_address("00000000:3B:00.0"), "0000:3b:00.0");
        assert_eq!(short_address("0000:01:00.0"), "0000:01:00.0");
        assert_eq!(short_address("00010000:01:00.0"), "00010000:01:00.0");
    }

    #[test]
    fn without_the_library_the_reason_names_it() {
        let reason = load_one_of(&["libno-such-nvml.so.1", "libno-such-nvml.so"]).err().unwrap();
        assert!(reason.contains("libno-such-nvml.so.1"), "{reason}");
    }
}
