//! From a name on the command line to a scene.

use std::path::{Path, PathBuf};
use std::time::Instant;

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::catalog;
use super::compose::{CameraPath, MOST_VIEWS, Model, compose};
use super::descriptor::{Descriptor, MaterialKey, Source};
use super::generate::MAX_REQUEST;
use super::search::{SearchPath, listed};
use super::views;
use super::{Geometry, LoadReport, MAX_TRIANGLES, Material, Origin, Provenance, Scene, SceneError, Sky};

/// Loads what a user names on the command line:
///
/// - a descriptor: `sponza`, found as `sponza.toml` on the search path or among the built-in ones;
/// - a generator's descriptor with other parameters: `city:triangles=1000000,seed=3`;
/// - a descriptor seen from a circle: `teapot:orbit=40` has 40 views around the target of its first, at the height and the
///   distance of that;
/// - a path to a descriptor, `out/tea.toml`, or to a scene that RTRS has written, `out/tea.json`;
/// - a path to a `.glb`, `.gltf` or `.obj` file. Views are read from `NAME.views.json` beside it if there
///   is one, and placed automatically if not. A file whose hash is that of a built-in descriptor gets its
///   sky and lights. If no light would reach the views of any other file, its surfaces glow faintly, and
///   the report says so.
///
/// # Errors
/// Any [`SceneError`]; each says what the user can do.
pub fn load(spec: &str, search: &SearchPath) -> Result<Scene, SceneError> {
    let started = Instant::now();
    let mut scene =
        if is_path(spec) { load_path(Path::new(spec), search) } else { load_named(spec, search) }?;
    scene.report.degenerate = scene
        .positions
        .par_chunks(1 << 14)
        .map(|chunk| chunk.iter().filter(|triangle| is_degenerate(triangle)).count() as u64)
        .sum();
    scene.report.seconds = started.elapsed().as_secs_f64();
    Ok(scene)
}

/// Whether [`load`] can make sense of `spec`, without loading anything: the name is known, a generator's
/// parameters are right, a path ends as a model's does. Whether a model's file is there, it does not ask.
///
/// # Errors
/// What [`load`] would say.
pub fn check(spec: &str, search: &SearchPath) -> Result<(), SceneError> {
    if is_path(spec) { kind(Path::new(spec), &SCENES).map(drop) } else { named(spec, search).map(drop) }
}

/// Finds a descriptor by name, without loading what it describes: first `NAME.toml` on the search path,
/// then the built-in ones. The path is where it was found, `None` for a built-in one.
///
/// # Errors
/// [`SceneError::UnknownScene`] where there is none, [`SceneError::Descriptor`] where it cannot be read.
pub fn describe(name: &str, search: &SearchPath) -> Result<(Descriptor, Option<PathBuf>), SceneError> {
    if let Some(path) = search.find(Path::new(&format!("{name}.toml"))) {
        let text = std::fs::read_to_string(&path)
            .map_err(|source| SceneError::Read { path: path.clone(), source })?;
        return Ok((Descriptor::parse(&path, &text)?, Some(path)));
    }
    let known = catalog::built_in();
    match known.iter().find(|entry| entry.name == name) {
        Some(entry) => Ok((entry.descriptor()?, None)),
        None => Err(SceneError::UnknownScene {
            name: name.to_owned(),
            known: known.iter().map(|entry| entry.name).collect::<Vec<_>>().join(", "),
            looked_in: listed(search.folders().iter().map(PathBuf::as_path)),
        }),
    }
}

/// What a surface is made of where the file does not say.
pub(super) fn default_material() -> Material {
    Material::diffuse("", [0.7; 3])
}

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// Extensions of the files that a scene can be.
const SCENES: [&str; 5] = ["glb", "gltf", "obj", "toml", "json"];

/// Those of them that hold nothing but a model.
const MODELS: [&str; 3] = ["glb", "gltf", "obj"];

