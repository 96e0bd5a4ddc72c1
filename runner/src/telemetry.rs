//! Clocks, temperature and power of an NVIDIA GPU, through NVML. Only reads: locking clocks is
//! `stabilize`'s business.

use nvml_wrapper::bitmasks::device::ThrottleReasons;
use nvml_wrapper::enum_wrappers::device::{Clock, ClockId, PerformanceState, TemperatureSensor};
use nvml_wrapper::error::{Bits, NvmlError};
use nvml_wrapper::{Device, Nvml};
use record::{Reading, ThrottleReason, Timestamp};
use std::collections::BTreeSet;
use std::ffi::OsStr;

/// PCI's number of the one vendor that can be asked.
const NVIDIA: u32 = 0x10de;

/// Names of NVML's library. The bare name belongs to the development package; a driver alone brings
/// the numbered one.
const LIBRARIES: &[&str] =
    if cfg!(windows) { &["nvml.dll"] } else { &["libnvidia-ml.so.1", "libnvidia-ml.so"] };

/// A way to ask one device about itself, or the reason why there is none.
pub struct Telemetry(Result<Source, String>);

/// What can be asked between two samples without keeping the device waiting.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Moment {
    /// Clock of the streaming multiprocessors in MHz, where the device tells.
    pub sm_clock_mhz: Option<u32>,
    /// Whether the device is being slowed down, where it tells.
    pub throttled: Option<bool>,
}

struct Source {
    nvml: Nvml,
    /// NVML's number of the device, which stays the same while the library is loaded.
    index: u32,
}

impl Telemetry {
    /// Finds the device with Vulkan's number of the vendor and UUID, or else with the PCI address
    /// (`0000:01:00.0`). Never fails: what cannot be asked is unavailable, for a reason.
    pub fn open(vendor_id: u32, uuid: [u8; 16], pci: Option<&str>) -> Telemetry {
        Telemetry::open_library(LIBRARIES, vendor_id, uuid, pci)
    }

    fn open_library(libraries: &[&str], vendor_id: u32, uuid: [u8; 16], pci: Option<&str>) -> Telemetry {
        if vendor_id != NVIDIA {
            let reason = "clocks and temperature are read through NVML, for NVIDIA's GPUs only";
            return Telemetry(Err(reason.into()));
        }
        Telemetry(load(libraries).and_then(|nvml| {
            let index = find(&nvml, &nvml_uuid(uuid), pci)
                .map_err(|error| format!("NVML does not know this device: {error}"))?;
            Ok(Source { nvml, index })
        }))
    }

    /// What the device says now.
    pub fn sample(&self) -> record::Telemetry {
        match &self.0 {
            Err(reason) => record::Telemetry::unavailable(reason),
            Ok(source) => match source.nvml.device_by_index(source.index) {
                Ok(device) => reading(answers(&device), Timestamp::now()),
                Err(error) => record::Telemetry::unavailable(error.to_string()),
            },
        }
    }

    /// The little that says whether a sample can be trusted.
    pub fn moment(&self) -> Moment {
        let Ok(source) = &self.0 else { return Moment::default() };
        let Ok(device) = source.nvml.device_by_index(source.index) else { return Moment::default() };
        Moment {
            sm_clock_mhz: device.clock_info(Clock::SM).ok(),
            throttled: throttled(device.current_throttle_reasons_strict())
                .map(|reasons| reasons.iter().any(|reason| reason.slows())),
        }
    }

    /// The clock in MHz that the device runs at by default, where it tells.
    pub fn base_clock(&self) -> Option<u32> {
        let source = self.0.as_ref().ok()?;
        source.nvml.device_by_index(source.index).ok()?.clock(Clock::SM, ClockId::DefaultAppClock).ok()
    }
}

