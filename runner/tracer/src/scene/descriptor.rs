//! Scene descriptors: what `scenes/NAME.toml` says about a scene.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{CameraPath, Generator, Light, Model, SceneError, Sky, Surface, View, compose};

/// The contents of `scenes/NAME.toml`; `NAME` is the scene's name.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Descriptor {
    /// One line about the scene.
    pub title: String,
    /// Licence of the geometry.
    pub licence: String,
    /// Who is to be credited.
    pub credit: String,
    /// Where a user gets the file, as a sentence; empty for generators.
    #[serde(default)]
    pub get: String,
    /// File, generator or models.
    pub source: Source,
    /// What models are made of, counted from 0 in their order; a grey one if absent. Only where the source is models.
    #[serde(default, rename = "material", skip_serializing_if = "Vec::is_empty")]
    pub materials: Vec<Surface>,
    /// Points that shine, which the path tracer does not see.
    #[serde(default, rename = "light", skip_serializing_if = "Vec::is_empty")]
    pub lights: Vec<Light>,
    /// Light from outside; a default if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sky: Option<Sky>,
    /// Materials that emit light, in addition to those that do so in the file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub emissive: Vec<Emissive>,
    /// A camera instead of views: one view, or several on its orbit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<CameraPath>,
    /// Views, at least one; placed automatically if absent and there is no camera.
    #[serde(default, rename = "view", skip_serializing_if = "Vec::is_empty")]
    pub views: Vec<View>,
}

/// Where the triangles come from.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(try_from = "PlainSource", into = "PlainSource")]
pub enum Source {
    /// A model file, looked for beside the descriptor and on the search path.
    File {
        /// Its name, or a path relative to a searched folder.
        file: String,
        /// Its hash in lower-case hexadecimal; not checked if absent.
        sha256: Option<String>,
        /// How many triangles it holds, for people; not checked.
        triangles: Option<u64>,
    },
    /// A procedural scene. Count and seed can be overridden: `city:triangles=1000000,seed=3`.
    Generator {
        /// Which one.
        generator: Generator,
        /// About how many triangles.
        triangles: u64,
        /// Seed of the random numbers.
        seed: u64,
    },
    /// Models, each in its place; at least one.
    Models(Vec<Model>),
}

/// [`Source`] as it stands in TOML.
#[derive(Clone, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct PlainSource {
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sha256: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    generator: Option<Generator>,
    #[serde(skip_serializing_if = "Option::is_none")]
    triangles: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    seed: Option<u64>,
    #[serde(default, rename = "model", skip_serializing_if = "Vec::is_empty")]
    models: Vec<Model>,
}

impl TryFrom<PlainSource> for Source {
    type Error = String;

    fn try_from(plain: PlainSource) -> Result<Self, String> {
        if !plain.models.is_empty() {
            let alone = plain.file.is_none() && plain.generator.is_none() && plain.sha256.is_none();
            return if alone && plain.triangles.is_none() && plain.seed.is_none() {
                Ok(Self::Models(plain.models))
            } else {
                Err("a source with 'model' takes nothing else".to_owned())
            };
        }
        match (plain.file, plain.generator) {
            (Some(file), None) if plain.seed.is_none() => {
                Ok(Self::File { file, sha256: plain.sha256, triangles: plain.triangles })
            }
            (Some(_), None) => Err("a source with 'file' takes no 'seed'".to_owned()),
            (None, Some(generator)) if plain.sha256.is_none() => {
                let triangles = plain.triangles.unwrap_or(generator.default_triangles());
                Ok(Self::Generator { generator, triangles, seed: plain.seed.unwrap_or(1) })
            }
            (None, Some(_)) => Err("a source with 'generator' takes no 'sha256'".to_owned()),
            _ => Err("a source needs one of 'file', 'generator' and 'model'".to_owned()),
        }
    }
}

impl From<Source> for PlainSource {
    fn from(source: Source) -> Self {
        match source {
            Source::File { file, sha256, triangles } => {
                Self { file: Some(file), sha256, triangles, ..Self::default() }
            }
            Source::Generator { generator, triangles, seed } => Self {
                generator: Some(generator),
                triangles: Some(triangles),
                seed: Some(seed),
                ..Self::default()
            },
            Source::Models(models) => Self { models, ..Self::default() },
        }
    }
}

