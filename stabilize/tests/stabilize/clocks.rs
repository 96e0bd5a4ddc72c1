//! Which clocks are locked, and what comes of it.

use crate::machine::{Machine, Ran};
use nvml_stand_in::{ErrorCode, FaultKind, Gpu};
use record::{Hold, Verdict};

const GPU: &str = "NVML_STAND_IN";

/// The settings of the only GPU while the command runs.
fn during(machine: &Machine, words: &[&str]) -> (Ran, nvml_stand_in::Settings) {
    let copy = machine.path("during.json");
    let script = format!("cp \"${GPU}\" {}", copy.display());
    let ran = machine.run(&[words, &["--", "sh", "-c", &script]].concat());
    assert_eq!(ran.status, Some(0), "{ran:?}");
    let state = nvml_stand_in::State::read(&copy).unwrap();
    (ran, state.gpus[0].settings())
}

#[test]
fn the_thesis_procedure_locks_below_what_is_reached() {
    let machine = Machine::new();
    let before = machine.settings();
    let (ran, held) = during(&machine, &[]);
    // The example names 1980 MHz and reaches 1935: 0.98 of that is 1896, and the nearest step 1890.
    assert_eq!(held.locked_graphics, Some((1890, 1890)), "{ran:?}");
    assert_eq!(held.locked_memory, Some((2619, 2619)));
    assert!(held.persistence);
    assert_eq!(machine.settings(), before);
    assert!(!before[0].persistence);
}

#[test]
fn a_clock_that_rises_slowly_is_waited_for() {
    let machine = Machine::new();
    machine.edit(|state| state.gpus[0].settling_reads = 25);
    let (_, held) = during(&machine, &["--settle", "3"]);
    assert_eq!(held.locked_graphics, Some((1890, 1890)));
}

#[test]
fn clocks_are_locked_as_asked() {
    let machine = Machine::new();
    for (words, graphics, memory) in [
        (["--graphics-clock", "max", "--memory-clock", "keep"], Some(1980), None),
        (["--graphics-clock", "1500", "--memory-clock", "1593"], Some(1500), Some(1593)),
        (["--graphics-clock", "1507", "--memory-clock", "max"], Some(1500), Some(2619)),
        (["--graphics-clock", "keep", "--memory-clock", "keep"], None, None),
    ] {
        let (ran, held) = during(&machine, &words);
        let twice = |mhz| (mhz, mhz);
        assert_eq!(held.locked_graphics, graphics.map(twice), "{ran:?}");
        assert_eq!(held.locked_memory, memory.map(twice), "{ran:?}");
        assert_eq!(ran.err.contains("1507 MHz is no step; the nearest is 1500"), words[1] == "1507");
    }
    machine.edit(|state| state.gpus[0].base_graphics_mhz = Some(1590));
    let (_, held) = during(&machine, &["--graphics-clock", "base"]);
    assert_eq!(held.locked_graphics, Some((1590, 1590)));
    machine.edit(|state| state.gpus[0].base_graphics_mhz = None);
    let (ran, held) = during(&machine, &["--graphics-clock", "base"]);
    assert_eq!(held.locked_graphics, None);
    assert!(ran.err.contains("does not tell its base"), "{ran:?}");
}

#[test]
fn many_steps_are_all_known() {
    let machine = Machine::new();
    machine.edit(|state| state.gpus[0].graphics_steps = (0..300).map(|step| 1980 - 5 * step).collect());
    let (_, held) = during(&machine, &[]);
    assert_eq!(held.locked_graphics, Some((1895, 1895)));
}

