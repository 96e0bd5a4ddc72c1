//! Scenes that RTRS has written: JSON with everything in it (Lewis 2024, listings 1 and 2, appendix B.1).
//!
//! ```json
//! {
//!   "camera": { "pos": [0, 0, 10], "at": [0, 0, 0] },
//!   "camera_controller": "Orbit",
//!   "prims": [{ "indices": [0, 1, 2], "material": 0 }],
//!   "vertices": [{ "pos": [0, 0, 0], "normal": [0, 0, 1] }, …],
//!   "lights": [{ "pos": [20, 20, 20], "strength": 1.5 }],
//!   "materials": [{ "color": [0.4, 0.4, 0.3], "albedo": [0.6, 0.3, 0.1], "spec": 50 }]
//! }
//! ```
//!
//! The paper prints the names of the first level and of the camera. Those of the others are inferred: that a `prim` is
//! three indices and a material fits its figure 8 (16 bytes a triangle) and the tool's sources; the seven numbers of a
//! material are those of `--material`, in its order. What else there is, such as normals, is not looked at.

use serde::Deserialize;
use std::path::Path;

use super::compose::CameraPath;
use super::{Geometry, Light, LoadReport, Material, Phong, SceneError};

#[derive(Deserialize)]
struct File {
    camera: Camera,
    camera_controller: Controller,
    prims: Vec<Prim>,
    vertices: Vec<Vertex>,
    #[serde(default)]
    lights: Vec<PointLight>,
    #[serde(default)]
    materials: Vec<PrimMat>,
}

#[derive(Deserialize)]
struct Camera {
    pos: [f32; 3],
    at: [f32; 3],
}

/// `"Orbit"`, or in sources of another day `{ "Orbit": { … } }` with the keys that are held.
#[derive(Deserialize)]
#[serde(untagged)]
enum Controller {
    Name(ControllerName),
    Held(std::collections::BTreeMap<ControllerName, serde::de::IgnoredAny>),
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
enum ControllerName {
    Fixed,
    Orbit,
}

#[derive(Deserialize)]
struct Prim {
    indices: [u32; 3],
    material: u32,
}

#[derive(Deserialize)]
struct Vertex {
    /// As f64, so that one that no f32 can hold is skipped and counted, and does not spoil the file.
    pos: [f64; 3],
}

#[derive(Deserialize)]
struct PointLight {
    pos: [f32; 3],
    strength: f32,
}

#[derive(Deserialize)]
struct PrimMat {
    color: [f32; 3],
    albedo: [f32; 3],
    spec: f32,
}

/// What a file holds.
pub(super) struct Parsed {
    pub geometry: Geometry,
    pub lights: Vec<Light>,
    pub camera: CameraPath,
}

/// Reads the file whose bytes are given; `path` is for messages.
pub(super) fn load(path: &Path, bytes: &[u8], report: &mut LoadReport) -> Result<Parsed, SceneError> {
    let wrong = |reason: String| SceneError::format(path, reason);
    let file: File = serde_json::from_slice(bytes)
        .map_err(|error| wrong(format!("it is no scene of RTRS in JSON: {error}")))?;
    let orbits = match &file.camera_controller {
        Controller::Name(name) => *name == ControllerName::Orbit,
        Controller::Held(map) => map.contains_key(&ControllerName::Orbit),
    };
    let camera = CameraPath {
        eye: file.camera.pos,
        target: file.camera.at,
        vfov_degrees: CameraPath::default_vfov(),
        orbit: orbits.then_some(CameraPath::ORBIT),
    };
    let lights: Vec<Light> = file
        .lights
        .into_iter()
        .map(|PointLight { pos, strength }| Light { position: pos, strength })
        .collect();
    let mut bright = 0;
    let mut materials = Vec::with_capacity(file.materials.len().max(1));
    for PrimMat { color, albedo: [diffuse, specular, reflective], spec: shininess } in file.materials {
        bright += u32::from(color.iter().any(|channel| !(0.0..=1.0).contains(channel)));
        let colour = color.map(|channel| if channel.is_finite() { channel.clamp(0.0, 1.0) } else { 0.5 });
        let phong = Some(Phong { diffuse, specular, reflective, shininess });
        materials.push(Material { phong, ..Material::diffuse("", colour) });
    }
    if bright > 0 {
        report.notes.push(format!(
            "{bright} materials reflect less than nothing or more than all light; cut to 0 and 1"
        ));
    }
    if materials.is_empty() {
        materials.push(super::load::default_material());
    }
    let mut geometry = Geometry { materials, ..Geometry::default() };
    for (i, Prim { indices, material }) in file.prims.iter().enumerate() {
        if *material as usize >= geometry.materials.len() {
            let count = geometry.materials.len();
            return Err(wrong(format!("prims[{i}] is of material {material}, and there are {count}")));
        }
        let [a, b, c] =
            indices.map(|index| file.vertices.get(index as usize).map(|vertex| vertex.pos.map(|x| x as f32)));
        let (Some(a), Some(b), Some(c)) = (a, b, c) else {
            report.out_of_range += 1;
            continue;
        };
        if [a, b, c].iter().flatten().all(|x| x.is_finite()) {
            geometry.positions.push([a, b, c]);
            geometry.material_ids.push(*material);
        } else {
            report.non_finite += 1;
        }
    }
    super::compose::check(&[], &[], &lights, Some(&camera)).map_err(wrong)?;
    Ok(Parsed { geometry, lights, camera })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> serde_json::Value {
        serde_json::json!({
            "camera": { "pos": [0.0, 0.0, 10.0], "at": [0.0, 0.0, 0.0] },
            "camera_controller": "Orbit",
            "prims": [
                { "indices": [0, 1, 2], "material": 1 },
                { "indices": [2, 1, 0], "material": 0 },
                { "indices": [0, 1, 3], "material": 0 },
            ],
            "vertices": [
                { "pos": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0] },
                { "pos": [1.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0] },
                { "pos": [0.0, 1.0, 0.5], "normal": [0.0, 0.0, 1.0] },
            ],
            "lights": [{ "pos": [20.0, 20.0, 20.0], "strength": 1.5 }],
            "materials": [
                { "color": [0.4, 0.4, 0.3], "albedo": [0.6, 0.3, 0.1], "spec": 50.0 },
                { "color": [0.3, 0.1, 0.1], "albedo": [0.9, 0.1, 0.0], "spec": 10.0 },
            ],
        })
    }

