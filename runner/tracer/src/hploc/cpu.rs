//! The plain twin: the same tree, bit for bit, by recursion from the root of the radix hierarchy.

use super::{HplocParams, PATIENCE};
use crate::bvh2::{Aabb, Bvh2, Bvh2Node, LEAF, Triangle};
use std::{collections::VecDeque, ops::Range};

/// Builds the tree over `triangles`, whose order along the curve is `order`; `codes` are those of the triangles, in
/// file order, and `scale` is the scene's.
///
/// # Panics
/// There are no triangles.
pub fn build(triangles: &[Triangle], codes: &[u64], order: &[u32], scale: f32, params: &HplocParams) -> Bvh2 {
    assert!(!order.is_empty(), "a tree has at least one triangle");
    let leaf = |&primitive: &u32| Bvh2Node::new(Aabb::of(&triangles[primitive as usize]), primitive, LEAF);
    let mut nodes: Vec<Bvh2Node> = order.iter().map(leaf).collect();
    nodes.resize(2 * order.len() - 1, Bvh2Node::new(Aabb::EMPTY, 0, 0));
    let keys = order.iter().zip(0..).map(|(&primitive, place)| (codes[primitive as usize], place)).collect();
    let mut builder = Builder { nodes, keys, scale, params };
    builder.range(0..order.len());
    Bvh2 { nodes: builder.nodes, leaves: order.len(), levels: Vec::new() }
}

struct Builder<'a> {
    nodes: Vec<Bvh2Node>,
    /// Of each leaf its code, and its place, by which equal codes differ.
    keys: Vec<(u64, u64)>,
    scale: f32,
    params: &'a HplocParams,
}

/// What a range of leaves has become.
struct Clusters {
    clusters: Vec<Cluster>,
    /// Numbers of nodes to come, in the order in which they are taken.
    numbers: VecDeque<u32>,
}

#[derive(Clone, Copy)]
struct Cluster {
    node: u32,
    bounds: Aabb,
    levels: u16,
}

impl Builder<'_> {
    /// Where the radix hierarchy parts a range: before the first key that has the highest bit in which keys differ.
    fn split(&self, range: &Range<usize>) -> usize {
        let keys = &self.keys[range.clone()];
        let (first, last) = (keys[0], keys[keys.len() - 1]);
        let bit = |x: u64| 1 << x.ilog2();
        let before = match (first.0 ^ last.0, first.1 ^ last.1) {
            (0, places) => keys.partition_point(|key| key.1 & bit(places) == 0),
            (codes, _) => keys.partition_point(|key| key.0 & bit(codes) == 0),
        };
        range.start + before
    }

    fn range(&mut self, range: Range<usize>) -> Clusters {
        let leaves = self.keys.len();
        let half = self.params.window as usize / 2;
        let root = range == (0..leaves);
        if leaves == 1 || range.len() <= half && !root {
            let cluster = |i: u32| Cluster { node: i, bounds: self.nodes[i as usize].bounds(), levels: 0 };
            let numbers = range.start as u32..range.end as u32;
            let mut own =
                Clusters { clusters: numbers.clone().map(cluster).collect(), numbers: numbers.collect() };
            if range.start == 0 {
                own.numbers.rotate_left(1);
            }
            return own;
        }
        let split = self.split(&range);
        let [mut left, right] = [range.start..split, split..range.end].map(|part| self.range(part));
        // The last leaf's number is never taken, and the first one's by the root alone: they stay behind.
        let zero = if range.start == 0 { left.numbers.pop_back() } else { None };
        left.numbers.extend(right.numbers);
        let place = left.numbers.len() - usize::from(root);
        zero.into_iter().for_each(|zero| left.numbers.insert(place, zero));
        left.clusters.extend(right.clusters);
        self.merge(&mut left, if root { 1 } else { half });
        left
    }

    fn merge(&mut self, Clusters { clusters, numbers }: &mut Clusters, goal: usize) {
        let leaves = self.keys.len() as u32;
        let mut patient = clusters.iter().all(|c| c.levels < PATIENCE);
        while clusters.len() > goal {
            let nearest: Vec<usize> = (0..clusters.len())
                .map(|i| match patient {
                    true => self.nearest(clusters, i),
                    false if i ^ 1 < clusters.len() => i ^ 1,
                    false => i,
                })
                .collect();
            let mut next = Vec::new();
            for (i, &partner) in nearest.iter().enumerate() {
                let (own, other) = (clusters[i], clusters[partner]);
                if partner == i || nearest[partner] != i {
                    next.push(own);
                } else if i < partner {
                    let number = numbers.pop_front().expect("there are as many as clusters");
                    let node = leaves + number.checked_sub(1).unwrap_or(leaves - 2);
                    let bounds = own.bounds.union(&other.bounds);
                    self.nodes[node as usize] = Bvh2Node::new(bounds, own.node, other.node);
                    next.push(Cluster { node, bounds, levels: 1 + own.levels.max(other.levels) });
                }
            }
            patient = patient && next.len() < clusters.len();
            *clusters = next;
        }
    }

    /// `nearest_cluster` in `climb.comp`.
    fn nearest(&self, clusters: &[Cluster], own: usize) -> usize {
        let radius = self.params.radius as usize;
        let around = own.saturating_sub(radius)..(own + radius + 1).min(clusters.len());
        let area = |other: usize| {
            let merged = clusters[own].bounds.union(&clusters[other].bounds);
            merged.half_area(self.scale)
        };
        let finite = around.filter(|&other| other != own && area(other) < f32::MAX);
        // Equally good pairs: the closer one, that which begins at an even place, the first.
        let tie = |other: usize| {
            let begin = own.min(other);
            (own.abs_diff(other), begin % 2, begin)
        };
        let best = finite.min_by(|&a, &b| {
            area(a).partial_cmp(&area(b)).expect("areas are numbers").then(tie(a).cmp(&tie(b)))
        });
        best.unwrap_or(own)
    }
}