#[test]
fn a_lock_that_is_not_delivered_is_told() {
    let machine = Machine::new();
    machine.edit(|state| {
        state.gpus[0].graphics_clock_follows = false;
        state.gpus[0].stuck_graphics_mhz = Some(1410);
    });
    let (ran, report) = machine.report(&["--graphics-clock", "1800", "--", "true"]);
    let hold = &report.gpus[0].policy.graphics;
    assert_eq!((hold.locked_mhz, hold.delivered_mhz), (Some(1800), Some(1410)));
    assert!(ran.err.contains("the driver accepted 1800 MHz but delivers 1410 MHz"), "{ran:?}");
    assert_eq!(machine.run(&["--strict", "--graphics-clock", "1800", "--", "true"]).status, Some(125));
    // A clock that does not even rise tells nothing about what could be reached.
    let (ran, report) = machine.report(&["--", "true"]);
    assert!(ran.err.contains("accepted"), "{ran:?}");
    machine.edit(|state| state.gpus[0].stuck_graphics_mhz = Some(345));
    assert_eq!(report.gpus[0].policy.graphics.locked_mhz, Some(1380));
    let (ran, report) = machine.report(&["--", "true"]);
    assert_eq!(report.gpus[0].policy.graphics.locked_mhz, Some(1935), "{ran:?}");
    assert!(ran.err.contains("did not rise"), "{ran:?}");
}

#[test]
fn a_memory_lock_that_moves_other_clocks_is_given_up() {
    let machine = Machine::new();
    machine.edit(|state| state.gpus[0].memory_lock_moves_graphics_mhz = Some(1410));
    let (ran, report) = machine.report(&["--", "true"]);
    let memory = &report.gpus[0].policy.memory;
    assert_eq!(memory.locked_mhz, None, "{ran:?}");
    assert!(memory.remark.as_ref().unwrap().contains("from 1890 to 1410 MHz; so it is left free"));
    let (_, held) = during(&machine, &[]);
    assert_eq!(held.locked_memory, None);
    // Asked for by name, it is kept, and what it does is told.
    let (_, report) = machine.report(&["--memory-clock", "max", "--", "true"]);
    assert_eq!(report.gpus[0].policy.memory.locked_mhz, Some(2619));
    assert_eq!(report.gpus[0].policy.graphics.delivered_mhz, Some(1410));
}

#[test]
fn a_memory_clock_that_cannot_be_locked_is_no_obstacle() {
    let machine = Machine::new();
    machine.edit(|state| state.gpus[0].memory_lock_supported = false);
    let (ran, report) = machine.report(&["--strict", "--", "true"]);
    assert_eq!(ran.status, Some(0), "{ran:?}");
    let not_locked = Hold {
        asked: "auto".into(),
        locked_mhz: None,
        delivered_mhz: None,
        remark: Some("not supported by this GPU or its driver".into()),
    };
    assert_eq!(report.gpus[0].policy.memory, not_locked);
    assert!(report.gpus[0].restored.iter().all(|restoration| restoration.failed.is_none()), "{report:?}");
    assert_eq!(machine.run(&["--strict", "--memory-clock", "max", "--", "true"]).status, Some(125));
}

#[test]
fn gpus_are_chosen_by_number_and_identifier() {
    let machine = Machine::new();
    let second = Gpu {
        uuid: "GPU-22222222-2222-2222-2222-222222222222".into(),
        pci_bus_id: "00000000:02:00.0".into(),
        ..Gpu::default()
    };
    machine.edit(|state| state.gpus.push(second.clone()));
    let locked = |words: &[&str]| {
        let (ran, report) = machine.report(&[words, &["--", "true"]].concat());
        assert_eq!(ran.status, Some(0), "{ran:?}");
        (ran, report.gpus.iter().map(|gpu| gpu.index).collect::<Vec<_>>())
    };
    let (ran, gpus) = locked(&[]);
    assert_eq!(gpus, [0]);
    assert!(ran.err.contains("only GPU 0"), "{ran:?}");
    assert_eq!(locked(&["--gpu", "1"]).1, [1]);
    assert_eq!(locked(&["--gpu", &second.uuid]).1, [1]);
    assert_eq!(locked(&["--gpu", "all"]).1, [0, 1]);
    let ran = machine.run(&["--gpu", "7", "--", "true"]);
    assert_eq!(ran.status, Some(125));
    assert!(ran.err.contains("there is no GPU 7; there is 0 ("), "{ran:?}");
}

