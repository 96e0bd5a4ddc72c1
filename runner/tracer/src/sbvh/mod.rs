//! The split bounding volume hierarchy, SBVH (Stich, Friedrich, Dietrich 2009, "Spatial Splits in Bounding
//! Volume Hierarchies"): a binary tree from the top down, on the CPU, better than PLOC's and slower to build.
//!
//! What is divided are references: a triangle's number and the box around a part of it. A node's references
//! are divided by their centres, as in every tree (an object split), or by a plane in space, at which the
//! triangles that cross it are cut in two references (a spatial split):
//!
//! ```text
//! object split                  spatial split             unsplit
//!    +-----------+                  |                          |
//!    | a  \     +---------+     a  \|     b                a  \|     b
//!    |     \    |  b  |   |         |\    |                 \  |     |
//!    |      \---|--+  |   |         | \   |                  \ |     |      where cutting c costs more
//!    +----------|--+  |   |     a   a  \  b             --c----|-    b      than a larger box does
//!               +---------+   left  |  right             left  |  right
//!    children: {a} {b}          children: {a} {a b}        children: {a c} {b}
//! ```
//!
//! The cheapest by the surface area heuristic is taken, down to one reference a leaf, as Ylitie, Karras and
//! Laine (2017, section 3.4) start from. Spatial splits are only tried where the boxes of the object split's
//! children overlap much (paper, section 4.5).
//!
//! We leave the paper in five points. Small nodes find their object split by a full sweep. A child of n
//! references is expected to cost not n times the area of its box but n^0.9 - 1/2 times: with one reference
//! a leaf its subtree has 2n - 1 nodes, whose boxes get smaller further down. That lowers the SAH cost by up
//! to 2% and adds fewer references: with n alone, triangles of quads are cut in vain. A cut triangle's box is
//! that of the polygon inside the reference's box, and it is conservative: computed in double precision,
//! rounded outwards, and met with the box it was cut from, so it always lies in the triangle's own box. The
//! number of references is bounded: what [`SbvhParams::budget`] allows is passed down the tree in proportion
//! to the references of the children, and where it is used up there are object splits only. And from a depth
//! on from which halving just suffices to stay within [`MAX_LEVELS`], nodes are halved by count.
//!
//! Where [`SbvhParams::reinsertions`] asks for it, subtrees are then moved to where they cost least: `reinsert.rs`.
//!
//! The tree is the same for any number of threads: what is shared out among them has fixed sizes, and sums
//! over it are of integers, or least and greatest coordinates.

pub mod cache;
mod clip;
mod divide;
mod reinsert;
mod split;

use crate::{
    assemble::{self, Part, Tree, assemble},
    bvh2::{Aabb, Bvh2, Bvh2Node, LEAF, MAX_LEVELS, MAX_TRIANGLES, Triangle},
    morton,
};
use divide::{Scratch, divide, divide_in_parallel};
use glam::{Vec3A, Vec4};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// What may be chosen about the tree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SbvhParams {
    /// Spatial splits are tried where the children of the best object split overlap in more than this share
    /// of the root's surface area. Smaller: more references and longer builds for lower cost; from 1 on
    /// there are no spatial splits, and a leaf for each triangle.
    pub alpha: f32,
    /// Bins an axis for object splits, 2 to 256. From 32 to 128 the SAH cost falls by 2% on sphereflake, which
    /// has detail at every scale, rises by 1% on living_room, and changes by less than 0.5% elsewhere.
    pub object_bins: u32,
    /// Bins an axis for spatial splits, 2 to 256. A triangle is cut at every plane between bins that it
    /// crosses, so large triangles cost in proportion: 16 halve the time of 32 on most scenes and 256 take two
    /// to three times as long, for up to 2% less SAH cost.
    pub spatial_bins: u32,
    /// Up to so many references an object split is found by sorting and sweeping them along each axis
    /// instead of by bins; at most 4096. From 16 to 256 the SAH cost changes by less than 0.5%, either way.
    pub sweep: u32,
    /// Most references that spatial splits may add, as a multiple of the triangles. Memory grows with it
    /// where triangles are long and overlap, in the tree and in everything made of it.
    pub budget: f32,
    /// Passes in which subtrees are moved to where they cost least, see `reinsert.rs`. Each takes two to four times as long
    /// as building the tree. Two lower the SAH cost by 7 %, and further ones by 1 %.
    pub reinsertions: u32,
}

