use crate::*;
use std::time::{Duration, UNIX_EPOCH};

/// A small, sound record with something in every field: for tests and documentation.
pub fn example() -> Record {
    let at = |seconds: u64| Timestamp::from(UNIX_EPOCH + Duration::from_secs(1_772_323_200 + seconds));
    let mut parameters = Parameters::default();
    parameters.set("collapse.c_i", 2.0);
    parameters.set("collapse.c_t", 2.0);
    parameters.set("collapse.max_leaf", 16u32);
    parameters.set("morton.bits", 10u32);
    parameters.set("ploc.radius", 8u32);
    parameters.set("trace.primary_fetch_below", 0.625);
    parameters.set("trace.postpone_below", 0.25);
    parameters.set("trace.primary_subgroups", 8u32);
    parameters.set("trace.secondary_subgroups", 8u32);
    parameters.set("trace.stack", 64u32);
    let command_line = ["runner", "sweep", "costs.toml", "--shard", "1/1", "-o", "out"].map(String::from);
    Record {
        schema: SCHEMA,
        tool: Tool {
            name: "runner".into(),
            version: "0.1.0".into(),
            commit: Some(Commit { hash: "0123456789abcdef0123456789abcdef01234567".into(), dirty: false }),
        },
        command_line: command_line.to_vec(),
        started: at(0),
        finished: Some(at(42)),
        host: host(),
        device: device(),
        shaders: [("traverse/binary".to_string(), "5f".repeat(32))].into(),
        run: Run {
            method: Method::Paths,
            width: 640,
            height: 360,
            samples: 30,
            warm_up: 1,
            depth: 3,
            seed: 1,
            stopping: Some(Stopping { least: 2, most: 30, half_width: 0.01, seconds: 60.0 }),
            clock: Some(Clock { kind: ClockKind::Locked, mhz: 2835, least_share: 0.95 }),
            policy: Some(Policy {
                graphics: Hold {
                    asked: "auto".into(),
                    locked_mhz: Some(2835),
                    delivered_mhz: Some(2835),
                    remark: None,
                },
                memory: Hold {
                    asked: "auto".into(),
                    locked_mhz: None,
                    delivered_mhz: None,
                    remark: Some("the driver does not lock it".into()),
                },
                persistence: Some(true),
            }),
        },
        sweep: Some(Sweep {
            title: "Traversal cost".into(),
            axes: vec!["collapse.c_t".into()],
            config: serde_json::json!({ "settings": { "depth": 3 }, "defaults": {}, "points": {} }),
            order_seed: 1,
            points: 2,
            shard: Some("1/1".into()),
        }),
        parts: vec![Part {
            host: host(),
            device: "Example GPU 4070".into(),
            device_uuid: "00112233-4455-6677-8899-aabbccddeeff".into(),
            driver: "570.124.0".into(),
            command_line: command_line.to_vec(),
            started: at(0),
            finished: at(42),
            shard: Some("1/1".into()),
        }],
        parameters,
        left_out: Vec::new(),
        references: vec![measured(at(20), at(21))],
        results: vec![measured(at(30), at(31)), generated()],
    }
}

fn host() -> Host {
    Host {
        name: Some("bench".into()),
        os: "Debian GNU/Linux 12 (bookworm)".into(),
        kernel: "Linux 6.1.0".into(),
        cpu: "Example CPU @ 4.5 GHz".into(),
        cores: 6,
        memory_bytes: 32 << 30,
    }
}

fn device() -> Device {
    Device {
        name: "Example GPU 4070".into(),
        vendor: "NVIDIA".into(),
        vendor_id: 0x10de,
        device_id: 0x2782,
        kind: DeviceKind::Discrete,
        driver: Driver { name: "NVIDIA".into(), version: "570.124.0".into(), info: "570.124".into() },
        api_version: "1.4.303".into(),
        uuid: "00112233-4455-6677-8899-aabbccddeeff".into(),
        pci: Some("0000:01:00.0".into()),
        limits: Limits {
            subgroup_size: 32,
            subgroup_size_min: 32,
            subgroup_size_max: 32,
            shared_memory_bytes: 48 << 10,
            workgroup_invocations: 1024,
            workgroup_size: [1024, 1024, 64],
            workgroup_count: [0x7fff_ffff, 65_535, 65_535],
            storage_buffer_bytes: 0xffff_ffff,
            timestamp_period_nanoseconds: 1.0,
            timestamp_bits: 64,
            heaps: vec![Heap { bytes: 12 << 30, device_local: true }],
        },
        features: ["subgroupSizeControl", "VK_KHR_pipeline_executable_properties"].map(String::from).into(),
    }
}

