//! Statistics of a tree, found by decoding it: the same for every layout.

use crate::{
    bvh2::Aabb,
    collapse::CollapseParams,
    layout::{NodeLayout, Target, children},
    traverse::TriangleTest,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// A tree in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TreeStats {
    /// Nodes; where leaves are no part of their parents, the items that both are made of.
    pub nodes: u64,
    /// Leaves.
    pub leaves: u64,
    /// Triangles in leaves.
    pub triangles: u64,
    /// Bytes of all nodes, the space between them included.
    pub node_bytes: u64,
    /// Bytes of all triangles in leaves: see [`TreeStats::stored_for`].
    pub triangle_bytes: u64,
    /// Nodes on the longest way from the root to a leaf, the root included.
    pub depth: u32,
    /// Mean number of children a node.
    pub children_per_node: f64,
    /// Nodes with 0, 1, 2, … children.
    pub children_histogram: Vec<u64>,
    /// Mean number of triangles a leaf.
    pub triangles_per_leaf: f64,
    /// Leaves with 0, 1, 2, … triangles.
    pub triangles_histogram: Vec<u64>,
    /// Expected cost of a ray that meets the scene's box (thesis 1.2.2): `c_t` for each node and `c_i` for
    /// each triangle of a leaf, times the probability that the ray meets its box.
    pub sah_cost: f64,
    /// The part of `sah_cost` that nodes cause.
    pub sah_traversal: f64,
    /// The part of `sah_cost` that triangles cause.
    pub sah_intersection: f64,
}

impl TreeStats {
    /// Of the same tree with triangles stored for a test; [`stats`] takes the usual one.
    pub fn stored_for(self, test: TriangleTest) -> Self {
        Self { triangle_bytes: self.triangles * test.triangle_bytes() as u64, ..self }
    }
}

/// Nodes that a thread takes at a time.
const PART: usize = 4096;

/// What is added up over nodes.
struct Sums {
    /// Areas of nodes.
    traversal: f64,
    /// Areas of leaves times their triangles.
    intersection: f64,
    /// Nodes by number of children.
    children: Vec<u64>,
    /// Leaves by number of triangles.
    triangles: Vec<u64>,
}

impl Sums {
    fn new<L: NodeLayout>() -> Self {
        Self {
            traversal: 0.0,
            intersection: 0.0,
            children: vec![0; L::LIMITS.children + 1],
            triangles: vec![0; L::LIMITS.triangles_per_leaf + 1],
        }
    }

    fn add(&mut self, other: &Self) {
        self.traversal += other.traversal;
        self.intersection += other.intersection;
        self.children.iter_mut().zip(&other.children).for_each(|(sum, count)| *sum += count);
        self.triangles.iter_mut().zip(&other.triangles).for_each(|(sum, count)| *sum += count);
    }
}

/// Walks a tree from its root; nodes are stored `stride` bytes apart, `costs` weighs them against triangles.
///
/// The tree is taken to be valid: see [`crate::validate::layout`].
pub fn stats<L: NodeLayout>(nodes: &[L::Node], stride: usize, costs: &CollapseParams) -> TreeStats {
    // In double precision even the squares of the greatest floats have room.
    let area = |b: &Aabb| {
        let e: [f64; 3] = std::array::from_fn(|i| f64::from(b.hi[i]) - f64::from(b.lo[i]));
        e[0] * e[1] + e[1] * e[2] + e[2] * e[0]
    };
    let root = children::<L>(nodes, 0).fold(Aabb::EMPTY, |b, c| b.union(&c.bounds));
    let mut sums = Sums::new::<L>();
    sums.traversal = area(&root);
    let mut depth = 0;
    // A level after the other, each in parts of a fixed size that are added in order: the sums do not depend on
    // the number of threads.
    let mut level = vec![0u32];
    while !level.is_empty() {
        depth += 1;
        let parts: Vec<(Sums, Vec<u32>)> = (level.par_chunks(PART))
            .map(|part| {
                let (mut sums, mut next) = (Sums::new::<L>(), Vec::new());
                for &index in part {
                    let mut count = 0;
                    for child in children::<L>(nodes, index) {
                        count += 1;
                        match child.target {
                            Target::Node(node) => {
                                sums.traversal += area(&child.bounds);
                                next.push(node);
                            }
                            Target::Leaf { count, .. } => {
                                sums.triangles[count as usize] += 1;
                                sums.intersection += area(&child.bounds) * f64::from(count);
                            }
                        }
                    }
                    sums.children[count] += 1;
                }
                (sums, next)
            })
            .collect();
        level.clear();
        for (part, next) in parts {
            sums.add(&part);
            level.extend(next);
        }
    }
    let Sums { traversal, intersection, children: children_histogram, triangles: triangles_histogram } = sums;
    let leaves = triangles_histogram.iter().sum();
    let triangles = triangles_histogram.iter().zip(0..).map(|(leaves, count)| leaves * count).sum();
    // Where the whole scene has no area, no ray meets it: what is inside costs nothing.
    let per_ray = |sum: f64, cost: f32| {
        let total = area(&root);
        if total > 0.0 { sum / total * f64::from(cost) } else { 0.0 }
    };
    let sah_traversal = per_ray(traversal, costs.traversal_cost);
    let sah_intersection = per_ray(intersection, costs.intersection_cost);
    let (nodes, inner) = (nodes.len() as u64, children_histogram.iter().sum::<u64>());
    TreeStats {
        nodes,
        leaves,
        triangles,
        node_bytes: nodes * stride as u64,
        triangle_bytes: triangles * TriangleTest::default().triangle_bytes() as u64,
        depth,
        children_per_node: (inner - 1 + leaves) as f64 / inner as f64,
        children_histogram,
        triangles_per_leaf: triangles as f64 / leaves as f64,
        triangles_histogram,
        sah_cost: sah_traversal + sah_intersection,
        sah_traversal,
        sah_intersection,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{Child, LayoutParams, NodeByNode, binary::Binary};

    #[test]
    fn the_cost_of_two_leaves_under_a_root_is_what_the_formula_says() {
        let bounds = |lo: f32, hi: f32| Aabb { lo: [lo, 0.0, 0.0], hi: [hi, 1.0, 1.0] };
        let nodes = [<Binary as NodeByNode>::encode(
            &[
                Some(Child { bounds: bounds(0.0, 1.0), target: Target::Leaf { first: 0, count: 3 } }),
                Some(Child { bounds: bounds(2.0, 4.0), target: Target::Leaf { first: 3, count: 1 } }),
            ],
            4,
            &LayoutParams::default(),
        )];
        let costs =
            CollapseParams { traversal_cost: 3.0, intersection_cost: 2.0, max_leaf: 16, by_size: false };
        let s = stats::<Binary>(&nodes, 56, &costs);
        // Half areas: root 4 + 1 + 4 = 9, leaves 3 and 5.
        assert!((s.sah_traversal - 3.0).abs() < 1e-12);
        assert!((s.sah_intersection - 2.0 * (3.0 * 3.0 + 5.0) / 9.0).abs() < 1e-12);
        assert_eq!((s.nodes, s.leaves, s.triangles, s.depth), (1, 2, 4, 1));
        assert_eq!((s.node_bytes, s.triangle_bytes), (56, 192));
        assert_eq!(s.children_histogram, [0, 0, 1]);
        assert_eq!((s.triangles_histogram[1], s.triangles_histogram[3]), (1, 1));
        assert_eq!((s.children_per_node, s.triangles_per_leaf), (2.0, 2.0));
    }
}
