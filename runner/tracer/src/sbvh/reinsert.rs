//! Moving subtrees to where they cost least: reinsertion (Bittner, Hapala and Havran 2013, "Fast Insertion-Based
//! Optimization of Bounding Volume Hierarchies"), with searches in parallel (Meister and Bittner 2018, "Parallel Reinsertion
//! for Bounding Volume Hierarchy Optimization").
//!
//! A subtree x is taken out together with its parent p, and put back with p above some other node y:
//!
//! ```text
//!       g                  g                what it gains in area:
//!      / \                / \                 p is no longer around s and x, but around y and x
//!     p   …              s   …                what was around p and is not around y shrinks
//!    / \        to                            what is around y and was not around p grows
//!   s   x                 … y …  becomes  … p …
//!                                            / \
//!                                           y   x
//! ```
//!
//! The sum of areas is what the SAH cost of inner nodes follows. In each pass, the best place of every subtree is searched for
//! in the tree as it is, from its own place upwards, above each ancestor and into its sibling, and no deeper than could gain
//! more than the best so far. Then they are moved, whoever gains most first.
//!
//! We leave the paper in one point. There, moves that touch the same nodes are settled by locks, and boxes are mended once a
//! pass. Here they are made one after the other, each mends the boxes above it, and one that does not gain in the tree as it
//! is by then is not made. So each lowers the sum, no move can put a node below itself, and the result is the same for any
//! number of threads.

use super::Extent;
use crate::{
    assemble::{self, Part, assemble},
    bvh2::{Bvh2, Bvh2Node, MAX_LEVELS},
};
use rayon::prelude::*;

/// The parent of the root.
const NONE: u32 = u32::MAX;

/// A tree whose nodes are linked both ways, numbered as in the [`Bvh2`] that it was made from.
#[derive(Clone)]
struct Links {
    nodes: Vec<Bvh2Node>,
    parent: Vec<u32>,
    leaves: usize,
    /// Brings areas into the range of floats.
    scale: f32,
}

/// A move that would pay.
#[derive(Clone, Copy)]
struct Move {
    subtree: u32,
    /// What it becomes the sibling of.
    to: u32,
    /// By how much the sum of areas falls.
    gain: f32,
}

/// The same leaves in a tree of less SAH cost, after so many passes, or fewer where one moves nothing, or where a tree would
/// get more than [`MAX_LEVELS`] levels.
pub(super) fn reinsert(tree: Bvh2, passes: u32, scale: f32) -> Bvh2 {
    if passes == 0 || tree.leaves < 4 {
        return tree;
    }
    let mut links = Links::of(&tree, scale);
    let mut changed = false;
    for _ in 0..passes {
        let mut moves = links.moves();
        moves.par_sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.subtree.cmp(&b.subtree)));
        let before = links.clone();
        let made = moves.iter().filter(|&m| links.apply(m)).count();
        if made == 0 {
            break;
        }
        if links.height() > MAX_LEVELS {
            links = before;
            break;
        }
        changed = true;
    }
    if !changed {
        return tree;
    }
    let mut part = Part::new(tree.leaves);
    links.add_to(&mut part, links.root());
    assemble(assemble::Tree::Part(part))
}

impl Links {
    fn of(tree: &Bvh2, scale: f32) -> Self {
        let mut parent = vec![NONE; tree.nodes.len()];
        for (index, node) in tree.nodes.iter().enumerate().skip(tree.leaves) {
            [node.left, node.right].iter().for_each(|&child| parent[child as usize] = index as u32);
        }
        Self { nodes: tree.nodes.clone(), parent, leaves: tree.leaves, scale }
    }

    fn root(&self) -> u32 {
        // What is moved has a parent and a grandparent, so the root stays the root.
        self.parent.len() as u32 - 1
    }

    fn is_leaf(&self, index: u32) -> bool {
        (index as usize) < self.leaves
    }

    fn bounds(&self, index: u32) -> Extent {
        Extent::of(&self.nodes[index as usize])
    }

    fn set_bounds(&mut self, index: u32, bounds: Extent) {
        let node = &mut self.nodes[index as usize];
        (node.lo, node.hi) = (bounds.lo.into(), bounds.hi.into());
    }

    /// Of an inner node.
    fn children(&self, index: u32) -> [u32; 2] {
        let node = &self.nodes[index as usize];
        [node.left, node.right]
    }

    fn area(&self, extent: Extent) -> f32 {
        extent.half_area(self.scale)
    }

    fn parent(&self, index: u32) -> u32 {
        self.parent[index as usize]
    }

    fn sibling(&self, index: u32) -> u32 {
        let [left, right] = self.children(self.parent(index));
        if left == index { right } else { left }
    }

    /// The best move of each subtree that has one.
    fn moves(&self) -> Vec<Move> {
        let all = 0..self.root();
        all.into_par_iter()
            .map_init(Vec::new, |stack, subtree| self.search(subtree, stack))
            .flatten()
            .collect()
    }

