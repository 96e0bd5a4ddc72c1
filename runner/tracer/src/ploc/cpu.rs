//! The plain twin: the same tree, bit for bit.

use super::{PlocParams, Step};
use crate::bvh2::{Aabb, Bvh2, Bvh2Node, LEAF, Triangle};

/// Builds the tree over `triangles`, whose order along the curve is `order`; `scale` is the scene's.
///
/// # Panics
/// There are no triangles.
pub fn build(triangles: &[Triangle], order: &[u32], scale: f32, params: &PlocParams) -> Bvh2 {
    assert!(!order.is_empty(), "a tree has at least one triangle");
    let leaves = order.len();
    let mut nodes: Vec<Bvh2Node> = order
        .iter()
        .map(|&primitive| Bvh2Node::new(Aabb::of(&triangles[primitive as usize]), primitive, LEAF))
        .collect();
    let mut clusters: Vec<u32> = (0..u32::try_from(leaves).expect("indices fit u32")).collect();
    let mut levels = Vec::new();
    let mut step = Step::first(leaves);
    while clusters.len() > 1 {
        let boxes: Vec<Aabb> = clusters.iter().map(|&c| nodes[c as usize].bounds()).collect();
        let nearest: Vec<usize> = (0..clusters.len())
            .map(|i| {
                if step.forced {
                    if i ^ 1 < clusters.len() { i ^ 1 } else { i }
                } else {
                    nearest(&boxes, i, scale, params.radius as usize)
                }
            })
            .collect();
        let begin = nodes.len() as u32;
        let mut next = Vec::with_capacity(clusters.len());
        for (i, &partner) in nearest.iter().enumerate() {
            let mutual = partner != i && nearest[partner] == i;
            if !mutual {
                next.push(clusters[i]);
            } else if i < partner {
                next.push(nodes.len() as u32);
                let merged = boxes[i].union(&boxes[partner]);
                nodes.push(Bvh2Node::new(merged, clusters[i], clusters[partner]));
            }
        }
        levels.push(begin..nodes.len() as u32);
        step = step.after(next.len());
        clusters = next;
    }
    // An iteration may find no pair at all before it is forced; such a level is empty, and kept, because
    // the GPU keeps it.
    Bvh2 { nodes, leaves, levels }
}

/// `nearest_cluster` in `ploc.glsl`.
fn nearest(boxes: &[Aabb], own: usize, scale: f32, radius: usize) -> usize {
    let mut best = (f32::MAX, usize::MAX, own);
    for other in own.saturating_sub(radius)..(own + radius + 1).min(boxes.len()) {
        if other == own {
            continue;
        }
        let area = boxes[own].union(&boxes[other]).half_area(scale);
        let tie = own ^ other;
        if area < best.0 || (area == best.0 && tie < best.1) {
            best = (area, tie, other);
        }
    }
    best.2
}
