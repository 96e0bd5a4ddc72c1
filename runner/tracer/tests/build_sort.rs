//! The radix sort against the standard library's.

mod support;

use support::{Random, assert_silent, gpu};
use tracer::{
    gpu::Pass,
    sort::{self, Sort, SortBuffers, SortParams},
};

struct Case {
    sort: Sort,
    buffers: SortBuffers,
    words: u32,
}

impl Case {
    fn new(words: u32, keys: u32, capacity: usize) -> Self {
        let sort = Sort::new(gpu(), words, &SortParams { keys }).unwrap();
        let buffers = sort.buffers(gpu(), capacity, words).unwrap();
        Self { sort, buffers, words }
    }

    fn check(&self, keys: &[u64], bits: u32, what: &str) {
        let n = keys.len();
        match self.words {
            1 => self.buffers.keys[0].write(&keys.iter().map(|&k| k as u32).collect::<Vec<_>>()).unwrap(),
            _ => self.buffers.keys[0].write(keys).unwrap(),
        }
        let mut pass = Pass::new(gpu()).unwrap();
        let result = self.sort.record(&mut pass, &self.buffers, n, bits);
        pass.submit().unwrap();
        let values: Vec<u32> = self.buffers.values[result].read(0, n).unwrap();
        let sorted: Vec<u64> = match self.words {
            1 => {
                let keys: Vec<u32> = self.buffers.keys[result].read(0, n).unwrap();
                keys.into_iter().map(u64::from).collect()
            }
            _ => self.buffers.keys[result].read(0, n).unwrap(),
        };
        let mask = if bits >= 64 { u64::MAX } else { (1 << bits) - 1 };
        let low: Vec<u64> = keys.iter().map(|k| k & mask).collect();
        let expected = sort::cpu::order(&low);
        assert_eq!(values, expected, "{n} keys of {bits} bits, {what}");
        let expected: Vec<u64> = expected.iter().map(|&i| keys[i as usize]).collect();
        assert_eq!(sorted, expected, "{n} keys of {bits} bits, {what}");
    }
}

#[test]
fn sizes_around_every_partition_are_sorted() {
    for keys in [16, 5, 1] {
        let case = Case::new(1, keys, 5 * 4096);
        let tile = case.sort.tile();
        let mut sizes = vec![1, 2, 3, 7, 8, 9, 31, 32, 33, 63, 64, 65, 127, 128, 129, 255, 256, 257];
        for tiles in 1..=4 {
            sizes.extend([tiles * tile - 1, tiles * tile, tiles * tile + 1]);
        }
        let mut random = Random(1);
        for n in sizes {
            let all: Vec<u64> = (0..n).map(|_| random.next() >> 34).collect();
            case.check(&all, 30, &format!("random, {keys} at a time"));
        }
    }
    assert_silent();
}

#[test]
fn equal_keys_keep_their_order_and_ordered_keys_stay_or_turn() {
    for words in [1, 2] {
        let n = 20_000;
        let case = Case::new(words, 16, n);
        let bits = 32 * words;
        let top = if words == 1 { u64::from(u32::MAX) } else { u64::MAX };
        let mut random = Random(2);
        case.check(&vec![0; n], bits, "all zero");
        case.check(&vec![top; n], bits, "all ones");
        case.check(&(0..n as u64).collect::<Vec<_>>(), bits, "sorted");
        case.check(&(0..n as u64).rev().collect::<Vec<_>>(), bits, "reversed");
        case.check(&(0..n as u64).map(|i| top - i * (top / n as u64)).collect::<Vec<_>>(), bits, "spread");
        case.check(&(0..n).map(|_| random.next() % 3).collect::<Vec<_>>(), bits, "three values");
        case.check(&(0..n).map(|_| random.next() & top).collect::<Vec<_>>(), bits, "random");
    }
    assert_silent();
}

#[test]
fn any_number_of_bits_decides() {
    let n = 5000;
    let mut random = Random(3);
    let keys: Vec<u64> = (0..n).map(|_| random.next()).collect();
    let case = Case::new(2, 16, n);
    for bits in [1, 8, 9, 24, 32, 33, 45, 48, 63, 64] {
        // Bits above the last whole digit take part, so they have to be zero, as those of a code are.
        let mask = if bits >= 64 { u64::MAX } else { (1 << bits) - 1 };
        case.check(&keys.iter().map(|k| k & mask).collect::<Vec<_>>(), bits, "random");
    }
    assert_silent();
}
