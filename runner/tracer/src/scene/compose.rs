//! Scenes put together of models: each in its place and of a material, with lights and a camera (Lewis 2024, RTRS,
//! appendix B.1).

use glam::{DMat4, DQuat, DVec3, DVec4};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Geometry, Light, LoadReport, Material, Phong, View};

/// Most views of an orbit.
pub const MOST_VIEWS: u32 = 360;

/// A model file in its place.
///
/// Its corners are scaled, then turned, then moved; or taken through `matrix`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Its path, relative to the descriptor's folder; looked for on the search path, too.
    pub file: String,
    /// Its hash in lower-case hexadecimal; not checked if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// The descriptor's material that all of it is made of, counted from 0; the file's own materials if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<u32>,
    /// Factors along x, y and z.
    #[serde(default = "once", skip_serializing_if = "is_once")]
    pub scale: [f32; 3],
    /// Degrees about the axes x, then y, then z; positive from y to z, from z to x and from x to y.
    #[serde(default, skip_serializing_if = "is_nowhere")]
    pub rotate: [f32; 3],
    /// What is added to x, y and z.
    #[serde(default, skip_serializing_if = "is_nowhere")]
    pub translate: [f32; 3],
    /// Instead of these three: rows of a matrix by which the column (x, y, z, 1) is multiplied.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub matrix: Option<[[f32; 4]; 3]>,
}

fn once() -> [f32; 3] {
    [1.0; 3]
}

fn is_once(factors: &[f32; 3]) -> bool {
    *factors == once()
}

fn is_nowhere(amounts: &[f32; 3]) -> bool {
    *amounts == [0.0; 3]
}

impl Model {
    /// The model of a file where it is.
    pub fn new(file: impl Into<String>, material: Option<u32>) -> Self {
        Self {
            file: file.into(),
            sha256: None,
            material,
            scale: once(),
            rotate: [0.0; 3],
            translate: [0.0; 3],
            matrix: None,
        }
    }

    /// Where its corners go.
    fn transform(&self) -> DMat4 {
        if let Some([x, y, z]) = self.matrix {
            let row = |row: [f32; 4]| DVec4::from_array(row.map(f64::from));
            return DMat4::from_cols(row(x), row(y), row(z), DVec4::W).transpose();
        }
        let [scale, rotate, translate] =
            [self.scale, self.rotate, self.translate].map(|v| DVec3::from_array(v.map(f64::from)));
        let turn = rotate.map(f64::to_radians);
        let turn =
            DQuat::from_rotation_z(turn.z) * DQuat::from_rotation_y(turn.y) * DQuat::from_rotation_x(turn.x);
        DMat4::from_scale_rotation_translation(scale, turn, translate)
    }

    /// What is wrong with it, where the descriptor has so many materials.
    fn check(&self, materials: usize) -> Result<(), String> {
        let numbers = [self.scale, self.rotate, self.translate];
        let rows = self.matrix.into_iter().flatten().flatten();
        if numbers.into_iter().flatten().chain(rows).any(|x| !x.is_finite()) {
            return Err("its transformation has a number that is not finite".into());
        }
        if self.matrix.is_some() && numbers != [once(), [0.0; 3], [0.0; 3]] {
            return Err(
                "a matrix stands instead of scale, rotate and translate; leave one of the two out".into()
            );
        }
        if self.transform().determinant() == 0.0 {
            return Err("its transformation makes it flat: no factor of a scale may be 0".into());
        }
        // Without any there is one, the default.
        let count = materials.max(1);
        match self.material {
            Some(material) if material as usize >= count => Err(match materials {
                0 => {
                    format!("its material is {material}, and where no material is described there is only 0")
                }
                1 => format!("its material is {material}, and there is one, which is 0"),
                _ => format!("its material is {material}, and there are {count}: 0 to {}", count - 1),
            }),
            _ => Ok(()),
        }
    }
}

