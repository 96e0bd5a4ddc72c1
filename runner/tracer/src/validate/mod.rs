//! Invariants of every tree and layout, checked on the CPU.

use crate::{
    bvh2::{Aabb, Bvh2, LEAF, MAX_LEVELS, Triangle},
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
    links(tree, n)?;
    let mut seen = vec![false; n];
    for (i, node) in tree.nodes[..n].iter().enumerate() {
        let primitive = node.left as usize;
        require!(!seen[primitive], "triangle {primitive} is in two leaves");
        seen[primitive] = true;
        require!(node.bounds() == Aabb::of(&triangles[primitive]), "leaf {i} has another triangle's box");
    }
    unions(tree)
}

/// Checks a binary tree whose leaves are around parts of triangles ([`crate::sbvh`]): every triangle is in
/// at least one leaf, a leaf's box lies in its triangle's box, the leaves' boxes together cover their
/// triangle; and the rest as in [`bvh2`].
///
/// That they cover it is tried out: with points spread over the triangle, and, since a gap would begin at
/// the side of a box, with those where its edges meet the planes of the boxes' sides.
///
/// # Errors
/// The first violation found.
pub fn references(tree: &Bvh2, triangles: &[Triangle]) -> Result<(), Invalid> {
    let n = triangles.len();
    links(tree, n)?;
    let mut boxes: Vec<Vec<Aabb>> = vec![Vec::new(); n];
    for (i, node) in tree.nodes[..tree.leaves].iter().enumerate() {
        let (primitive, bounds) = (node.left as usize, node.bounds());
        require!(!bounds.is_empty(), "the box of leaf {i} is empty");
        let inside = Aabb::of(&triangles[primitive]).contains(&bounds);
        require!(inside, "leaf {i} sticks out of the box of triangle {primitive}");
        boxes[primitive].push(bounds);
    }
    for (primitive, (boxes, triangle)) in boxes.iter().zip(triangles).enumerate() {
        require!(!boxes.is_empty(), "triangle {primitive} is in no leaf");
        if let Some(point) = uncovered(boxes, triangle) {
            return Err(Invalid(format!("no leaf of triangle {primitive} covers its point {point:?}")));
        }
    }
    unions(tree)
}

/// A point of the triangle that is in none of the boxes.
fn uncovered(boxes: &[Aabb], triangle: &Triangle) -> Option<[f64; 3]> {
    const STEPS: u32 = 6;
    let whole = Aabb::of(triangle);
    if boxes.iter().any(|b| b.contains(&whole)) {
        return None;
    }
    let corners = triangle.map(|p| p.map(f64::from));
    let [a, b, c] = corners;
    // Points are rounded, and may lie beside their triangle by that much.
    let error = corners.as_flattened().iter().fold(0.0f64, |m, x| m.max(x.abs())) * f64::EPSILON * 8.0;
    let inside = |p: &[f64; 3]| {
        let within =
            |b: &Aabb, k: usize| f64::from(b.lo[k]) - error <= p[k] && p[k] <= f64::from(b.hi[k]) + error;
        boxes.iter().any(|b| (0..3).all(|k| within(b, k)))
    };
    let spread = (0..=STEPS).flat_map(|i| (0..=STEPS - i).map(move |j| (i, j))).map(|(i, j)| {
        let [u, v, w] = [i, j, STEPS - i - j].map(|x| f64::from(x) / f64::from(STEPS));
        std::array::from_fn(|k| u * a[k] + v * b[k] + w * c[k])
    });
    let planes = boxes.iter().flat_map(|b| (0..3).flat_map(|k| [(k, b.lo[k]), (k, b.hi[k])]));
    let meeting = planes.flat_map(|(axis, plane)| {
        [(a, b), (b, c), (c, a)].into_iter().filter_map(move |(from, to)| {
            let t = (f64::from(plane) - from[axis]) / (to[axis] - from[axis]);
            (0.0..=1.0).contains(&t).then(|| std::array::from_fn(|k| from[k] + t * (to[k] - from[k])))
        })
    });
    spread.chain(meeting).find(|p| !inside(p))
}

