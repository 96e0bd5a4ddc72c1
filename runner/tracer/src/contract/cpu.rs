//! The plain twin of `contract.glsl`.

use super::{ContractParams, Contraction, WideBvh, WideLeaf, WideNode, optimal};
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
        None => Subtree { cost: 0.0, triangles: 1, inner: 0, height: 0, levels: 0 },
    };
    let plans = match params.method {
        Contraction::Optimal => optimal::cpu::plan(tree, subtrees, scale, arity, &params.costs()),
        _ => Vec::new(),
    };
    let greedy = Greedy { tree, subtrees: &subtree, scale, arity, params, visits };

    let mut nodes: Vec<WideNode> = Vec::new();
    let mut sources = vec![tree.nodes.len() as u32 - 1];
    let mut first_triangle = 0;
    while nodes.len() < sources.len() {
        let from = sources[nodes.len()];
        let children: Vec<(u32, bool)> = match params.method {
            Contraction::Optimal => optimal::cpu::children(tree, &plans, from, arity)
                .into_iter()
                .map(|node| {
                    (node, (node as usize).checked_sub(tree.leaves).is_none_or(|inner| plans[inner].leaf))
                })
                .collect(),
            _ => greedy.children(from),
        };
        let of = |leaf: bool| children.iter().filter(move |child| child.1 == leaf).map(|child| child.0);
        let leaves: Vec<_> =
            of(true).map(|node| WideLeaf { node, triangles: subtree(node).triangles }).collect();
        let inner: Vec<u32> = of(false).collect();
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

/// Chooses the children of nodes one after the other: see `contract.glsl`.
struct Greedy<'a, S> {
    tree: &'a Bvh2,
    subtrees: &'a S,
    scale: f32,
    arity: usize,
    params: &'a ContractParams,
    visits: Visits<'a>,
}

/// A child that may still be opened.
#[derive(Clone, Copy)]
struct Candidate {
    node: u32,
    /// Whether it is a leaf.
    leaf: bool,
    /// How much it is worth to be opened; negative for not at all.
    worth: f32,
}

impl<S: Fn(u32) -> Subtree> Greedy<'_, S> {
    fn area(&self, node: u32) -> f32 {
        self.tree.nodes[node as usize].bounds().half_area(self.scale)
    }

    fn visited(&self, node: u32) -> u32 {
        match self.params.method.by_view() {
            true => self.visits.counts[node as usize - self.tree.leaves],
            false => 0,
        }
    }

    /// Of a node whose parent in the binary tree has `above`. See `worth` in `contract.glsl`.
    fn worth(&self, from: u32, node: u32, above: f32) -> f32 {
        let (own, whole) = (self.area(node), self.area(from));
        match self.params.method {
            Contraction::Sah => own * (self.subtrees)(node).triangles as f32,
            Contraction::Satc if own > self.params.alpha * whole => own,
            Contraction::Satc => -1.0,
            Contraction::Rdtc => {
                let (own, whole) = (self.visited(node), self.visited(from));
                let often = whole > self.visits.threshold && own as f32 > self.params.alpha * whole as f32;
                if often { own as f32 } else { -1.0 }
            }
            Contraction::Cbtc if self.visited(from) <= self.visits.threshold => own,
            Contraction::Cbtc if self.visited(node) > self.visits.threshold => {
                self.visited(node) as f32 * whole
            }
            Contraction::Cbtc => own * self.visited(from) as f32,
            Contraction::Wald | Contraction::Afra => own,
            Contraction::Fixed => above - 1.0,
            Contraction::Optimal => unreachable!("it plans ahead"),
        }
    }

    /// The children of the wide node that is made of inner node `from`, and whether each is a leaf.
    fn children(&self, from: u32) -> Vec<(u32, bool)> {
        let candidate = |node: u32, above: Candidate| {
            let leaf = above.leaf || (self.subtrees)(node).inner == 0;
            // Leaves can be opened where nothing else is left, and they hold more than one triangle.
            let alone = (self.subtrees)(node).triangles == 1;
            let worth = match leaf {
                true if self.params.method == Contraction::Afra && !alone => self.area(node),
                true => -1.0,
                false => self.worth(from, node, above.worth),
            };
            Candidate { node, leaf, worth }
        };
        let opened = |above: Candidate| {
            let node = self.tree.nodes[above.node as usize];
            [node.left, node.right].map(|child| candidate(child, above))
        };
        let root = Candidate { node: from, leaf: false, worth: self.arity.ilog2() as f32 - 1.0 };
        let mut candidates = opened(root).to_vec();
        while candidates.len() < self.arity {
            // Of equals the first.
            let best = |leaf: bool| {
                let fit = candidates.iter().enumerate().filter(|(_, candidate)| candidate.leaf == leaf);
                fit.fold((-1.0, None), |best, (slot, candidate)| {
                    if candidate.worth > best.0 { (candidate.worth, Some(slot)) } else { best }
                })
            };
            let Some(slot) = best(false).1.or_else(|| best(true).1) else { break };
            let [left, right] = opened(candidates[slot]);
            candidates[slot] = left;
            candidates.push(right);
        }
        candidates.iter().map(|candidate| (candidate.node, candidate.leaf)).collect()
    }
}