/// A material that emits light.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Emissive {
    /// Which material.
    pub material: MaterialKey,
    /// Emitted radiance, linear RGB.
    pub radiance: [f32; 3],
    /// Only triangles of the material that lie wholly in this box emit: a ceiling that shares its
    /// material with the walls. All of them if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within: Option<Region>,
}

/// A box along the axes.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Its lowest corner.
    pub low: [f32; 3],
    /// Its highest corner.
    pub high: [f32; 3],
}

impl Region {
    /// Whether a point is in the box or on its faces.
    pub fn contains(&self, point: [f32; 3]) -> bool {
        (0..3).all(|k| self.low[k] <= point[k] && point[k] <= self.high[k])
    }
}

/// How a descriptor names a material.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(untagged)]
pub enum MaterialKey {
    /// By its place in the file.
    Index(u32),
    /// By its name in the file; every material of that name is meant. `*` means all.
    Name(String),
}

impl Descriptor {
    /// Reads TOML; `path` is for messages.
    ///
    /// # Errors
    /// [`SceneError::Descriptor`] where the text is not such a descriptor, with the place and the reason.
    pub fn parse(path: &Path, text: &str) -> Result<Self, SceneError> {
        let descriptor: Self =
            toml::from_str(text).map_err(|e| SceneError::descriptor(path, e.to_string().trim_end()))?;
        descriptor.check().map_err(|reason| SceneError::descriptor(path, reason))?;
        Ok(descriptor)
    }

