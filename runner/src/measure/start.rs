//! What is settled before the first point is measured.

use super::{Held, Plan};
use crate::{describe, host, session::Session, size::Size, telemetry::Telemetry};
use record::{Clock, ClockKind, Method, Record};
use tracer::gpu::{DeviceKind, shaders};

/// What depends on the sort of device where nobody chose.
pub struct Defaults {
    /// Whether it is a driver that runs on the CPU.
    pub cpu: bool,
    /// Picture size.
    pub size: Size,
    /// Measured builds of each tree.
    pub builds: u32,
}

/// Launches of each bounce where nobody says how many (Ylitie et al. 2017, section 5).
pub const LAUNCHES: u32 = 10;

/// Most rays in a path where nobody says: the thesis's, or those of bounces 0 to 8 where bounces are looked at.
pub fn depth(method: Method) -> u32 {
    match method {
        Method::Paths => 8,
        Method::Replay => 9,
    }
}

impl Defaults {
    /// Of the session's device.
    pub fn of(session: &Session) -> Self {
        if session.gpu.info().kind == DeviceKind::Cpu {
            Self { cpu: true, size: Size { width: 320, height: 180 }, builds: 3 }
        } else {
            Self { cpu: false, size: Size { width: 1920, height: 1080 }, builds: 10 }
        }
    }
}

/// Samples with a clock below this share of the locked or base clock do not count.
pub const LEAST_CLOCK: f64 = 0.95;

/// What the session's device says about itself.
pub fn telemetry(session: &Session) -> Telemetry {
    let info = session.gpu.info();
    Telemetry::open(info.vendor_id, describe::uuid_bytes(&info.uuid), info.pci.as_deref())
}

/// The clock that samples are held against: the one that the device is said to be locked to, or that `stabilize`
/// has locked it to, or else its base clock.
pub fn clock(telemetry: &Telemetry, held: &Held, locked_mhz: Option<u32>, least_share: f64) -> Option<Clock> {
    let of = |kind| move |mhz| Clock { kind, mhz, least_share };
    let locked_mhz = locked_mhz.or(held.locked_mhz());
    locked_mhz.map(of(ClockKind::Locked)).or_else(|| telemetry.base_clock().map(of(ClockKind::Base)))
}

/// A record of a run that begins now.
pub fn begin(session: &Session, plan: &Plan, host_name: bool) -> Record {
    let sampling = &plan.sampling;
    let run = record::Run {
        method: plan.method,
        width: plan.size.0,
        height: plan.size.1,
        samples: sampling.most,
        warm_up: plan.warm_up,
        depth: plan.path.depth,
        seed: plan.path.seed.into(),
        stopping: (!sampling.is_exact()).then_some(record::Stopping {
            least: sampling.least,
            most: sampling.most,
            half_width: sampling.half_width,
            seconds: sampling.time.as_secs_f64(),
        }),
        clock: plan.clock.clone(),
        policy: plan.held.policy().cloned(),
    };
    let mut record =
        Record::new(host::tool(), host::gather(host_name), describe::device(session.gpu.info()), run);
    record.shaders = shaders::ALL.iter().map(|s| (s.name.to_owned(), s.sha256())).collect();
    record
}
