//! Invariants of every tree and layout, checked on the CPU.

use crate::{
    bvh2::{Aabb, Bvh2, LEAF, Triangle},
    collapse::Subtree,
    contract::WideBvh,
    layout::{LeafTriangles, NodeLayout, Target, children},
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

/// Checks a wide tree against the collapsed binary tree it was made of: every inner node of that has one
/// place inside one wide node, children lie where the seam promises them, runs of triangles fill the tree's
/// triangles without gaps or overlaps.
///
/// # Errors
/// The first violation found.
pub fn wide(wide: &WideBvh, tree: &Bvh2, subtrees: &[Subtree]) -> Result<(), Invalid> {
    let inner = |node: u32| (node as usize).checked_sub(tree.leaves).map(|i| subtrees[i]);
    let mut reached = vec![false; wide.nodes.len()];
    let mut runs = Vec::new();
    let mut todo = vec![(0u32, tree.nodes.len() as u32 - 1)];
    while let Some((index, from)) = todo.pop() {
        require!((index as usize) < wide.nodes.len(), "wide node {index} of {}", wide.nodes.len());
        require!(!reached[index as usize], "wide node {index} is reached twice");
        reached[index as usize] = true;
        let node = &wide.nodes[index as usize];
        let count = node.leaves.len() + node.nodes.len();
        let least = if tree.leaves == 1 { 1 } else { 2 };
        require!((least..=wide.arity).contains(&count), "wide node {index} has {count} children");
        let triangles = inner(from).map_or(1, |s| s.triangles);
        require!(
            node.triangles == triangles,
            "wide node {index} has {} triangles, not {triangles}",
            node.triangles
        );
        // Going down from its binary node, every way has to end at exactly one of its children.
        let mut ends: Vec<u32> =
            node.leaves.iter().map(|l| l.node).chain(node.nodes.iter().copied()).collect();
        let mut below = vec![from];
        while let Some(at) = below.pop() {
            if let Some(end) = ends.iter().position(|&e| e == at) {
                ends.swap_remove(end);
                continue;
            }
            require!(at as usize >= tree.leaves, "leaf {at} is in no child of wide node {index}");
            below.extend([tree.nodes[at as usize].left, tree.nodes[at as usize].right]);
        }
        require!(ends.is_empty(), "wide node {index} has children that are not below it: {ends:?}");
        let mut first = node.first_triangle;
        for leaf in &node.leaves {
            let size = inner(leaf.node).map_or(1, |s| s.triangles);
            require!(inner(leaf.node).is_none_or(|s| s.inner == 0), "leaf {} is none", leaf.node);
            require!(
                leaf.triangles == size,
                "leaf {} has {} triangles, not {size}",
                leaf.node,
                leaf.triangles
            );
            runs.push((first, first + size));
            first += size;
        }
        for (i, &child) in node.nodes.iter().enumerate() {
            require!(
                inner(child).is_some_and(|s| s.inner > 0),
                "node {child} is a leaf, in wide node {index}"
            );
            todo.push((node.first_node + i as u32, child));
        }
    }
    let unreached = reached.iter().filter(|r| !**r).count();
    require!(unreached == 0, "{unreached} wide nodes are not reached");
    runs.sort_unstable();
    let mut end = 0;
    for (first, last) in runs {
        require!(first == end, "triangles of a leaf start at {first}, those before end at {end}");
        end = last;
    }
    require!(end as usize == tree.leaves, "leaves hold {end} of {} triangles", tree.leaves);
    Ok(())
}

/// Checks nodes in a layout: every node is reached once, every triangle is in one leaf and unchanged, or stored as
/// the map that belongs to it ([`crate::layout::UnitTriangle::fault`] says how exactly), and every child's box is exactly, or where the layout rounds contains, the box of all triangles below it.
/// Returns the depth: nodes on the longest way down.
///
/// # Errors
/// The first violation found.
pub fn layout<L: NodeLayout>(
    nodes: &[L::Node],
    leaf_triangles: &LeafTriangles,
    triangles: &[Triangle],
) -> Result<usize, Invalid> {
    let n = triangles.len();
    require!(leaf_triangles.len() == n, "{} triangles in leaves, {n} in the scene", leaf_triangles.len());
    let mut seen = vec![false; n];
    for i in 0..n {
        let p = leaf_triangles.index(i) as usize;
        require!(p < n, "place {i} holds triangle {p} of {n}");
        require!(!seen[p], "triangle {p} has two places");
        seen[p] = true;
        match leaf_triangles {
            LeafTriangles::Corners { triangles: stored, .. } => {
                require!(
                    stored[i].corners() == triangles[p],
                    "place {i} holds other corners than triangle {p}"
                );
            }
            LeafTriangles::Maps { maps, .. } => {
                let fault = maps[i].fault(&triangles[p]);
                require!(fault.is_none(), "place {i} is not for triangle {p}: {}", fault.unwrap_or_default());
            }
        }
    }

    // From the root down, in the order in which nodes are reached: children come after their parents.
    let mut reached = vec![false; nodes.len()];
    let mut in_leaf = vec![false; n];
    let mut order = vec![(0u32, 1)];
    let mut next = 0;
    while let Some(&(i, depth)) = order.get(next) {
        next += 1;
        require!((i as usize) < nodes.len(), "node {i} of {}", nodes.len());
        require!(!reached[i as usize], "node {i} is reached twice");
        reached[i as usize] = true;
        let (mut in_node, mut empty) = (0, true);
        for child in children::<L>(&nodes[i as usize]) {
            empty = false;
            match child.target {
                Target::Node(index) => order.push((index, depth + 1)),
                Target::Leaf { first, count } => {
                    let (first, count) = (first as usize, count as usize);
                    require!(
                        (1..=L::LIMITS.triangles_per_leaf).contains(&count),
                        "a leaf of node {i} has {count} triangles"
                    );
                    require!(first + count <= n, "a leaf of node {i} ends at {} of {n}", first + count);
                    in_node += count;
                    for (place, taken) in in_leaf.iter_mut().enumerate().skip(first).take(count) {
                        require!(!*taken, "place {place} is in two leaves");
                        *taken = true;
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

    let mut exact = vec![Aabb::EMPTY; nodes.len()];
    for &(i, _) in order.iter().rev() {
        for child in children::<L>(&nodes[i as usize]) {
            let bounds = match child.target {
                Target::Node(index) => exact[index as usize],
                Target::Leaf { first, count } => (first as usize..(first + count) as usize)
                    .map(|place| &triangles[leaf_triangles.index(place) as usize])
                    .fold(Aabb::EMPTY, |b, t| b.union(&Aabb::of(t))),
            };
            require!(child.bounds.contains(&bounds), "something sticks out of a child of node {i}");
            require!(
                !L::EXACT || child.bounds == bounds,
                "a child of node {i} has a larger box than it needs"
            );
            exact[i as usize] = exact[i as usize].union(&bounds);
        }
    }
    Ok(order.last().map_or(0, |&(_, depth)| depth))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        collapse::{self, CollapseParams},
        contract::{self, ContractParams},
        layout::{
            LeafTriangle,
            binary::{self, Binary, BinaryNode},
        },
        ploc::{self, PlocParams},
        traverse::TriangleTest,
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
    fn a_sound_wide_tree_passes_and_each_kind_of_damage_is_found() {
        let (_, tree) = build(20);
        let subtrees =
            collapse::cpu::collapse(&tree, 1.0, &CollapseParams { max_leaf: 2, ..Default::default() });
        let sound = contract::cpu::contract(&tree, &subtrees, 1.0, 4, &ContractParams::default(), None);
        assert_eq!(wide(&sound, &tree, &subtrees), Ok(()));
        let damage = |f: fn(&mut WideBvh)| {
            let mut damaged = sound.clone();
            f(&mut damaged);
            wide(&damaged, &tree, &subtrees).unwrap_err().0
        };
        assert!(damage(|w| w.nodes[0].triangles += 1).contains("21 triangles, not 20"));
        assert!(damage(|w| w.nodes[2].first_node = 1).contains("reached twice"));
        assert!(damage(|w| w.nodes[0].nodes.swap(0, 1)).contains("not"));
        assert!(damage(|w| w.nodes[1].first_triangle += 1).contains("start at"));
        assert!(damage(|w| w.nodes[0].nodes.truncate(3)).contains("in no child"));
        let bottom = sound.nodes.len() - 1;
        assert!(!sound.nodes[bottom].leaves.is_empty());
        assert!(damage(|w| w.nodes.last_mut().unwrap().leaves[0].triangles += 1).contains("triangles, not"));
    }

    #[test]
    fn a_sound_layout_passes_and_each_kind_of_damage_is_found() {
        let (triangles, tree) = build(20);
        let subtrees =
            collapse::cpu::collapse(&tree, 1.0, &CollapseParams { max_leaf: 2, ..Default::default() });
        let wide = contract::cpu::contract(&tree, &subtrees, 1.0, 2, &ContractParams::default(), None);
        let (nodes, leaves) = crate::layout::cpu::encode::<Binary>(&wide, &tree, &triangles);
        let stored = TriangleTest::ALL.map(|test| LeafTriangles::new(test, leaves.clone()));
        for stored in &stored {
            assert_eq!(layout::<Binary>(&nodes, stored, &triangles), Ok(subtrees[18].height as usize));
        }
        let damage = |f: fn(&mut Vec<BinaryNode>, &mut Vec<LeafTriangle>)| {
            let (mut nodes, mut leaves) = (nodes.clone(), leaves.clone());
            f(&mut nodes, &mut leaves);
            let [corners, _, maps] = TriangleTest::ALL.map(|test| {
                let leaves = LeafTriangles::new(test, leaves.clone());
                layout::<Binary>(&nodes, &leaves, &triangles).unwrap_err().0
            });
            assert_eq!(corners, maps);
            corners
        };
        assert!(damage(|n, _| n[1].hi0[0] += 100.0).contains("larger box"));
        assert!(damage(|n, _| n[1].hi0[0] -= 0.25).contains("sticks out"));
        assert!(damage(|n, _| n[0].child0 = n[0].child1).contains("twice"));
        assert!(damage(|n, _| n.push(binary::EMPTY_NODE)).contains("not reached"));
        assert!(damage(|_, l| l.swap(0, 19)).contains("sticks out"));
        assert!(damage(|_, l| l[3] = l[4]).contains("two places"));
        let [.., LeafTriangles::Maps { mut maps, indices }] = stored else { panic!("{stored:?}") };
        maps.swap(0, 19);
        let swapped = layout::<Binary>(&nodes, &LeafTriangles::Maps { maps, indices }, &triangles);
        assert!(swapped.unwrap_err().0.contains("place 0 is not for triangle"));
    }
}
