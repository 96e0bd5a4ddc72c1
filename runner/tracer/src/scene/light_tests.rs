//! Does light reach the views of every built-in scene? A tiny path tracer on the CPU takes a look.
//!
//! With `BROADLEAF_PREVIEW=FOLDER` it also writes the pictures there, larger, as PPM.

use std::io::Write;
use std::path::{Path, PathBuf};

use glam::Vec3;
use rayon::prelude::*;

use super::probe::Probe;
use super::random::Random;
use super::{Scene, SceneError, SearchPath, View, built_in, load};

const DEPTH: u32 = 8;

fn radiance(
    scene: &Scene,
    probe: &Probe<'_>,
    mut origin: Vec3,
    mut direction: Vec3,
    random: &mut Random,
) -> Vec3 {
    let mut light = Vec3::ZERO;
    let mut weight = Vec3::ONE;
    for _ in 0..DEPTH {
        let Some(hit) = probe.hit(origin, direction, 0.0) else {
            return light + weight * Vec3::from_array(scene.sky.radiance(direction.to_array()));
        };
        let material = &scene.materials[scene.material_ids[hit.triangle as usize] as usize];
        light += weight * Vec3::from_array(material.emission);
        weight *= Vec3::from_array(material.albedo);
        let normal = if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal };
        let at = origin + hit.t * direction;
        origin = at + normal * (1e-4 * hit.t.max(at.length() * 0.1));
        direction = (normal + random.direction()).normalize_or(normal);
    }
    light
}

fn picture(scene: &Scene, probe: &Probe<'_>, view: &View, (w, h): (u32, u32), samples: u32) -> Vec<Vec3> {
    let (eye, target) = (Vec3::from_array(view.eye), Vec3::from_array(view.target));
    let forward = (target - eye).normalize();
    let right = forward.cross(Vec3::from_array(view.up)).normalize();
    let up = right.cross(forward);
    let half = (view.vfov_degrees.to_radians() / 2.0).tan();
    (0..w * h)
        .into_par_iter()
        .map(|i| {
            let mut random = Random::new(3).fork(u64::from(i));
            let mut sum = Vec3::ZERO;
            for _ in 0..samples {
                let x = ((i % w) as f32 + random.unit()) / w as f32 * 2.0 - 1.0;
                let y = 1.0 - ((i / w) as f32 + random.unit()) / h as f32 * 2.0;
                let direction =
                    (forward + right * (x * half * w as f32 / h as f32) + up * (y * half)).normalize();
                sum += radiance(scene, probe, eye, direction, &mut random);
            }
            sum / samples as f32
        })
        .collect()
}

fn luminance(c: &Vec3) -> f32 {
    c.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

fn write_preview(folder: &Path, name: &str, (w, h): (u32, u32), pixels: &[Vec3]) {
    let mut file = std::fs::File::create(folder.join(format!("{name}.ppm"))).unwrap();
    let bytes: Vec<u8> = pixels
        .iter()
        .flat_map(|c| c.to_array())
        .map(|x| (255.0 * (1.0 - (-1.2 * x).exp()).powf(1.0 / 2.2)) as u8)
        .collect();
    write!(file, "P6\n{w} {h}\n255\n").unwrap();
    file.write_all(&bytes).unwrap();
}

/// The folders with the real scenes: the environment's, or those beside the workspace.
fn folders() -> SearchPath {
    SearchPath::new([Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes")])
}

#[test]
fn light_reaches_every_view() {
    let preview = std::env::var_os("BROADLEAF_PREVIEW").map(PathBuf::from);
    let only = std::env::var("BROADLEAF_PREVIEW_ONLY").unwrap_or_default();
    let mut dark = Vec::new();
    for entry in built_in().iter().filter(|entry| entry.name.contains(&only)) {
        let scene = match load(entry.name, &folders()) {
            Ok(scene) => scene,
            Err(SceneError::MissingFile { file, .. }) => {
                println!("SKIPPED: {file} is not there; set BROADLEAF_SCENES");
                continue;
            }
            Err(e) => panic!("{e}"),
        };
        assert!(scene.report.notes.is_empty(), "{}: {:?}", scene.name, scene.report.notes);
        let probe = Probe::new(&scene.positions);
        for view in &scene.views {
            let (size, samples) = if preview.is_some() { ((72, 48), 16) } else { ((18, 12), 24) };
            let pixels = picture(&scene, &probe, view, size, samples);
            if let Some(folder) = &preview {
                write_preview(folder, &format!("{} {}", scene.name, view.name), size, &pixels);
            }
            let mean = pixels.iter().map(luminance).sum::<f32>() / pixels.len() as f32;
            let black = pixels.iter().filter(|p| luminance(p) < 0.01).count() as f32 / pixels.len() as f32;
            if preview.is_some() {
                println!("{} {}: mean {mean:.3}, black {black:.2}", scene.name, view.name);
            }
            if !(0.12..4.0).contains(&mean) || black > 0.2 {
                dark.push(format!("{} {}: mean {mean:.3}, black {black:.2}", scene.name, view.name));
            }
        }
    }
    assert!(dark.is_empty(), "badly lit:\n{}", dark.join("\n"));
}
