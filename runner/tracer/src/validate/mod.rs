//! Invariants of every tree and layout, checked on the CPU.

use crate::{
    bvh2::{Aabb, Bvh2, LEAF, Triangle},
    layout::{LeafTriangle, NodeLayout, Target, children},
};

/// What is wrong with a tree, in words that name the node.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct Invalid(pub String);

macro_rules! require {
    ($holds:expr, $($what:tt)*) => {
        if !$holds {
            return Err(Invalid(format!($($what)*)));
        }
    };
}

/// Checks a binary tree against the triangles it was built over: every triangle is in one leaf, every
/// node but the root has one parent in a later level, boxes are exactly those of what they contain.
///
/// # Errors
/// The first violation found.
pub fn bvh2(tree: &Bvh2, triangles: &[Triangle]) -> Result<(), Invalid> {
    let n = triangles.len();
    require!(tree.leaves == n, "{} leaves for {n} triangles", tree.leaves);
    require!(tree.nodes.len() == 2 * n - 1, "{} nodes for {n} triangles", tree.nodes.len());
    let mut end = n as u32;
    for (k, level) in tree.levels.iter().enumerate() {
        require!(level.start == end && level.end >= end, "level {k} is {level:?}, after {end}");
        end = level.end;
    }
    require!(end as usize == tree.nodes.len(), "levels end at node {end} of {}", tree.nodes.len());

    let mut seen = vec![false; n];
    for (i, node) in tree.nodes[..n].iter().enumerate() {
        require!(node.right == LEAF, "leaf {i} is not marked as one");
        let primitive = node.left as usize;
        require!(primitive < n, "leaf {i} holds triangle {primitive} of {n}");
        require!(!seen[primitive], "triangle {primitive} is in two leaves");
        seen[primitive] = true;
        require!(node.bounds() == Aabb::of(&triangles[primitive]), "leaf {i} has another triangle's box");
    }
    let mut has_parent = vec![false; tree.nodes.len()];
    for (k, level) in tree.levels.iter().enumerate() {
        for i in level.clone() {
            let node = tree.nodes[i as usize];
            for child in [node.left, node.right] {
                require!(child < level.start, "node {i} of level {k} has child {child}");
                require!(!has_parent[child as usize], "node {child} has two parents");
                has_parent[child as usize] = true;
            }
            let [l, r] = [node.left, node.right].map(|c| tree.nodes[c as usize].bounds());
            require!(node.bounds() == l.union(&r), "the box of node {i} is not that of its children");
        }
    }
    let orphans = has_parent.iter().filter(|p| !**p).count();
    require!(orphans == 1 && !has_parent[tree.nodes.len() - 1], "{orphans} nodes have no parent");
    Ok(())
}

