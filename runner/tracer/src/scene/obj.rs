//! Wavefront OBJ with its MTL files: positions, faces, `Kd` and `Ke`.
//!
//! The `tobj` crate reads a thinned copy of the text: normals and texture coordinates are dropped (they
//! would only split vertices), and faces that point past the vertices are counted and left out.

use std::fmt::Write;
use std::io::BufReader;
use std::path::Path;

use super::{Geometry, LoadReport, MAX_TRIANGLES, Material, SceneError};

/// Reads the file whose bytes are given; MTL files are looked for beside `path`.
pub(super) fn load(path: &Path, bytes: &[u8], report: &mut LoadReport) -> Result<Geometry, SceneError> {
    let thin = thinned(&String::from_utf8_lossy(bytes), report);
    let folder = path.parent().unwrap_or(Path::new(""));
    let options =
        tobj::LoadOptions { triangulate: true, single_index: true, ignore_points: true, ignore_lines: true };
    let mut missing = std::cell::RefCell::new(Vec::new());
    let (models, materials) = tobj::load_obj_buf(&mut thin.as_bytes(), &options, |name| {
        let loaded = match std::fs::File::open(folder.join(name)) {
            Ok(file) => tobj::load_mtl_buf(&mut BufReader::new(file)),
            Err(_) => Err(tobj::LoadError::OpenFileFailed),
        };
        if let Err(e) = &loaded {
            missing.borrow_mut().push(format!("materials of {} are not used: {e}", name.display()));
        }
        loaded
    })
    .map_err(|e| SceneError::format(path, format!("not a readable OBJ: {e}")))?;
    report.notes.append(missing.get_mut());

    let mut geometry = Geometry {
        materials: materials.unwrap_or_default().iter().map(material).collect(),
        ..Geometry::default()
    };
    let default_material = geometry.materials.len() as u32;
    let mut used_default = geometry.materials.is_empty();
    for model in &models {
        let mesh = &model.mesh;
        let id = match mesh.material_id {
            Some(id) if id < default_material as usize => id as u32,
            _ => {
                used_default = true;
                default_material
            }
        };
        for corners in mesh.indices.chunks_exact(3) {
            let corner = |i: u32| -> Option<[f32; 3]> {
                let start = i as usize * 3;
                mesh.positions.get(start..start + 3)?.try_into().ok()
            };
            let (Some(a), Some(b), Some(c)) = (corner(corners[0]), corner(corners[1]), corner(corners[2]))
            else {
                report.out_of_range += 1;
                continue;
            };
            if [a, b, c].iter().flatten().all(|x| x.is_finite()) {
                geometry.positions.push([a, b, c]);
                geometry.material_ids.push(id);
            } else {
                report.non_finite += 1;
            }
        }
        if geometry.positions.len() as u64 > MAX_TRIANGLES {
            let triangles = geometry.positions.len() as u64;
            return Err(SceneError::TooLarge { path: path.to_owned(), triangles, limit: MAX_TRIANGLES });
        }
    }
    if used_default {
        geometry.materials.push(super::load::default_material());
    }
    Ok(geometry)
}

fn material(material: &tobj::Material) -> Material {
    let unit = |value: f32| {
        if value.is_finite() { value.clamp(0.0, 1.0) } else { 0.5 }
    };
    let radiance = |value: f32| {
        if value.is_finite() { value.max(0.0) } else { 0.0 }
    };
    Material {
        name: material.name.clone(),
        albedo: material.diffuse.map_or(super::load::default_material().albedo, |kd| kd.map(unit)),
        emission: material.emissive.map_or([0.0; 3], |ke| ke.map(radiance)),
        phong: None,
    }
}

/// The lines that matter, with absolute position indices only. A backslash joins a line to the next.
fn thinned(text: &str, report: &mut LoadReport) -> String {
    let mut thin = String::with_capacity(text.len());
    let mut vertices = 0i64;
    let mut joined = String::new();
    for raw in text.lines() {
        if let Some(start) = raw.strip_suffix('\\') {
            joined.push_str(start);
            joined.push(' ');
            continue;
        }
        let whole;
        let line = if joined.is_empty() {
            raw
        } else {
            joined.push_str(raw);
            whole = std::mem::take(&mut joined);
            &whole
        };
        let line = line.trim();
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                vertices += 1;
                thin.push('v');
                for word in words.take(3) {
                    thin.push(' ');
                    thin.push_str(word);
                }
                thin.push('\n');
            }
            Some("f") => face(words, vertices, &mut thin, report),
            Some("p" | "l") => report.skipped_primitives += 1,
            Some("o" | "g" | "usemtl" | "mtllib") => {
                thin.push_str(line);
                thin.push('\n');
            }
            _ => {}
        }
    }
    thin
}

