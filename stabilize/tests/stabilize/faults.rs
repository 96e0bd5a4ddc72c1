//! Drivers that fail in the middle.

use crate::machine::Machine;
use nvml_stand_in::{ErrorCode, Fault, FaultKind, Settings};
use proptest::prelude::*;
use record::Restoration;

fn kinds() -> impl Strategy<Value = FaultKind> {
    use ErrorCode::{GpuIsLost, InvalidArgument, NoPermission, NotSupported, Timeout, Unknown};
    prop_oneof![
        prop::sample::select(vec![GpuIsLost, InvalidArgument, NoPermission, NotSupported, Timeout, Unknown])
            .prop_map(FaultKind::Error),
        (1u64..30).prop_map(|milliseconds| FaultKind::Slow { milliseconds }),
        Just(FaultKind::Silent),
    ]
}

fn faults() -> impl Strategy<Value = Vec<Fault>> {
    let functions = vec![
        "*",
        "DeviceSetPersistenceMode",
        "DeviceGetPersistenceMode",
        "DeviceSetGpuLockedClocks",
        "DeviceResetGpuLockedClocks",
        "DeviceSetMemoryLockedClocks",
        "DeviceResetMemoryLockedClocks",
        "DeviceGetClockInfo",
        "DeviceGetHandleByIndex_v2",
        "DeviceGetSupportedMemoryClocks",
    ];
    let fault = (prop::sample::select(functions), 0u32..40, prop::option::of(1u32..4), kinds());
    let fault = fault.prop_map(|(function, skip, times, kind)| Fault {
        function: function.into(),
        // Setters are called a few times only.
        skip: if function.contains("Set") { skip % 4 } else { skip },
        times,
        kind,
    });
    // A driver that says that it has unlocked a clock, and has not, cannot be caught: none tells what is locked.
    let honest = |fault: &Fault| {
        fault.kind != FaultKind::Silent || !(fault.function == "*" || fault.function.contains("Reset"))
    };
    prop::collection::vec(fault.prop_filter("an unlock that lies cannot be seen", honest), 1..5)
}

/// What differs from before, in the words of the report.
fn changed(first: &Settings, last: &Settings) -> Vec<&'static str> {
    let mut changed = Vec::new();
    if first.persistence != last.persistence {
        changed.push("persistence mode off");
    }
    if first.locked_graphics != last.locked_graphics {
        changed.push("graphics clock unlocked");
    }
    if first.locked_memory != last.locked_memory {
        changed.push("memory clock unlocked");
    }
    changed
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever fails, all is as before, or the report names what is not; and `restore` can do it later.
    #[test]
    fn nothing_is_lost_without_a_word(faults in faults()) {
        let machine = Machine::new();
        let first = machine.settings();
        machine.edit(|state| state.faults = faults.clone());
        let (ran, report) = machine.report(&["--", "sh", "-c", "exit 3"]);
        let last = machine.settings();
        let failed: Vec<Restoration> = (report.gpus.iter())
            .flat_map(|gpu| gpu.restored.clone())
            .filter(|restoration| restoration.failed.is_some())
            .collect();
        for what in changed(&first[0], &last[0]) {
            prop_assert!(failed.iter().any(|restoration| restoration.what == what), "{what}: {failed:?} {ran:?}");
            prop_assert!(ran.err.contains(what), "{what}: {ran:?}");
        }
        prop_assert_eq!(ran.status, Some(if failed.is_empty() { 3 } else { 125 }), "{:?}", ran);
        machine.edit(|state| state.faults.clear());
        let restore = machine.run(&["restore"]);
        prop_assert_eq!(restore.status, Some(0), "{:?}", restore);
        prop_assert_eq!(machine.settings(), first);
    }
}