/// Checks nodes in a layout: every node is reached once, every triangle is in one leaf and unchanged, and
/// every box contains the boxes and triangles below it. Returns the depth: nodes on the longest way down.
///
/// # Errors
/// The first violation found.
pub fn layout<L: NodeLayout>(
    nodes: &[L::Node],
    leaf_triangles: &[LeafTriangle],
    triangles: &[Triangle],
) -> Result<usize, Invalid> {
    let n = triangles.len();
    require!(leaf_triangles.len() == n, "{} triangles in leaves, {n} in the scene", leaf_triangles.len());
    let mut seen = vec![false; n];
    for (i, t) in leaf_triangles.iter().enumerate() {
        let p = t.primitive as usize;
        require!(p < n, "place {i} holds triangle {p} of {n}");
        require!(!seen[p], "triangle {p} has two places");
        seen[p] = true;
        require!(t.corners() == triangles[p], "place {i} holds other corners than triangle {p}");
    }

    let mut reached = vec![false; nodes.len()];
    let mut in_leaf = vec![false; n];
    let mut depth = 0;
    // A node, its own depth, and the box that its parent keeps for it.
    let mut stack = vec![(0u32, 1, None::<Aabb>)];
    while let Some((i, at, bounds)) = stack.pop() {
        require!((i as usize) < nodes.len(), "node {i} of {}", nodes.len());
        require!(!reached[i as usize], "node {i} is reached twice");
        reached[i as usize] = true;
        depth = depth.max(at);
        let within = |b: &Aabb| bounds.is_none_or(|outer| outer.contains(b));
        let mut in_node = 0;
        let mut empty = true;
        for child in children::<L>(&nodes[i as usize]) {
            empty = false;
            require!(within(&child.bounds), "a child's box sticks out of node {i}");
            match child.target {
                Target::Node(index) => stack.push((index, at + 1, Some(child.bounds))),
                Target::Leaf { first, count } => {
                    let (first, count) = (first as usize, count as usize);
                    require!(
                        (1..=L::LIMITS.triangles_per_leaf).contains(&count),
                        "a leaf of node {i} has {count} triangles"
                    );
                    require!(first + count <= n, "a leaf of node {i} ends at {} of {n}", first + count);
                    in_node += count;
                    for t in first..first + count {
                        require!(!in_leaf[t], "place {t} is in two leaves");
                        in_leaf[t] = true;
                        let own = Aabb::of(&leaf_triangles[t].corners());
                        require!(child.bounds.contains(&own), "place {t} sticks out of its leaf in node {i}");
                    }
                }
            }
        }
        require!(!empty, "node {i} has no child");
        require!(in_node <= L::LIMITS.triangles_per_node, "the leaves of node {i} have {in_node} triangles");
    }
    let unreached = reached.iter().filter(|r| !**r).count();
    require!(unreached == 0, "{unreached} nodes are not reached");
    let outside = in_leaf.iter().filter(|r| !**r).count();
    require!(outside == 0, "{outside} triangles are in no leaf");
    Ok(depth)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        collapse::{self, CollapseParams},
        layout::binary::{self, Binary},
        ploc::{self, PlocParams},
    };

    fn strip(n: usize) -> Vec<Triangle> {
        (0..n).map(|i| [[i as f32, 0.0, 0.0], [i as f32 + 0.5, 0.0, 0.0], [i as f32, 1.0, 0.0]]).collect()
    }

    fn build(n: usize) -> (Vec<Triangle>, Bvh2) {
        let triangles = strip(n);
        let order: Vec<u32> = (0..n as u32).collect();
        let tree = ploc::cpu::build(&triangles, &order, 1.0, &PlocParams::default());
        (triangles, tree)
    }

    #[test]
    fn a_sound_tree_passes_and_each_kind_of_damage_is_found() {
        let (triangles, sound) = build(20);
        assert_eq!(bvh2(&sound, &triangles), Ok(()));
        let damage = |f: fn(&mut Bvh2)| {
            let mut tree = sound.clone();
            f(&mut tree);
            bvh2(&tree, &triangles).unwrap_err().0
        };
        assert!(damage(|t| t.nodes[1] = t.nodes[0]).contains("two leaves"));
        assert!(damage(|t| t.nodes[25].left = t.nodes[24].left).contains("two parents"));
        assert!(damage(|t| t.nodes[25].hi[0] += 1.0).contains("the box of node 25"));
        assert!(damage(|t| t.nodes[20].left = 38).contains("has child"));
        assert!(damage(|t| t.levels.truncate(1)).contains("levels end"));
    }

    #[test]
    fn a_sound_layout_passes_and_each_kind_of_damage_is_found() {
        let (triangles, tree) = build(20);
        let subtrees =
            collapse::cpu::collapse(&tree, 1.0, &CollapseParams { max_leaf: 2, ..Default::default() });
        let (nodes, leaves) = binary::cpu::rearrange(&tree, &subtrees, &triangles);
        assert_eq!(layout::<Binary>(&nodes, &leaves, &triangles), Ok(subtrees[18].height as usize));
        let damage = |f: fn(&mut Vec<binary::BinaryNode>, &mut Vec<LeafTriangle>)| {
            let (mut nodes, mut leaves) = (nodes.clone(), leaves.clone());
            f(&mut nodes, &mut leaves);
            layout::<Binary>(&nodes, &leaves, &triangles).unwrap_err().0
        };
        assert!(damage(|n, _| n[1].hi0[0] += 100.0).contains("sticks out"));
        assert!(damage(|n, _| n[0].child0 = n[0].child1).contains("twice"));
        assert!(damage(|n, _| n.push(binary::EMPTY_NODE)).contains("not reached"));
        assert!(damage(|_, l| l.swap(0, 19)).contains("sticks out"));
        assert!(damage(|_, l| l[3] = l[4]).contains("two places"));
    }
}