impl Default for SbvhParams {
    fn default() -> Self {
        Self { alpha: 1e-5, object_bins: 32, spatial_bins: 32, sweep: 64, budget: 2.0, reinsertions: 0 }
    }
}

/// A part of a triangle, stored as the leaf it becomes: its box, and the triangle's number in `left`.
type Reference = Bvh2Node;

/// An [`Aabb`] in vector registers.
#[derive(Clone, Copy, Debug)]
struct Extent {
    lo: Vec3A,
    hi: Vec3A,
}

impl Extent {
    const EMPTY: Self = Self { lo: Vec3A::INFINITY, hi: Vec3A::NEG_INFINITY };

    #[inline]
    fn of(reference: &Reference) -> Self {
        let [lo, hi]: [[f32; 4]; 2] = bytemuck::cast(*reference);
        Self { lo: Vec3A::from_vec4(Vec4::from_array(lo)), hi: Vec3A::from_vec4(Vec4::from_array(hi)) }
    }

    #[inline]
    fn union(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    fn with(self, point: Vec3A) -> Self {
        Self { lo: self.lo.min(point), hi: self.hi.max(point) }
    }

    fn intersection(self, other: Self) -> Self {
        Self { lo: self.lo.max(other.lo), hi: self.hi.min(other.hi) }
    }

    fn is_empty(self) -> bool {
        self.lo.cmpgt(self.hi).any()
    }

    fn center(self) -> Vec3A {
        0.5 * self.lo + 0.5 * self.hi
    }

    /// [`Aabb::half_area`].
    #[inline]
    fn half_area(self, scale: f32) -> f32 {
        let [x, y, z] = ((self.hi - self.lo) * scale).to_array();
        x * y + y * z + z * x
    }
}

/// What is known of a node's references before they are divided.
#[derive(Clone, Copy, Debug)]
struct Group {
    /// Around their boxes.
    bounds: Extent,
    /// Around the centres of their boxes.
    centers: Extent,
    count: usize,
}

impl Group {
    const EMPTY: Self = Self { bounds: Extent::EMPTY, centers: Extent::EMPTY, count: 0 };

    fn add(&mut self, extent: Extent) {
        self.bounds = self.bounds.union(extent);
        self.centers = self.centers.with(extent.center());
        self.count += 1;
    }

    fn merge(self, other: Self) -> Self {
        Self {
            bounds: self.bounds.union(other.bounds),
            centers: self.centers.union(other.centers),
            count: self.count + other.count,
        }
    }

    fn of(references: &[Reference]) -> Self {
        let mut group = Self::EMPTY;
        references.iter().for_each(|r| group.add(Extent::of(r)));
        group
    }
}

/// What all nodes have in common.
struct Context<'a> {
    triangles: &'a [Triangle],
    params: &'a SbvhParams,
    /// The scene's: brings areas into the range of floats.
    scale: f32,
    /// Scaled half area of an overlap above which spatial splits are tried.
    overlap: f32,
    /// [`Context::weight`] of few references.
    weights: Vec<f32>,
}

impl Context<'_> {
    /// What a subtree over so many references is expected to cost for each unit of its box's area.
    fn weight(&self, count: u32) -> f32 {
        self.weights.get(count as usize).copied().unwrap_or_else(|| weight(count))
    }
}

/// [`Context::weight`], computed.
fn weight(count: u32) -> f32 {
    if count == 0 { 0.0 } else { (count as f32).powf(0.9) - 0.5 }
}

/// A node to be divided.
#[derive(Clone, Copy)]
struct Task {
    group: Group,
    /// Nodes above it.
    depth: usize,
    /// How many references its subtree may add.
    spare: usize,
}

impl Task {
    /// Whether only halving by count can keep the tree within [`MAX_LEVELS`]. A child can have as many
    /// references as its parent has, so one level is kept in reserve.
    fn must_halve(&self) -> bool {
        self.depth + 1 + self.group.count.next_power_of_two().ilog2() as usize > MAX_LEVELS
    }