    /// Whether its values can be used. Whether the files are there, it does not ask.
    ///
    /// # Errors
    /// What is wrong, and where.
    pub fn check(&self) -> Result<(), String> {
        super::views::check(&self.views)?;
        let bright = self.emissive.iter().flat_map(|e| e.radiance);
        let sky = self.sky.iter().flat_map(|sky| [sky.zenith, sky.horizon, sky.ground]).flatten();
        if bright.chain(sky).any(|x| !x.is_finite() || x < 0.0) {
            return Err("radiance must be finite and not negative".into());
        }
        let models = match &self.source {
            Source::Models(models) => &models[..],
            _ if !self.materials.is_empty() => {
                return Err("materials are for models, and the source is none; leave [[material]] out".into());
            }
            _ => &[],
        };
        if self.camera.is_some() && !self.views.is_empty() {
            return Err("there are views and a camera; leave [camera] or [[view]] out".into());
        }
        compose::check(models, &self.materials, &self.lights, self.camera.as_ref())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "title = 't'\nlicence = 'l'\ncredit = 'c'\n";

    fn parse(rest: &str) -> Result<Descriptor, SceneError> {
        Descriptor::parse(Path::new("x.toml"), &format!("{HEAD}{rest}"))
    }

    #[test]
    fn a_source_is_a_file_or_a_generator() {
        let file = parse("[source]\nfile = 'a.glb'\nsha256 = '00'\n").unwrap();
        assert_eq!(
            file.source,
            Source::File { file: "a.glb".into(), sha256: Some("00".into()), triangles: None }
        );
        let made = parse("[source]\ngenerator = 'city'\nseed = 4\n").unwrap();
        let triangles = Generator::City.default_triangles();
        assert_eq!(made.source, Source::Generator { generator: Generator::City, triangles, seed: 4 });
        for wrong in
            ["", "file = 'a'\ngenerator = 'city'", "generator = 'town'", "file = 'a'\nseed = 1", "fle = 'a'"]
        {
            assert!(parse(&format!("[source]\n{wrong}\n")).is_err(), "{wrong}");
        }
    }

    #[test]
    fn materials_are_named_or_numbered() {
        let d = parse("[source]\nfile = 'a'\n[[emissive]]\nmaterial = 12\nradiance = [1,2,3]\n[[emissive]]\nmaterial = 'Bulb'\nradiance = [1.5,2,3]\n").unwrap();
        assert_eq!(d.emissive[0].material, MaterialKey::Index(12));
        assert_eq!(d.emissive[1].material, MaterialKey::Name("Bulb".into()));
    }

    #[test]
    fn models_have_materials_lights_and_a_camera() {
        let text = "[[source.model]]\nfile = 'a.glb'\nmaterial = 1\nrotate = [0, 90, 0]\n\
                    [[source.model]]\nfile = 'b.obj'\n\
                    [[material]]\nalbedo = [0.1, 0.2, 0.3]\n\
                    [[material]]\nname = 'rubber'\nalbedo = [0.3, 0.1, 0.1]\n\
                    phong = { diffuse = 0.9, specular = 0.1, reflective = 0, shininess = 10 }\n\
                    [[light]]\nposition = [1, 2, 3]\nstrength = 1.5\n\
                    [camera]\neye = [0, 0, 10]\ntarget = [0, 0, 0]\norbit = 12\n";
        let d = parse(text).unwrap();
        let Source::Models(models) = &d.source else { panic!("{:?}", d.source) };
        assert_eq!((models[0].material, models[1].material), (Some(1), None));
        assert_eq!(d.materials[1].phong.unwrap().shininess, 10.0);
        assert_eq!(d.camera.as_ref().unwrap().views().len(), 12);
        assert_eq!(Descriptor::parse(Path::new("y"), &toml::to_string(&d).unwrap()).unwrap(), d);
        for (old, new, words) in [
            ("material = 1", "material = 2", "model 0 (a.glb): its material is 2, and there are 2: 0 to 1"),
            ("rotate = [0, 90, 0]", "rotate = [0, nan, 0]", "not finite"),
            ("rotate = [0, 90, 0]", "scale = [1, 0, 1]", "flat"),
            ("rotate = [0, 90, 0]", "matrix = [[1,0,0,0],[0,1,0,0],[0,0,inf,0]]", "not finite"),
            ("rotate", "matrix = [[1,0,0,0],[0,1,0,0],[0,0,1,0]]\nrotate", "instead of"),
            ("rotate", "turn", "turn"),
            ("0.2, 0.3", "1.2, 0.3", "material 0: its colour"),
            ("specular = 0.1", "specular = -0.1", "material 1"),
            ("[1, 2, 3]", "[1, inf, 3]", "light 0"),
            ("strength = 1.5", "strength = nan", "light 0"),
            ("orbit = 12", "orbit = 0", "1 to 360"),
            ("orbit = 12", "orbit = 361", "1 to 360"),
            ("eye = [0, 0, 10]", "eye = [0, 10, 0]", "is no camera"),
            (
                "[camera]",
                "[[view]]\nname = 'v'\nvfov_degrees = 9\neye = [0,0,1]\ntarget = [0,0,0]\n[camera]",
                "leave",
            ),
        ] {
            assert!(text.contains(old), "{old}");
            let error = parse(&text.replacen(old, new, 1)).unwrap_err().to_string();
            assert!(error.contains(words), "{new}: {error}");
        }
        let error =
            parse("[source]\nfile = 'a'\n[[material]]\nalbedo = [0, 0, 0]\n").unwrap_err().to_string();
        assert!(error.contains("materials are for models"), "{error}");
        let error = parse("[source]\nseed = 1\n[[source.model]]\nfile = 'a'\n").unwrap_err().to_string();
        assert!(error.contains("takes nothing else"), "{error}");
        let error = parse("[[source.model]]\nfile = 'a'\nmaterial = 1\n").unwrap_err().to_string();
        assert!(error.contains("there is only 0"), "{error}");
    }

    #[test]
    fn errors_name_the_place() {
        let message =
            parse("[source]\nfile = 'a'\n[[view]]\nname = 'x'\neye = [0, 0]\n").unwrap_err().to_string();
        assert!(message.contains("x.toml") && message.contains("line"), "{message}");
        let message = parse("[source]\nfile = 'a'\n[[emissive]]\nmaterial = 0\nradiance = [1,-2,3]\n")
            .unwrap_err()
            .to_string();
        assert!(message.contains("negative"), "{message}");
    }

    #[test]
    fn toml_round_trip() {
        let d = parse("[source]\ngenerator = 'forest'\n[[view]]\nname = 'x'\neye = [0.0,1.0,2.0]\ntarget = [1.0,1.0,1.0]\nvfov_degrees = 40.0\n").unwrap();
        assert_eq!(Descriptor::parse(Path::new("y"), &toml::to_string(&d).unwrap()).unwrap(), d);
    }
}