    /// Where a subtree gains most, if it gains anything. `stack` is scratch, and empty.
    fn search(&self, subtree: u32, stack: &mut Vec<(f32, u32)>) -> Option<Move> {
        let parent = self.parent(subtree);
        if parent == self.root() {
            return None;
        }
        let own = self.bounds(subtree);
        let own_area = self.area(own);
        let mut best = Move { subtree, to: NONE, gain: 0.0 };
        // Puts it beside a node, and tells what of the gain there is left for places below.
        let consider = |best: &mut Move, gained: f32, to: u32| {
            let bounds = self.bounds(to);
            let gain = gained - self.area(bounds.union(own));
            if gain > best.gain {
                *best = Move { to, gain, ..*best };
            }
            gain + self.area(bounds)
        };
        // What taking it out gains below the place where it may go in.
        let mut gained = self.area(self.bounds(parent));
        // Into its own sibling it may go, but not beside it, where it is.
        let sibling = self.sibling(subtree);
        let mut rest = self.bounds(sibling);
        stack.push((gained - self.area(rest.union(own)) + self.area(rest), sibling));
        let mut below = parent;
        loop {
            while let Some((gained, index)) = stack.pop() {
                // A box around both is no smaller than its own.
                if self.is_leaf(index) || gained - own_area <= best.gain {
                    continue;
                }
                let [left, right] =
                    self.children(index).map(|child| (consider(&mut best, gained, child), child));
                // Where more is left first.
                let (first, second) = if left.0 > right.0 { (left, right) } else { (right, left) };
                stack.extend([second, first]);
            }
            if below == self.root() {
                break;
            }
            if below != parent {
                consider(&mut best, gained, below);
            }
            // One level up: `rest` is what is left of its box.
            let aside = self.sibling(below);
            stack.push((consider(&mut best, gained, aside), aside));
            below = self.parent(below);
            rest = rest.union(self.bounds(aside));
            gained += self.area(self.bounds(below)) - self.area(rest);
        }
        (best.to != NONE).then_some(best)
    }

    /// Moves a subtree if that still gains, and tells whether it does.
    fn apply(&mut self, wanted: &Move) -> bool {
        let Move { subtree, to, .. } = *wanted;
        let (parent, sibling) = (self.parent(subtree), self.sibling(subtree));
        let stays = self.parent(parent) == NONE || to == sibling || to == parent;
        if stays || self.is_below(to, subtree) {
            return false;
        }
        if self.take_out(subtree) + self.put_in(subtree, to) < 0.0 {
            return true;
        }
        self.take_out(subtree);
        self.put_in(subtree, sibling);
        false
    }

    fn is_below(&self, mut index: u32, ancestor: u32) -> bool {
        while index != NONE && index != ancestor {
            index = self.parent(index);
        }
        index == ancestor
    }

    /// Takes a subtree out together with its parent, whose place its sibling takes, and tells by how much areas grow.
    fn take_out(&mut self, subtree: u32) -> f64 {
        let (parent, sibling) = (self.parent(subtree), self.sibling(subtree));
        self.replace(parent, sibling);
        self.mend(self.parent(sibling)) - f64::from(self.area(self.bounds(parent)))
    }

    /// Puts a subtree that was taken out back, its parent around it and the node `to`, and tells by how much areas grow.
    fn put_in(&mut self, subtree: u32, to: u32) -> f64 {
        let parent = self.parent(subtree);
        self.replace(to, parent);
        let node = &mut self.nodes[parent as usize];
        (node.left, node.right) = (to, subtree);
        self.parent[to as usize] = parent;
        let bounds = self.bounds(to).union(self.bounds(subtree));
        self.set_bounds(parent, bounds);
        f64::from(self.area(bounds)) + self.mend(self.parent(parent))
    }

    /// Puts a node where another one is.
    fn replace(&mut self, old: u32, new: u32) {
        let parent = self.parent(old);
        self.parent[new as usize] = parent;
        let node = &mut self.nodes[parent as usize];
        *(if node.left == old { &mut node.left } else { &mut node.right }) = new;
    }

    /// Fits the boxes of a node and of all above it to their children, and tells by how much areas grow.
    fn mend(&mut self, mut index: u32) -> f64 {
        let mut grown = 0.0;
        while index != NONE {
            let [left, right] = self.children(index).map(|child| self.bounds(child));
            let bounds = left.union(right);
            grown += f64::from(self.area(bounds)) - f64::from(self.area(self.bounds(index)));
            self.set_bounds(index, bounds);
            index = self.parent(index);
        }
        grown
    }

    /// Levels of inner nodes.
    fn height(&self) -> usize {
        let mut highest = 0;
        let mut stack = vec![(self.root(), 1)];
        while let Some((index, depth)) = stack.pop() {
            if !self.is_leaf(index) {
                highest = highest.max(depth);
                stack.extend(self.children(index).map(|child| (child, depth + 1)));
            }
        }
        highest
    }

    /// Adds a subtree to a part. No deeper than there are levels, of which there are few.
    fn add_to(&self, part: &mut Part, index: u32) -> assemble::Child {
        if self.is_leaf(index) {
            return part.leaf(self.nodes[index as usize]);
        }
        let children = self.children(index).map(|child| self.add_to(part, child));
        part.inner(children)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bvh2::{Aabb, LEAF, Triangle},
        sbvh::{SbvhParams, build},
        validate,
    };