/// Checks all of a binary tree but its boxes: how many nodes and levels there are, that leaves hold one of
/// `triangles` triangles, and that every node but the root has one parent in a later level.
///
/// # Errors
/// The first violation found.
pub(crate) fn links(tree: &Bvh2, triangles: usize) -> Result<(), Invalid> {
    let leaves = tree.leaves;
    require!(
        leaves > 0 && tree.nodes.len() == 2 * leaves - 1,
        "{} nodes for {leaves} leaves",
        tree.nodes.len()
    );
    require!(tree.levels.len() <= MAX_LEVELS, "{} levels", tree.levels.len());
    let mut end = leaves as u32;
    for (k, level) in tree.levels.iter().enumerate() {
        require!(level.start == end && level.end >= end, "level {k} is {level:?}, after {end}");
        end = level.end;
    }
    let ordered = !tree.levels.is_empty() || leaves == 1;
    require!(
        !ordered || end as usize == tree.nodes.len(),
        "levels end at node {end} of {}",
        tree.nodes.len()
    );
    for (i, node) in tree.nodes[..leaves].iter().enumerate() {
        require!(node.right == LEAF, "leaf {i} is not marked as one");
        require!((node.left as usize) < triangles, "leaf {i} holds triangle {} of {triangles}", node.left);
    }
    for (k, level) in tree.levels.iter().enumerate() {
        for i in level.clone() {
            let node = tree.nodes[i as usize];
            for child in [node.left, node.right] {
                require!(child < level.start, "node {i} of level {k} has child {child}");
            }
        }
    }
    // Without levels a node could be below itself; but then it is not below the root.
    let mut reached = vec![false; tree.nodes.len()];
    let mut todo = vec![tree.nodes.len() as u32 - 1];
    while let Some(i) = todo.pop() {
        let Some(seen) = reached.get_mut(i as usize) else {
            return Err(Invalid(format!("a node has child {i} of {}", tree.nodes.len())));
        };
        require!(!std::mem::replace(seen, true), "node {i} has two parents");
        if i as usize >= leaves {
            todo.extend([tree.nodes[i as usize].left, tree.nodes[i as usize].right]);
        }
    }
    let orphans = reached.iter().filter(|r| !**r).count();
    require!(orphans == 0, "{orphans} nodes are not below the root");
    Ok(())
}

/// Checks that an inner node's box is that of its children. All links are right.
fn unions(tree: &Bvh2) -> Result<(), Invalid> {
    for (i, node) in tree.nodes.iter().enumerate().skip(tree.leaves) {
        let [l, r] = [node.left, node.right].map(|c| tree.nodes[c as usize].bounds());
        require!(node.bounds() == l.union(&r), "the box of node {i} is not that of its children");
    }
    Ok(())
}

