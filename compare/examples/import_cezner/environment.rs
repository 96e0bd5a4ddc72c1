//! Where the thesis measured (its sections 5.1.1 and 6.2).

use record::{
    Device, DeviceKind, Driver, Hold, Host, Limits, Method, Parameters, Policy, Record, Run, SCHEMA,
    Timestamp, Tool,
};

/// A record of that environment without results.
pub fn empty() -> Record {
    // The thesis is of May 2025; when it measured, it does not say.
    let time: Timestamp = "2025-05-01T00:00:00Z".parse().expect("it is a time");
    let mut parameters = Parameters::default();
    parameters.set("import.document", "Cezner 2025, tables 13 to 17");
    parameters.set("import.samples", 15u32);
    parameters.set("import.views", 8u32);
    Record {
        schema: SCHEMA,
        tool: Tool { name: "import_cezner".into(), version: env!("CARGO_PKG_VERSION").into(), commit: None },
        command_line: Vec::new(),
        started: time,
        finished: Some(time),
        host: Host {
            name: None,
            os: "Linux".into(),
            kernel: "Linux 6.13.6".into(),
            cpu: "Intel Core i5-9600K @ 4.5 GHz".into(),
            cores: 6,
            memory_bytes: 0,
        },
        device: device(),
        shaders: Default::default(),
        run: Run {
            method: Method::Paths,
            width: 1920,
            height: 1080,
            samples: 15,
            warm_up: 0,
            depth: 8,
            seed: 0,
            stopping: None,
            clock: None,
            policy: Some(Policy { graphics: locked(2835), memory: locked(10_501), persistence: Some(true) }),
        },
        sweep: None,
        parts: Vec::new(),
        parameters,
        results: Vec::new(),
        references: Vec::new(),
        left_out: Vec::new(),
    }
}

fn locked(mhz: u32) -> Hold {
    let remark = Some("imported: by nvidia-stabilize, as the thesis says".into());
    Hold { asked: mhz.to_string(), locked_mhz: Some(mhz), delivered_mhz: None, remark }
}

fn device() -> Device {
    Device {
        name: "NVIDIA GeForce RTX 4070 Ti".into(),
        vendor: "NVIDIA".into(),
        vendor_id: 0x10de,
        device_id: 0x2782,
        kind: DeviceKind::Discrete,
        driver: Driver {
            name: "NVIDIA".into(),
            version: "570.124.04".into(),
            info: "nvidia-open 570.124.04".into(),
        },
        api_version: String::new(),
        uuid: String::new(),
        pci: None,
        // Table 1, as far as it goes.
        limits: Limits {
            subgroup_size: 32,
            subgroup_size_min: 32,
            subgroup_size_max: 32,
            shared_memory_bytes: 49_152,
            workgroup_invocations: 1024,
            workgroup_size: [1024, 0, 0],
            workgroup_count: [0, 0, 0],
            storage_buffer_bytes: 0,
            // What every NVIDIA GPU has.
            timestamp_period_nanoseconds: 1.0,
            timestamp_bits: 64,
            heaps: Vec::new(),
        },
        features: Default::default(),
    }
}