fn launches<const N: usize>(launches: [(u64, f64); N]) -> Sample {
    Sample {
        depths: launches.map(|(rays, milliseconds)| Launch { rays, milliseconds }).to_vec(),
        ..Sample::default()
    }
}

fn repetition<const N: usize>(milliseconds: f64, phases: [(&str, f64); N]) -> Repetition {
    Repetition {
        milliseconds,
        phases: phases.map(|(name, milliseconds)| Phase { name: name.into(), milliseconds }).to_vec(),
        launches: Some(20 * N as u32),
    }
}

/// What rays met, and in how many steps: of nodes, of triangles, and to fetch them.
fn counters<const N: usize>(depths: [([u64; 4], [u64; 3]); N]) -> Option<Counters> {
    let count =
        |([rays, nodes, boxes, triangles], [node_steps, triangle_steps, fetches]): ([u64; 4], [u64; 3])| {
            Count {
                rays,
                nodes,
                boxes,
                triangles,
                utilization: Some(Utilization {
                    subgroup_size: 32,
                    node_steps,
                    node_lanes: nodes,
                    triangle_steps,
                    triangle_lanes: triangles,
                    fetches,
                    fetch_lanes: rays,
                }),
            }
        };
    Some(Counters { depths: depths.map(count).to_vec() })
}

fn kernel(purpose: &str, registers: u32, occupancy: f64, limited_by: OccupancyLimit) -> Kernel {
    Kernel {
        name: "traverse/binary".into(),
        purpose: purpose.into(),
        workgroup_size: 256,
        subgroup_size: 32,
        registers: Some(registers),
        local_bytes: Some(256),
        shared_bytes: Some(12),
        spills: Some(0),
        code_bytes: Some(9472),
        occupancy: Some(occupancy),
        limited_by: Some(limited_by),
    }
}

fn measured(before: Timestamp, after: Timestamp) -> Point {
    let reading = |time, temperature, power| {
        Telemetry::Available(Reading {
            time,
            graphics_clock_mhz: Some(2835),
            sm_clock_mhz: Some(2835),
            memory_clock_mhz: Some(10_501),
            temperature_celsius: Some(temperature),
            power_watts: Some(power),
            performance_state: Some(0),
            throttle_reasons: Some([ThrottleReason::ApplicationsClocksSetting].into()),
        })
    };
    Point {
        scene: Scene {
            name: "sponza".into(),
            source: Source::File { name: "sponza.glb".into(), sha256: "a0".repeat(32) },
            triangles: 262_205,
            skipped: [("non_finite".to_string(), 2)].into(),
            load_milliseconds: 21.5,
        },
        variant: "Binary".into(),
        parameters: Parameters::default(),
        adopted: None,
        build: Build {
            repetitions: vec![
                repetition(
                    1.42,
                    [("morton", 0.05), ("sort", 0.4), ("ploc", 0.7), ("collapse", 0.1), ("layout", 0.1)],
                ),
                repetition(
                    1.39,
                    [("morton", 0.05), ("sort", 0.38), ("ploc", 0.69), ("collapse", 0.1), ("layout", 0.1)],
                ),
            ],
        },
        tree: Tree {
            nodes: Some(98_303),
            leaves: Some(98_304),
            node_bytes: Some(98_303 * 56),
            triangle_bytes: Some(262_205 * 48),
            bytes: None,
            average_children: Some(2.0),
            average_triangles_per_leaf: Some(2.667),
            depth: Some(27),
            sah_cost: Some(181.25),
        },
        kernels: vec![
            kernel("primary", 40, 1.0, OccupancyLimit::Subgroups),
            kernel("secondary", 72, 0.5, OccupancyLimit::Registers),
        ],
        views: vec![View {
            name: "atrium".into(),
            adaptation: None,
            samples: vec![
                Sample {
                    sm_clock_mhz: Some(2610),
                    excluded: Some(Exclusion::LowClock),
                    ..launches([(230_400, 0.139), (229_865, 0.838), (228_911, 0.981)])
                },
                launches([(230_400, 0.128), (229_870, 0.771), (228_910, 0.903)]),
                launches([(230_400, 0.127), (229_881, 0.769), (228_904, 0.899)]),
            ],
            counters: counters([
                ([230_400, 9_216_000, 18_432_000, 4_608_000], [320_000, 240_000, 9_000]),
                ([229_870, 11_493_500, 22_987_000, 6_896_100], [718_344, 862_013, 17_959]),
                ([228_910, 11_674_410, 23_348_820, 7_096_210], [729_651, 887_027, 17_884]),
            ]),
            before: reading(before, 51, 92.4),
            after: reading(after, 58, 204.75),
            pictures: vec!["sponza-atrium.png".into()],
        }],
        measurement: Some(Measurement {
            part: 0,
            position: 7,
            started: before,
            finished: after,
            stopped: Stop::Precise,
            unreliable: false,
            verdict: Some(Verdict::Trusted),
        }),
    }
}

