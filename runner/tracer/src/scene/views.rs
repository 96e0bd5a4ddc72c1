//! Views: read from a file beside the model, or placed by probing the scene with rays.
//!
//! Placement makes three kinds of candidate: all around the scene, close up, and inside it at standing
//! height over whatever is below. Each candidate is judged by a coarse picture of rays: how much of it
//! sees geometry, how near and how varied in depth that is, and whether it is seen from its back, which
//! tells a camera inside a solid; and how many different triangles it shows. Of the best, those are taken
//! that differ from each other; an open scene gets some views of the whole.

use std::collections::HashSet;
use std::f32::consts::{PI, TAU};
use std::path::{Path, PathBuf};

use glam::Vec3;
use rayon::prelude::*;

use super::probe::Probe;
use super::random::Random;
use super::{SceneError, View};

const COUNT: usize = 8;
const FOV_DEGREES: f32 = 50.0;
const ASPECT: f32 = 1.5;
/// The coarse picture of a candidate.
const GRID: (u32, u32) = (12, 8);
const INSIDE_POINTS: u64 = 96;
const TURNS: u32 = 6;
/// Directions in which the surroundings of a point are felt.
const SIDES: u32 = 32;

/// `NAME.views.json` beside the model `NAME.…`.
pub(super) fn file_beside(model: &Path) -> PathBuf {
    model.with_extension("views.json")
}

/// Reads the views beside a model, if there are any.
pub(super) fn beside(model: &Path) -> Result<Option<Vec<View>>, SceneError> {
    let path = file_beside(model);
    let text = match std::fs::read(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(source) => return Err(SceneError::Read { path, source }),
    };
    let views: Vec<View> =
        serde_json::from_slice(&text).map_err(|e| SceneError::descriptor(&path, e.to_string()))?;
    if views.is_empty() {
        return Err(SceneError::descriptor(&path, "it holds no views; remove it to have them placed"));
    }
    check(&views).map_err(|reason| SceneError::descriptor(&path, reason))?;
    Ok(Some(views))
}

/// Whether every view is a usable camera.
pub(super) fn check(views: &[View]) -> Result<(), String> {
    for view in views {
        let [eye, target, up] = [view.eye, view.target, view.up].map(Vec3::from_array);
        let usable = eye.is_finite()
            && target.is_finite()
            && up.is_finite()
            && (target - eye).cross(up).length_squared() > 0.0
            && view.vfov_degrees > 0.0
            && view.vfov_degrees < 180.0;
        if !usable {
            return Err(format!(
                "view '{}' is no camera: eye and target must differ, up must not point along the view, \
                 and vfov_degrees must lie between 0 and 180",
                view.name
            ));
        }
    }
    Ok(())
}

/// Places eight views that see the triangles. The same triangles always get the same views.
///
/// Time grows with the number of triangles: about half a second for a million on two cores.
pub fn place(triangles: &[[[f32; 3]; 3]]) -> Vec<View> {
    let probe = Probe::new(triangles);
    let (low, high) = core_box(triangles);
    let diagonal = (high - low).length();
    let diagonal = if diagonal > 0.0 && diagonal.is_finite() { diagonal } else { 1.0 };
    let centre = (low + high) / 2.0;

    let (mut whole, mut close) = (Vec::new(), Vec::new());
    let fit = 0.5 * diagonal / (FOV_DEGREES.to_radians() / 2.0).tan();
    for k in 0..12 {
        let yaw = TAU * k as f32 / 12.0;
        for elevation in [0.2, 0.6] {
            whole.push((centre + 0.95 * fit * look(yaw + elevation, elevation), centre));
        }
        let target = centre + 0.12 * diagonal * look(yaw + 1.0, 0.4);
        close.push((target + 0.55 * fit * look(yaw, 0.3), target));
    }
    let judged = |cameras: Vec<(Vec3, Vec3)>| -> Vec<Candidate> {
        cameras.into_par_iter().map(|(eye, target)| judge(&probe, eye, target, diagonal)).collect()
    };

    let random = Random::new(0x5eed);
    let inside: Vec<(Candidate, u32)> = (0..INSIDE_POINTS)
        .into_par_iter()
        .filter_map(|i| inside_candidate(&probe, &mut random.fork(i), low, high, diagonal))
        .collect();
    let enclosed =
        inside.iter().filter(|(candidate, sides)| *sides >= SIDES - 2 && candidate.score > 0.05).count();
    let interior = enclosed >= COUNT && enclosed * 3 >= inside.len();
    // Around a lone object more than half of all directions lead past it.
    let sides: u32 = inside.iter().map(|(_, sides)| sides).sum();
    let object = inside.len() * 4 < INSIDE_POINTS as usize || sides * 2 < SIDES * inside.len() as u32;
    let inside: Vec<Candidate> = inside.into_iter().map(|(candidate, _)| candidate).collect();

    let mut chosen = Vec::new();
    let mut candidates = inside;
    if !interior {
        // From outside a closed interior there is only its shell; anything else is worth an overview.
        choose(judged(whole), diagonal, if object { 4 } else { 2 }, &mut chosen);
        candidates.extend(judged(close));
    }
    choose(candidates, diagonal, COUNT, &mut chosen);
    chosen
        .into_iter()
        .enumerate()
        .map(|(i, c)| View {
            name: format!("auto_{i}"),
            eye: c.eye.to_array(),
            target: c.target.to_array(),
            up: [0.0, 1.0, 0.0],
            vfov_degrees: FOV_DEGREES,
        })
        .collect()
}

