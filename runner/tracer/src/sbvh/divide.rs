//! Dividing a node's references among its children.

use super::{
    Context, Extent, Group, PART, Reference, Task,
    clip::clip,
    split::{Bin, Grid, Side, Split, bin_objects, bin_parts, cheapest_of_bins, sweep},
};
use crate::bvh2::Aabb;
use rayon::prelude::*;

/// Working memory for the nodes of a thread.
#[derive(Default)]
pub(super) struct Scratch {
    bins: Vec<Bin>,
    after: Vec<(f32, u32)>,
    orders: [Vec<u64>; 3],
    node: Vec<Reference>,
    left: Vec<Reference>,
}

/// Divides the references of `stack` from `first` on: those of the right child take their places, those of
/// the left child follow.
pub(super) fn divide(
    context: &Context<'_>,
    stack: &mut Vec<Reference>,
    first: usize,
    task: &Task,
    scratch: &mut Scratch,
) -> [Group; 2] {
    let Scratch { bins, after, orders, node, left } = scratch;
    let (params, group) = (context.params, &task.group);
    node.clear();
    node.extend_from_slice(&stack[first..]);
    let mut objects = None;
    let mut grid = None;
    if !task.must_halve() {
        if node.len() <= params.sweep as usize {
            objects = sweep(context, node, group, orders, bins, after);
        } else {
            let by_centers = Grid::new(group.centers, params.object_bins as usize);
            refill(bins, &by_centers);
            bin_objects(node, &by_centers, bins);
            objects = cheapest_of_bins(context, bins, node.len(), after);
            grid = Some(by_centers);
        }
        let (least, overlap) = object_split(context, group, objects);
        if task.spare > 0 && overlap > context.overlap {
            // Finer bins than this are of no use to a few references.
            let bins_wanted = (4 * node.len()).next_power_of_two().min(params.spatial_bins as usize);
            let space = Grid::new(group.bounds, bins_wanted);
            refill(bins, &space);
            bin_parts(context, node, &space, bins);
            let spatial = cheapest_of_bins(context, bins, node.len() + task.spare, after);
            if let Some(split) = spatial.filter(|s| s.cost < least) {
                stack.truncate(first);
                left.clear();
                let groups = split_references(context, node, &space, &split, left, stack);
                if groups.iter().all(|g| g.count > 0) {
                    stack.append(left);
                    return groups;
                }
            }
        }
    }
    stack.truncate(first);
    left.clear();
    let groups = match (objects, grid) {
        (Some(split), Some(grid)) => by_centers(node, &grid, &split, left, stack),
        (Some(split), None) => {
            let place = |&key: &u64| node[key as u32 as usize];
            let (before, from) = orders[split.axis].split_at(split.bin);
            left.extend(before.iter().map(place));
            stack.extend(from.iter().map(place));
            [Group::of(left), Group::of(&stack[first..])]
        }
        (None, _) => {
            halve(group, node);
            let (before, from) = node.split_at(node.len() / 2);
            left.extend_from_slice(before);
            stack.extend_from_slice(from);
            [Group::of(before), Group::of(from)]
        }
    };
    stack.append(left);
    groups
}

/// The same for a node of many references: they are shared out among threads in parts of a fixed size.
pub(super) fn divide_in_parallel(
    context: &Context<'_>,
    mut node: Vec<Reference>,
    task: &Task,
) -> ([Vec<Reference>; 2], [Group; 2]) {
    let (params, group) = (context.params, &task.group);
    let mut after = Vec::new();
    if !task.must_halve() {
        let grid = Grid::new(group.centers, params.object_bins as usize);
        let bins = bin_in_parallel(&node, &grid, |part, bins| bin_objects(part, &grid, bins));
        let objects = cheapest_of_bins(context, &bins, node.len(), &mut after);
        let (least, overlap) = object_split(context, group, objects);
        if task.spare > 0 && overlap > context.overlap {
            let space = Grid::new(group.bounds, params.spatial_bins as usize);
            let bins = bin_in_parallel(&node, &space, |part, bins| bin_parts(context, part, &space, bins));
            let spatial = cheapest_of_bins(context, &bins, node.len() + task.spare, &mut after);
            if let Some(split) = spatial.filter(|s| s.cost < least) {
                let divided = share_out(&node, |part, left, right| {
                    split_references(context, part, &space, &split, left, right)
                });
                if divided.1.iter().all(|g| g.count > 0) {
                    return divided;
                }
            }
        }
        if let Some(split) = objects {
            return share_out(&node, |part, left, right| by_centers(part, &grid, &split, left, right));
        }
    }
    halve(group, &mut node);
    let right = node.split_off(node.len() / 2);
    let groups = [&node, &right].map(|side| Group::of(side));
    ([node, right], groups)
}

fn refill(bins: &mut Vec<Bin>, grid: &Grid) {
    bins.clear();
    bins.resize(3 * grid.bins, Bin::EMPTY);
}