/// Whether a spec is a path to a file, and no name.
pub(super) fn is_path(spec: &str) -> bool {
    SCENES.contains(&extension(Path::new(spec)).as_str())
        || spec.contains('/')
        || spec.contains(std::path::MAIN_SEPARATOR)
}

/// The extension of a file, one of those that can be read.
fn kind(path: &Path, readable: &[&str]) -> Result<String, SceneError> {
    let kind = extension(path);
    if readable.contains(&kind.as_str()) {
        return Ok(kind);
    }
    let feature =
        if kind.is_empty() { "a file without extension".to_owned() } else { format!(".{kind} files") };
    Err(SceneError::Unsupported { path: path.to_owned(), feature })
}

fn is_degenerate(&[a, b, c]: &[[f32; 3]; 3]) -> bool {
    let edge = |p: [f32; 3], q: [f32; 3]| {
        glam::DVec3::from_array(p.map(f64::from)) - glam::DVec3::from_array(q.map(f64::from))
    };
    edge(b, a).cross(edge(c, a)).length_squared() == 0.0
}

/// The name in `NAME` or `NAME:key=value,…`, its descriptor with these values, and where that was found.
fn named<'s>(
    spec: &'s str,
    search: &SearchPath,
) -> Result<(&'s str, Descriptor, Option<PathBuf>), SceneError> {
    let (name, parameters) = match spec.split_once(':') {
        Some((name, parameters)) => (name, Some(parameters)),
        None => (spec, None),
    };
    if name.is_empty() || name.contains(char::is_whitespace) {
        return Err(SceneError::spec(
            spec,
            "expected NAME, NAME:key=value,… or a path to a .glb, .gltf, .obj, .toml or .json file",
        ));
    }
    let (mut descriptor, found_at) = describe(name, search)?;
    let generated = match &mut descriptor.source {
        Source::Generator { triangles, seed, .. } => Some((triangles, seed)),
        Source::File { .. } | Source::Models(_) => None,
    };
    if let Some(orbit) = parse_parameters(spec, parameters, generated)? {
        let circle = match (&descriptor.camera, descriptor.views.first()) {
            (Some(camera), _) => CameraPath { orbit: Some(orbit), ..camera.clone() },
            (None, Some(view)) => CameraPath {
                eye: view.eye,
                target: view.target,
                vfov_degrees: view.vfov_degrees,
                orbit: Some(orbit),
            },
            (None, None) => {
                let reason = format!("'{name}' has no view to go around from; describe one in its TOML");
                return Err(SceneError::spec(spec, reason));
            }
        };
        descriptor.views.clear();
        descriptor.camera = Some(circle);
    }
    Ok((name, descriptor, found_at))
}

fn load_named(spec: &str, search: &SearchPath) -> Result<Scene, SceneError> {
    let (name, descriptor, found_at) = named(spec, search)?;
    load_described(name, descriptor, found_at.as_deref(), search)
}

/// What a descriptor describes; `found_at` is its file, if it has one.
fn load_described(
    name: &str,
    descriptor: Descriptor,
    found_at: Option<&Path>,
    search: &SearchPath,
) -> Result<Scene, SceneError> {
    let mut report = LoadReport::default();
    let (mut geometry, origin) = match descriptor.source {
        Source::Generator { generator, triangles, seed } => {
            (generator.generate(triangles, seed), Origin::Generated { generator, triangles, seed })
        }
        Source::File { ref file, ref sha256, .. } => {
            let path = find_file(name, file, &descriptor, found_at, search)?;
            let (geometry, found) = read_model(&path, &mut report)?;
            if let Some(expected) = sha256.as_ref().filter(|expected| !expected.eq_ignore_ascii_case(&found))
            {
                let (name, expected) = (name.to_owned(), expected.clone());
                return Err(SceneError::WrongHash { name, path, found, expected });
            }
            (geometry, Origin::File { path, sha256: found })
        }
        Source::Models(ref models) => {
            let path = found_at.map_or_else(|| PathBuf::from(format!("{name}.toml")), Path::to_path_buf);
            let geometry = load_models(name, models, &descriptor, found_at, search, &mut report)?;
            let sha256 = sha256(&match found_at {
                Some(path) => read(path)?,
                None => toml::to_string(&descriptor).unwrap_or_default().into_bytes(),
            });
            (geometry, Origin::File { path, sha256 })
        }
    };
    light(&mut geometry, &descriptor, &mut report);
    let views = match &descriptor.camera {
        Some(camera) => camera.views(),
        None if descriptor.views.is_empty() => views::place(&geometry.positions),
        None => descriptor.views.clone(),
    };
    Ok(Scene {
        name: name.to_owned(),
        positions: geometry.positions,
        material_ids: geometry.material_ids,
        materials: geometry.materials,
        views,
        lights: descriptor.lights,
        sky: descriptor.sky.unwrap_or_default(),
        provenance: Provenance { origin, licence: descriptor.licence, credit: descriptor.credit },
        report,
    })
}

