//! Scene descriptors: what `scenes/NAME.toml` says about a scene.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Generator, SceneError, Sky, View};

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
    /// File or generator.
    pub source: Source,
    /// Light from outside; a default if absent.
    #[serde(default)]
    pub sky: Option<Sky>,
    /// Materials that emit light, in addition to those that do so in the file.
    #[serde(default)]
    pub emissive: Vec<Emissive>,
    /// Views, at least one; placed automatically if absent.
    #[serde(default, rename = "view")]
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
}

impl TryFrom<PlainSource> for Source {
    type Error = String;

    fn try_from(plain: PlainSource) -> Result<Self, String> {
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
            _ => Err("a source needs either 'file' or 'generator'".to_owned()),
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
        super::views::check(&descriptor.views).map_err(|reason| SceneError::descriptor(path, reason))?;
        let bright = descriptor.emissive.iter().flat_map(|e| e.radiance);
        let sky = descriptor.sky.iter().flat_map(|sky| [sky.zenith, sky.horizon, sky.ground]).flatten();
        if bright.chain(sky).any(|x| !x.is_finite() || x < 0.0) {
            return Err(SceneError::descriptor(path, "radiance must be finite and not negative"));
        }
        Ok(descriptor)
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
