//! `runner scene construct`: puts models, materials, lights and a camera together in a descriptor.

use crate::{
    args::{Construct, Global, Placed},
    commands::print,
    progress::remark,
    table::thousands,
};
use anyhow::{Context, ensure};
use std::{
    fs,
    path::{Component, Path, PathBuf},
};
use tracer::scene::{self, CameraPath, Descriptor, Light, Model, Phong, Source, Surface};

/// Writes the descriptor that the command line describes.
///
/// # Errors
/// A value cannot be used, a model not be read, or the descriptor not be written.
pub fn construct(global: &Global, arguments: &Construct) -> anyhow::Result<()> {
    let out = match (&arguments.output, &arguments.name) {
        (Some(out), _) => out.clone(),
        (None, Some(name)) => PathBuf::from(format!("scenes/{name}.toml")),
        (None, None) => unreachable!("one of the two is required"),
    };
    ensure!(
        out.extension().is_some_and(|extension| extension == "toml"),
        "{}: descriptors are TOML files, so that other commands know them; call it NAME.toml",
        out.display()
    );
    let mut descriptor = described(arguments);
    // Values first: to read models may take a while.
    descriptor.check().map_err(anyhow::Error::msg)?;
    let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut triangles = 0;
    let mut rights: Vec<(String, String)> = Vec::new();
    if let Source::Models(models) = &mut descriptor.source {
        for (model, placed) in models.iter_mut().zip(&arguments.models.0) {
            let found = scene::inspect(&placed.path)?;
            triangles += found.triangles;
            rights.extend(found.rights);
            model.sha256 = Some(found.sha256);
        }
        fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
        for (model, placed) in models.iter_mut().zip(&arguments.models.0) {
            model.file = relative(folder, &placed.path)?;
        }
    }
    rights.sort();
    rights.dedup();
    let (licences, credits): (Vec<_>, Vec<_>) = rights.into_iter().unzip();
    descriptor.licence = arguments.licence.clone().unwrap_or_else(|| licences.join("; "));
    descriptor.credit = arguments.credit.clone().unwrap_or_else(|| credits.join("; "));
    let text = written(&descriptor)?;
    record::replace(&out, |file| file.write_all(text.as_bytes()))
        .with_context(|| format!("cannot write {}", out.display()))?;
    let views = descriptor.camera.as_ref().map_or(0, |camera| camera.views().len());
    print(&format!(
        "{}: {} triangles; models: {}, materials: {}, lights: {}, views: {views}",
        out.display(),
        thousands(triangles),
        arguments.models.0.len(),
        descriptor.materials.len().max(1),
        descriptor.lights.len()
    ))?;
    remark(global.quiet, format_args!("look at it: runner render {0} -o {0}.png", out.display()));
    Ok(())
}

/// What the command line describes; models have the paths that it gives, and nobody's rights.
fn described(arguments: &Construct) -> Descriptor {
    let models = arguments.models.0.iter().map(|placed| {
        let Placed { path, material, scale, rotate, translate, matrix } = placed;
        let plain = Model::new(path.to_string_lossy(), Some(*material));
        Model {
            scale: scale.unwrap_or(plain.scale),
            rotate: rotate.unwrap_or(plain.rotate),
            translate: translate.unwrap_or(plain.translate),
            matrix: *matrix,
            ..plain
        }
    });
    let materials = arguments.material.chunks_exact(7).map(|numbers| Surface {
        name: String::new(),
        albedo: [numbers[0], numbers[1], numbers[2]],
        phong: Some(Phong {
            diffuse: numbers[3],
            specular: numbers[4],
            reflective: numbers[5],
            shininess: numbers[6],
        }),
    });
    let lights = arguments
        .light
        .chunks_exact(4)
        .map(|numbers| Light { position: [numbers[0], numbers[1], numbers[2]], strength: numbers[3] });
    let pos = &arguments.camera_pos;
    Descriptor {
        title: arguments.title.clone().unwrap_or_else(|| "Put together by runner scene construct".into()),
        licence: String::new(),
        credit: String::new(),
        get: String::new(),
        source: Source::Models(models.collect()),
        materials: materials.collect(),
        lights: lights.collect(),
        sky: None,
        emissive: Vec::new(),
        camera: Some(CameraPath {
            eye: [pos[0], pos[1], pos[2]],
            target: [pos[3], pos[4], pos[5]],
            vfov_degrees: arguments.camera_fov,
            orbit: arguments.camera_orbit,
        }),
        views: Vec::new(),
    }
}

/// A descriptor as text.
fn written(descriptor: &Descriptor) -> anyhow::Result<String> {
    let text = toml::to_string(descriptor).context("the descriptor cannot be written as TOML")?;
    Ok(format!("# Paths are relative to this file.\n{text}"))
}

/// The path of a file as seen from a folder, both of which are there; the whole path where they have nothing in common.
fn relative(folder: &Path, file: &Path) -> anyhow::Result<String> {
    let whole = |path: &Path| path.canonicalize().with_context(|| format!("cannot find {}", path.display()));
    let (folder, file) = (whole(folder)?, whole(file)?);
    let (from, to): (Vec<_>, Vec<_>) = (folder.components().collect(), file.components().collect());
    let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let path: PathBuf = if common == 0 {
        file.clone()
    } else {
        std::iter::repeat_n(Component::ParentDir, from.len() - common)
            .chain(to[common..].iter().copied())
            .collect()
    };
    let text = path.to_str().with_context(|| {
        format!("{}: descriptors are text, and this path is none; rename the file", file.display())
    })?;
    Ok(text.replace(std::path::MAIN_SEPARATOR, "/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_lead_from_the_descriptor_to_the_model() {
        let folder = tempfile::tempdir().unwrap();
        let (models, out) = (folder.path().join("a/models"), folder.path().join("a/out/deep"));
        fs::create_dir_all(&models).unwrap();
        fs::create_dir_all(&out).unwrap();
        let file = models.join("x.obj");
        fs::write(&file, "").unwrap();
        assert_eq!(relative(&out, &file).unwrap(), "../../models/x.obj");
        assert_eq!(relative(&models, &file).unwrap(), "x.obj");
        assert_eq!(relative(folder.path(), &file).unwrap(), "a/models/x.obj");
        assert!(relative(&out, &models.join("y.obj")).is_err());
    }
}
