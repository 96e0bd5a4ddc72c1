//! How near a traversal comes to what the device can do: a record's rates beside `runner roofline`'s.

use anyhow::Context;
use record::{Operation, PerRay, Point, Rays, Record, Roofline};
use std::path::Path;

/// Bytes of a box whose planes are bytes.
const BYTES_A_BOX: f64 = 6.0;

/// A limit of the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// Copying memory: were every byte that a ray asks for to come from there.
    Copy,
    /// Reading nodes at random, each lane its own.
    Alone,
    /// Reading nodes at random, the lanes of a subgroup together.
    Together,
    /// Testing boxes: three axes each.
    Slab,
    /// Making floats of bytes, six of each box, where nodes are quantized.
    Bytes,
}

impl Limit {
    /// All of them.
    pub const ALL: [Limit; 5] = [Limit::Copy, Limit::Alone, Limit::Together, Limit::Slab, Limit::Bytes];

    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Limit::Copy => "memory copy",
            Limit::Alone => "node reads alone",
            Limit::Together => "node reads together",
            Limit::Slab => "box tests",
            Limit::Bytes => "bytes to floats",
        }
    }
}

/// What rays of one kind meet, and how near the kernel comes to each limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reached {
    /// Million rays a second.
    pub mrps: f64,
    /// What a ray meets.
    pub per_ray: PerRay,
    /// Bytes of nodes and triangles that a ray asks for.
    pub bytes: f64,
    /// Share of the lanes of a subgroup that take part in a step at a node, and in one at a triangle; nothing in records
    /// from before that was counted.
    pub lanes: [Option<f64>; 2],
    /// Of each limit, the share that is reached; nothing where it was not measured or does not concern the variant.
    pub shares: [Option<f64>; Limit::ALL.len()],
}

/// How near a point's rays come to what a device can do; nothing where the record does not tell what they meet, as of
/// the driver's own ray tracing.
pub fn reached(point: &Point, rays: Rays, roofline: &Roofline) -> Option<Reached> {
    let counters = point.counters()?;
    let met = match rays {
        Rays::Primary => counters.primary(),
        Rays::Secondary => counters.secondary(),
        Rays::All => counters.all(),
    };
    let (mrps, per_ray) = (point.rate(rays)?, met.per_ray()?);
    let bytes: f64 = point.bytes_per_ray(&met)?.iter().sum();
    let lanes = [record::Utilization::of_nodes, record::Utilization::of_triangles]
        .map(|of| met.utilization.as_ref().and_then(of));
    let a_second = mrps * 1e6;
    let node_bytes = point.of_trees(record::Tree::bytes_per_node)?;
    let table_bytes = point.of_trees(|tree| tree.node_bytes.map(|bytes| bytes as f64))?;
    let of = |limit| match limit {
        Limit::Copy => {
            Some(a_second * bytes / roofline.copy_bytes_per_second).filter(|share| share.is_finite())
        }
        Limit::Alone | Limit::Together => {
            let most = roofline.nodes_per_second(node_bytes, table_bytes, limit == Limit::Together)?;
            Some(a_second * per_ray.nodes / most)
        }
        Limit::Slab => Some(a_second * per_ray.boxes * 3.0 / roofline.rate(Operation::SlabAxis)?),
        Limit::Bytes => {
            let quantized = point.variant.split(' ').any(|word| ["Quantized", "Compressed"].contains(&word));
            let rate = roofline.rate(Operation::ByteToFloat).filter(|_| quantized)?;
            Some(a_second * per_ray.boxes * BYTES_A_BOX / rate)
        }
    };
    Some(Reached { mrps, per_ray, bytes, lanes, shares: Limit::ALL.map(of) })
}

