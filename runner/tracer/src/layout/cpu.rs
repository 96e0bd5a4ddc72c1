//! The plain twin of `encode.comp` and `triangles.comp`, for every layout.

use super::{Child, LayoutParams, LeafTriangle, NodeLayout, Stored, Target};
use crate::{
    bvh2::{Bvh2, Triangle},
    contract::WideBvh,
};

/// Of each place in the order of leaves, the leaf of the binary tree that is stored there.
pub fn places(wide: &WideBvh, tree: &Bvh2) -> Vec<u32> {
    let mut places = vec![0; tree.leaves];
    for node in &wide.nodes {
        let leaves = node.leaves.iter().flat_map(|leaf| WideBvh::triangles_below(tree, leaf.node));
        leaves.zip(node.first_triangle..).for_each(|(leaf, place)| places[place as usize] = leaf);
    }
    places
}

/// A wide tree's nodes in a layout, and its triangles where its leaves expect them. Nodes are in the tree's own order,
/// but for siblings of a layout whose slots have an order.
pub fn encode<L: NodeLayout>(
    wide: &WideBvh,
    tree: &Bvh2,
    triangles: &[Triangle],
    params: &LayoutParams,
) -> (Vec<L::Node>, Vec<LeafTriangle>) {
    let of_leaf = |leaf: u32| {
        let primitive = tree.nodes[leaf as usize].left;
        LeafTriangle::new(&triangles[primitive as usize], primitive)
    };
    let ordered = places(wide, tree).into_iter().map(of_leaf).collect();
    // Of each node, where it goes.
    let mut moved = vec![0; wide.nodes.len()];
    let arranged: Vec<Vec<Option<Child>>> = wide
        .nodes
        .iter()
        .map(|node| {
            let bounds = |index: u32| tree.nodes[index as usize].bounds();
            let mut first = node.first_triangle;
            let mut children = Vec::new();
            for leaf in &node.leaves {
                let target = Target::Leaf { first, count: leaf.triangles };
                children.push(Child { bounds: bounds(leaf.node), target });
                first += leaf.triangles;
            }
            children.extend(node.nodes.iter().enumerate().map(|(i, &index)| Child {
                bounds: bounds(index),
                target: Target::Node(node.first_node + i as u32),
            }));
            let seed = node.leaves.first().map_or_else(|| node.nodes[0], |leaf| leaf.node);
            let slots = L::slots(&children, seed, params);
            let mut arranged = vec![None; slots.iter().max().map_or(0, |last| last + 1)];
            slots.iter().zip(children).for_each(|(&slot, child)| arranged[slot] = Some(child));
            let mut next = node.first_node;
            for child in arranged.iter_mut().flatten() {
                if let Target::Node(index) = &mut child.target {
                    moved[*index as usize] = next;
                    *index = next;
                    next += 1;
                }
            }
            arranged
        })
        .collect();
    let mut placed = vec![Stored { children: &[], triangles: 0 }; wide.nodes.len()];
    for ((node, children), &place) in wide.nodes.iter().zip(&arranged).zip(&moved) {
        placed[place as usize] = Stored { children, triangles: node.triangles };
    }
    (L::encode(&placed, params), ordered)
}
