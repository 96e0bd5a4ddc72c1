//! The plain twin of `closest_hits.glsl`: one ray at a time, so that nothing is ever put off.

use super::Order;
use crate::{
    layout::{LeafTriangles, compressed::CompressedNode},
    traverse::{Counts, Hit, Ray, cpu::Slab},
};

/// `PAD` in `node.glsl`.
const PAD: f32 = 1.5 * Slab::EXACT_PAD;

/// `inverse_octant` of `closest_hits.glsl`.
fn inverse_octant(order: Order, inverse: [f32; 3], first_node: u32) -> u32 {
    if order == Order::Random {
        let h = (first_node ^ 61 ^ first_node >> 16).wrapping_mul(9);
        let h = (h ^ h >> 4).wrapping_mul(0x27d4_eb2d);
        return (h ^ h >> 15) & 7;
    }
    (0..3).map(|k| u32::from(inverse[k] >= 0.0) << k).sum()
}

/// A group as the kernel keeps it: nodes if a bit above the 23rd is set.
#[derive(Clone, Copy)]
struct Group {
    first: u32,
    bits: u32,
}

const NODES: u32 = 0xff00_0000;

/// The nearest hit through compressed nodes; `extent` is the scene's largest absolute coordinate.
pub fn closest_hit(
    nodes: &[CompressedNode],
    triangles: &LeafTriangles,
    extent: f32,
    order: Order,
    ray: &Ray,
) -> (Hit, Counts) {
    let slab = Slab::new(ray, extent, PAD);
    let mut best = Hit { t: ray.t_max.min(f32::MAX), triangle: Hit::MISS };
    let mut counts = Counts::default();
    let mut stack = vec![Group { first: 0, bits: 1 << 31 }];
    while let Some(mut group) = stack.pop() {
        let octinv = inverse_octant(order, slab.inverse, group.first);
        let bit = group.bits.ilog2();
        group.bits ^= 1 << bit;
        let slot = (bit - 24) ^ octinv;
        let index = group.first + (group.bits & 255 & ((1 << slot) - 1)).count_ones();
        if group.bits & NODES != 0 {
            stack.push(group);
        }
        let node = &nodes[index as usize];
        counts.nodes += 1;
        counts.boxes += node.meta.iter().filter(|&&meta| meta != 0).count() as u32;
        let octinv = inverse_octant(order, slab.inverse, node.first_node);
        let (met, t) = meet(node, &slab, octinv, ray.t_min, best.t);
        let children = Group { first: node.first_node, bits: met & NODES | u32::from(node.imask) };
        if order == Order::Distance {
            let mut alone: Vec<(f32, u32)> = (0..8u32)
                .map(|slot| (t[slot as usize], 1 << (24 + (slot ^ octinv))))
                .filter(|(_, bit)| met & bit != 0)
                .collect();
            alone.sort_by(|a, b| b.0.total_cmp(&a.0));
            let imask = u32::from(node.imask);
            stack.extend(alone.into_iter().map(|(_, bit)| Group { bits: bit | imask, ..children }));
        } else if children.bits & NODES != 0 {
            stack.push(children);
        }
        for offset in (0..24).filter(|offset| met >> offset & 1 == 1) {
            let place = (node.first_triangle + offset) as usize;
            counts.triangles += 1;
            if let Some(t) = triangles.intersect(place, ray, best.t) {
                best = Hit { t, triangle: triangles.index(place) };
            }
        }
    }
    (if best.triangle == Hit::MISS { Hit::NONE } else { best }, counts)
}

/// `meet` of `node.glsl`.
fn meet(node: &CompressedNode, slab: &Slab, octinv: u32, t_min: f32, t_max: f32) -> (u32, [f32; 8]) {
    let step: [f32; 3] =
        std::array::from_fn(|k| f32::from_bits(u32::from(node.exponents[k]) << 23) * slab.inverse[k]);
    // Of the planes that the ray comes to first, and of the others.
    let along = |first: bool| -> [f32; 3] {
        std::array::from_fn(|k| {
            let lower = first == (slab.inverse[k] >= 0.0);
            let bias = if lower { slab.lower[k] } else { slab.upper[k] };
            f32::from_bits(node.origin[k]).mul_add(slab.inverse[k], bias)
        })
    };
    let (near, far) = (along(true), along(false));
    // Lines of the slots that the kernel decodes by logic have this much more, and pay for what that loses.
    const LINE_OFFSET: f32 = 32768.0;
    let of_offset = |bias: [f32; 3], outward: f32| -> [f32; 3] {
        std::array::from_fn(|k| step[k].mul_add(-LINE_OFFSET, bias[k]) + outward * step[k].abs() / 256.0)
    };
    let (near_of_offset, far_of_offset) = (of_offset(near, -1.0), of_offset(far, 1.0));
    let (mut met, mut t) = (0, [0.0; 8]);
    for (slot, t) in t.iter_mut().enumerate() {
        let (mut enters, mut leaves) = (0f32, t_max);
        let (offset, near, far) = match slot % 4 {
            1 | 2 => (LINE_OFFSET, &near_of_offset, &far_of_offset),
            _ => (0.0, &near, &far),
        };
        for k in 0..3 {
            let (first, second) = match slab.inverse[k] < 0.0 {
                false => (node.lo[k][slot], node.hi[k][slot]),
                true => (node.hi[k][slot], node.lo[k][slot]),
            };
            enters = enters.max((offset + f32::from(first)).mul_add(step[k], near[k]));
            leaves = leaves.min((offset + f32::from(second)).mul_add(step[k], far[k]));
        }
        *t = enters.max(t_min);
        if enters <= leaves {
            let meta = u32::from(node.meta[slot]);
            let inner = meta & meta << 1 & 0x10 != 0;
            let bit = (meta ^ if inner { octinv } else { 0 }) & 31;
            met |= (meta >> 5) << bit;
        }
    }
    (met, t)
}