/// What the best object split costs, and how much its children overlap; where centres tell nothing apart,
/// the same of two halves with the whole node's box.
fn object_split(context: &Context<'_>, group: &Group, found: Option<Split>) -> (f32, f32) {
    match found {
        Some(split) => (split.cost, split.overlap(context.scale)),
        None => {
            let half = Side { extent: group.bounds, count: (group.count / 2) as u32 };
            (2.0 * half.cost(context), group.bounds.half_area(context.scale))
        }
    }
}

fn bin_in_parallel(
    node: &[Reference],
    grid: &Grid,
    fill: impl Fn(&[Reference], &mut [Bin]) + Sync,
) -> Vec<Bin> {
    let parts = node.par_chunks(PART).map(|part| {
        let mut bins = Vec::new();
        refill(&mut bins, grid);
        fill(part, &mut bins);
        bins
    });
    let merge = |mut a: Vec<Bin>, b: Vec<Bin>| {
        a.iter_mut().zip(&b).for_each(|(a, b)| a.merge(b));
        a
    };
    parts.reduce_with(merge).expect("there are references")
}

/// Divides each part, and puts the left sides and the right sides together.
fn share_out(
    node: &[Reference],
    divide: impl Fn(&[Reference], &mut Vec<Reference>, &mut Vec<Reference>) -> [Group; 2] + Sync,
) -> ([Vec<Reference>; 2], [Group; 2]) {
    let parts: Vec<_> = (node.par_chunks(PART))
        .map(|part| {
            let mut sides = [Vec::with_capacity(part.len()), Vec::with_capacity(part.len())];
            let [left, right] = &mut sides;
            let groups = divide(part, left, right);
            (sides, groups)
        })
        .collect();
    let groups = [0, 1].map(|side| parts.iter().map(|(_, g)| g[side]).fold(Group::EMPTY, Group::merge));
    let gather = |side: usize| {
        let mut all = Vec::with_capacity(groups[side].count);
        parts.iter().for_each(|(sides, _)| all.extend_from_slice(&sides[side]));
        all
    };
    let (left, right) = rayon::join(|| gather(0), || gather(1));
    ([left, right], groups)
}

/// An object split.
fn by_centers(
    node: &[Reference],
    grid: &Grid,
    split: &Split,
    left: &mut Vec<Reference>,
    right: &mut Vec<Reference>,
) -> [Group; 2] {
    let mut groups = [Group::EMPTY; 2];
    for reference in node {
        let extent = Extent::of(reference);
        let side = usize::from(grid.slabs(extent.center())[split.axis] >= split.bin);
        groups[side].add(extent);
        if side == 0 { left.push(*reference) } else { right.push(*reference) }
    }
    groups
}

/// A spatial split. A reference that reaches both sides is cut, unless it is cheaper to leave it whole on
/// one side, whose box then grows (paper, section 4.4). One side can end up without references.
fn split_references(
    context: &Context<'_>,
    node: &[Reference],
    grid: &Grid,
    split: &Split,
    left: &mut Vec<Reference>,
    right: &mut Vec<Reference>,
) -> [Group; 2] {
    let Split { axis, bin, mut sides, .. } = *split;
    let plane = grid.plane(axis, bin);
    let mut groups = [Group::EMPTY; 2];
    let mut put = |side: usize, reference: Reference| {
        groups[side].add(Extent::of(&reference));
        if side == 0 { left.push(reference) } else { right.push(reference) }
    };
    for &reference in node {
        let extent = Extent::of(&reference);
        if grid.slabs(extent.hi)[axis] < bin {
            put(0, reference);
            continue;
        }
        if grid.slabs(extent.lo)[axis] >= bin {
            put(1, reference);
            continue;
        }
        let cost = |sides: [Side; 2]| sides[0].cost(context) + sides[1].cost(context);
        let whole = [0, 1].map(|side: usize| {
            let mut whole = sides;
            whole[side].extent = whole[side].extent.union(extent);
            whole[1 - side].count = whole[1 - side].count.saturating_sub(1);
            (cost(whole), side, whole)
        });
        let (least, side, whole) = if whole[1].0 < whole[0].0 { whole[1] } else { whole[0] };
        if least < cost(sides) {
            sides = whole;
            put(side, reference);
            continue;
        }
        let triangle = &context.triangles[reference.left as usize];
        match clip(triangle, &reference.bounds(), axis, plane) {
            [Some(below), Some(above)] => {
                put(0, Reference::new(below, reference.left, reference.right));
                put(1, Reference::new(above, reference.left, reference.right));
            }
            [Some(_), None] => put(0, reference),
            [None, _] => put(1, reference),
        }
    }
    groups
}

/// Orders references so that those with lower centres along the longest axis come first, half of them.
fn halve(group: &Group, node: &mut [Reference]) {
    let Aabb { lo, hi } = Aabb { lo: group.centers.lo.into(), hi: group.centers.hi.into() };
    let length = |axis: &usize| 0.5 * hi[*axis] - 0.5 * lo[*axis];
    let axis = (0..3).max_by(|a, b| length(a).total_cmp(&length(b))).expect("there are three");
    let center = |r: &Reference| Extent::of(r).center()[axis];
    node.select_nth_unstable_by(node.len() / 2, |a, b| center(a).total_cmp(&center(b)));
}
