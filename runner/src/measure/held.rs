//! How `stabilize` holds the clocks of the device, where this process runs under it.

use crate::{progress::remark, session::Session};
use record::{Policy, REPORT_VARIABLE, Report, TOLERANCE, ThrottleTimes, Verdict};
use std::path::PathBuf;
use tracer::gpu::DeviceKind;

/// What is known of it.
#[derive(Clone, Debug, Default)]
pub struct Held(Option<Report>);

impl Held {
    /// As the report says whose path is in the environment. Never fails: a report that is missing or about other
    /// devices is none, and the user is told.
    pub fn of(session: &Session) -> Held {
        let Some(path) = std::env::var_os(REPORT_VARIABLE).map(PathBuf::from) else { return Held(None) };
        let info = session.gpu.info();
        let mut report = match Report::read(&path) {
            Ok(report) => report,
            Err(error) => {
                remark(session.quiet, format_args!("{} says nothing: {error}", path.display()));
                return Held(None);
            }
        };
        report.gpus.retain(|gpu| gpu.is(&info.uuid, info.pci.as_deref()));
        if report.gpus.is_empty() {
            if info.kind != DeviceKind::Cpu {
                remark(session.quiet, format_args!("stabilize holds other devices than {}", info.name));
            }
            return Held(None);
        }
        Held(Some(report))
    }

    /// The policy in force, where there is one.
    pub fn policy(&self) -> Option<&Policy> {
        Some(&self.0.as_ref()?.gpus.first()?.policy)
    }

    /// What the graphics clock is locked to in MHz.
    pub fn locked_mhz(&self) -> Option<u32> {
        self.policy()?.graphics.locked_mhz
    }

    /// Whether what was measured within so many milliseconds between two readings can be trusted.
    pub fn judge(&self, before: &ThrottleTimes, after: &ThrottleTimes, milliseconds: f64) -> Verdict {
        let tolerance = self.0.as_ref().map_or(TOLERANCE, |report| report.tolerance);
        let own = before.judge(after, milliseconds, tolerance);
        let lost = match &self.0 {
            Some(report) if !report.is_current() => {
                Some(Verdict::Unknown { reason: "stabilize has ended, and what it held is free".into() })
            }
            _ => None,
        };
        Verdict::worst([own].into_iter().chain(lost)).expect("there is one")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::ThrottleReason::{SoftwarePowerCap, SoftwareThermalSlowdown};

    fn times(power: f64) -> ThrottleTimes {
        ThrottleTimes([(SoftwarePowerCap, power), (SoftwareThermalSlowdown, 0.0)].into())
    }

    fn report() -> Report {
        let mut report = record::example_report();
        report.process = std::process::id();
        report.process_started = record::process_started(report.process).unwrap_or_default();
        report
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_stabilize_that_was_killed_holds_nothing() {
        let held = Held(Some(report()));
        assert_eq!(held.judge(&times(0.0), &times(0.0), 1e3), Verdict::Trusted);
        let mut dead = report();
        dead.process_started += 1;
        let verdict = Held(Some(dead.clone())).judge(&times(0.0), &times(0.0), 1e3);
        assert!(verdict.to_string().contains("stabilize has ended"), "{verdict}");
        let verdict = Held(Some(dead)).judge(&times(0.0), &times(500.0), 1e3);
        assert!(matches!(verdict, Verdict::Throttled { .. }), "{verdict}");
    }

    #[test]
    fn its_tolerance_counts() {
        let mut report = report();
        report.tolerance = 0.5;
        let generous = Held(Some(report)).judge(&times(0.0), &times(400.0), 1e3);
        assert!(!matches!(generous, Verdict::Throttled { .. }), "{generous}");
        let strict = Held::default().judge(&times(0.0), &times(400.0), 1e3);
        assert!(matches!(strict, Verdict::Throttled { .. }), "{strict}");
    }
}
