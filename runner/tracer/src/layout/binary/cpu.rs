//! The plain twin of `rearrange.comp` and `triangles.comp`.

use super::{Binary, BinaryNode, EMPTY_NODE};
use crate::{
    bvh2::{Bvh2, Triangle},
    collapse::Subtree,
    layout::{Child, LeafTriangle, NodeLayout, Target},
};

/// Nodes depth first, and triangles in the order of their leaves.
pub fn rearrange(
    tree: &Bvh2,
    subtrees: &[Subtree],
    triangles: &[Triangle],
) -> (Vec<BinaryNode>, Vec<LeafTriangle>) {
    let leaf_triangle = |leaf: u32| {
        let primitive = tree.nodes[leaf as usize].left;
        LeafTriangle::new(&triangles[primitive as usize], primitive)
    };
    let root = tree.nodes.len() - 1;
    if root == 0 {
        let only = Child { bounds: tree.nodes[0].bounds(), target: Target::Leaf { first: 0, count: 1 } };
        return (vec![Binary::encode(&[only])], vec![leaf_triangle(0)]);
    }

    let mut nodes = vec![EMPTY_NODE; subtrees[root - tree.leaves].inner as usize];
    let mut ordered = vec![LeafTriangle::new(&Triangle::default(), 0); tree.leaves];
    // Where each node goes: a node's index if it stays one, and the first of its triangles.
    let mut stack = vec![(root as u32, Some(0), 0)];
    while let Some((index, place, first)) = stack.pop() {
        if (index as usize) < tree.leaves {
            ordered[first as usize] = leaf_triangle(index);
            continue;
        }
        let node = tree.nodes[index as usize];
        let of = |i: u32| match (i as usize).checked_sub(tree.leaves) {
            Some(inner) => subtrees[inner],
            None => Subtree { cost: 0.0, triangles: 1, inner: 0, height: 0 },
        };
        let (l, r) = (of(node.left), of(node.right));
        let child = |i: u32, of: Subtree, at: Option<u32>, first: u32| Child {
            bounds: tree.nodes[i as usize].bounds(),
            target: match at {
                Some(at) if of.inner > 0 => Target::Node(at),
                _ => Target::Leaf { first, count: of.triangles },
            },
        };
        let (left_at, right_at) = (place.map(|p| p + 1), place.map(|p| p + 1 + l.inner));
        let right_first = first + l.triangles;
        if let Some(place) = place {
            nodes[place as usize] = Binary::encode(&[
                child(node.left, l, left_at, first),
                child(node.right, r, right_at, right_first),
            ]);
        }
        stack.push((node.left, left_at.filter(|_| l.inner > 0), first));
        stack.push((node.right, right_at.filter(|_| r.inner > 0), right_first));
    }
    (nodes, ordered)
}
