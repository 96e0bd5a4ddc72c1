//! The plain twin of `assign.glsl`: which slot a child gets.
//!
//! Slot s is the first that a ray along d(s) goes to, d(s) = (±1, ±1, ±1) with the signs of the bits of s. A child
//! costs there how far along d(s) it lies (Ylitie et al. 2017, equation 9):
//!
//! ```text
//! cost(c, s) = (centre of c - centre of the node) · d(s)
//! ```

use super::Assignment;
use crate::bvh2::Aabb;

/// Slots of a node.
const SLOTS: usize = 8;

/// A bid is higher than it has to be by this share of the largest offset, so that bidding ends; the costs in all are
/// above the least by no more than that for each child.
const RAISE: f32 = 1.0 / 1024.0;

/// After so many bids, those without a slot take what is left. Only offsets that are no numbers need as many.
const MOST_BIDS: usize = 4096;

/// Offsets of the children from the node's centre, for `cost`.
fn offsets(bounds: &[Aabb]) -> Vec<[f32; 3]> {
    let center = bounds.iter().fold(Aabb::EMPTY, |all, b| all.union(b)).center();
    bounds.iter().map(|b| b.center()).map(|c| std::array::from_fn(|k| c[k] - center[k])).collect()
}

/// Equation 9.
fn cost(offset: [f32; 3], slot: usize) -> f32 {
    let [x, y, z]: [f32; 3] =
        std::array::from_fn(|k| if slot >> k & 1 == 1 { -offset[k] } else { offset[k] });
    x + y + z
}

/// The slot of each child; `seed` tells nodes apart where slots are random.
pub fn slots(bounds: &[Aabb], seed: u32, assignment: Assignment) -> Vec<usize> {
    match assignment {
        Assignment::Auction => auction(&offsets(bounds)),
        Assignment::Greedy => greedy(&offsets(bounds)),
        Assignment::Random => random(bounds.len(), seed),
    }
}

/// Children bid for slots until each has one (Bertsekas 1992): one without a slot offers, for the one that it likes
/// best at its price, as much more as it likes it better than the second best, and a little.
fn auction(offsets: &[[f32; 3]]) -> Vec<usize> {
    let mut price = [0f32; SLOTS];
    let mut owner = [None; SLOTS];
    let mut slot_of: Vec<Option<usize>> = vec![None; offsets.len()];
    let largest = offsets.as_flattened().iter().fold(0f32, |m, x| m.max(x.abs()));
    // Of no offsets, or of such as are hardly numbers, any assignment is as good.
    if largest > 1e-30 {
        for _ in 0..MOST_BIDS {
            let Some(child) = slot_of.iter().position(Option::is_none) else { break };
            let (mut best, mut second, mut chosen) = (f32::NEG_INFINITY, f32::NEG_INFINITY, 0);
            for (slot, price) in price.iter().enumerate() {
                let value = -cost(offsets[child], slot) - price;
                if value > best {
                    (second, best, chosen) = (best, value, slot);
                } else if value > second {
                    second = value;
                }
            }
            price[chosen] = (price[chosen] + (best - second)) + RAISE * largest;
            if let Some(loser) = owner[chosen].replace(child) {
                slot_of[loser] = None;
            }
            slot_of[child] = Some(chosen);
        }
    }
    let mut free = (0..SLOTS).filter(|&slot| owner[slot].is_none());
    slot_of.into_iter().map(|slot| slot.unwrap_or_else(|| free.next().expect("8 slots"))).collect()
}

/// The cheapest child in the cheapest slot first; of equals the first.
fn greedy(offsets: &[[f32; 3]]) -> Vec<usize> {
    let mut slot_of: Vec<Option<usize>> = vec![None; offsets.len()];
    let mut taken = [false; SLOTS];
    for _ in 0..offsets.len() {
        let (mut least, mut chosen) = (f32::INFINITY, None);
        for child in (0..offsets.len()).filter(|&child| slot_of[child].is_none()) {
            for slot in (0..SLOTS).filter(|&slot| !taken[slot]) {
                let cost = cost(offsets[child], slot);
                // The first one even where costs are no numbers.
                if cost < least || chosen.is_none() {
                    (least, chosen) = (cost, Some((child, slot)));
                }
            }
        }
        let (child, slot) = chosen.expect("a child without a slot, and one");
        slot_of[child] = Some(slot);
        taken[slot] = true;
    }
    slot_of.into_iter().map(|slot| slot.expect("each has one")).collect()
}

