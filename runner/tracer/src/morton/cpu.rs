//! The plain twins of `bounds.comp` and `codes.comp`.

use super::{MortonParams, SceneBounds};
use crate::bvh2::{Aabb, Triangle};

/// Boxes around all triangles and around the centres of their boxes.
pub fn bounds(triangles: &[Triangle]) -> SceneBounds {
    let mut all = SceneBounds { centers: Aabb::EMPTY, boxes: Aabb::EMPTY };
    for triangle in triangles {
        let own = Aabb::of(triangle);
        let center = own.center();
        all.boxes = all.boxes.union(&own);
        all.centers = all.centers.union(&Aabb { lo: center, hi: center });
    }
    all
}

/// The Morton code of each triangle.
pub fn codes(triangles: &[Triangle], bounds: &SceneBounds, params: &MortonParams) -> Vec<u64> {
    let to_grid = bounds.to_grid();
    let cells = (1u32 << params.bits) as f32;
    let lo = bounds.centers.lo;
    triangles
        .iter()
        .map(|triangle| {
            let center = Aabb::of(triangle).center();
            let cell = |axis: usize| {
                let unit = (0.5 * center[axis] - 0.5 * lo[axis]) * to_grid;
                (unit * cells).clamp(0.0, cells - 1.0) as u64
            };
            let cell = [cell(0), cell(1), cell(2)];
            (0..params.bits).fold(0, |code, bit| {
                let [x, y, z] = cell.map(|c| c >> bit & 1);
                code | (x << 2 | y << 1 | z) << (3 * bit)
            })
        })
        .collect()
}
