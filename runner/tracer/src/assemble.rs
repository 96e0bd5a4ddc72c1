//! Putting subtrees together in the order in which a [`Bvh2`] has its nodes.

use crate::bvh2::{Aabb, Bvh2, Bvh2Node};
use bytemuck::Zeroable;
use rayon::prelude::*;

/// A tree in parts, before its nodes have numbers.
pub(crate) enum Tree {
    /// What one thread has built.
    Part(Part),
    /// A node and its subtrees.
    Fork(Box<[Tree; 2]>),
}

/// A subtree that one thread has built, or a node above such.
pub(crate) struct Part {
    /// In depth-first order.
    leaves: Vec<Bvh2Node>,
    /// Inner nodes of height 1, 2, …, in depth-first order, children before parents.
    levels: Vec<Vec<Inner>>,
}

/// A node, as its parent sees it.
#[derive(Clone, Copy)]
pub(crate) struct Child {
    bounds: Aabb,
    at: Place,
}

/// Where a node is.
#[derive(Clone, Copy)]
struct Place {
    /// The part it is in, in depth-first order.
    part: u32,
    /// Levels below it; a leaf has 0.
    height: u32,
    /// Among the nodes of the part that have this height.
    index: u32,
}

struct Inner {
    bounds: Aabb,
    children: [Place; 2],
}

impl Part {
    /// Holds nothing, and has room for so many leaves. Its places have `part` 0 until it is given a number.
    pub fn new(leaves: usize) -> Self {
        Self { leaves: Vec::with_capacity(leaves), levels: Vec::new() }
    }

    /// Adds a leaf.
    pub fn leaf(&mut self, leaf: Bvh2Node) -> Child {
        self.leaves.push(leaf);
        let index = self.leaves.len() as u32 - 1;
        Child { bounds: leaf.bounds(), at: Place { part: 0, height: 0, index } }
    }

    /// Adds the parent of nodes that were added before.
    pub fn inner(&mut self, children: [Child; 2]) -> Child {
        let [left, right] = children;
        let below = left.at.height.max(right.at.height) as usize;
        if self.levels.len() <= below {
            self.levels.resize_with(below + 1, Vec::new);
        }
        let level = &mut self.levels[below];
        let bounds = left.bounds.union(&right.bounds);
        level.push(Inner { bounds, children: [left.at, right.at] });
        Child { bounds, at: Place { part: 0, height: below as u32 + 1, index: level.len() as u32 - 1 } }
    }

    /// Its last node, once it is complete.
    fn root(&self) -> Child {
        let height = self.levels.len() as u32;
        let bounds = self.levels.last().map_or_else(|| self.leaves[0].bounds(), |level| level[0].bounds);
        Child { bounds, at: Place { part: 0, height, index: 0 } }
    }
}

/// A part in its place.
struct Numbered {
    part: Part,
    /// The numbers of its first nodes of height 0, 1, ….
    first: Vec<u32>,
    /// Whether children's places tell their part, as those of a node above parts do.
    above: bool,
}

/// Numbers all nodes.
pub(crate) fn assemble(tree: Tree) -> Bvh2 {
    let mut parts = Vec::new();
    flatten(tree, &mut parts);
    let most = parts.iter().map(|p| p.part.levels.len()).max().unwrap_or(0);
    let mut ends = vec![0u32; most + 1];
    let counts: Vec<Vec<u32>> = parts
        .iter()
        .map(|p| {
            let levels = p.part.levels.iter().map(|level| level.len() as u32);
            std::iter::once(p.part.leaves.len() as u32).chain(levels).collect()
        })
        .collect();
    counts.iter().for_each(|counts| ends.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count));
    let mut sum = 0;
    let mut next: Vec<u32> = (ends.iter_mut())
        .map(|end| {
            let begin = sum;
            sum += *end;
            *end = sum;
            begin
        })
        .collect();
    for (part, counts) in parts.iter_mut().zip(&counts) {
        part.first = next[..counts.len()].to_vec();
        next.iter_mut().zip(counts).for_each(|(next, count)| *next += count);
    }

    let mut nodes = vec![Bvh2Node::zeroed(); sum as usize];
    let mut places: Vec<Vec<&mut [Bvh2Node]>> = parts.iter().map(|_| Vec::new()).collect();
    let mut rest = &mut nodes[..];
    for height in 0..=most {
        for (places, counts) in places.iter_mut().zip(&counts) {
            if let Some(&count) = counts.get(height) {
                let (own, others) = rest.split_at_mut(count as usize);
                places.push(own);
                rest = others;
            }
        }
    }
    parts.par_iter().zip(places).for_each(|(own, mut places)| {
        let (leaves, levels) = places.split_first_mut().expect("every part has a list of leaves");
        leaves.copy_from_slice(&own.part.leaves);
        let number = |at: Place| {
            let part = if own.above { &parts[at.part as usize] } else { own };
            part.first[at.height as usize] + at.index
        };
        for (level, to) in own.part.levels.iter().zip(levels) {
            for (inner, node) in level.iter().zip(to.iter_mut()) {
                let [left, right] = inner.children.map(number);
                *node = Bvh2Node::new(inner.bounds, left, right);
            }
        }
    });
    let levels = ends.windows(2).map(|w| w[0]..w[1]).collect();
    Bvh2 { nodes, leaves: ends[0] as usize, levels }
}

/// Puts parts in a row, the nodes above them as parts of one node. Returns the root.
fn flatten(tree: Tree, parts: &mut Vec<Numbered>) -> Child {
    let (part, mut root, above) = match tree {
        Tree::Part(part) => {
            let root = part.root();
            (part, root, false)
        }
        Tree::Fork(subtrees) => {
            let children = subtrees.map(|tree| flatten(tree, parts));
            let mut part = Part::new(0);
            let root = part.inner(children);
            (part, root, true)
        }
    };
    root.at.part = parts.len() as u32;
    parts.push(Numbered { part, first: Vec::new(), above });
    root
}