fn face<'a>(words: impl Iterator<Item = &'a str>, vertices: i64, thin: &mut String, report: &mut LoadReport) {
    let start = thin.len();
    thin.push('f');
    let mut corners = 0;
    for word in words {
        let index = word.split('/').next().unwrap_or(word);
        match index.parse::<i64>() {
            // Left for tobj, which refuses the file with a reason.
            Err(_) => {
                let _ = write!(thin, " {index}");
            }
            Ok(i) => {
                let absolute = if i < 0 { i.saturating_add(vertices).saturating_add(1) } else { i };
                if absolute < 1 || absolute > vertices {
                    thin.truncate(start);
                    report.out_of_range += 1;
                    return;
                }
                let _ = write!(thin, " {absolute}");
            }
        }
        corners += 1;
    }
    if corners < 3 {
        thin.truncate(start);
        report.skipped_primitives += 1;
        return;
    }
    thin.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> (Result<Geometry, SceneError>, LoadReport) {
        let mut report = LoadReport::default();
        let geometry = load(Path::new("nowhere/x.obj"), text.as_bytes(), &mut report);
        (geometry, report)
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn triangles_quads_polygons_and_relative_indices() {
        let (geometry, report) = read(&format!("{SQUARE}f 1 2 3\nf 1/9/9 2//9 3 4\nf -4 -3 -2 -1 \\\n 1\n"));
        let geometry = geometry.unwrap();
        assert_eq!(geometry.positions.len(), 1 + 2 + 3);
        assert_eq!(geometry.positions[0], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]);
        assert_eq!(geometry.positions[3], geometry.positions[1]);
        assert_eq!(geometry.materials.len(), 1);
        assert!(report.is_clean(), "{report:?}");
    }

    #[test]
    fn faces_past_the_vertices_and_infinite_corners_are_counted() {
        let (geometry, report) = read(&format!(
            "{SQUARE}v nan 0 0\nv 0 inf 0\nf 1 2 9\nf 0 1 2\nf -9 1 2\nf 1 2 5\nf 1 2 6\nf 1 2 3\np 1\nl 1 2\nf 1 2\n"
        ));
        assert_eq!(geometry.unwrap().positions.len(), 1);
        assert_eq!((report.out_of_range, report.non_finite, report.skipped_primitives), (3, 2, 3));
    }

    #[test]
    fn materials_give_diffuse_and_emissive_colours() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(
            folder.path().join("m.mtl"),
            "newmtl red\nKd 0.8 0.1 0.1\nnewmtl lamp\nKd 2 0 0\nKe 5 6 7\n",
        )
        .unwrap();
        let text = format!(
            "mtllib m.mtl\n{SQUARE}usemtl lamp\nf 1 2 3\nusemtl red\nf 1 2 3\nusemtl unknown\nf 1 2 3\n"
        );
        let mut report = LoadReport::default();
        let geometry = load(&folder.path().join("x.obj"), text.as_bytes(), &mut report).unwrap();
        let used: Vec<&Material> =
            geometry.material_ids.iter().map(|&id| &geometry.materials[id as usize]).collect();
        assert_eq!((used[0].albedo, used[0].emission), ([1.0, 0.0, 0.0], [5.0, 6.0, 7.0]));
        assert_eq!((used[1].albedo, used[1].emission), ([0.8, 0.1, 0.1], [0.0; 3]));
        assert_eq!(*used[2], super::super::load::default_material());
    }

    #[test]
    fn a_missing_material_file_is_noted() {
        let (geometry, report) = read(&format!("mtllib gone.mtl\n{SQUARE}usemtl a\nf 1 2 3\n"));
        assert_eq!(geometry.unwrap().positions.len(), 1);
        assert!(report.notes.iter().any(|note| note.contains("gone.mtl")), "{report:?}");
    }

    #[test]
    fn nonsense_is_an_error_or_empty() {
        assert!(read("v a b c\nf 1 1 1\n").0.is_err());
        assert!(read("v 0 0 0\nf x y z\n").0.is_err());
        assert!(read("\u{0}\u{1}garbage\n\n").0.unwrap().positions.is_empty());
    }
}