fn load(libraries: &[&str]) -> Result<Nvml, String> {
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

fn find(nvml: &Nvml, uuid: &str, pci: Option<&str>) -> Result<u32, NvmlError> {
    let device = match (nvml.device_by_uuid(uuid), pci) {
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

/// NVML's answers, one by one: most devices leave some out.
struct Answers {
    graphics_clock: Result<u32, NvmlError>,
    sm_clock: Result<u32, NvmlError>,
    memory_clock: Result<u32, NvmlError>,
    temperature: Result<u32, NvmlError>,
    milliwatts: Result<u32, NvmlError>,
    performance_state: Result<PerformanceState, NvmlError>,
    throttle_reasons: Result<ThrottleReasons, NvmlError>,
}

fn answers(device: &Device) -> Answers {
    Answers {
        graphics_clock: device.clock_info(Clock::Graphics),
        sm_clock: device.clock_info(Clock::SM),
        memory_clock: device.clock_info(Clock::Memory),
        temperature: device.temperature(TemperatureSensor::Gpu),
        milliwatts: device.power_usage(),
        performance_state: device.performance_state(),
        throttle_reasons: device.current_throttle_reasons_strict(),
    }
}

fn reading(answers: Answers, time: Timestamp) -> record::Telemetry {
    // A device without any clock tells nothing worth keeping: it is lost, or we may not ask.
    if let (Err(error), Err(_), Err(_)) = (&answers.graphics_clock, &answers.sm_clock, &answers.memory_clock)
    {
        return record::Telemetry::unavailable(format!("NVML reads no clock: {error}"));
    }
    record::Telemetry::Available(Reading {
        time,
        graphics_clock_mhz: answers.graphics_clock.ok(),
        sm_clock_mhz: answers.sm_clock.ok(),
        memory_clock_mhz: answers.memory_clock.ok(),
        temperature_celsius: answers.temperature.ok(),
        power_watts: answers.milliwatts.ok().map(|power| f64::from(power) / 1e3),
        performance_state: answers.performance_state.ok().and_then(performance_state),
        throttle_reasons: throttled(answers.throttle_reasons),
    })
}

fn throttled(answer: Result<ThrottleReasons, NvmlError>) -> Option<BTreeSet<ThrottleReason>> {
    match answer {
        Ok(reasons) => Some(throttle_reasons(reasons.bits())),
        // A newer driver has reasons that the wrapper does not know.
        Err(NvmlError::IncorrectBits(Bits::U64(bits))) => Some(throttle_reasons(bits)),
        Err(_) => None,
    }
}

fn performance_state(state: PerformanceState) -> Option<u32> {
    (state != PerformanceState::Unknown).then_some(state as u32)
}

fn throttle_reasons(bits: u64) -> BTreeSet<ThrottleReason> {
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
            throttle_reasons: Ok(ThrottleReasons::SW_POWER_CAP | ThrottleReasons::SYNC_BOOST),
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
        assert_eq!(reading(full(), time), record::Telemetry::Available(expected));
    }

    #[test]
    fn what_a_device_leaves_out_is_absent() {
        let answers = Answers {
            sm_clock: Err(NvmlError::NotSupported),
            temperature: Err(NvmlError::NoPermission),
            milliwatts: Err(NvmlError::FailedToLoadSymbol("symbol".into())),
            performance_state: Ok(PerformanceState::Unknown),
            throttle_reasons: Err(NvmlError::NotSupported),
            ..full()
        };
        let telemetry = reading(answers, Timestamp::now());
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
        let record::Telemetry::Unavailable { reason } = reading(answers, Timestamp::now()) else {
            panic!("a lost device has no clock");
        };
        assert!(reason.contains(&NvmlError::GpuLost.to_string()), "{reason}");
    }

    #[test]
    fn each_bit_is_one_reason() {
        assert_eq!(throttle_reasons(0), [].into());
        let all: BTreeSet<_> = (0..9).flat_map(|bit| throttle_reasons(1 << bit)).collect();
        assert_eq!(all.len(), 9, "{all:?}");
        assert!(!all.contains(&ThrottleReason::Other));
        assert_eq!(throttle_reasons(1 << 40), [ThrottleReason::Other].into());
        let newer =
            Answers { throttle_reasons: Err(NvmlError::IncorrectBits(Bits::U64(1 << 40 | 1))), ..full() };
        let expected = [ThrottleReason::GpuIdle, ThrottleReason::Other].into();
        let telemetry = reading(newer, Timestamp::now());
        assert_eq!(telemetry.reading().unwrap().throttle_reasons, Some(expected));
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

    #[track_caller]
    fn unavailable(telemetry: Telemetry) -> String {
        match telemetry.sample() {
            record::Telemetry::Unavailable { reason } => reason,
            record::Telemetry::Available(reading) => panic!("{reading:?}"),
        }
    }

    #[test]
    fn without_the_library_the_reason_names_it() {
        let missing = ["libno-such-nvml.so.1", "libno-such-nvml.so"];
        let telemetry = Telemetry::open_library(&missing, NVIDIA, [0; 16], None);
        assert!(unavailable(telemetry).contains("libno-such-nvml.so.1"));
    }

    #[test]
    fn other_vendors_are_not_asked() {
        let mesa = 0x10005;
        assert!(unavailable(Telemetry::open(mesa, [0; 16], None)).contains("NVIDIA"));
    }
}
