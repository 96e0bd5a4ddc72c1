//! The grid on which planes of boxes are rounded outward, one axis at a time.
//!
//! It starts at the least plane of all children and has steps of a power of two, 2^bits - 1 of which reach the
//! greatest (Ylitie et al. 2017, equation 1). A plane is the number of its grid line (equation 2).
//!
//! Boxes decoded from it contain the exact ones, even before the sum `origin + line * step` is rounded: the
//! difference of a plane and the origin is rounded outward with its exact error (Knuth's TwoSum), scaled by
//! a power of two, which is exact, and rounded outward to a line. Where even the difference leaves the range
//! of a float, it is taken of halves. Steps are never below 2^-126, so no exponent is zero.

/// The grid of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    origin: f32,
    /// Biased exponent of the step.
    pub exponent: u32,
    /// Differences are taken of halves, the exponent for them being one less.
    halved: bool,
}

/// `difference` in `grid.glsl`.
fn difference(x: f32, y: f32, up: bool, halved: bool) -> f32 {
    let (x, y) = if halved { (0.5 * x, 0.5 * y) } else { (x, y) };
    let d = x - y;
    let v = d - x;
    let error = (x - (d - v)) - (y + v);
    let off = if up { error > 0.0 } else { error < 0.0 } || halved;
    match off && d > 0.0 {
        true if up => f32::from_bits(d.to_bits() + 1).min(f32::MAX),
        true => f32::from_bits(d.to_bits() - 1),
        false => d,
    }
}

impl Grid {
    /// The finest one on which 2^bits - 1 steps lead from `lo` to `hi`; `bits` is 4 to 8.
    pub fn new(lo: f32, hi: f32, bits: u32) -> Self {
        let extent = difference(hi, lo, true, false);
        let halved = extent.is_infinite();
        let extent = if halved { difference(hi, lo, true, true) } else { extent };
        let pattern = extent.to_bits();
        // Mantissa of the largest line: 255 is 1.9921875 * 2^7, with 0x7f0000.
        let mantissa = 0x80_0000 - (1 << (24 - bits));
        let exponent = (pattern >> 23) + u32::from(pattern & 0x7f_ffff > mantissa);
        Self { origin: lo, exponent: exponent.max(bits) - (bits - 1) + u32::from(halved), halved }
    }

    fn inverse(self) -> f32 {
        f32::from_bits((254 + u32::from(self.halved) - self.exponent) << 23)
    }

    /// The last line that is not above a plane.
    pub fn line_below(self, plane: f32) -> u32 {
        (difference(plane, self.origin, false, self.halved) * self.inverse()).floor() as u32
    }

    /// The first line that is not below a plane.
    pub fn line_above(self, plane: f32) -> u32 {
        let above = difference(plane, self.origin, true, self.halved);
        // A step may be so much longer that the product is nothing.
        ((above * self.inverse()).ceil() as u32).max(u32::from(above > 0.0))
    }
}