/// The share of surface points seen by `views` from which a random direction leads out of the scene.
pub(super) fn share_that_sees_sky(probe: &Probe<'_>, views: &[View]) -> f32 {
    let mut random = Random::new(11);
    let (mut out, mut all) = (0u32, 0u32);
    for view in views {
        let (eye, target) = (Vec3::from_array(view.eye), Vec3::from_array(view.target));
        for direction in picture(eye, target, view.vfov_degrees) {
            all += 1;
            let Some(hit) = probe.hit(eye, direction, 0.0) else {
                out += 1;
                continue;
            };
            let normal = if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal };
            let bounce = (normal + random.direction()).normalize_or(normal);
            let start = eye + hit.t * direction + 1e-4 * hit.t * normal;
            out += u32::from(probe.hit(start, bounce, 1e-4 * hit.t).is_none());
        }
    }
    out as f32 / all.max(1) as f32
}

/// The box that holds the middle 98 % of triangles along each axis, so that a far outlier does not count.
fn core_box(triangles: &[[[f32; 3]; 3]]) -> (Vec3, Vec3) {
    let (all_low, all_high) = super::bounds(triangles);
    let (all_low, all_high) = (Vec3::from_array(all_low), Vec3::from_array(all_high));
    if triangles.len() < 1000 {
        return (all_low, all_high);
    }
    let step = (triangles.len() / 20_000).max(1);
    let mut low = Vec3::ZERO;
    let mut high = Vec3::ZERO;
    for axis in 0..3 {
        let mut values: Vec<f32> =
            triangles.iter().step_by(step).flatten().map(|corner| corner[axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
        low[axis] = values[values.len() / 100];
        high[axis] = values[values.len() - 1 - values.len() / 100];
    }
    // A flat direction may be lost to outliers elsewhere; never return an empty box.
    if (high - low).max_element() > 0.0 { (low, high) } else { (all_low, all_high) }
}

#[derive(Clone, Copy)]
struct Candidate {
    eye: Vec3,
    target: Vec3,
    score: f32,
}

fn look(yaw: f32, pitch: f32) -> Vec3 {
    Vec3::new(yaw.cos() * pitch.cos(), pitch.sin(), yaw.sin() * pitch.cos())
}

/// Directions of a coarse picture.
fn picture(eye: Vec3, target: Vec3, fov_degrees: f32) -> impl Iterator<Item = Vec3> {
    let forward = (target - eye).normalize_or(Vec3::Z);
    let right = forward.cross(Vec3::Y).normalize_or(Vec3::X);
    let up = right.cross(forward);
    let half = (fov_degrees.to_radians() / 2.0).tan();
    (0..GRID.0 * GRID.1).map(move |i| {
        let x = ((i % GRID.0) as f32 + 0.5) / GRID.0 as f32 * 2.0 - 1.0;
        let y = ((i / GRID.0) as f32 + 0.5) / GRID.1 as f32 * 2.0 - 1.0;
        (forward + right * (x * half * ASPECT) + up * (y * half)).normalize()
    })
}

fn judge(probe: &Probe<'_>, eye: Vec3, target: Vec3, diagonal: f32) -> Candidate {
    let rays = (GRID.0 * GRID.1) as f32;
    let (mut hits, mut near, mut back, mut sum, mut squares) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let mut triangles = HashSet::new();
    for direction in picture(eye, target, FOV_DEGREES) {
        let Some(hit) = probe.hit(eye, direction, 0.0) else {
            continue;
        };
        hits += 1.0;
        triangles.insert(hit.triangle);
        near += f32::from(u8::from(hit.t < 0.04 * diagonal));
        back += f32::from(u8::from(hit.normal.dot(direction) > 0.0));
        let depth = (hit.t / diagonal).max(1e-4).ln();
        sum += depth;
        squares += depth * depth;
    }
    let mut score = 0.0;
    if hits > 0.0 {
        let spread = (squares / hits - (sum / hits) * (sum / hits)).max(0.0).sqrt();
        let seen = (hits / rays / 0.6).min(1.0);
        let front = 1.0 - back / hits;
        let detail = 0.25 + 0.75 * triangles.len() as f32 / hits;
        score = detail * seen * (0.2 + spread.min(1.0)) * (1.0 - near / rays).powi(3) * front * front;
    }
    Candidate { eye, target, score }
}

/// A camera inside the box, and on how many of [`SIDES`] sides it has geometry.
fn inside_candidate(
    probe: &Probe<'_>,
    random: &mut Random,
    low: Vec3,
    high: Vec3,
    diagonal: f32,
) -> Option<(Candidate, u32)> {
    let size = high - low;
    let at = low + size * Vec3::new(random.unit(), random.range(0.05, 0.95), random.unit());
    let eye = match probe.hit(at, Vec3::NEG_Y, 0.0) {
        Some(floor) => at - Vec3::Y * (floor.t - (0.35 * floor.t).clamp(0.03 * diagonal, 0.12 * diagonal)),
        None => at,
    };
    let (mut hits, mut back) = (0, 0);
    for k in 0..SIDES {
        // A Fibonacci sphere.
        let y = 1.0 - (2.0 * k as f32 + 1.0) / SIDES as f32;
        let direction = look(k as f32 * 2.399_963, y.asin());
        if let Some(hit) = probe.hit(eye, direction, 0.0) {
            if hit.t < 0.012 * diagonal {
                return None;
            }
            hits += 1;
            back += u32::from(hit.normal.dot(direction) > 0.0);
        }
    }
    if back * 2 > hits {
        return None;
    }
    let start = random.unit() * TAU;
    (0..TURNS)
        .map(|k| {
            let direction = look(start + TAU * k as f32 / TURNS as f32, random.range(-0.2, 0.05));
            judge(probe, eye, eye + 0.2 * diagonal * direction, diagonal)
        })
        .max_by(|a, b| a.score.total_cmp(&b.score))
        .map(|candidate| (candidate, hits))
}

/// Until there are `count` views, takes the best of those that differ most from all taken so far.
fn choose(mut candidates: Vec<Candidate>, diagonal: f32, count: usize, chosen: &mut Vec<Candidate>) {
    while chosen.len() < count {
        let worth = |c: &Candidate| {
            let difference = chosen
                .iter()
                .map(|d| {
                    let turn = (c.target - c.eye).angle_between(d.target - d.eye) / PI;
                    (c.eye - d.eye).length() / diagonal + turn
                })
                .fold(1.0, f32::min);
            c.score * (difference + 0.02)
        };
        let best =
            (0..candidates.len()).max_by(|&a, &b| worth(&candidates[a]).total_cmp(&worth(&candidates[b])));
        let Some(best) = best else { break };
        chosen.push(candidates.swap_remove(best));
    }
}

#[cfg(test)]
mod tests {
    use super::super::Generator;
    use super::*;

    /// The share of a view's rays that hit, and the nearest hit.
    fn seen(triangles: &[[[f32; 3]; 3]], view: &View) -> (f32, f32) {
        let probe = Probe::new(triangles);
        let (eye, target) = (Vec3::from_array(view.eye), Vec3::from_array(view.target));
        let hits: Vec<f32> = picture(eye, target, view.vfov_degrees)
            .filter_map(|d| probe.hit(eye, d, 0.0))
            .map(|hit| hit.t)
            .collect();
        (hits.len() as f32 / (GRID.0 * GRID.1) as f32, hits.iter().copied().fold(f32::INFINITY, f32::min))
    }

    #[test]
    fn every_placed_view_sees_geometry_from_a_distance() {
        for generator in Generator::ALL {
            let triangles = generator.generate(5000, 1).positions;
            let (low, high) = super::super::bounds(&triangles);
            let diagonal = (Vec3::from_array(high) - Vec3::from_array(low)).length();
            let views = place(&triangles);
            assert_eq!(views.len(), COUNT, "{generator:?}");
            check(&views).unwrap();
            for view in &views {
                let (share, nearest) = seen(&triangles, view);
                assert!(share > 0.1, "{generator:?} {view:?} sees {share}");
                assert!(nearest > 0.002 * diagonal, "{generator:?} {view:?} stares at {nearest}");
            }
        }
    }

    #[test]
    fn a_closed_room_is_looked_at_from_inside() {
        let triangles = Generator::Cornell.generate(2000, 1).positions;
        let (low, high) = super::super::bounds(&triangles);
        for view in place(&triangles) {
            for k in 0..3 {
                assert!(view.eye[k] > low[k] && view.eye[k] < high[k], "{view:?}");
            }
        }
    }

    #[test]
    fn a_solid_is_looked_at_from_outside() {
        let ball: Vec<[[f32; 3]; 3]> = {
            let at = |i: u32, j: u32| look(TAU * i as f32 / 24.0, PI * (j as f32 / 12.0 - 0.5)).to_array();
            (0..24)
                .flat_map(|i| (0..12).map(move |j| (i, j)))
                .flat_map(|(i, j)| {
                    [[at(i, j), at(i, j + 1), at(i + 1, j)], [at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)]]
                })
                .collect()
        };
        let views = place(&ball);
        assert_eq!(views.len(), COUNT);
        for view in views {
            assert!(Vec3::from_array(view.eye).length() > 1.0, "{view:?}");
        }
    }

    #[test]
    fn degenerate_scenes_still_get_views() {
        for triangles in [
            vec![[[1.0; 3]; 3]],
            vec![[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]],
            vec![[[0.0, 0.0, 0.0], [1e30, 0.0, 0.0], [0.0, 1e30, 0.0]]],
        ] {
            let views = place(&triangles);
            assert_eq!(views.len(), COUNT);
            check(&views).unwrap();
        }
    }
}