/// The triangles of models, each in its place.
fn load_models(
    name: &str,
    models: &[Model],
    descriptor: &Descriptor,
    found_at: Option<&Path>,
    search: &SearchPath,
    report: &mut LoadReport,
) -> Result<Geometry, SceneError> {
    let described = || found_at.unwrap_or(Path::new(name));
    let (mut triangles, mut read_report) = (0, LoadReport::default());
    let parts = models.iter().map(|model| {
        let path = find_file(name, &model.file, descriptor, found_at, search)?;
        let (geometry, found) = read_model(&path, &mut read_report)?;
        if let Some(expected) = model.sha256.as_ref().filter(|expected| !expected.eq_ignore_ascii_case(&found)) {
            let reason = format!(
                "{} has changed: its sha256 is {found}, expected {expected}. Bring the file back that was meant, \
                 or write the hash that it has now into the descriptor",
                path.display()
            );
            return Err(SceneError::descriptor(described(), reason));
        }
        triangles += geometry.positions.len() as u64;
        if triangles > MAX_TRIANGLES {
            return Err(SceneError::TooLarge { path: described().to_owned(), triangles, limit: MAX_TRIANGLES });
        }
        Ok((model.clone(), geometry))
    });
    let geometry = compose(parts, &descriptor.materials, report)?;
    report.non_finite += read_report.non_finite;
    report.out_of_range += read_report.out_of_range;
    report.skipped_primitives += read_report.skipped_primitives;
    report.notes.append(&mut read_report.notes);
    if geometry.positions.is_empty() {
        let reason = ": its models lie beyond what numbers can tell".to_owned();
        return Err(SceneError::Empty { path: described().to_owned(), reason });
    }
    Ok(geometry)
}

/// What is known of a model file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Inspected {
    /// Hash of its bytes, in lower-case hexadecimal.
    pub sha256: String,
    /// Triangles that can be used.
    pub triangles: u64,
    /// Licence and credit of the built-in scene that it is the file of, if it is.
    pub rights: Option<(String, String)>,
}

/// Reads a `.glb`, `.gltf` or `.obj` file, to see whether it can be used.
///
/// # Errors
/// It cannot be.
pub fn inspect(path: &Path) -> Result<Inspected, SceneError> {
    let (geometry, sha256) = read_model(path, &mut LoadReport::default())?;
    let rights = catalog::by_hash(&sha256).map(|(_, descriptor)| (descriptor.licence, descriptor.credit));
    Ok(Inspected { sha256, triangles: geometry.positions.len() as u64, rights })
}

