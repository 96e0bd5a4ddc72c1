//! The search for the cheapest split.

use super::{Context, Extent, Group, Reference};
use crate::bvh2::Triangle;
use glam::Vec3A;

/// What lies in a slab of the node's box, or has its centre there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bin {
    extent: Extent,
    /// References whose first bin it is.
    enter: u32,
    /// References whose last bin it is.
    leave: u32,
}

impl Bin {
    pub const EMPTY: Self = Self { extent: Extent::EMPTY, enter: 0, leave: 0 };

    /// One reference, and all of it.
    pub fn of(extent: Extent) -> Self {
        Self { extent, enter: 1, leave: 1 }
    }

    fn add(&mut self, extent: Extent) {
        self.merge(&Self::of(extent));
    }

    pub fn merge(&mut self, other: &Self) {
        self.extent = self.extent.union(other.extent);
        self.enter += other.enter;
        self.leave += other.leave;
    }
}

/// Cuts a box into equally many slabs along each axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    lo: Vec3A,
    hi: Vec3A,
    per_unit: Vec3A,
    pub bins: usize,
}

impl Grid {
    pub fn new(bounds: Extent, bins: usize) -> Self {
        let per_unit = Vec3A::splat(bins as f32) / (bounds.hi - bounds.lo);
        // Where the box is flat, or so thin or so large that floats end, there is one slab.
        let per_unit = Vec3A::select(per_unit.is_finite_mask(), per_unit, Vec3A::ZERO);
        Self { lo: bounds.lo, hi: bounds.hi, per_unit, bins }
    }

    /// The slab that a point is in, along each axis.
    pub fn slabs(&self, point: Vec3A) -> [usize; 3] {
        ((point - self.lo) * self.per_unit).to_array().map(|x| (x as usize).min(self.bins - 1))
    }

    /// Where a slab begins.
    pub fn plane(&self, axis: usize, slab: usize) -> f32 {
        let share = slab as f32 / self.bins as f32;
        (self.lo[axis] * (1.0 - share) + self.hi[axis] * share).clamp(self.lo[axis], self.hi[axis])
    }
}

/// One side of a split, as the search sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    pub extent: Extent,
    pub count: u32,
}

impl Side {
    pub fn cost(&self, context: &Context<'_>) -> f32 {
        self.extent.half_area(context.scale) * context.weight(self.count)
    }
}

/// A split between two bins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Split {
    pub axis: usize,
    /// The first bin on the right.
    pub bin: usize,
    /// The sum over both sides of their scaled half area times [`Context::weight`] of their references.
    pub cost: f32,
    pub sides: [Side; 2],
}

impl Split {
    /// Scaled half area of what both sides' boxes have in common.
    pub fn overlap(&self, scale: f32) -> f32 {
        let common = self.sides[0].extent.intersection(self.sides[1].extent);
        if common.is_empty() { 0.0 } else { common.half_area(scale) }
    }
}

/// The cheapest split between the bins of one axis, with at most `most` references on both sides together.
/// Of equally cheap ones that which divides the references most evenly. `after` is working memory.
pub(super) fn cheapest(
    context: &Context<'_>,
    axis: usize,
    bins: &[Bin],
    most: usize,
    after: &mut Vec<(f32, u32)>,
) -> Option<Split> {
    after.clear();
    after.resize(bins.len(), (0.0, 0));
    let mut side = Side { extent: Extent::EMPTY, count: 0 };
    for i in (1..bins.len()).rev() {
        side = Side { extent: side.extent.union(bins[i].extent), count: side.count + bins[i].leave };
        after[i] = (side.cost(context), side.count);
    }
    let mut best: Option<(f32, u32, usize, Side)> = None;
    let mut side = Side { extent: Extent::EMPTY, count: 0 };
    for i in 1..bins.len() {
        side = Side { extent: side.extent.union(bins[i - 1].extent), count: side.count + bins[i - 1].enter };
        let (other_cost, other) = after[i];
        if side.count == 0 || other == 0 || (side.count + other) as usize > most {
            continue;
        }
        let cost = side.cost(context) + other_cost;
        let uneven = side.count.abs_diff(other);
        let better = match best {
            None => cost < f32::INFINITY,
            Some((least, most_even, ..)) => cost < least || (cost == least && uneven < most_even),
        };
        if better {
            best = Some((cost, uneven, i, side));
        }
    }
    best.map(|(cost, _, bin, left)| {
        let extent = bins[bin..].iter().fold(Extent::EMPTY, |e, b| e.union(b.extent));
        Split { axis, bin, cost, sides: [left, Side { extent, count: after[bin].1 }] }
    })
}