#[test]
fn a_cool_start_is_waited_for_but_not_for_ever() {
    let machine = Machine::new();
    machine.edit(|state| {
        state.gpus[0].temperature_celsius = 60;
        state.gpus[0].cooling_celsius_per_read = 10;
    });
    let ran = machine.run(&["--wait-below", "45", "--wait-limit", "20", "--", "true"]);
    assert_eq!(ran.status, Some(0), "{ran:?}");
    assert!(machine.state().gpus[0].temperature_celsius < 45);
    machine.edit(|state| {
        state.gpus[0].temperature_celsius = 60;
        state.gpus[0].cooling_celsius_per_read = 0;
    });
    let hot = ["--wait-below", "45", "--wait-limit", "0.1", "--", "true"];
    let ran = machine.run(&hot);
    assert!(ran.status == Some(0) && ran.err.contains("is at 60 °C"), "{ran:?}");
    assert_eq!(machine.run(&[&["--strict"], &hot[..]].concat()).status, Some(125));
}

#[test]
fn observing_and_planning_change_nothing() {
    let machine = Machine::new();
    let ran = machine.run(&["--observe", "--", "true"]);
    assert!(ran.status == Some(0) && ran.err.ends_with("stabilize: trusted\n"), "{ran:?}");
    let ran = machine.run(&["--dry-run", "--", "touch", machine.path("touched").to_str().unwrap()]);
    assert_eq!(ran.status, Some(0));
    for part in
        ["locked to 1980 MHz, then to 0.98", "persistence mode on, and persistence mode off at the end"]
    {
        assert!(ran.out.contains(part), "{ran:?}");
    }
    let doctor = machine.run(&["doctor"]);
    assert!(doctor.status == Some(0) && doctor.out.contains("highest 1980 MHz"), "{doctor:?}");
    let status = machine.run(&["status"]);
    assert!(status.status == Some(0) && status.out.contains("held by nobody"), "{status:?}");
    assert!(!machine.was_touched() && !machine.path("touched").exists() && !machine.path("state").exists());
}

#[test]
fn throttling_is_told_by_reason() {
    let machine = Machine::new();
    let (ran, report) = machine.report(&["--", "sleep", "0.02"]);
    assert_eq!(report.verdict, Verdict::Trusted, "{ran:?}");
    // Right after the command the counters are read again; before it they were read once.
    let script = |nanoseconds: u64| {
        format!(
            "sed -i 's/\"sw_power_cap\": *[0-9]*/\"sw_power_cap\": {nanoseconds}/; s/\"power\": *[0-9]*/\"power\": {nanoseconds}/' \"${GPU}\""
        )
    };
    machine.edit(|state| {
        for counter in ["sw_power_cap", "power"] {
            state.gpus[0].counters.insert(counter.into(), 7);
        }
    });
    let slow = script(80_000_000);
    let (ran, report) = machine.report(&["--fail-on-throttle", "--", "sh", "-c", &slow]);
    let Verdict::Throttled { by } = &report.verdict else { panic!("{ran:?}") };
    assert_eq!(by[0].reason, record::ThrottleReason::SoftwarePowerCap);
    assert!((by[0].milliseconds - 80.0).abs() < 1e-3 && by[0].share > 0.1, "{by:?}");
    assert!(
        ran.status == Some(124) && ran.err.contains("throttled: software power cap for 80.0 ms"),
        "{ran:?}"
    );
    let slow = script(90_000_000) + "; sleep 1";
    let ran = machine.run(&["--fail-on-throttle", "--tolerance", "5%", "--", "sh", "-c", &slow]);
    assert_eq!(ran.status, Some(0), "{ran:?}");
    // A command that failed has its own status.
    let failing = script(990_000_000) + "; exit 3";
    assert_eq!(machine.run(&["--fail-on-throttle", "--", "sh", "-c", &failing]).status, Some(3));
}