/// Reads `key=value,…`: what a generator is given, and how many views of a circle are asked for.
fn parse_parameters(
    spec: &str,
    parameters: Option<&str>,
    mut generated: Option<(&mut u64, &mut u64)>,
) -> Result<Option<u32>, SceneError> {
    let mut orbit = None;
    for pair in parameters.iter().flat_map(|list| list.split(',')) {
        let (key, value) = pair.split_once('=').ok_or_else(|| {
            SceneError::spec(spec, format!("'{pair}' is not key=value (triangles=…, seed=…, orbit=…)"))
        })?;
        match (key.trim(), &mut generated) {
            ("orbit", _) => {
                let count = value.trim().parse().ok().filter(|count| (1..=MOST_VIEWS).contains(count));
                let wrong = || SceneError::spec(spec, format!("orbit must be 1 to {MOST_VIEWS} views"));
                orbit = Some(count.ok_or_else(wrong)?);
            }
            ("triangles", Some((triangles, _))) => {
                **triangles =
                    parse_count(value.trim()).filter(|n| (1..=MAX_REQUEST).contains(n)).ok_or_else(|| {
                        let reason = format!(
                            "triangles must be a number from 1 to {MAX_REQUEST}, such as 50000 or 1e6"
                        );
                        SceneError::spec(spec, reason)
                    })?;
            }
            ("seed", Some((_, seed))) => {
                let wrong = |_| SceneError::spec(spec, "seed must be a whole number");
                **seed = value.trim().parse().map_err(wrong)?;
            }
            (other, generated) => {
                let there = match generated {
                    Some(_) => "there are triangles, seed and orbit",
                    None => "for a scene of files there is orbit; generators have more",
                };
                return Err(SceneError::spec(spec, format!("there is no parameter '{other}'; {there}")));
            }
        }
    }
    Ok(orbit)
}

/// `50000`, `50_000`, `1e6` and `2.5e6` are counts.
fn parse_count(text: &str) -> Option<u64> {
    let plain = text.replace('_', "");
    plain.parse().ok().or_else(|| {
        let value: f64 = plain.parse().ok()?;
        (value.is_finite() && value >= 0.0 && value.fract() == 0.0 && value <= 1e15).then_some(value as u64)
    })
}

fn find_file(
    name: &str,
    file: &str,
    descriptor: &Descriptor,
    found_at: Option<&Path>,
    search: &SearchPath,
) -> Result<PathBuf, SceneError> {
    let beside = found_at.and_then(Path::parent);
    let beside_file = beside.map(|folder| folder.join(file)).filter(|path| path.is_file());
    beside_file.or_else(|| search.find(Path::new(file))).ok_or_else(|| SceneError::MissingFile {
        name: name.to_owned(),
        file: file.to_owned(),
        looked_in: listed(beside.into_iter().chain(search.folders().iter().map(PathBuf::as_path))),
        get: match descriptor.get.trim().trim_end_matches('.') {
            "" => "The descriptor does not say where to get it".to_owned(),
            sentence => sentence.to_owned(),
        },
    })
}

/// The name of the scene in a file.
fn stem(path: &Path) -> String {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}

fn load_path(path: &Path, search: &SearchPath) -> Result<Scene, SceneError> {
    match kind(path, &SCENES)?.as_str() {
        "toml" => {
            let text = String::from_utf8(read(path)?)
                .map_err(|_| SceneError::descriptor(path, "it is not text in UTF-8"))?;
            load_described(&stem(path), Descriptor::parse(path, &text)?, Some(path), search)
        }
        "json" => load_rtrs(path),
        _ => load_model(path),
    }
}

/// A scene that RTRS has written, under the sky that scenes without one have.
fn load_rtrs(path: &Path) -> Result<Scene, SceneError> {
    let mut report = LoadReport::default();
    let bytes = read(path)?;
    let super::rtrs::Parsed { geometry, lights, camera } = super::rtrs::load(path, &bytes, &mut report)?;
    if geometry.positions.is_empty() {
        return Err(empty(path, &report));
    }
    Ok(Scene {
        name: stem(path),
        positions: geometry.positions,
        material_ids: geometry.material_ids,
        materials: geometry.materials,
        views: camera.views(),
        lights,
        sky: Sky::default(),
        provenance: Provenance {
            origin: Origin::File { path: path.to_owned(), sha256: sha256(&bytes) },
            licence: String::new(),
            credit: String::new(),
        },
        report,
    })
}