    /// Its children.
    fn children(&self, groups: [Group; 2]) -> [Self; 2] {
        let sum = groups[0].count + groups[1].count;
        let left = self.spare - (sum - self.group.count);
        let first = (left as u128 * groups[0].count as u128 / sum as u128) as usize;
        let depth = self.depth + 1;
        [
            Self { group: groups[0], depth, spare: first },
            Self { group: groups[1], depth, spare: left - first },
        ]
    }
}

/// References that a thread takes at a time where a node's work is shared out; nodes of fewer are divided
/// by one thread, with all nodes below them.
const PART: usize = 8192;

/// Builds the tree over `triangles`, nine finite floats each.
///
/// The tree has a leaf for each reference: a triangle can be in several, and a leaf's box is around a part
/// of its triangle, inside the triangle's box; together they cover it ([`crate::validate::references`]).
/// Leaves and, within a level, inner nodes are in depth-first order; a level holds the nodes of one height.
///
/// # Panics
/// There are no triangles or more than [`MAX_TRIANGLES`], or a parameter is out of its documented range.
pub fn build(triangles: &[Triangle], params: &SbvhParams) -> Bvh2 {
    let n = triangles.len();
    assert!((1..=MAX_TRIANGLES).contains(&n), "a tree has 1 to 2^27 triangles, not {n}");
    for bins in [params.object_bins, params.spatial_bins] {
        assert!((2..=256).contains(&bins), "there are 2 to 256 bins, not {bins}");
    }
    assert!(params.sweep <= 4096, "up to 4096 references are swept, not {}", params.sweep);
    // Adding zero makes zeros positive: of zeros with two signs, the least would depend on the order.
    let references: Vec<Reference> = (triangles.par_iter().zip(0..n as u32))
        .map(|(triangle, i)| {
            let Aabb { lo, hi } = Aabb::of(triangle);
            Reference::new(Aabb { lo: lo.map(|x| x + 0.0), hi: hi.map(|x| x + 0.0) }, i, LEAF)
        })
        .collect();
    let group = references.par_chunks(PART).map(Group::of).reduce(|| Group::EMPTY, Group::merge);
    let bounds = morton::SceneBounds {
        centers: Aabb { lo: group.centers.lo.into(), hi: group.centers.hi.into() },
        boxes: Aabb { lo: group.bounds.lo.into(), hi: group.bounds.hi.into() },
    };
    let scale = bounds.scale();
    let overlap = params.alpha * group.bounds.half_area(scale);
    let context =
        Context { triangles, params, scale, overlap, weights: (0..PART as u32).map(weight).collect() };
    let spare = ((f64::from(params.budget) * n as f64) as usize).min(MAX_TRIANGLES - n);
    let tree = assemble(large(&context, references, Task { group, depth: 0, spare }));
    reinsert::reinsert(tree, params.reinsertions, scale)
}

/// The subtree over so many references that several threads share the work.
fn large(context: &Context<'_>, references: Vec<Reference>, task: Task) -> Tree {
    if references.len() <= PART {
        return Tree::Part(Small::build(context, references, task));
    }
    let ([left, right], groups) = divide_in_parallel(context, references, &task);
    let [left_task, right_task] = task.children(groups);
    let (left, right) = rayon::join(|| large(context, left, left_task), || large(context, right, right_task));
    Tree::Fork(Box::new([left, right]))
}

/// A subtree that one thread builds.
struct Small<'a> {
    context: &'a Context<'a>,
    /// References of nodes that are still to be divided, those of the next at the end:
    /// dividing a node replaces its references by those of its right child, then those of its left child.
    stack: Vec<Reference>,
    scratch: Scratch,
    part: Part,
}

impl<'a> Small<'a> {
    fn build(context: &'a Context<'a>, references: Vec<Reference>, task: Task) -> Part {
        let part = Part::new(references.len());
        let mut small = Self { context, stack: references, scratch: Scratch::default(), part };
        small.node(&task);
        small.part
    }

    /// Builds the subtree over the last references of the stack, and takes them off.
    fn node(&mut self, task: &Task) -> assemble::Child {
        let first = self.stack.len() - task.group.count;
        if task.group.count == 1 {
            return self.part.leaf(self.stack.pop().expect("there is one"));
        }
        let groups = divide(self.context, &mut self.stack, first, task, &mut self.scratch);
        let [left, right] = task.children(groups);
        let left = self.node(&left);
        let right = self.node(&right);
        self.part.inner([left, right])
    }
}