/// Reads the file that goes with some records.
///
/// # Errors
/// It cannot be read, or was measured on another device than one of the records.
pub fn load<'r>(path: &Path, records: impl IntoIterator<Item = &'r Record>) -> anyhow::Result<Roofline> {
    let roofline = Roofline::read(path).with_context(|| format!("--roofline {}", path.display()))?;
    for record in records {
        let (own, its) = (&roofline.device.name, &record.device.name);
        anyhow::ensure!(
            own == its,
            "the roofline was measured on {own} and a record on {its}: `runner roofline -o FILE` measures that device"
        );
    }
    Ok(roofline)
}

/// What numbers of rooflines mean, for captions.
pub const EXPLAINED: &str = "Lanes: how many of a subgroup take part in a step. Shares are what the kernel did in a second of what the device can do at best. Memory copy: were \
     every byte that a ray asks for to come from memory; caches serve some, so more than 100 % is possible. Node reads: \
     random reads of whole nodes of that size from a table as large as the nodes. Box tests: three slab axes a box. Bytes \
     to floats: six a box of quantized nodes.";

#[cfg(test)]
mod tests {
    use super::*;
    use record::{example, example_roofline};

    #[test]
    fn shares_are_what_was_done_of_what_can_be() {
        let record = example();
        let mut point = record.results[0].clone();
        let roofline = example_roofline();
        let (bytes, nodes) = (64 * 65_536, 65_536);
        (point.tree.nodes, point.tree.node_bytes) = (Some(nodes), Some(bytes));
        (point.tree.leaves, point.tree.average_triangles_per_leaf) = (Some(1000), Some(1.0));
        point.tree.triangle_bytes = Some(48_000);
        let found = reached(&point, Rays::Primary, &roofline).unwrap();
        // 40 nodes, 80 boxes and 20 triangles a ray.
        assert_eq!((found.per_ray.nodes, found.per_ray.boxes, found.per_ray.triangles), (40.0, 80.0, 20.0));
        assert!((found.bytes - (40.0 * 64.0 + 20.0 * 48.0)).abs() < 1e-9);
        let rays = point.primary_mrps().unwrap() * 1e6;
        let expected = [
            Some(rays * found.bytes / 1e12),
            Some(rays * 40.0 / 10e9),
            Some(rays * 40.0 / 20e9),
            Some(rays * 240.0 / 1e12),
            None,
        ];
        for (found, expected) in found.shares.iter().zip(expected) {
            match (found, expected) {
                (Some(found), Some(expected)) => assert!((found / expected - 1.0).abs() < 1e-9),
                (found, expected) => assert_eq!(*found, expected),
            }
        }
        for view in &mut point.views {
            for met in &mut view.counters.as_mut().unwrap().depths {
                met.utilization = Some(record::Utilization {
                    subgroup_size: 8,
                    node_steps: 10,
                    node_lanes: 60,
                    triangle_steps: 0,
                    triangle_lanes: 0,
                    fetches: 1,
                    fetch_lanes: 8,
                });
            }
        }
        assert_eq!(reached(&point, Rays::Primary, &roofline).unwrap().lanes, [Some(0.75), None]);
        point.variant = "Wide4 Quantized".into();
        let quantized = reached(&point, Rays::Primary, &roofline).unwrap();
        assert!((quantized.shares[4].unwrap() / (rays * 480.0 / 1e12) - 1.0).abs() < 1e-9);
        // What the driver traces nobody counts.
        point.views[0].counters = None;
        assert_eq!(reached(&point, Rays::Primary, &roofline), None);
    }

    #[test]
    fn a_roofline_of_another_device_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("roof.json");
        let mut roofline = example_roofline();
        roofline.write_atomic(&path).unwrap();
        assert_eq!(load(&path, [&example()]).unwrap(), roofline);
        roofline.device.name = "Another".into();
        roofline.write_atomic(&path).unwrap();
        let error = load(&path, [&example()]).unwrap_err().to_string();
        assert!(error.contains("Another") && error.contains("runner roofline"), "{error}");
        assert!(load(&folder.path().join("none"), []).unwrap_err().to_string().contains("--roofline"));
    }
}