fn read(path: &Path) -> Result<Vec<u8>, SceneError> {
    std::fs::read(path).map_err(|source| SceneError::Read { path: path.to_owned(), source })
}

fn load_model(path: &Path) -> Result<Scene, SceneError> {
    let mut report = LoadReport::default();
    let (mut geometry, sha256) = read_model(path, &mut report)?;
    let beside = views::beside(path)?;
    let known = catalog::by_hash(&sha256);
    if let Some((name, descriptor)) = &known {
        report.notes.push(format!("the file is that of scene '{name}': its sky and lights are used"));
        light(&mut geometry, descriptor, &mut report);
    }
    let views = match (beside, &known) {
        (Some(views), _) => views,
        (None, Some((_, descriptor))) => descriptor.views.clone(),
        (None, None) => views::place(&geometry.positions),
    };
    let sky = known.as_ref().and_then(|(_, descriptor)| descriptor.sky).unwrap_or_default();
    if known.is_none() && geometry.materials.iter().all(|m| m.emission == [0.0; 3]) {
        glow_if_dark(&mut geometry, &views, &mut report);
    }
    let (licence, credit) = known.map(|(_, d)| (d.licence, d.credit)).unwrap_or_default();
    Ok(Scene {
        name: stem(path),
        positions: geometry.positions,
        material_ids: geometry.material_ids,
        materials: geometry.materials,
        views,
        lights: Vec::new(),
        sky,
        provenance: Provenance { origin: Origin::File { path: path.to_owned(), sha256 }, licence, credit },
        report,
    })
}

/// A closed file without lamps would give black pictures, so every surface glows in its own colour.
fn glow_if_dark(geometry: &mut Geometry, views: &[super::View], report: &mut LoadReport) {
    let probe = super::probe::Probe::new(&geometry.positions);
    if views::share_that_sees_sky(&probe, views) > 0.02 {
        return;
    }
    for material in &mut geometry.materials {
        material.emission = material.albedo.map(|channel| 0.25 * channel);
    }
    report.notes.push(
        "the scene is closed and has no lamps: every surface glows faintly. \
         A descriptor can name emissive materials instead"
            .to_owned(),
    );
}

/// Reads, hashes and parses a model file.
fn read_model(path: &Path, report: &mut LoadReport) -> Result<(Geometry, String), SceneError> {
    let kind = kind(path, &MODELS)?;
    let bytes = read(path)?;
    let (geometry, sha256) = rayon::join(
        || {
            if kind == "obj" {
                super::obj::load(path, &bytes, report)
            } else {
                super::gltf::load(path, &bytes, report)
            }
        },
        || sha256(&bytes),
    );
    let geometry = geometry?;
    if geometry.positions.is_empty() {
        return Err(empty(path, report));
    }
    debug_assert!(geometry.positions.len() as u64 <= MAX_TRIANGLES);
    Ok((geometry, sha256))
}

/// Why nothing is left of a file.
fn empty(path: &Path, report: &LoadReport) -> SceneError {
    let skipped = report.non_finite + report.out_of_range + report.skipped_primitives;
    let reason =
        if skipped > 0 { format!(" that can be used ({skipped} were skipped)") } else { String::new() };
    SceneError::Empty { path: path.to_owned(), reason }
}