    fn parse(value: &serde_json::Value) -> Result<(Parsed, LoadReport), String> {
        let mut report = LoadReport::default();
        let parsed = load(Path::new("x.json"), value.to_string().as_bytes(), &mut report);
        parsed.map(|parsed| (parsed, report)).map_err(|error| error.to_string())
    }

    #[test]
    fn everything_arrives_in_its_place() {
        let (Parsed { geometry, lights, camera }, report) = parse(&scene()).unwrap();
        let (a, b, c) = ([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]);
        assert_eq!(geometry.positions, [[a, b, c], [c, b, a]]);
        assert_eq!(geometry.material_ids, [1, 0]);
        assert_eq!(report.out_of_range, 1);
        assert_eq!(geometry.materials[0].albedo, [0.4, 0.4, 0.3]);
        let phong = Phong { diffuse: 0.9, specular: 0.1, reflective: 0.0, shininess: 10.0 };
        assert_eq!(geometry.materials[1].phong, Some(phong));
        assert_eq!(lights, [Light { position: [20.0; 3], strength: 1.5 }]);
        assert_eq!((camera.eye, camera.target, camera.orbit), ([0.0, 0.0, 10.0], [0.0; 3], Some(8)));
        for (controller, orbit) in [
            (serde_json::json!("Fixed"), None),
            (serde_json::json!({ "Orbit": { "left": false, "right": true } }), Some(8)),
        ] {
            let mut other = scene();
            other["camera_controller"] = controller;
            assert_eq!(parse(&other).unwrap().0.camera.orbit, orbit);
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (at, value, words) in [
            ("/prims/1/material", serde_json::json!(2), "prims[1] is of material 2"),
            ("/prims/0/indices", serde_json::json!([0, 1]), "no scene of RTRS"),
            ("/camera_controller", serde_json::json!("Free"), "no scene of RTRS"),
            ("/camera/at", serde_json::json!([0.0, 0.0, 10.0]), "is no camera"),
            ("/lights/0/strength", serde_json::json!(-1.0), "light 0"),
            ("/vertices/0", serde_json::json!({ "normal": [0, 0, 1] }), "pos"),
        ] {
            let mut other = scene();
            *other.pointer_mut(at).unwrap() = value;
            let error = parse(&other).map(|_| ()).unwrap_err();
            assert!(error.contains(words) && error.contains("x.json"), "{at}: {error}");
        }
        assert!(parse(&serde_json::Value::Null).is_err());
        let mut far = scene();
        far["vertices"][2]["pos"][0] = serde_json::json!(1e39);
        assert_eq!(parse(&far).unwrap().1.non_finite, 2);
    }
}
