//! Planes of boxes in half precision, rounded outward: the plain twin of `half.glsl`.
//!
//! Conversions are made of integers, since hardware rounds halves in ways of its own, and may take small ones for zero.
//! So there are none below 2^-14, the least of full precision, but zero:
//!
//! ```text
//! plane          below      above
//! 1.0            1.0        1.0
//! 1.0001         1.0        1.0009766      the next half after 1
//! -1.0001       -1.0009766 -1.0
//! 0.00001        0          0.00006104     2^-14
//! 100000         65504      infinity       65504 is the largest half
//! -100000       -infinity  -65504
//! ```

/// The largest half.
const LARGEST: u32 = 0x7bff;
/// 2^-14, the least half that is kept beside zero.
const LEAST: u32 = 0x0400;

/// Of a magnitude, as the bits of a finite float, the bits of the last half that is not above it; and whether it is
/// below it.
fn truncated(magnitude: u32) -> (u32, bool) {
    if magnitude < 0x3880_0000 {
        (0, magnitude != 0)
    } else if magnitude >= 0x4780_0000 {
        (LARGEST, true)
    } else {
        ((magnitude >> 13) - (112 << 10), magnitude & 0x1fff != 0)
    }
}

/// The same, the first half that is not below it.
fn away(magnitude: u32) -> u32 {
    match truncated(magnitude) {
        (0, true) => LEAST,
        (bits, inexact) => bits + u32::from(inexact),
    }
}

/// The bits of the last half that is not above a plane, as far as there are halves; 16 bits.
pub(super) fn below(plane: f32) -> u32 {
    let (bits, magnitude) = (plane.to_bits(), plane.to_bits() & 0x7fff_ffff);
    if bits >> 31 == 0 { truncated(magnitude).0 } else { 0x8000 | away(magnitude) }
}

/// The bits of the first half that is not below a plane.
pub(super) fn above(plane: f32) -> u32 {
    let (bits, magnitude) = (plane.to_bits(), plane.to_bits() & 0x7fff_ffff);
    if bits >> 31 == 0 { away(magnitude) } else { 0x8000 | truncated(magnitude).0 }
}

/// The value of a half, which is none of those that are not kept.
pub(super) fn value(half: u32) -> f32 {
    let (sign, magnitude) = ((half & 0x8000) << 16, half & 0x7fff);
    let bits = match magnitude {
        0 => 0,
        0x7c00 => f32::INFINITY.to_bits(),
        _ => (magnitude + (112 << 10)) << 13,
    };
    f32::from_bits(sign | bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// All halves that are kept, in order; zero once.
    fn halves() -> Vec<f32> {
        let positive = (LEAST..=0x7c00).map(value);
        let mut all: Vec<f32> = positive.clone().map(|x| -x).chain([0.0]).chain(positive).collect();
        all.sort_by(f32::total_cmp);
        all
    }

    fn check(plane: f32, halves: &[f32]) {
        let (lo, hi) = (value(below(plane)), value(above(plane)));
        let at = halves.partition_point(|&half| half < plane);
        let next = halves[at];
        let last = if next == plane { next } else { halves[at - 1] };
        assert!(lo == last && hi == next, "{plane:e}: {lo:e} and {hi:e}, not {last:e} and {next:e}");
    }

    #[test]
    fn the_examples_are_right() {
        let planes = [
            (1.0, 1.0, 1.0),
            (1.0001, 1.0, 1.000_976_6),
            (-1.0001, -1.000_976_6, -1.0),
            (1e-5, 0.0, 6.103_515_6e-5),
            (1e5, 65504.0, f32::INFINITY),
            (-1e5, f32::NEG_INFINITY, -65504.0),
        ];
        for (plane, lo, hi) in planes {
            assert_eq!((value(below(plane)), value(above(plane))), (lo, hi), "{plane}");
        }
    }

    #[test]
    fn every_half_is_itself_and_what_is_beside_it_is_rounded_away_from_it() {
        let halves = halves();
        for &half in halves.iter().filter(|half| half.is_finite()) {
            for plane in [half.next_down(), half, half.next_up()] {
                check(plane, &halves);
            }
        }
        for extreme in [f32::MAX, f32::MIN_POSITIVE, f32::from_bits(1), -0.0] {
            check(extreme, &halves);
            check(-extreme, &halves);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..Default::default() })]

        #[test]
        fn planes_lie_between_the_halves_next_to_them(bits in any::<u32>()) {
            let plane = f32::from_bits(bits);
            if plane.is_finite() {
                check(plane, &halves());
            }
        }
    }
}