/// The first of a random permutation (Fisher and Yates).
fn random(children: usize, seed: u32) -> Vec<usize> {
    let mut slots: [usize; SLOTS] = std::array::from_fn(|slot| slot);
    // PCG (O'Neill 2014).
    let mut state = seed;
    for at in (1..SLOTS).rev() {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
        slots.swap(at, ((word >> 22 ^ word) % (at as u32 + 1)) as usize);
    }
    slots[..children].to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::grid::tests::{boxes, extremes};
    use proptest::prelude::*;

    fn assert_each_has_its_own(slots: &[usize]) {
        let mut seen = [false; SLOTS];
        assert!(slots.iter().all(|&slot| !std::mem::replace(&mut seen[slot], true)), "{slots:?}");
    }

    fn total(offsets: &[[f32; 3]], slots: &[usize]) -> f64 {
        offsets.iter().zip(slots).map(|(&offset, &slot)| f64::from(cost(offset, slot))).sum()
    }

    /// The least cost in all, by trying every assignment.
    fn least(offsets: &[[f32; 3]], taken: u8) -> f64 {
        let Some((&first, rest)) = offsets.split_first() else { return 0.0 };
        (0..SLOTS)
            .filter(|slot| taken >> slot & 1 == 0)
            .map(|slot| f64::from(cost(first, slot)) + least(rest, taken | 1 << slot))
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn children_at_the_corners_get_the_corners_slots() {
        let at = |corner: usize| {
            let lo = std::array::from_fn(|k| if corner >> k & 1 == 1 { 3.0 } else { 0.0 });
            Aabb { lo, hi: lo.map(|x| x + 1.0) }
        };
        // What a ray with negative direction meets first is what lies at the far end.
        let bounds: Vec<Aabb> = (0..8).map(at).collect();
        let corners: Vec<usize> = (0..8).collect();
        for assignment in [Assignment::Auction, Assignment::Greedy] {
            assert_eq!(slots(&bounds, 0, assignment), corners);
        }
        assert_eq!(slots(&bounds[3..6], 0, Assignment::Auction).len(), 3);
    }

    #[test]
    fn the_first_slot_of_a_ray_holds_what_it_meets_first() {
        let left = Aabb { lo: [0.0; 3], hi: [1.0; 3] };
        let right = Aabb { lo: [5.0, 0.0, 0.0], hi: [6.0, 1.0, 1.0] };
        for assignment in [Assignment::Auction, Assignment::Greedy] {
            let slots = slots(&[right, left], 0, assignment);
            // Bit 0 stands for x: set where rays go to the left.
            assert_eq!((slots[0] & 1, slots[1] & 1), (1, 0), "{assignment:?}");
        }
    }

    fn check(bounds: &[Aabb]) {
        for &assignment in Assignment::ALL {
            assert_each_has_its_own(&slots(bounds, 7, assignment));
        }
    }

    #[test]
    fn any_boxes_get_slots() {
        extremes(check);
        check(&[Aabb { lo: [1.0; 3], hi: [2.0; 3] }; 8]);
    }

    #[test]
    fn random_slots_depend_on_the_node_and_spread_evenly() {
        let mut count = [[0; SLOTS]; SLOTS];
        for seed in 0..8000 {
            let slots = random(8, seed);
            assert_eq!(slots, random(8, seed));
            slots.iter().enumerate().for_each(|(child, &slot)| count[child][slot] += 1);
        }
        assert!(count.as_flattened().iter().all(|n| (850..1150).contains(n)), "{count:?}");
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 100, failure_persistence: None, ..Default::default() })]

        #[test]
        fn no_assignment_costs_less(
            offsets in prop::collection::vec(prop::array::uniform3(-1f32..1.0), 1..7),
        ) {
            let largest = offsets.as_flattened().iter().fold(0f32, |m, x| m.max(x.abs()));
            let found = total(&offsets, &auction(&offsets));
            let allowed = f64::from(RAISE * largest) * offsets.len() as f64 + 1e-5;
            let least = least(&offsets, 0);
            prop_assert!(found <= least + allowed, "{found}, {least}");
            // Greed may cost more, never less.
            prop_assert!(total(&offsets, &greedy(&offsets)) >= least - 1e-5);
        }

        #[test]
        fn every_child_gets_a_slot_of_its_own(boxes in boxes()) {
            check(&boxes);
        }
    }
}
