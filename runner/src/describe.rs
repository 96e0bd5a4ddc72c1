//! What the tracer and this program know, in the record's words.

use record::{Phase, Repetition, Source};
use std::collections::BTreeMap;
use tracer::{
    builder::BuildReport,
    driver,
    gpu::{DeviceInfo, DeviceKind},
    list,
    measure::tree::TreeStats,
    path::WaveCounts,
    scene::{Origin, Scene},
    treefile::{Made, Recipe},
};

/// One build.
pub fn repetition(report: &BuildReport) -> Repetition {
    let took = &report.milliseconds;
    // A tree for a view is made of one that is there: its first phases take no part.
    let phases = phases(&[
        ("sbvh", took.sbvh),
        ("midpoint", took.midpoint),
        ("adopt", took.adopt),
        ("morton", took.morton),
        ("sort", took.sort),
        ("ploc", took.ploc),
        ("hploc", took.hploc),
        ("collapse", took.collapse),
        ("contract", took.contract),
        ("layout", took.layout),
    ]);
    Repetition { milliseconds: took.total, phases, launches: Some(report.timings.launches) }
}

/// One build by the driver.
pub fn by_driver(took: &driver::Milliseconds) -> Repetition {
    Repetition {
        milliseconds: took.total,
        launches: None,
        phases: phases(&[("bottom", took.bottom), ("compact", took.compact), ("top", took.top)]),
    }
}

/// One build of no tree.
pub fn listing(milliseconds: f64) -> Repetition {
    // One kernel stores the triangles.
    Repetition { milliseconds, phases: phases(&[("layout", milliseconds)]), launches: Some(1) }
}

/// Those that took part.
fn phases(all: &[(&str, f64)]) -> Vec<Phase> {
    let took_part = all.iter().filter(|(_, milliseconds)| *milliseconds > 0.0);
    took_part.map(|&(name, milliseconds)| Phase { name: name.into(), milliseconds }).collect()
}

/// What a build made.
pub fn tree(stats: &TreeStats) -> record::Tree {
    record::Tree {
        nodes: Some(stats.nodes),
        leaves: Some(stats.leaves),
        node_bytes: Some(stats.node_bytes),
        triangle_bytes: Some(stats.triangle_bytes),
        bytes: None,
        average_children: Some(stats.children_per_node),
        average_triangles_per_leaf: Some(stats.triangles_per_leaf),
        depth: Some(stats.depth),
        sah_cost: Some(stats.sah_cost),
    }
}

/// What the driver tells of the tree that it has made: how much memory it takes.
pub fn driver_tree(structure: &driver::Structure) -> record::Tree {
    record::Tree { bytes: Some(structure.bytes()), ..record::Tree::default() }
}

/// No tree: the triangles alone.
pub fn list(list: &list::List) -> record::Tree {
    record::Tree {
        nodes: Some(0),
        node_bytes: Some(0),
        triangle_bytes: Some(list.triangle_bytes()),
        ..record::Tree::default()
    }
}

/// What the rays of a wavefront met, and how well subgroups of a size were used.
pub fn count(counts: &WaveCounts, subgroup_size: u32) -> record::Count {
    let own = &counts.utilization;
    record::Count {
        rays: counts.rays,
        nodes: counts.nodes,
        boxes: counts.boxes,
        triangles: counts.triangles,
        utilization: Some(record::Utilization {
            subgroup_size,
            node_steps: own.node_steps,
            node_lanes: own.node_lanes,
            triangle_steps: own.triangle_steps,
            triangle_lanes: own.triangle_lanes,
            fetches: own.fetches,
            fetch_lanes: own.fetch_lanes,
        }),
    }
}

/// A binary tree from a file of that name and hash, which reading and checking took so long.
pub fn adopted(name: String, sha256: String, made: &Made, read_milliseconds: f64) -> record::Adopted {
    let mut parameters = record::Parameters::default();
    let added = match &made.recipe {
        Recipe::Ploc { morton, ploc } => {
            parameters.add("morton", morton).and_then(|()| parameters.add("ploc", ploc))
        }
        Recipe::Hploc { morton, hploc } => {
            parameters.add("morton", morton).and_then(|()| parameters.add("hploc", hploc))
        }
        Recipe::Sbvh { sbvh } => parameters.add("sbvh", sbvh),
        Recipe::Midpoint => Ok(()),
    };
    added.expect("parameters are plain data");
    let method = made.recipe.method().to_string();
    record::Adopted { name, sha256, method, parameters, built_seconds: made.seconds, read_milliseconds }
}