/// A material that a descriptor describes.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Surface {
    /// For people, and for `[[emissive]]`; may be left out.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Diffuse reflectance, linear RGB, each channel in 0 to 1.
    pub albedo: [f32; 3],
    /// How a local shading model lights it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phong: Option<Phong>,
}

impl Surface {
    fn check(&self) -> Result<(), String> {
        if self.albedo.iter().any(|channel| !(0.0..=1.0).contains(channel)) {
            return Err(format!("its colour is {:?}, and each channel is from 0 to 1", self.albedo));
        }
        match self.phong {
            Some(Phong { diffuse, specular, reflective, shininess })
                if [diffuse, specular, reflective, shininess].iter().any(|x| !x.is_finite() || *x < 0.0) =>
            {
                Err("its coefficients and its shininess must be finite and not negative".into())
            }
            _ => Ok(()),
        }
    }

    fn material(&self) -> Material {
        Material { phong: self.phong, ..Material::diffuse(&self.name, self.albedo) }
    }
}

/// A camera that stays, or circles its target.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct CameraPath {
    /// Where it is, or starts.
    pub eye: [f32; 3],
    /// The point it looks at.
    pub target: [f32; 3],
    /// Vertical field of view in degrees.
    #[serde(default = "CameraPath::default_vfov")]
    pub vfov_degrees: f32,
    /// On how many places of its circle there is a view, 1 to [`MOST_VIEWS`]; it stays if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orbit: Option<u32>,
}

impl CameraPath {
    /// Views of an orbit where nobody says how many: as many as scenes have otherwise.
    pub const ORBIT: u32 = 8;

    /// Vertical field of view where nobody says, in degrees: RTRS's paper does not tell its own.
    pub fn default_vfov() -> f32 {
        60.0
    }

    /// One view called `camera`, or those of the orbit, `orbit_0` at the eye and so on.
    ///
    /// The orbit is RTRS's: around the vertical axis through the target, at the eye's height and distance from that axis,
    /// with y up. It goes from z to x, by equal angles.
    pub fn views(&self) -> Vec<View> {
        let [eye, target] = [self.eye, self.target].map(|v| DVec3::from_array(v.map(f64::from)));
        let at = |name, eye| View {
            name,
            eye,
            target: self.target,
            up: [0.0, 1.0, 0.0],
            vfov_degrees: self.vfov_degrees,
        };
        let Some(count) = self.orbit else { return vec![at("camera".into(), self.eye)] };
        (0..count)
            .map(|i| {
                let angle = std::f64::consts::TAU * f64::from(i) / f64::from(count);
                let place = target + DQuat::from_rotation_y(angle) * (eye - target);
                at(format!("orbit_{i}"), if i == 0 { self.eye } else { place.as_vec3().to_array() })
            })
            .collect()
    }

    fn check(&self) -> Result<(), String> {
        if self.orbit.is_some_and(|count| !(1..=MOST_VIEWS).contains(&count)) {
            return Err(format!("an orbit has 1 to {MOST_VIEWS} views"));
        }
        super::views::check(&self.views())
    }
}

/// What is wrong with a scene of these parts.
pub(super) fn check(
    models: &[Model],
    materials: &[Surface],
    lights: &[Light],
    camera: Option<&CameraPath>,
) -> Result<(), String> {
    for (i, model) in models.iter().enumerate() {
        model.check(materials.len()).map_err(|reason| format!("model {i} ({}): {reason}", model.file))?;
    }
    for (i, material) in materials.iter().enumerate() {
        material.check().map_err(|reason| format!("material {i}: {reason}"))?;
    }
    for (i, Light { position, strength }) in lights.iter().enumerate() {
        if position.iter().any(|x| !x.is_finite()) || !strength.is_finite() || *strength < 0.0 {
            return Err(format!("light {i}: its place and strength must be finite, and that not negative"));
        }
    }
    camera.map_or(Ok(()), CameraPath::check).map_err(|reason| format!("camera: {reason}"))
}

