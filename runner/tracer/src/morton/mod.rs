//! Triangles → Morton codes: where along a space-filling curve does each triangle's box have its centre?
//!
//! The curve visits a cubic grid laid over all centres. Neighbours on it are near each other in space, and
//! that is all PLOC needs to know about its input (thesis 2.1.1).

use crate::{
    bvh2::Aabb,
    gpu::{Buffer, Error, Gpu, Kernel, Pass, groups, shaders},
};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

pub mod cpu;

/// What may be chosen about the curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MortonParams {
    /// Bits of a grid coordinate, 1 to 21: the grid has 2^bits cells an axis.
    ///
    /// Triangles of one cell keep their file order. Every eight bits of the code, which has three times as
    /// many, cost a sorting pass, and more than ten need 64-bit keys, whose passes are half again as dear.
    /// Finer grids than 2^10 an axis changed the SAH cost of sponza, kitchen and both bistros by less than
    /// 1%, in either direction: clusters look farther along the curve than a cell holds triangles.
    pub bits: u32,
}

impl Default for MortonParams {
    fn default() -> Self {
        Self { bits: 10 }
    }
}

impl MortonParams {
    /// 32-bit words a key.
    pub fn words(&self) -> u32 {
        if self.bits <= 10 { 1 } else { 2 }
    }

    /// Bits of a code.
    pub fn code_bits(&self) -> u32 {
        3 * self.bits
    }
}

/// The boxes that the grid and the scale of all areas derive from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneBounds {
    /// Around the centres of all triangles' boxes.
    pub centers: Aabb,
    /// Around all triangles.
    pub boxes: Aabb,
}

/// Bytes of `SceneBounds` in `scene_bounds.glsl`.
pub const BOUNDS_BYTES: u64 = 48;

impl SceneBounds {
    /// From the twelve words that the reduction leaves (`scene_bounds.glsl`).
    pub fn decode(words: [u32; 12]) -> Self {
        let float = |x: u32| f32::from_bits(x ^ if x >> 31 != 0 { 1 << 31 } else { u32::MAX });
        let corner = |at: usize, complement: u32| std::array::from_fn(|i| float(words[at + i] ^ complement));
        Self {
            centers: Aabb { lo: corner(0, 0), hi: corner(3, u32::MAX) },
            boxes: Aabb { lo: corner(6, 0), hi: corner(9, u32::MAX) },
        }
    }

    /// The power of two that brings the scene's longest edge into 1 to 2; `scene_scale` in
    /// `scene_bounds.glsl`.
    pub fn scale(&self) -> f32 {
        let e: [f32; 3] = std::array::from_fn(|i| self.boxes.hi[i] - self.boxes.lo[i]);
        let exponent = e[0].max(e[1].max(e[2])).to_bits() >> 23 & 255;
        if exponent == 0 { 1.0 } else { f32::from_bits((254 - exponent.min(253)) << 23) }
    }

    /// The power of two that brings half the centres' longest extent into 1/2 to 1.
    fn to_grid(self) -> f32 {
        let Aabb { lo, hi } = self.centers;
        let e: [f32; 3] = std::array::from_fn(|i| 0.5 * hi[i] - 0.5 * lo[i]);
        let exponent = e[0].max(e[1].max(e[2])).to_bits() >> 23;
        if exponent == 0 { 0.0 } else { f32::from_bits((253 - exponent.min(252)) << 23) }
    }
}

/// The two kernels, compiled.
#[derive(Debug)]
pub struct Morton {
    bounds: Kernel,
    codes: Kernel,
}

const WORKGROUP: u32 = 256;

/// More workgroups than this fill no GPU better, and each ends in twelve atomics on the same words.
const REDUCING_GROUPS: u32 = 1024;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct BoundsPush {
    triangles: u64,
    bounds: u64,
    count: u32,
    pad: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct CodesPush {
    triangles: u64,
    bounds: u64,
    keys: u64,
    count: u32,
    pad: u32,
}

impl Morton {
    /// Compiles the kernels.
    ///
    /// # Errors
    /// The driver's compiler failed.
    ///
    /// # Panics
    /// `params.bits` is not in 1 to 21.
    pub fn new(gpu: &Gpu, params: &MortonParams) -> Result<Self, Error> {
        assert!((1..=21).contains(&params.bits), "a grid coordinate has 1 to 21 bits, not {}", params.bits);
        Ok(Self {
            bounds: Kernel::new(gpu, &shaders::MORTON_BOUNDS, WORKGROUP, &[])?,
            codes: Kernel::new(gpu, &shaders::MORTON_CODES, WORKGROUP, &[params.bits, params.words()])?,
        })
    }

    /// Writes the bounds of `count` triangles ([`BOUNDS_BYTES`]) and their keys
    /// ([`MortonParams::words`] words each).
    pub fn record(&self, pass: &mut Pass, triangles: &Buffer, count: usize, bounds: &Buffer, keys: &Buffer) {
        self.record_bounds(pass, triangles, count, bounds);
        let all = u32::try_from(count).expect("at most MAX_TRIANGLES");
        let push = CodesPush {
            triangles: triangles.address(),
            bounds: bounds.address(),
            keys: keys.address(),
            count: all,
            pad: 0,
        };
        pass.dispatch("codes", &self.codes, &push, groups(count, WORKGROUP));
    }

    /// Writes the bounds alone.
    pub fn record_bounds(&self, pass: &mut Pass, triangles: &Buffer, count: usize, bounds: &Buffer) {
        let all = u32::try_from(count).expect("at most MAX_TRIANGLES");
        pass.fill(bounds, u32::MAX);
        let push =
            BoundsPush { triangles: triangles.address(), bounds: bounds.address(), count: all, pad: 0 };
        pass.dispatch("bounds", &self.bounds, &push, groups(count, WORKGROUP).min(REDUCING_GROUPS));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bvh2::Triangle,
        gpu::interface::{Module, fields},
    };

    #[test]
    fn shaders_see_arguments_as_the_host_does() {
        Module::read(&shaders::MORTON_BOUNDS)
            .assert_push_constants(size_of::<BoundsPush>(), &fields!(BoundsPush: triangles, bounds, count))
            .assert_items("Triangles", size_of::<Triangle>(), None);
        Module::read(&shaders::MORTON_CODES).assert_push_constants(
            size_of::<CodesPush>(),
            &fields!(CodesPush: triangles, bounds, keys, count),
        );
    }
}