fn generated() -> Point {
    let mut given = Parameters::default();
    given.set("seed", 1u32);
    given.set("triangles", 36u32);
    let unasked = Telemetry::unavailable("the NVIDIA management library is not installed");
    let mut parameters = Parameters::default();
    parameters.set("collapse.c_t", 3.0);
    Point {
        scene: Scene {
            name: "cornell".into(),
            source: Source::Generator { name: "cornell".into(), parameters: given, sha256: None },
            triangles: 36,
            skipped: Default::default(),
            load_milliseconds: 0.02,
        },
        variant: "Wide4 CBTC".into(),
        parameters,
        adopted: None,
        build: Build {
            repetitions: vec![repetition(0.31, [("morton", 0.05), ("sort", 0.1), ("ploc", 0.1)])],
        },
        tree: Tree {
            nodes: Some(13),
            leaves: Some(14),
            node_bytes: Some(13 * 56),
            triangle_bytes: Some(36 * 48),
            bytes: None,
            average_children: Some(2.0),
            average_triangles_per_leaf: Some(2.571),
            depth: Some(2),
            sah_cost: Some(23.5),
        },
        kernels: Vec::new(),
        views: vec![View {
            name: "front".into(),
            adaptation: Some(Adaptation {
                sampling_milliseconds: vec![0.07],
                build: Build { repetitions: vec![repetition(0.05, [("contract", 0.03), ("layout", 0.02)])] },
                tree: Tree {
                    nodes: Some(5),
                    leaves: Some(14),
                    node_bytes: Some(5 * 120),
                    triangle_bytes: Some(36 * 48),
                    bytes: None,
                    average_children: Some(3.6),
                    average_triangles_per_leaf: Some(2.571),
                    depth: Some(2),
                    sah_cost: Some(23.5),
                },
            }),
            samples: vec![launches([(230_400, 0.081), (230_112, 0.213)])],
            counters: None,
            before: unasked.clone(),
            after: unasked,
            pictures: Vec::new(),
        }],
        measurement: None,
    }
}

/// A report with something in every field, and a run that the heat slowed down: for tests and documentation.
pub fn example_report() -> Report {
    let record = example();
    let view = &record.results[0].views[0];
    let state = |reading: &Telemetry, heat: f64| State {
        reading: reading.clone(),
        throttled: ThrottleTimes(
            [(ThrottleReason::SoftwarePowerCap, 0.0), (ThrottleReason::SoftwareThermalSlowdown, heat)].into(),
        ),
    };
    let by = |reason, milliseconds, share| Throttling { reason, milliseconds, share };
    let heat = by(ThrottleReason::SoftwareThermalSlowdown, 1260.0, 0.03);
    Report {
        schema: SCHEMA,
        tool: Tool { name: "stabilize".into(), version: "0.1.0".into(), commit: None },
        process: 4711,
        process_started: 123_456,
        command: ["runner", "sweep", "costs.toml", "-o", "out"].map(String::from).to_vec(),
        started: record.started,
        finished: record.finished,
        status: Some(0),
        left_behind: 0,
        tolerance: TOLERANCE,
        verdict: Verdict::Throttled { by: vec![heat.clone()] },
        gpus: vec![Stabilized {
            index: 0,
            name: record.device.name.clone(),
            uuid: format!("GPU-{}", record.device.uuid),
            pci: record.device.pci.clone(),
            driver: "570.124.04".into(),
            policy: record.run.policy.clone().expect("the example has one"),
            before: state(&view.before, 3500.0),
            after: Some(state(&view.after, 4760.0)),
            throttling: vec![by(ThrottleReason::SoftwarePowerCap, 0.0, 0.0), heat.clone()],
            verdict: Verdict::Throttled { by: vec![heat] },
            restored: vec![
                Restoration { what: "graphics clock unlocked".into(), failed: None },
                Restoration { what: "persistence mode off".into(), failed: Some("the GPU is lost".into()) },
            ],
            timeline: Vec::new(),
        }],
        awake: vec![Inhibition {
            what: "screen saver".into(),
            service: "org.freedesktop.ScreenSaver".into(),
            refusal: Some("there is no session bus".into()),
        }],
        remarks: vec!["the memory clock is not locked: the driver does not lock it".into()],
    }
}