/// The plane of a grid line, rounded to the nearest float.
pub(super) fn plane(origin: f32, exponent: u32, line: u32) -> f32 {
    (line as f32).mul_add(f32::from_bits(exponent << 23), origin)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::bvh2::Aabb;
    use proptest::prelude::*;
    use std::cmp::Ordering;

    /// How `line` steps compare with `to - from`, exactly.
    fn compare(line: u32, exponent: u32, from: f32, to: f32) -> Ordering {
        // Exact: 8 bits times a power of two.
        let steps = f64::from(line) * 2f64.powi(exponent as i32 - 127);
        // The sum of two floats and its error; doubles have room for both.
        let (x, y) = (f64::from(to), f64::from(from));
        let d = x - y;
        let v = d - x;
        let error = (x - (d - v)) - (y + v);
        // The error is less than the distance to the next double, so it counts only among equals.
        steps
            .partial_cmp(&d)
            .and_then(|order| Some(order.then(0.0f64.partial_cmp(&error)?)))
            .expect("numbers")
    }

    /// Encodes boxes of one axis and holds their lines against the exact planes.
    fn check_axis(planes: &[(f32, f32)], bits: u32) {
        let most = (1 << bits) - 1;
        let lo = planes.iter().fold(f32::INFINITY, |m, p| m.min(p.0));
        let hi = planes.iter().fold(f32::NEG_INFINITY, |m, p| m.max(p.1));
        let grid = Grid::new(lo, hi, bits);
        let exponent = grid.exponent;
        assert!((1..=254).contains(&exponent), "{grid:?}");
        // With steps half as long, the largest line would not do. Where differences are taken of halves they count as
        // rounded even if they are not.
        let half = compare(most, exponent.saturating_sub(1), lo, hi);
        assert!(
            exponent == 1 || half.is_lt() || grid.halved && half.is_eq(),
            "{grid:?} is too coarse for {hi}"
        );
        for &(a, b) in planes {
            let (below, above) = (grid.line_below(a), grid.line_above(b));
            assert!(below <= most && above <= most, "{grid:?}: lines {below} and {above} of {a} and {b}");
            assert!(compare(below, exponent, lo, a).is_le(), "{grid:?}: line {below} lies above {a}");
            assert!(compare(above, exponent, lo, b).is_ge(), "{grid:?}: line {above} lies below {b}");
            // No line nearer would have done; where differences are taken of halves, none but the next.
            let nearer = 1 + u32::from(grid.halved);
            let below_is_tight = compare(below + nearer, exponent, lo, a).is_gt();
            let above_is_tight =
                above.checked_sub(nearer).is_none_or(|line| compare(line, exponent, lo, b).is_lt());
            assert!(below_is_tight, "{grid:?}: line {below} is not the nearest below {a}");
            assert!(above_is_tight, "{grid:?}: line {above} is not the nearest above {b}");
        }
    }

    /// Coordinates of every size and sign; `kind` chooses what is next to each other in one node.
    fn coordinate(kind: u8) -> BoxedStrategy<f32> {
        let finite = any::<f32>().prop_filter("coordinates are finite", |x| x.is_finite());
        match kind {
            0 => (-100.0f32..100.0).boxed(),
            1 => finite.boxed(),
            2 => prop_oneof![Just(f32::MAX), Just(-f32::MAX), Just(0.0), -f32::MAX..f32::MAX, finite].boxed(),
            // Denormals and what is next to them.
            3 => (any::<bool>(), 0u32..1 << 25)
                .prop_map(|(sign, bits)| f32::from_bits(bits | u32::from(sign) << 31))
                .boxed(),
            // Few, so that boxes are flat and planes coincide.
            4 => (-3i8..4).prop_map(|x| f32::from(x) * 0.1).boxed(),
            // Far from the origin, where floats are far apart.
            5 => (0u32..4000).prop_map(|ulps| f32::from_bits(1e4f32.to_bits() + ulps)).boxed(),
            6 => (0u32..300).prop_map(|ulps| -f32::from_bits(1e18f32.to_bits() + ulps)).boxed(),
            // Whole steps, and just beside them.
            _ => (0u32..256, -1i32..=1)
                .prop_map(|(line, off)| {
                    f32::from_bits((line as f32 + 256.0).to_bits().wrapping_add_signed(off))
                })
                .boxed(),
        }
    }

    /// Up to eight boxes.
    pub fn boxes() -> impl Strategy<Value = Vec<Aabb>> {
        (0u8..8, 0u8..8, 0u8..8, 1usize..=8).prop_flat_map(|(x, y, z, n)| {
            let pair = |kind| (coordinate(kind), coordinate(kind));
            proptest::collection::vec((pair(x), pair(y), pair(z)), n..=n).prop_map(|all| {
                let sorted = all.into_iter().map(|(x, y, z)| Aabb {
                    lo: [x, y, z].map(|(a, b)| a.min(b)),
                    hi: [x, y, z].map(|(a, b)| a.max(b)),
                });
                sorted.collect()
            })
        })
    }

    /// Hands boxes at the limits of floats to a check.
    pub fn extremes(check: impl Fn(&[Aabb])) {
        let (most, least) = (f32::MAX, f32::from_bits(1));
        for (lo, hi) in [
            (-most, most),
            (0.0, most),
            (-most, 0.0),
            (-most, -most),
            (most, most),
            (-most, least),
            (-least, least),
            (0.0, least),
            (-0.0, 0.0),
            (0.0, f32::MIN_POSITIVE),
            (1.0, 1.0),
            (1.0, 1.0f32.next_up()),
            (0.0, 255.0),
            (0.0, 255.0f32.next_up()),
            (-255.0 * 2f32.powi(120), 0.0),
            (1e4, 1e4f32.next_up()),
        ] {
            let whole = Aabb { lo: [lo; 3], hi: [hi; 3] };
            let (at_lo, at_hi) = (Aabb { lo: [lo; 3], hi: [lo; 3] }, Aabb { lo: [hi; 3], hi: [hi; 3] });
            check(&[whole]);
            check(&[whole, at_lo, at_hi]);
            check(&[at_lo, at_hi]);
        }
    }

    fn check_axes(boxes: &[Aabb]) {
        for bits in 4..=8 {
            for axis in 0..3 {
                check_axis(&boxes.iter().map(|b| (b.lo[axis], b.hi[axis])).collect::<Vec<_>>(), bits);
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..Default::default() })]

        #[test]
        fn lines_enclose_planes_as_tightly_as_the_grid_allows(boxes in boxes()) {
            check_axes(&boxes);
        }
    }

    #[test]
    fn lines_enclose_the_largest_and_the_smallest_planes() {
        extremes(check_axes);
    }
}
