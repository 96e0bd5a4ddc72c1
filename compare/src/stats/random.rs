//! Random numbers that are the same on every computer and in every run.

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub struct Random(Xoshiro256PlusPlus);

impl Random {
    /// The stream of a name: what is drawn for one row of a table does not depend on the others.
    pub fn named(name: &str) -> Random {
        // FNV-1a. The standard library's hash may change with its version.
        let hash = name.bytes().fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
        Random(Xoshiro256PlusPlus::seed_from_u64(hash))
    }

    /// A whole number from 0 up to, not including, `end`.
    pub fn below(&mut self, end: usize) -> usize {
        // The upper half of a product (Lemire 2019) without its rejection: for ends below a million, one number is
        // more probable than another by less than one in 10^13.
        ((u128::from(self.0.next_u64()) * end as u128) >> 64) as usize
    }
}

#[cfg(test)]
impl Random {
    /// A number that is normally distributed with a mean of 0 and a deviation of 1.
    pub fn normal(&mut self) -> f64 {
        let mut uniform = || (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
        let (radius, angle) = ((-2.0 * (1.0 - uniform()).ln()).sqrt(), std::f64::consts::TAU * uniform());
        radius * angle.cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_comes_up_and_a_name_has_its_own_stream() {
        let mut random = Random::named("Wide4");
        let mut count = [0; 5];
        for _ in 0..5000 {
            count[random.below(5)] += 1;
        }
        assert!(count.iter().all(|&times| (850..1150).contains(&times)), "{count:?}");
        let first = |name| Random::named(name).below(1 << 40);
        assert_eq!(first("Wide4"), first("Wide4"));
        assert_ne!(first("Wide4"), first("Wide6"));
    }
}