/// Puts models together: each with what its file holds. Of their own materials only those are kept that are needed.
pub(super) fn compose(
    parts: impl IntoIterator<Item = Result<(Model, Geometry), super::SceneError>>,
    surfaces: &[Surface],
    report: &mut LoadReport,
) -> Result<Geometry, super::SceneError> {
    let mut materials: Vec<Material> = surfaces.iter().map(Surface::material).collect();
    if materials.is_empty() {
        materials.push(super::load::default_material());
    }
    let mut whole = Geometry { materials, ..Geometry::default() };
    for part in parts {
        let (model, mut geometry) = part?;
        let transform = model.transform();
        if transform != DMat4::IDENTITY {
            geometry.positions.par_iter_mut().flatten().for_each(|corner| {
                let point = DVec3::from_array(corner.map(f64::from));
                *corner = transform.transform_point3(point).as_vec3().to_array();
            });
        }
        let first = whole.materials.len() as u32;
        if model.material.is_none() {
            whole.materials.append(&mut geometry.materials);
        }
        for (triangle, own) in geometry.positions.into_iter().zip(geometry.material_ids) {
            if triangle.iter().flatten().all(|x| x.is_finite()) {
                whole.positions.push(triangle);
                whole.material_ids.push(model.material.unwrap_or(first + own));
            } else {
                report.non_finite += 1;
            }
        }
    }
    Ok(whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(model: &Model, point: [f64; 3]) -> [f32; 3] {
        model
            .transform()
            .transform_point3(DVec3::from_array(point))
            .as_vec3()
            .to_array()
            .map(|x| (x * 1e5).round() / 1e5)
    }

    #[test]
    fn a_model_is_scaled_then_turned_then_moved() {
        let model = Model { scale: [2.0, 1.0, 1.0], ..Model::new("x", None) };
        assert_eq!(moved(&model, [1.0, 1.0, 1.0]), [2.0, 1.0, 1.0]);
        let model = Model { rotate: [0.0, 90.0, 0.0], ..model };
        assert_eq!(moved(&model, [1.0, 0.0, 0.0]), [0.0, 0.0, -2.0]);
        let model = Model { translate: [0.0, 5.0, 0.5], ..model };
        assert_eq!(moved(&model, [1.0, 0.0, 0.0]), [0.0, 5.0, -1.5]);
        // About x first: y becomes z, which the turn about y takes to x.
        let model = Model { rotate: [90.0, 90.0, 0.0], ..Model::new("x", None) };
        assert_eq!(moved(&model, [0.0, 1.0, 0.0]), [1.0, 0.0, 0.0]);
        let rows = [[0.0, 1.0, 0.0, 7.0], [2.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]];
        let model = Model { matrix: Some(rows), ..Model::new("x", None) };
        assert_eq!(moved(&model, [1.0, 3.0, 5.0]), [10.0, 2.0, 4.0]);
    }

    #[test]
    fn an_orbit_keeps_height_and_distance() {
        let camera =
            CameraPath { eye: [8.0, 4.0, 8.0], target: [0.0, 1.0, 0.0], vfov_degrees: 60.0, orbit: Some(4) };
        let views = camera.views();
        let eyes: Vec<_> = views.iter().map(|view| view.eye.map(|x| (x * 1e4).round() / 1e4)).collect();
        assert_eq!(eyes, [[8.0, 4.0, 8.0], [8.0, 4.0, -8.0], [-8.0, 4.0, -8.0], [-8.0, 4.0, 8.0]]);
        assert!(views.iter().all(|view| view.target == [0.0, 1.0, 0.0] && view.up == [0.0, 1.0, 0.0]));
        assert_eq!(views[3].name, "orbit_3");
        let fixed = CameraPath { orbit: None, ..camera }.views();
        assert_eq!((fixed.len(), fixed[0].eye, &*fixed[0].name), (1, [8.0, 4.0, 8.0], "camera"));
    }
}