/// Checks a wide tree against the collapsed binary tree it was made of: every inner node of that has one
/// place inside one wide node, children lie where the seam promises them, runs of triangles fill the tree's
/// triangles without gaps or overlaps; and where the contraction `keeps_leaves`, leaves are those of the collapse.
///
/// # Errors
/// The first violation found.
pub fn wide(wide: &WideBvh, tree: &Bvh2, subtrees: &[Subtree], keeps_leaves: bool) -> Result<(), Invalid> {
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
            let is_leaf = !keeps_leaves || inner(leaf.node).is_none_or(|s| s.inner == 0);
            require!(is_leaf && leaf.triangles <= 16, "leaf {} is none", leaf.node);
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
                inner(child).is_some_and(|s| s.inner > 0 || !keeps_leaves),
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

/// Checks nodes in a layout: every node is reached once, every triangle is in a leaf and unchanged, or stored as
/// the map that belongs to it ([`crate::layout::UnitTriangle::fault`] says how exactly), and every child's box is
/// exactly, or where the layout rounds contains, the box of all below it. Returns the depth: nodes on the longest way
/// down.
///
/// `parts` are the boxes of the places in leaves where triangles may be in several ([`crate::sbvh`]); without them each
/// triangle is in one leaf, as a whole.
///
/// # Errors
/// The first violation found.
pub fn layout<L: NodeLayout>(
    nodes: &[L::Node],
    leaf_triangles: &LeafTriangles,
    triangles: &[Triangle],
    parts: Option<&[Aabb]>,
) -> Result<usize, Invalid> {
    let places = leaf_triangles.len();
    let n = parts.map_or(triangles.len(), <[Aabb]>::len);
    require!(places == n, "{places} triangles in leaves, not {n}");
    let mut seen = vec![false; triangles.len()];
    for i in 0..n {
        let p = leaf_triangles.index(i) as usize;
        require!(p < triangles.len(), "place {i} holds triangle {p} of {}", triangles.len());
        require!(parts.is_some() || !seen[p], "triangle {p} has two places");
        seen[p] = true;
        let fault = match leaf_triangles {
            LeafTriangles::Corners { triangles: stored, .. } => {
                (stored[i].corners() != triangles[p]).then(|| "it has other corners".into())
            }
            LeafTriangles::Edges(edges) => edges[i].fault(&triangles[p]),
            LeafTriangles::Maps { maps, .. } => maps[i].fault(&triangles[p]),
        };
        require!(fault.is_none(), "place {i} is not for triangle {p}: {}", fault.unwrap_or_default());
    }
    let missing = seen.iter().position(|seen| !seen);
    require!(missing.is_none(), "triangle {missing:?} has no place");
    let part = |place: usize| match parts {
        Some(parts) => parts[place],
        None => Aabb::of(&triangles[leaf_triangles.index(place) as usize]),
    };

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
        for item in (0..L::LIMITS.children).flat_map(|slot| L::own_items(nodes, i, slot)) {
            require!((item as usize) < nodes.len(), "item {item} of {}, below node {i}", nodes.len());
            require!(!reached[item as usize], "item {item} is taken twice");
            reached[item as usize] = true;
        }
        for child in children::<L>(nodes, i) {
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
        for child in children::<L>(nodes, i) {
            let bounds = match child.target {
                Target::Node(index) => exact[index as usize],
                Target::Leaf { first, count } => {
                    (first..first + count).fold(Aabb::EMPTY, |b, place| b.union(&part(place as usize)))
                }
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
            LayoutParams, LeafTriangle,
            binary::{self, Binary, BinaryNode},
        },
        ploc::{self, PlocParams},
        sbvh::{self, SbvhParams},
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
    fn a_sound_tree_of_references_passes_and_each_kind_of_damage_is_found() {
        // Long crossing slivers, which are cut.
        let triangles: Vec<Triangle> = (0..20)
            .map(|i| {
                let (x, y) = (i as f32, (i * 7 % 20) as f32);
                [[x, 0.0, 0.0], [20.0 - x, 20.0, y], [x + 0.5, 0.0, 0.0]]
            })
            .collect();
        let sound = sbvh::build(&triangles, &SbvhParams::default());
        let r = sound.leaves;
        assert!(r > triangles.len());
        assert_eq!(references(&sound, &triangles), Ok(()));
        let damage = |f: &dyn Fn(&mut Bvh2)| {
            let mut tree = sound.clone();
            f(&mut tree);
            references(&tree, &triangles).unwrap_err().0
        };
        assert!(damage(&|t| t.nodes[1].left = 20).contains("triangle 20 of 20"));
        assert!(damage(&|t| t.nodes[0].hi[1] = 21.0).contains("sticks out"));
        assert!(damage(&|t| t.nodes[0].hi[0] = -1.0).contains("is empty"));
        assert!(damage(&|t| t.nodes[r].left = t.nodes[r].right).contains("two parents"));
        assert!(damage(&|t| t.nodes[r].left = r as u32).contains("has child"));
        assert!(damage(&|t| t.nodes[r].lo[0] -= 1.0).contains("is not that of its children"));
        assert!(damage(&|t| t.levels.truncate(1)).contains("levels end"));
        assert!(damage(&|t| t.nodes.truncate(3)).contains("3 nodes"));
        // Each leaf in turn loses a little of its longest side, or its triangle.
        for leaf in 0..r {
            let e: [f32; 3] = std::array::from_fn(|k| sound.nodes[leaf].hi[k] - sound.nodes[leaf].lo[k]);
            let axis = (0..3).max_by(|&a, &b| e[a].total_cmp(&e[b])).unwrap();
            let lost = damage(&|t| t.nodes[leaf].hi[axis] -= 0.05 * e[axis]);
            assert!(lost.contains("covers"), "{lost}");
        }
        let triangles = strip(4);
        let sound = sbvh::build(&triangles, &SbvhParams::default());
        let mut tree = sound.clone();
        tree.nodes[0] = tree.nodes[1];
        assert!(references(&tree, &triangles).unwrap_err().0.contains("in no leaf"));
    }

    #[test]
    fn a_sound_wide_tree_passes_and_each_kind_of_damage_is_found() {
        let (_, tree) = build(20);
        let subtrees =
            collapse::cpu::collapse(&tree, 1.0, &CollapseParams { max_leaf: 2, ..Default::default() });
        let sound = contract::cpu::contract(&tree, &subtrees, 1.0, 4, &ContractParams::default(), None);
        assert_eq!(wide(&sound, &tree, &subtrees, true), Ok(()));
        let damage = |f: fn(&mut WideBvh)| {
            let mut damaged = sound.clone();
            f(&mut damaged);
            wide(&damaged, &tree, &subtrees, true).unwrap_err().0
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
        let (nodes, leaves) =
            crate::layout::cpu::encode::<Binary>(&wide, &tree, &triangles, &LayoutParams::default());
        let stored = TriangleTest::ALL.map(|test| LeafTriangles::new(test, leaves.clone()));
        for stored in &stored {
            assert_eq!(layout::<Binary>(&nodes, stored, &triangles, None), Ok(subtrees[18].height as usize));
        }
        let damage = |f: fn(&mut Vec<BinaryNode>, &mut Vec<LeafTriangle>)| {
            let (mut nodes, mut leaves) = (nodes.clone(), leaves.clone());
            f(&mut nodes, &mut leaves);
            let [corners, _, edges, maps] = TriangleTest::ALL.map(|test| {
                let leaves = LeafTriangles::new(test, leaves.clone());
                layout::<Binary>(&nodes, &leaves, &triangles, None).unwrap_err().0
            });
            assert_eq!((&corners, &corners), (&edges, &maps));
            corners
        };
        assert!(damage(|n, _| n[1].hi0[0] += 100.0).contains("larger box"));
        assert!(damage(|n, _| n[1].hi0[0] -= 0.25).contains("sticks out"));
        assert!(damage(|n, _| n[0].child0 = n[0].child1).contains("twice"));
        assert!(damage(|n, _| n.push(binary::EMPTY_NODE)).contains("not reached"));
        assert!(damage(|_, l| l.swap(0, 19)).contains("sticks out"));
        assert!(damage(|_, l| l[3] = l[4]).contains("two places"));
        let [.., LeafTriangles::Edges(mut edges), LeafTriangles::Maps { mut maps, indices }] = stored else {
            panic!("{stored:?}")
        };
        maps.swap(0, 19);
        let swapped = layout::<Binary>(&nodes, &LeafTriangles::Maps { maps, indices }, &triangles, None);
        assert!(swapped.unwrap_err().0.contains("place 0 is not for triangle"));
        edges[0].e2[1] += 1.0;
        let bent = layout::<Binary>(&nodes, &LeafTriangles::Edges(edges), &triangles, None);
        assert!(bent.unwrap_err().0.contains("place 0 is not for triangle"));
    }
}
