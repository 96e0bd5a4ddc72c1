//! Who of several machines measures a point, and when: by hashes of its name.

use sha2::{Digest, Sha256};
use std::str::FromStr;

/// One of several equal shares of a sweep, such as `2/4`.
///
/// A point belongs to a share by the hash of its key alone, so whatever is added to a config, the points that
/// were there before stay where they were.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// From 1 on.
    pub number: u64,
    /// How many there are.
    pub of: u64,
}

impl Shard {
    /// Whether a point belongs to it.
    pub fn has(self, key: &str) -> bool {
        hash(&[b"shard", key.as_bytes()]) % self.of == self.number - 1
    }
}

impl FromStr for Shard {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?} is no share; write I/N with I from 1 to N, such as 2/4");
        let (number, of) = text.split_once('/').ok_or_else(wrong)?;
        let shard =
            Self { number: number.parse().map_err(|_| wrong())?, of: of.parse().map_err(|_| wrong())? };
        if (1..=shard.of).contains(&shard.number) { Ok(shard) } else { Err(wrong()) }
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

/// Where a point comes in the order of a sweep: those with smaller numbers are measured first.
///
/// A hash with the seed shuffles as well as a random number, and leaves the others in their order when a point
/// is added or has been measured already.
pub fn place(seed: u64, key: &str) -> u64 {
    hash(&[b"order", &seed.to_le_bytes(), key.as_bytes()])
}

fn hash(parts: &[&[u8]]) -> u64 {
    let mut hash = Sha256::new();
    for part in parts {
        hash.update(part);
    }
    let digest = hash.finalize();
    u64::from_le_bytes(digest[..8].try_into().expect("eight of 32 bytes"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(count: u32) -> Vec<String> {
        (0..count).map(|i| format!("sponza | Wide4 | collapse.c_t={i}")).collect()
    }

    #[test]
    fn every_point_belongs_to_one_share_of_about_equal_size() {
        for of in [1, 2, 3, 7] {
            let mut sizes = vec![0; of as usize];
            for key in keys(700) {
                let shares: Vec<u64> = (1..=of).filter(|&number| Shard { number, of }.has(&key)).collect();
                assert_eq!(shares.len(), 1, "{key}");
                sizes[shares[0] as usize - 1] += 1;
            }
            let fair = 700 / of as i32;
            assert!(sizes.iter().all(|&size: &i32| (size - fair).abs() <= fair / 4), "{sizes:?}");
        }
    }

    #[test]
    fn an_order_depends_on_its_seed_and_on_nothing_else() {
        let ordered = |seed, keys: &[String]| {
            let mut keys = keys.to_vec();
            keys.sort_by_key(|key| place(seed, key));
            keys
        };
        let (few, many) = (keys(50), keys(60));
        assert_ne!(ordered(1, &few), ordered(2, &few));
        assert_ne!(ordered(1, &few), few);
        let mut left = ordered(1, &many);
        left.retain(|key| few.contains(key));
        assert_eq!(left, ordered(1, &few));
        // Fixed for all time: shards of one sweep may be measured by different builds.
        assert_eq!(ordered(1, &keys(5))[0], "sponza | Wide4 | collapse.c_t=2");
    }

    #[test]
    fn shares_are_read_from_text() {
        assert_eq!("2/4".parse(), Ok(Shard { number: 2, of: 4 }));
        for wrong in ["", "2", "0/4", "5/4", "2/0", "a/b", "-1/4", "1/2/3"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
        assert_eq!(Shard { number: 2, of: 4 }.to_string(), "2/4");
    }
}
