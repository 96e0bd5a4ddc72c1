//! The plain twin of `costs.comp`, and the way down that `contract.glsl` takes by it.

use super::Costs;
use crate::{bvh2::Bvh2, collapse::Subtree};

/// What was decided about an inner node.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// C(n, 1) to C(n, arity - 1), in units of the scaled half area.
    pub costs: Vec<f32>,
    /// For up to 2, 3, … arity trees, how many of them may lie below the left child; 0 where fewer are as good.
    pub left: Vec<usize>,
    /// Whether it is a leaf where it is a single tree.
    pub leaf: bool,
}

/// The plan of each inner node; `scale` is the scene's.
pub fn plan(tree: &Bvh2, subtrees: &[Subtree], scale: f32, arity: usize, costs: &Costs) -> Vec<Plan> {
    let area = |node: u32| tree.nodes[node as usize].bounds().half_area(scale);
    let mut plans = vec![Plan { costs: Vec::new(), left: Vec::new(), leaf: false }; tree.leaves - 1];
    for index in tree.upwards() {
        let node = tree.nodes[index as usize];
        // C(child, i).
        let cost = |child: u32, i: usize| match (child as usize).checked_sub(tree.leaves) {
            Some(inner) => plans[inner].costs[i - 1],
            None => costs.triangle * area(child),
        };
        // D(n, j) and its k.
        let distribute = |j: usize| {
            (1..j).fold((f32::INFINITY, 1), |best, k| {
                let cost = cost(node.left, k) + cost(node.right, j - k);
                if cost < best.0 { (cost, k) } else { best }
            })
        };
        let own = area(index);
        let inner = index as usize - tree.leaves;
        let triangles = subtrees[inner].triangles;
        let as_inner = distribute(arity).0 + costs.node * own;
        let as_leaf = costs.triangle * own * triangles as f32;
        let leaf = triangles <= costs.max_leaf && as_leaf <= as_inner;
        let mut least = vec![if leaf { as_leaf } else { as_inner }];
        let mut left = Vec::new();
        for j in 2..=arity {
            let (cost, k) = distribute(j);
            let fewer = least[least.len() - 1];
            // A wide node has at least two children.
            left.push(if j == arity || cost < fewer { k } else { 0 });
            least.push(cost.min(fewer));
        }
        least.truncate(arity - 1);
        plans[inner] = Plan { costs: least, left, leaf };
    }
    plans
}

/// The children of the wide node that is made of inner node `from`, from left to right.
pub fn children(tree: &Bvh2, plans: &[Plan], from: u32, arity: usize) -> Vec<u32> {
    let plan = |node: u32| (node as usize).checked_sub(tree.leaves).map(|inner| &plans[inner]);
    let mut found = Vec::new();
    let split = |node: u32, roots: usize, k: usize| {
        let node = tree.nodes[node as usize];
        [(node.right, roots - k), (node.left, k)]
    };
    let root = plan(from).expect("leaves have no children");
    let mut todo = split(from, arity, root.left[arity - 2]).to_vec();
    while let Some((node, mut roots)) = todo.pop() {
        let Some(plan) = plan(node) else {
            found.push(node);
            continue;
        };
        while roots > 1 && plan.left[roots - 2] == 0 {
            roots -= 1;
        }
        match roots {
            1 => found.push(node),
            _ => todo.extend(split(node, roots, plan.left[roots - 2])),
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bvh2::Triangle,
        collapse::{self, CollapseParams},
        ploc::{self, PlocParams},
    };
    use proptest::prelude::*;

    /// The costs of every way of making a subtree a forest of at most `roots` trees, the least of them: equation 4
    /// itself, with nothing remembered and nothing left out.
    fn brute_force(tree: &Bvh2, node: u32, roots: usize, arity: usize, costs: &Costs) -> f64 {
        let area = f64::from(tree.nodes[node as usize].bounds().half_area(1.0));
        let below = crate::contract::WideBvh::triangles_below(tree, node).len();
        let (c_node, c_prim) = (f64::from(costs.node), f64::from(costs.triangle));
        let as_leaf =
            if below <= costs.max_leaf as usize { area * below as f64 * c_prim } else { f64::INFINITY };
        if (node as usize) < tree.leaves {
            return as_leaf;
        }
        let forest = |roots: usize| {
            let own = tree.nodes[node as usize];
            (1..roots)
                .map(|k| {
                    brute_force(tree, own.left, k, arity, costs)
                        + brute_force(tree, own.right, roots - k, arity, costs)
                })
                .fold(f64::INFINITY, f64::min)
        };
        let single = as_leaf.min(forest(arity) + area * c_node);
        (2..=roots).map(forest).fold(single, f64::min)
    }

    fn made_of(triangles: &[Triangle]) -> (Bvh2, Vec<Subtree>) {
        let order: Vec<u32> = (0..triangles.len() as u32).collect();
        let tree = ploc::cpu::build(triangles, &order, 1.0, &PlocParams::default());
        let subtrees = collapse::cpu::collapse(&tree, 1.0, &CollapseParams::default());
        (tree, subtrees)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        #[test]
        fn no_contraction_costs_less(
            corners in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-1f32..1.0)), 2..9),
            (node, triangle, max_leaf) in (0.1f32..4.0, 0.0f32..2.0, 1u32..5),
        ) {
            let (tree, subtrees) = made_of(&corners);
            let costs = Costs { node, triangle, max_leaf };
            for arity in [2, 4, 6, 8] {
                let plans = plan(&tree, &subtrees, 1.0, arity, &costs);
                for (inner, plan) in plans.iter().enumerate() {
                    let index = (tree.leaves + inner) as u32;
                    for (roots, &cost) in (1..).zip(&plan.costs) {
                        let least = brute_force(&tree, index, roots, arity, &costs);
                        prop_assert!((f64::from(cost) - least).abs() <= 1e-4 * least, "{cost} {least}");
                    }
                }
            }
        }
    }
}