#[test]
fn what_is_not_counted_is_unknown() {
    let machine = Machine::new();
    machine.edit(|state| state.gpus[0].missing_counters = vec!["thermal".into(), "sw_thermal".into()]);
    let (ran, report) = machine.report(&["--fail-on-throttle", "--", "true"]);
    assert_eq!(ran.status, Some(124));
    assert_eq!(report.verdict.to_string(), "unknown: the GPU does not count software thermal slowdown");
    // Older drivers have violation times alone.
    machine.edit(|state| {
        state.gpus[0].missing_counters =
            ["sw_power_cap", "sw_thermal", "hw_thermal", "hw_power_brake", "sync_boost"]
                .map(String::from)
                .to_vec();
    });
    assert_eq!(machine.report(&["--", "true"]).1.verdict, Verdict::Trusted);
}

#[test]
fn a_lock_that_somebody_takes_away_is_noticed() {
    let machine = Machine::new();
    let script =
        format!("sed -i 's/\"graphics_clock_follows\": *true/\"graphics_clock_follows\": false/' \"${GPU}\"");
    let (ran, report) = machine.report(&["--", "sh", "-c", &script]);
    let told = report.verdict.to_string();
    assert!(
        told.contains("graphics clock, locked at 1890 MHz, was no longer so at the end"),
        "{told} {ran:?}"
    );
}

#[test]
fn old_drivers_do_what_they_can() {
    let machine =
        Machine::without_functions(&["nvmlDeviceSetGpuLockedClocks", "nvmlDeviceGetViolationStatus"]);
    let (ran, report) = machine.report(&["--", "true"]);
    assert_eq!(ran.status, Some(0));
    assert!(ran.err.contains("graphics clock of GPU 0 not locked: the driver is too old"), "{ran:?}");
    assert_eq!(report.verdict, Verdict::Trusted);
    assert!(machine.run(&["doctor"]).out.contains("nvmlDeviceSetGpuLockedClocks"));
    let machine = Machine::without_functions(&["nvmlDeviceGetCurrentClocksThrottleReasons"]);
    let (_, report) = machine.report(&["--", "true"]);
    assert!(report.gpus[0].before.reading.reading().unwrap().throttle_reasons.is_some());
}

#[test]
fn a_timeline_is_read_when_asked_for() {
    let machine = Machine::new();
    let (_, report) = machine.report(&["--timeline", "50", "--", "sleep", "0.3"]);
    let readings = report.gpus[0].timeline.len();
    assert!((3..=17).contains(&readings), "{readings}");
    assert!(machine.report(&["--", "sleep", "0.1"]).1.gpus[0].timeline.is_empty());
}

#[test]
fn without_rights_the_way_out_is_told() {
    let machine = Machine::new();
    for function in ["DeviceSetPersistenceMode", "DeviceSetGpuLockedClocks", "DeviceSetMemoryLockedClocks"] {
        machine.fault(function, FaultKind::Error(ErrorCode::NoPermission));
    }
    let ran = machine.run(&["--", "sh", "-c", "exit 7"]);
    assert_eq!(ran.status, Some(7));
    for part in
        ["graphics clock of GPU 0 not locked: no permission", "to lock clocks: sudo /", "sh -c 'exit 7'"]
    {
        assert!(ran.err.contains(part), "{part}: {ran:?}");
    }
    let ran = machine.run(&["--strict", "--", "touch", machine.path("touched").to_str().unwrap()]);
    assert!(ran.status == Some(125) && !machine.path("touched").exists(), "{ran:?}");
    assert_eq!(
        std::fs::metadata(machine.path("state").read_dir().unwrap().next().unwrap().unwrap().path())
            .unwrap()
            .len(),
        0
    );
}