/// A scene.
pub fn scene(scene: &Scene) -> record::Scene {
    let report = &scene.report;
    let source = match &scene.provenance.origin {
        Origin::File { path, sha256 } => Source::File {
            name: path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
            sha256: sha256.clone(),
        },
        Origin::Generated { generator, triangles, seed } => {
            let mut parameters = record::Parameters::default();
            parameters.set("triangles", *triangles);
            parameters.set("seed", *seed);
            Source::Generator { name: generator.to_string(), parameters, sha256: None }
        }
    };
    let skipped = [
        ("non_finite", report.non_finite),
        ("out_of_range", report.out_of_range),
        ("not_triangles", report.skipped_primitives),
    ];
    record::Scene {
        name: scene.name.clone(),
        source,
        triangles: scene.positions.len() as u64,
        skipped: skipped
            .into_iter()
            .filter(|(_, count)| *count > 0)
            .map(|(reason, count)| (reason.to_owned(), count))
            .collect::<BTreeMap<_, _>>(),
        load_milliseconds: report.seconds * 1e3,
    }
}

/// A device.
pub fn device(info: &DeviceInfo) -> record::Device {
    record::Device {
        name: info.name.clone(),
        vendor: vendor(info.vendor_id).into(),
        vendor_id: info.vendor_id,
        device_id: info.device_id,
        kind: match info.kind {
            DeviceKind::Discrete => record::DeviceKind::Discrete,
            DeviceKind::Integrated => record::DeviceKind::Integrated,
            DeviceKind::Virtual => record::DeviceKind::Virtual,
            DeviceKind::Cpu => record::DeviceKind::Cpu,
            DeviceKind::Other => record::DeviceKind::Other,
        },
        driver: record::Driver {
            name: info.driver_name.clone(),
            version: info.driver_version.to_string(),
            info: info.driver_info.clone(),
        },
        api_version: info.api_version.clone(),
        uuid: info.uuid.clone(),
        pci: info.pci.clone(),
        limits: record::Limits {
            subgroup_size: info.subgroup_size,
            subgroup_size_min: info.subgroup_size_range[0],
            subgroup_size_max: info.subgroup_size_range[1],
            shared_memory_bytes: info.shared_memory_bytes,
            workgroup_invocations: info.max_workgroup_size,
            workgroup_size: info.max_workgroup_axes,
            workgroup_count: info.max_workgroups,
            storage_buffer_bytes: info.storage_buffer_bytes,
            timestamp_period_nanoseconds: f64::from(info.timestamp_period_ns),
            timestamp_bits: info.timestamp_bits,
            heaps: info
                .heaps
                .iter()
                .map(|&(bytes, device_local)| record::Heap { bytes, device_local })
                .collect(),
        },
        features: info.optional.iter().cloned().collect(),
    }
}

/// The vendor behind a PCI or Khronos vendor number.
fn vendor(id: u32) -> &'static str {
    match id {
        0x10DE => "NVIDIA",
        0x1002 => "AMD",
        0x8086 => "Intel",
        0x13B5 => "Arm",
        0x5143 => "Qualcomm",
        0x106B => "Apple",
        0x10005 => "Mesa",
        0x1AE0 => "Google",
        _ => "unknown",
    }
}

/// Vulkan's device UUID from its text.
pub fn uuid_bytes(uuid: &str) -> [u8; 16] {
    let digits: Vec<u8> = uuid.bytes().filter_map(|c| (c as char).to_digit(16)).map(|d| d as u8).collect();
    std::array::from_fn(|i| match digits.get(2 * i..2 * i + 2) {
        Some(pair) => pair[0] << 4 | pair[1],
        None => 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uuid_is_read_back_from_its_text() {
        let bytes = uuid_bytes("00112233-4455-6677-8899-aabbccddeeff");
        assert_eq!(bytes[..4], [0x00, 0x11, 0x22, 0x33]);
        assert_eq!(bytes[15], 0xff);
    }
}