/// SHA-256 of a file's bytes in lower-case hexadecimal, as `sha256sum` prints it.
pub fn sha256(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

/// In lower-case hexadecimal.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Makes materials emit as the descriptor says. Where only part of a material emits, that part becomes
/// a material of its own.
fn light(geometry: &mut Geometry, descriptor: &Descriptor, report: &mut LoadReport) {
    for emissive in &descriptor.emissive {
        let mut found = false;
        for i in 0..geometry.materials.len() {
            let meant = match &emissive.material {
                MaterialKey::Index(index) => *index as usize == i,
                MaterialKey::Name(name) => name == "*" || *name == geometry.materials[i].name,
            };
            if !meant {
                continue;
            }
            match emissive.within {
                None => {
                    geometry.materials[i].emission = emissive.radiance;
                    found = true;
                }
                Some(region) => {
                    let part = geometry.materials.len() as u32;
                    let mut any = false;
                    for (id, triangle) in geometry.material_ids.iter_mut().zip(&geometry.positions) {
                        if *id == i as u32 && triangle.iter().all(|&corner| region.contains(corner)) {
                            *id = part;
                            any = true;
                        }
                    }
                    if any {
                        let whole = geometry.materials[i].clone();
                        geometry.materials.push(Material { emission: emissive.radiance, ..whole });
                        found = true;
                    }
                }
            }
        }
        if !found {
            report.notes.push(format!(
                "the descriptor's emissive material {:?} is not in the scene",
                emissive.material
            ));
        }
    }
}

impl Sky {
    /// Radiance from direction `direction`, which need not be of unit length.
    pub fn radiance(&self, direction: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = direction;
        let height = y / (x * x + y * y + z * z).sqrt().max(f32::MIN_POSITIVE);
        if height < 0.0 {
            return self.ground;
        }
        std::array::from_fn(|k| self.horizon[k] + (self.zenith[k] - self.horizon[k]) * height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nowhere() -> SearchPath {
        SearchPath::only([])
    }

    #[test]
    fn counts_are_read_in_the_usual_notations() {
        assert_eq!(parse_count("50000"), Some(50_000));
        assert_eq!(parse_count("50_000"), Some(50_000));
        assert_eq!(parse_count("2.5e6"), Some(2_500_000));
        for wrong in ["", "-1", "1.5", "nan", "1e99", "many"] {
            assert_eq!(parse_count(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn parameters_reach_the_generator() {
        let scene = load("cornell:triangles=3000,seed=9", &nowhere()).unwrap();
        let expected =
            Origin::Generated { generator: super::super::Generator::Cornell, triangles: 3000, seed: 9 };
        assert_eq!(scene.provenance.origin, expected);
        assert!((2400..3600).contains(&scene.positions.len()), "{}", scene.positions.len());
    }

    #[test]
    fn an_orbit_goes_around_what_the_first_view_looks_at() {
        let scene = load("cornell:seed=9,triangles=100,orbit=4", &nowhere()).unwrap();
        let first = &load("cornell", &nowhere()).unwrap().views[0];
        let names: Vec<_> = scene.views.iter().map(|view| view.name.as_str()).collect();
        assert_eq!(names, ["orbit_0", "orbit_1", "orbit_2", "orbit_3"]);
        assert_eq!((scene.views[0].eye, scene.views[0].vfov_degrees), (first.eye, first.vfov_degrees));
        assert!(scene.views.iter().all(|view| view.target == first.target && view.eye[1] == first.eye[1]));
        let [[x, _, z], [tx, _, tz]] = [scene.views[2].eye, first.target];
        let opposite = [2.0 * tx - first.eye[0], 2.0 * tz - first.eye[2]];
        assert!((x - opposite[0]).abs() < 1e-5 && (z - opposite[1]).abs() < 1e-5, "{x}, {z}");
    }

    #[test]
    fn specs_are_checked_without_loading() {
        for fine in ["city:triangles=1e6,seed=3", "sponza", "no/such/thing.glb", "thing.OBJ"] {
            check(fine, &nowhere()).unwrap();
        }
        for wrong in ["citty", "city:size=3", "sponza:seed=3", "no/such/thing.png", "folder/thing", ""] {
            let (checked, loaded) = (check(wrong, &nowhere()).unwrap_err(), load(wrong, &nowhere()));
            assert_eq!(checked.to_string(), loaded.unwrap_err().to_string());
        }
    }

    #[test]
    fn wrong_specs_say_what_would_be_right() {
        for (spec, part) in [
            ("", "NAME"),
            ("cornell:5", "key=value"),
            ("cornell:size=5", "triangles, seed and orbit"),
            ("cornell:triangles=0", "from 1 to"),
            ("cornell:triangles=1e12", "from 1 to"),
            ("cornell:seed=x", "whole number"),
            ("sponza:seed=1", "there is orbit"),
            ("cornell:orbit=0", "1 to 360"),
            ("cornell:orbit=361", "1 to 360"),
            ("spnza", "sponza"),
            ("a/b.fbx", ".fbx"),
            ("no/such.glb", "no/such.glb"),
        ] {
            let message = load(spec, &nowhere()).unwrap_err().to_string();
            assert!(message.contains(part), "{spec}: {message}");
        }
    }

    #[test]
    fn a_missing_file_says_where_it_was_looked_for_and_where_to_get_it() {
        let message = load("sponza", &SearchPath::only([PathBuf::from("/nowhere")])).unwrap_err().to_string();
        for part in ["/nowhere", "sponza.glb", "http", "--scene-dir", "BROADLEAF_SCENES"] {
            assert!(message.contains(part), "{part}: {message}");
        }
    }

    #[test]
    fn part_of_a_material_can_emit() {
        let folder = tempfile::tempdir().unwrap();
        let obj = "v 0 0 0\nv 1 0 0\nv 0 0 1\nv 0 3 0\nv 1 3 0\nv 0 3 1\nf 1 2 3\nf 4 5 6\nf 1 2 6\n";
        std::fs::write(folder.path().join("room.obj"), obj).unwrap();
        let toml = "title = 't'\nlicence = 'l'\ncredit = 'c'\n[source]\nfile = 'room.obj'\n\
                    [[emissive]]\nmaterial = 0\nradiance = [1, 2, 3]\n\
                    within = { low = [-9, 2.5, -9], high = [9, 3.5, 9] }\n\
                    [[emissive]]\nmaterial = 'lamp'\nradiance = [1, 2, 3]\n";
        std::fs::write(folder.path().join("room.toml"), toml).unwrap();
        let scene = load("room", &SearchPath::only([folder.path().to_owned()])).unwrap();
        let emission: Vec<f32> =
            scene.material_ids.iter().map(|&id| scene.materials[id as usize].emission[1]).collect();
        assert_eq!(emission, [0.0, 2.0, 0.0]);
        assert!(scene.report.notes.iter().any(|note| note.contains("lamp")), "{:?}", scene.report);
        assert_eq!(scene.views.len(), 8);
    }

    #[test]
    fn a_closed_file_without_lamps_glows() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.obj");
        let room = super::super::Generator::Cornell.generate(500, 1).positions;
        let mut obj = String::new();
        for corner in room.iter().flatten() {
            obj += &format!("v {} {} {}\n", corner[0], corner[1], corner[2]);
        }
        for i in 0..room.len() {
            obj += &format!("f {} {} {}\n", 3 * i + 1, 3 * i + 2, 3 * i + 3);
        }
        std::fs::write(&path, obj).unwrap();
        let scene = load(path.to_str().unwrap(), &nowhere()).unwrap();
        assert!(scene.materials[0].emission[0] > 0.0, "{:?}", scene.report);
        assert!(scene.report.notes.iter().any(|note| note.contains("glows")), "{:?}", scene.report);
    }

    #[test]
    fn the_sky_runs_from_horizon_to_zenith() {
        let sky = Sky { zenith: [2.0; 3], horizon: [1.0; 3], ground: [0.0; 3] };
        assert_eq!(sky.radiance([0.0, 5.0, 0.0]), [2.0; 3]);
        assert_eq!(sky.radiance([5.0, 0.0, 0.0]), [1.0; 3]);
        assert_eq!(sky.radiance([1.0, -0.1, 0.0]), [0.0; 3]);
    }
}
