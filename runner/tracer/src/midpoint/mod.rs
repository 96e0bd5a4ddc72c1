//! RTRS's binary tree (Lewis 2024, 3.1, figures 4 to 6): boxes halved in the middle, from the top down, on the CPU.
//!
//! ```text
//!   +-----------+-----------+
//!   |   /\      |    /\     |     the box of a node, halved along its longest axis;
//!   |  /. \     |   / .\    |     a triangle goes where its centroid is
//!   | /____\    |  /____\   |
//!   +-----------+-----------+
//!      first        second
//! ```
//!
//! There, a node is a leaf where it has no more triangles than a leaf may have, or where one half gets none. Here as
//! everywhere leaves of the binary tree have one triangle, and larger ones come of the collapse, which for this method
//! makes a leaf of every subtree that is small enough ([`crate::collapse::CollapseParams::by_size`]): the same leaves,
//! whatever their size, of one tree. We leave the paper in two points. Where one half gets none, triangles are halved by
//! count, in the order they have in the file, because leaves are limited; so they are from a depth on from which that just
//! suffices to stay within [`MAX_LEVELS`]. And the least size of a box, appendix B.3, is none.
//!
//! The tree is the same for any number of threads.

use crate::{
    assemble::{Child, Part, Tree, assemble},
    bvh2::{Aabb, Bvh2, Bvh2Node, LEAF, MAX_LEVELS, MAX_TRIANGLES, Triangle},
};
use rayon::prelude::*;

/// A triangle on its way to its leaf.
struct Item {
    centroid: [f32; 3],
    leaf: Bvh2Node,
}

/// Items of a node that one thread divides, with all nodes below it.
const PART: usize = 8192;

/// Builds the tree over `triangles`, nine finite floats each, with a leaf for each.
///
/// # Panics
/// There are no triangles or more than [`MAX_TRIANGLES`].
pub fn build(triangles: &[Triangle]) -> Bvh2 {
    let n = triangles.len();
    assert!((1..=MAX_TRIANGLES).contains(&n), "a tree has 1 to 2^27 triangles, not {n}");
    let items = (triangles.par_iter().zip(0..n as u32))
        .map(|(triangle, i)| {
            let sum = |k: usize| triangle.iter().map(|corner| f64::from(corner[k])).sum::<f64>();
            Item {
                centroid: std::array::from_fn(|k| (sum(k) / 3.0) as f32),
                leaf: Bvh2Node::new(Aabb::of(triangle), i, LEAF),
            }
        })
        .collect();
    assemble(large(items, 0))
}

/// The subtree over so many triangles that several threads share the work.
fn large(items: Vec<Item>, depth: usize) -> Tree {
    if items.len() <= PART {
        let mut part = Part::new(items.len());
        small(items, depth, &mut part);
        return Tree::Part(part);
    }
    let [first, second] = divide(items, depth);
    let (first, second) = rayon::join(|| large(first, depth + 1), || large(second, depth + 1));
    Tree::Fork(Box::new([first, second]))
}

fn small(items: Vec<Item>, depth: usize, part: &mut Part) -> Child {
    if let [item] = &items[..] {
        return part.leaf(item.leaf);
    }
    let children = divide(items, depth).map(|half| small(half, depth + 1, part));
    part.inner(children)
}

/// The two halves of a node's items, at least two, each in the order that they had; neither is empty.
fn divide(items: Vec<Item>, depth: usize) -> [Vec<Item>; 2] {
    let bounds = items.iter().fold(Aabb::EMPTY, |b, item| b.union(&item.leaf.bounds()));
    let axis = longest(&bounds);
    let middle = bounds.center()[axis];
    let in_first = |item: &Item| item.centroid[axis] <= middle;
    let first = items.iter().filter(|item| in_first(item)).count();
    // A child can have all items but one, so one level is kept in reserve.
    let must_halve = depth + 1 + items.len().next_power_of_two().ilog2() as usize > MAX_LEVELS;
    if must_halve || first == 0 || first == items.len() {
        let mut items = items;
        let second = items.split_off(items.len() / 2);
        return [items, second];
    }
    let (first, second) = items.into_iter().partition(in_first);
    [first, second]
}

