//! Sorts keys of 32 or 64 bits, each with its index: a radix sort from the least digit of eight bits up.
//!
//! A pass has three dispatches, and keys move from one buffer to another:
//!
//! ```text
//! count    each tile of a few thousand keys counts its digits            counts[digit][tile]
//! scan     one workgroup a digit sums up over the tiles before           totals[digit]
//! scatter  each tile sorts itself and writes each digit's run where it belongs
//! ```
//!
//! Faster sorts fuse the three by letting tiles wait for each other; nothing promises that a waiting
//! workgroup lets the other one run, so we do not.

use crate::gpu::{Buffer, Error, Gpu, Kernel, Pass, groups, shaders};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

pub mod cpu;

const DIGITS: u64 = 256;
const DIGIT_BITS: u32 = 8;

/// Subgroups a workgroup: each has 256 counters in shared memory, 8 KiB together.
const SUBGROUPS: u32 = 8;

/// Keys a tile at most: one word each in shared memory, 16 KiB.
const MAX_TILE: u32 = 4096;

/// What may be chosen about the sort.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SortParams {
    /// Keys that an invocation takes at a time, 1 to 16. More make larger tiles, whose runs of equal digits are longer;
    /// fewer make more tiles, of which a small scene has too few to fill a device. On an H100 12 take 0.24 ms for the
    /// 2.5 million triangles of bistro_exterior, 8 and 16 take 0.26 and 0.31 ms. What does not fit into shared memory
    /// is cut.
    pub keys: u32,
}

impl Default for SortParams {
    fn default() -> Self {
        Self { keys: 12 }
    }
}

/// The three kernels, compiled for keys of one width.
#[derive(Debug)]
pub struct Sort {
    count: Kernel,
    scan: Kernel,
    scatter: Kernel,
    tile: u32,
}

/// Buffers a sort needs: [`Sort::record`] says what is in which at the end.
#[derive(Debug)]
pub struct SortBuffers {
    /// Unsorted keys in the first; both are overwritten.
    pub keys: [Buffer; 2],
    /// Undefined at first.
    pub values: [Buffer; 2],
    counts: Buffer,
    totals: Buffer,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Push {
    keys_in: u64,
    keys_out: u64,
    values_in: u64,
    values_out: u64,
    counts: u64,
    totals: u64,
    count: u32,
    tiles: u32,
    word: u32,
    shift: u32,
    first: u32,
    pad: u32,
}

impl Sort {
    /// Compiles the kernels for keys of `words` 32-bit words (1 or 2), least significant first.
    ///
    /// # Errors
    /// The driver's compiler failed.
    ///
    /// # Panics
    /// A parameter is out of its documented range.
    pub fn new(gpu: &Gpu, words: u32, params: &SortParams) -> Result<Self, Error> {
        assert!(words == 1 || words == 2, "keys have 32 or 64 bits");
        assert!((1..=16).contains(&params.keys), "an invocation takes 1 to 16 keys, not {}", params.keys);
        let info = gpu.info();
        let subgroups = SUBGROUPS.min(info.max_workgroup_size / info.subgroup_size);
        let workgroup = subgroups * info.subgroup_size;
        let items = (MAX_TILE / workgroup).clamp(1, params.keys);
        let constants = [items, words, subgroups];
        Ok(Self {
            count: Kernel::new(gpu, &shaders::SORT_COUNT, workgroup, &constants)?,
            scan: Kernel::new(gpu, &shaders::SORT_SCAN, workgroup, &constants)?,
            scatter: Kernel::new(gpu, &shaders::SORT_SCATTER, workgroup, &constants)?,
            tile: workgroup * items,
        })
    }

    /// Keys a workgroup sorts at a time.
    pub fn tile(&self) -> usize {
        self.tile as usize
    }

    /// Allocates for up to `count` keys of `words` words.
    ///
    /// # Errors
    /// Too little memory.
    pub fn buffers(&self, gpu: &Gpu, count: usize, words: u32) -> Result<SortBuffers, Error> {
        let keys = 4 * u64::from(words) * count as u64;
        let values = 4 * count as u64;
        let tiles = u64::from(groups(count, self.tile));
        Ok(SortBuffers {
            keys: [gpu.buffer("keys", keys)?, gpu.buffer("sorted keys", keys)?],
            values: [gpu.buffer("indices", values)?, gpu.buffer("sorted indices", values)?],
            counts: gpu.buffer("digit counts", 4 * DIGITS * tiles)?,
            totals: gpu.buffer("digit totals", 4 * DIGITS)?,
        })
    }

    /// Sorts the first `count` of `buffers.keys[0]` by their lowest `bits` bits. Returns which of the two
    /// key and value buffers hold the result; values are the indices that the keys had.
    pub fn record(&self, pass: &mut Pass, buffers: &SortBuffers, count: usize, bits: u32) -> usize {
        let tiles = groups(count, self.tile);
        let passes = bits.div_ceil(DIGIT_BITS).max(1);
        for p in 0..passes {
            let (from, to) = ((p % 2) as usize, ((p + 1) % 2) as usize);
            let push = Push {
                keys_in: buffers.keys[from].address(),
                keys_out: buffers.keys[to].address(),
                values_in: buffers.values[from].address(),
                values_out: buffers.values[to].address(),
                counts: buffers.counts.address(),
                totals: buffers.totals.address(),
                count: u32::try_from(count).expect("at most MAX_TRIANGLES"),
                tiles,
                word: p * DIGIT_BITS / 32,
                shift: p * DIGIT_BITS % 32,
                first: u32::from(p == 0),
                pad: 0,
            };
            pass.dispatch("count", &self.count, &push, tiles);
            pass.dispatch("scan", &self.scan, &push, DIGITS as u32);
            pass.dispatch("scatter", &self.scatter, &push, tiles);
        }
        (passes % 2) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::interface::{Module, fields};

    #[test]
    fn shaders_see_arguments_as_the_host_does() {
        let push = fields!(
            Push: keys_in, keys_out, values_in, values_out, counts, totals, count, tiles, word, shift, first
        );
        for shader in [&shaders::SORT_COUNT, &shaders::SORT_SCAN, &shaders::SORT_SCATTER] {
            Module::read(shader).assert_push_constants(size_of::<Push>(), &push);
        }
    }
}
