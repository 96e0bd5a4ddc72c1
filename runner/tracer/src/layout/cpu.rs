//! The plain twin of `encode.comp` and `triangles.comp`, for every layout.

use super::{Child, LeafTriangle, NodeLayout, Target};
use crate::{
    bvh2::{Bvh2, Triangle},
    contract::WideBvh,
};

/// A wide tree's nodes in a layout, in its own order, and its triangles where its leaves expect them.
pub fn encode<L: NodeLayout>(
    wide: &WideBvh,
    tree: &Bvh2,
    triangles: &[Triangle],
) -> (Vec<L::Node>, Vec<LeafTriangle>) {
    let mut ordered = vec![LeafTriangle::new(&Triangle::default(), 0); tree.leaves];
    let encoded = wide.nodes.iter().map(|node| {
        let bounds = |index: u32| tree.nodes[index as usize].bounds();
        let mut first = node.first_triangle;
        let mut children = Vec::new();
        for leaf in &node.leaves {
            let target = Target::Leaf { first, count: leaf.triangles };
            children.push(Child { bounds: bounds(leaf.node), target });
            for below in WideBvh::triangles_below(tree, leaf.node) {
                let primitive = tree.nodes[below as usize].left;
                ordered[first as usize] = LeafTriangle::new(&triangles[primitive as usize], primitive);
                first += 1;
            }
        }
        children.extend(node.nodes.iter().enumerate().map(|(i, &index)| Child {
            bounds: bounds(index),
            target: Target::Node(node.first_node + i as u32),
        }));
        L::encode(&children, node.triangles)
    });
    (encoded.collect(), ordered)
}