    /// Points of a sequence without repetition, as triangles around them.
    fn triangles(count: u32, size: f32) -> Vec<Triangle> {
        (0..count)
            .map(|i| {
                let unit = |prime: u32| (i * prime % 1013) as f32 / 1013.0;
                let p = [unit(211), unit(571), unit(887)];
                [p, [p[0] + size * unit(97), p[1], p[2]], [p[0], p[1] + size * unit(389), p[2] + size]]
            })
            .collect()
    }

    /// Every leaf beside all before it: about the worst tree there is.
    fn chain(triangles: &[Triangle]) -> Bvh2 {
        let leaf = |(i, t)| Bvh2Node::new(Aabb::of(t), i as u32, LEAF);
        let leaves: Vec<Bvh2Node> = triangles.iter().enumerate().map(leaf).collect();
        let mut part = Part::new(leaves.len());
        let mut root = part.leaf(leaves[0]);
        for &leaf in &leaves[1..] {
            let leaf = part.leaf(leaf);
            root = part.inner([root, leaf]);
        }
        assemble(assemble::Tree::Part(part))
    }

    fn area(links: &Links) -> f64 {
        (links.leaves as u32..=links.root()).map(|i| f64::from(links.area(links.bounds(i)))).sum()
    }

    #[test]
    fn a_search_finds_what_trying_all_places_finds() {
        let triangles = triangles(24, 0.3);
        let mut gains = 0;
        for tree in
            [chain(&triangles), build(&triangles, &SbvhParams { alpha: 1.0, ..SbvhParams::default() })]
        {
            let links = Links::of(&tree, 1.0);
            for subtree in 0..links.root() {
                let parent = links.parent(subtree);
                if parent == links.root() {
                    continue;
                }
                let mut best = 0.0;
                for to in 0..links.root() {
                    if to != parent && to != links.sibling(subtree) && !links.is_below(to, subtree) {
                        let mut tried = links.clone();
                        let grown = tried.take_out(subtree) + tried.put_in(subtree, to);
                        assert!((area(&tried) - area(&links) - grown).abs() < 1e-4, "{subtree} to {to}");
                        best = f64::max(best, -grown);
                    }
                }
                let found = links.search(subtree, &mut Vec::new()).map_or(0.0, |m| f64::from(m.gain));
                assert!((found - best).abs() < 1e-4, "{subtree}: {found}, and there is {best}");
                gains += usize::from(found > 0.0);
            }
        }
        assert!(gains > 20, "{gains}");
    }

    #[test]
    fn a_move_that_does_not_gain_leaves_all_as_it_was() {
        let triangles = triangles(200, 0.1);
        let tree = build(&triangles, &SbvhParams { reinsertions: 8, ..SbvhParams::default() });
        let mut links = Links::of(&tree, 1.0);
        let (before, sum) = (links.clone(), area(&links));
        let mut refused = 0;
        for subtree in (0..links.root()).step_by(7) {
            for to in (0..links.root()).step_by(11) {
                refused += usize::from(!links.apply(&Move { subtree, to, gain: 1.0 }));
                assert!(area(&links) <= sum + 1e-6);
            }
        }
        assert!(refused > 500, "{refused}");
        for index in 0..=links.root() {
            assert_eq!(links.parent(index), before.parent(index), "{index}");
            assert_eq!(
                links.nodes[index as usize].bounds(),
                before.nodes[index as usize].bounds(),
                "{index}"
            );
        }
    }

    #[test]
    fn the_worst_tree_becomes_a_good_one() {
        let triangles = triangles(200, 0.02);
        let cost = |tree: &Bvh2| area(&Links::of(tree, 1.0));
        let worst = chain(&triangles);
        let moved = reinsert(worst.clone(), 20, 1.0);
        assert_eq!(validate::bvh2(&moved, &triangles), Ok(()));
        let built = build(&triangles, &SbvhParams { alpha: 1.0, ..SbvhParams::default() });
        assert!(cost(&moved) < 1.1 * cost(&built), "{}, {}, {}", cost(&worst), cost(&moved), cost(&built));
        assert!(cost(&worst) > 5.0 * cost(&built));
    }

    #[test]
    fn trees_that_would_get_too_deep_stay_as_they_are() {
        // Each around all before it, so that the best tree is a chain.
        let triangles: Vec<Triangle> = (0..400)
            .map(|i| {
                let r = 1.06f32.powi(i);
                [[-r, -r, -r], [r, r, -r], [r, -r, r]]
            })
            .collect();
        let params = SbvhParams { alpha: 1.0, ..SbvhParams::default() };
        for reinsertions in [1, 3, 30] {
            let tree = build(&triangles, &SbvhParams { reinsertions, ..params.clone() });
            assert_eq!(validate::bvh2(&tree, &triangles), Ok(()));
            assert!(tree.levels.len() <= MAX_LEVELS, "{}", tree.levels.len());
        }
    }
}
