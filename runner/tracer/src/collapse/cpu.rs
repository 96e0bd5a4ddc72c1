//! The plain twin of `collapse.comp`.

use super::{CollapseParams, Subtree};
use crate::bvh2::Bvh2;

/// What becomes of each inner node's subtree, in the order of the inner nodes; `scale` is the scene's.
pub fn collapse(tree: &Bvh2, scale: f32, params: &CollapseParams) -> Vec<Subtree> {
    let root = tree.nodes.len() - 1;
    let unknown = Subtree { cost: 0.0, triangles: 0, inner: 0, height: 0, levels: 0 };
    let mut all = vec![unknown; tree.leaves - 1];
    for index in tree.upwards() {
        let node = tree.nodes[index as usize];
        let child = |i: u32| {
            let i = i as usize;
            if i >= tree.leaves {
                all[i - tree.leaves]
            } else {
                let cost = params.intersection_cost * tree.nodes[i].bounds().half_area(scale);
                Subtree { cost, triangles: 1, inner: 0, height: 0, levels: 0 }
            }
        };
        let (l, r) = (child(node.left), child(node.right));
        let area = node.bounds().half_area(scale);
        let triangles = l.triangles + r.triangles;
        let levels = 1 + l.levels.max(r.levels);
        let as_inner = params.traversal_cost * area + (l.cost + r.cost);
        let as_leaf = params.intersection_cost * area * triangles as f32;
        let cheaper = params.by_size || as_leaf <= as_inner;
        let is_leaf = triangles <= params.max_leaf && cheaper && index as usize != root;
        all[index as usize - tree.leaves] = if is_leaf {
            Subtree { cost: as_leaf, triangles, inner: 0, height: 0, levels }
        } else {
            Subtree {
                cost: as_inner,
                triangles,
                inner: 1 + l.inner + r.inner,
                height: 1 + l.height.max(r.height),
                levels,
            }
        };
    }
    all
}