/// The cheapest split between bins of any axis; those of x come first, then y, then z.
pub(super) fn cheapest_of_bins(
    context: &Context<'_>,
    bins: &[Bin],
    most: usize,
    after: &mut Vec<(f32, u32)>,
) -> Option<Split> {
    let rows = bins.chunks_exact(bins.len() / 3).enumerate();
    rows.filter_map(|(axis, row)| cheapest(context, axis, row, most, after)).reduce(cheaper)
}

/// The first unless the second is cheaper.
pub(super) fn cheaper(a: Split, b: Split) -> Split {
    if b.cost < a.cost { b } else { a }
}

/// Puts references into bins by their centres.
pub(super) fn bin_objects(references: &[Reference], grid: &Grid, bins: &mut [Bin]) {
    for reference in references {
        let extent = Extent::of(reference);
        for (axis, slab) in grid.slabs(extent.center()).into_iter().enumerate() {
            bins[axis * grid.bins + slab].add(extent);
        }
    }
}

/// Puts references into every bin they reach, cut at the planes between (paper, section 4.2).
///
/// These boxes only serve to estimate costs: they are neither conservative nor as tight as those of
/// [`super::clip::clip`].
pub(super) fn bin_parts(context: &Context<'_>, references: &[Reference], grid: &Grid, bins: &mut [Bin]) {
    for reference in references {
        let extent = Extent::of(reference);
        let (first, last) = (grid.slabs(extent.lo), grid.slabs(extent.hi));
        for axis in 0..3 {
            let row = &mut bins[axis * grid.bins..][..grid.bins];
            row[first[axis]].enter += 1;
            row[last[axis]].leave += 1;
            let mut rest = extent;
            if first[axis] < last[axis] {
                let corners = context.triangles[reference.left as usize];
                for (bin, next) in row[first[axis]..last[axis]].iter_mut().zip(first[axis] + 1..) {
                    let [below, above] = cut(&corners, axis, grid.plane(axis, next));
                    bin.extent = bin.extent.union(below.intersection(rest));
                    rest = rest.intersection(above);
                }
            }
            let part = &mut row[last[axis]].extent;
            *part = part.union(rest);
        }
    }
}

/// Boxes around what a triangle has on either side of a plane.
fn cut(triangle: &Triangle, axis: usize, plane: f32) -> [Extent; 2] {
    let corners = triangle.map(Vec3A::from_array);
    let (mut below, mut above) = (Extent::EMPTY, Extent::EMPTY);
    for i in 0..3 {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        let (from, to) = (triangle[i][axis], triangle[(i + 1) % 3][axis]);
        if from <= plane {
            below = below.with(a);
        }
        if from >= plane {
            above = above.with(a);
        }
        if (from < plane && plane < to) || (to < plane && plane < from) {
            let crossing = a + (b - a) * ((plane - from) / (to - from));
            below = below.with(crossing);
            above = above.with(crossing);
        }
    }
    below.hi[axis] = below.hi[axis].min(plane);
    above.lo[axis] = above.lo[axis].max(plane);
    [below, above]
}

/// The object split found by sweeping a few references along each axis. `orders` receives their order along
/// each axis, as numbers whose lower half is the reference's place.
pub(super) fn sweep(
    context: &Context<'_>,
    references: &[Reference],
    group: &Group,
    orders: &mut [Vec<u64>; 3],
    bins: &mut Vec<Bin>,
    after: &mut Vec<(f32, u32)>,
) -> Option<Split> {
    let flat = group.centers.lo.cmpeq(group.centers.hi);
    let mut best = None;
    for (axis, order) in orders.iter_mut().enumerate().filter(|&(axis, _)| !flat.test(axis)) {
        order.clear();
        order.extend(references.iter().zip(0u64..).map(|(reference, place)| {
            let center = Extent::of(reference).center()[axis].to_bits();
            // Ordered as the floats are.
            let key = center ^ if center >> 31 == 0 { 1 << 31 } else { u32::MAX };
            u64::from(key) << 32 | place
        }));
        order.sort_unstable();
        bins.clear();
        bins.extend(order.iter().map(|&key| Bin::of(Extent::of(&references[key as u32 as usize]))));
        let found = cheapest(context, axis, bins, references.len(), after);
        best = [best, found].into_iter().flatten().reduce(cheaper);
    }
    best
}
