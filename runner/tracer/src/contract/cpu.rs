//! The plain twin of `contract.glsl`.

use super::{ContractParams, Contraction, WideBvh, WideLeaf, WideNode};
use crate::{bvh2::Bvh2, collapse::Subtree};

/// Visit counts and the threshold t above which they are trusted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Visits<'a> {
    /// Of each inner node of the binary tree.
    pub counts: &'a [u32],
    /// The threshold.
    pub threshold: u32,
}

/// Contracts a collapsed tree; `scale` is the scene's. Nodes are numbered level by level, so the result is
/// [canonical](WideBvh::canonical).
///
/// # Panics
/// The method goes by view and there are no visits.
pub fn contract(
    tree: &Bvh2,
    subtrees: &[Subtree],
    scale: f32,
    arity: usize,
    params: &ContractParams,
    visits: Option<Visits<'_>>,
) -> WideBvh {
    assert!(visits.is_some() || !params.method.by_view(), "{} needs visits", params.method);
    let visits = visits.unwrap_or_default();
    if tree.leaves == 1 {
        let leaves = vec![WideLeaf { node: 0, triangles: 1 }];
        let root = WideNode { first_node: 0, first_triangle: 0, triangles: 1, leaves, nodes: Vec::new() };
        return WideBvh { arity, nodes: vec![root] };
    }
    let subtree = |node: u32| match (node as usize).checked_sub(tree.leaves) {
        Some(inner) => subtrees[inner],
        None => Subtree { cost: 0.0, triangles: 1, inner: 0, height: 0 },
    };
    let area = |node: u32| tree.nodes[node as usize].bounds().half_area(scale);
    let visited = |node: u32| match params.method.by_view() {
        true => visits.counts[node as usize - tree.leaves],
        false => 0,
    };
    // See `worth` in `contract.glsl`.
    let worth = |parent: u32, node: u32| {
        if subtree(node).inner == 0 {
            return -1.0;
        }
        let (own, whole) = (area(node), area(parent));
        match params.method {
            Contraction::Sah => own * subtree(node).triangles as f32,
            Contraction::Satc if own > params.alpha * whole => own,
            Contraction::Satc => -1.0,
            Contraction::Rdtc => {
                let (own, whole) = (visited(node), visited(parent));
                let often = whole > visits.threshold && own as f32 > params.alpha * whole as f32;
                if often { own as f32 } else { -1.0 }
            }
            Contraction::Cbtc if visited(parent) <= visits.threshold => own,
            Contraction::Cbtc if visited(node) > visits.threshold => visited(node) as f32 * whole,
            Contraction::Cbtc => own * visited(parent) as f32,
        }
    };

    let mut nodes: Vec<WideNode> = Vec::new();
    let mut sources = vec![tree.nodes.len() as u32 - 1];
    let mut first_triangle = 0;
    while nodes.len() < sources.len() {
        let from = sources[nodes.len()];
        let node = tree.nodes[from as usize];
        let mut children = vec![node.left, node.right];
        while children.len() < arity {
            // Of equals the first.
            let best = children.iter().enumerate().fold((-1.0, None), |best, (slot, &child)| {
                let value = worth(from, child);
                if value > best.0 { (value, Some(slot)) } else { best }
            });
            let (_, Some(slot)) = best else { break };
            let opened = tree.nodes[children[slot] as usize];
            children[slot] = opened.left;
            children.push(opened.right);
        }
        let (leaves, inner): (Vec<u32>, Vec<u32>) = children.iter().partition(|&&c| subtree(c).inner == 0);
        let leaves: Vec<_> =
            leaves.into_iter().map(|node| WideLeaf { node, triangles: subtree(node).triangles }).collect();
        let own: u32 = leaves.iter().map(|l| l.triangles).sum();
        nodes.push(WideNode {
            first_node: if inner.is_empty() { 0 } else { sources.len() as u32 },
            first_triangle: if leaves.is_empty() { 0 } else { first_triangle },
            triangles: subtree(from).triangles,
            leaves,
            nodes: inner.clone(),
        });
        first_triangle += own;
        sources.extend(inner);
    }
    WideBvh { arity, nodes }
}