/// The axis along which a box is halved (figure 5): z unless another is longer than both others.
fn longest(bounds: &Aabb) -> usize {
    // Halves, because the difference of two floats may be none.
    let [x, y, z] = std::array::from_fn(|k| 0.5 * bounds.hi[k] - 0.5 * bounds.lo[k]);
    if x > y && x > z {
        0
    } else if y > x && y > z {
        1
    } else {
        2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        collapse::{self, CollapseParams},
        validate,
    };

    /// Small triangles with these centroids.
    fn at(centroids: &[[f32; 3]]) -> Vec<Triangle> {
        let corners = [[-0.01, -0.01, 0.0], [0.02, -0.01, 0.0], [-0.01, 0.02, 0.0]];
        centroids.iter().map(|c| corners.map(|o| std::array::from_fn(|k| c[k] + o[k]))).collect()
    }

    /// The triangles of each leaf after the collapse, from left to right.
    fn leaves(triangles: &[Triangle], max_leaf: u32) -> Vec<Vec<u32>> {
        let tree = build(triangles);
        let params = CollapseParams { max_leaf, by_size: true, ..CollapseParams::default() };
        let subtrees = collapse::cpu::collapse(&tree, 1.0, &params);
        let mut found = Vec::new();
        let mut todo = vec![tree.nodes.len() as u32 - 1];
        while let Some(index) = todo.pop() {
            let is_leaf = (index as usize).checked_sub(tree.leaves).is_none_or(|i| subtrees[i].inner == 0);
            if is_leaf {
                let below = crate::contract::WideBvh::triangles_below(&tree, index);
                found.push(below.into_iter().map(|leaf| tree.nodes[leaf as usize].left).collect());
            } else {
                let node = tree.nodes[index as usize];
                todo.extend([node.right, node.left]);
            }
        }
        found
    }

    #[test]
    fn boxes_are_halved_in_the_middle_of_their_longest_axis() {
        // The middle in x is 5, then 2 on the left; on the right y is longer.
        let centroids =
            [[9.0, 8.0, 0.0], [0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
        let triangles = at(&centroids);
        assert_eq!(leaves(&triangles, 1), [vec![1], vec![4], vec![3], vec![2], vec![0]]);
        assert_eq!(leaves(&triangles, 2), [vec![1, 4], vec![3], vec![2, 0]]);
        assert_eq!(leaves(&triangles, 3), [vec![1, 4, 3], vec![2, 0]]);
        assert_eq!(validate::bvh2(&build(&triangles), &triangles), Ok(()));
    }

    #[test]
    fn of_equal_axes_the_last_is_taken() {
        let cube = |hi: [f32; 3]| longest(&Aabb { lo: [0.0; 3], hi });
        assert_eq!([cube([2.0, 1.0, 1.0]), cube([1.0, 2.0, 1.0]), cube([1.0, 1.0, 2.0])], [0, 1, 2]);
        assert_eq!([cube([2.0, 2.0, 1.0]), cube([1.0; 3]), cube([2.0, 1.0, 2.0])], [2, 2, 2]);
    }

    #[test]
    fn triangles_in_one_place_are_halved_by_count() {
        let triangles = at(&[[1.0, 2.0, 3.0]; 21]);
        let found = leaves(&triangles, 8);
        let sizes: Vec<usize> = found.iter().map(Vec::len).collect();
        assert_eq!(sizes, [5, 5, 5, 6]);
        assert_eq!(found.concat(), (0..21).collect::<Vec<_>>());
        assert_eq!(validate::bvh2(&build(&triangles), &triangles), Ok(()));
    }

    #[test]
    fn the_deepest_trees_stay_within_their_levels() {
        // Each half has one triangle and all the smaller ones, along x, then y, then z.
        let triangles: Vec<Triangle> = (0..700)
            .map(|i| {
                let size = 2f32.powi(120 - i / 3);
                let mut p = [0.0; 3];
                p[i as usize % 3] = size;
                [p; 3]
            })
            .collect();
        let tree = build(&triangles);
        assert!(tree.levels.len() > 200 && tree.levels.len() <= MAX_LEVELS, "{}", tree.levels.len());
        assert_eq!(validate::bvh2(&tree, &triangles), Ok(()));
    }

    #[test]
    fn many_triangles_make_the_same_tree_with_any_number_of_threads() {
        let mut random = 1u32;
        let mut next = || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 8) as f32 / 65536.0
        };
        let centroids: Vec<[f32; 3]> = (0..40_000).map(|_| std::array::from_fn(|_| next())).collect();
        let triangles = at(&centroids);
        let tree = build(&triangles);
        assert_eq!(validate::bvh2(&tree, &triangles), Ok(()));
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert!(alone.install(|| build(&triangles)) == tree);
    }
}
