//! Every real scene loads whole, by name and by path.
//!
//! The files are looked for in `BROADLEAF_SCENES` and in `../shared/scenes` beside the workspace; a file
//! that is in neither is skipped, and the test says so.

use std::path::{Path, PathBuf};

use tracer::scene::{self, Origin, SceneError, SearchPath, Source};

fn search() -> SearchPath {
    SearchPath::new([Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes")])
}

/// Each built-in scene with a file: its name, the file's path, and its triangle count.
fn present() -> Vec<(&'static str, PathBuf, u64)> {
    let search = search();
    scene::built_in()
        .iter()
        .filter_map(|entry| match entry.descriptor().unwrap().source {
            Source::File { file, triangles, .. } => {
                let path =
                    search.folders().iter().map(|folder| folder.join(&file)).find(|path| path.is_file());
                if path.is_none() {
                    println!("SKIPPED: {file} is not there; set BROADLEAF_SCENES");
                }
                Some((entry.name, path?, triangles.unwrap()))
            }
            Source::Generator { .. } | Source::Models(_) => None,
        })
        .collect()
}

#[test]
fn every_file_loads_with_its_triangle_count() {
    for (name, _, triangles) in present() {
        let scene = scene::load(name, &search()).unwrap();
        assert_eq!(scene.positions.len() as u64, triangles, "{name}");
        assert_eq!(scene.material_ids.len() as u64, triangles, "{name}");
        assert!(scene.report.is_clean() && scene.report.notes.is_empty(), "{name}: {:?}", scene.report);
        assert!(scene.report.degenerate * 50 < triangles, "{name}: {:?}", scene.report);
        assert_eq!(scene.views.len(), 8, "{name}");
        assert!(scene.material_ids.iter().all(|&id| (id as usize) < scene.materials.len()), "{name}");
        println!(
            "{name}: {triangles} triangles, {} degenerate, {:.3} s",
            scene.report.degenerate, scene.report.seconds
        );
    }
}

#[test]
fn a_path_gives_the_same_triangles_lights_and_views() {
    for (name, path, triangles) in present().into_iter().filter(|&(_, _, triangles)| triangles < 300_000) {
        let by_path = scene::load(path.to_str().unwrap(), &SearchPath::only([])).unwrap();
        assert_eq!(by_path.positions.len() as u64, triangles, "{name}");
        let by_name = scene::load(name, &search()).unwrap();
        assert!(by_path.positions == by_name.positions, "{name}");
        assert!(by_path.report.notes.iter().any(|note| note.contains(name)), "{name}: {:?}", by_path.report);
        assert_eq!(by_path.sky, by_name.sky, "{name}");
        assert_eq!(by_path.materials, by_name.materials, "{name}");
        assert_eq!(by_path.views, by_name.views, "{name}");
    }
}

/// Bounds as the list that comes with the files states them, to four digits.
#[test]
fn bounds_are_those_of_the_source() {
    let known: [(&str, [f32; 3], [f32; 3]); 4] = [
        ("bistro_exterior", [-67.43, -5.311, -85.64], [30.35, 28.89, 47.87]),
        ("sponza", [-192.1, -12.64, -118.3], [180.0, 142.9, 110.5]),
        ("lucy", [225.9, -605.9, -145.4], [1156.0, 991.3, 388.4]),
        ("bunny", [-0.09469, 0.03299, -0.06187], [0.06101, 0.1873, 0.0588]),
    ];
    for (name, _, _) in present() {
        let Some((_, low, high)) = known.iter().find(|known| known.0 == name) else {
            continue;
        };
        let (found_low, found_high) = scene::load(name, &search()).unwrap().bounds();
        let size = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
        for k in 0..3 {
            assert!((found_low[k] - low[k]).abs() < 1e-3 * size, "{name}: {found_low:?}");
            assert!((found_high[k] - high[k]).abs() < 1e-3 * size, "{name}: {found_high:?}");
        }
    }
}

#[test]
fn an_altered_file_is_refused_by_name_and_taken_by_path() {
    let Some((_, path, triangles)) = present().into_iter().find(|scene| scene.0 == "bunny") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("bunny.obj");
    let mut text = std::fs::read(path).unwrap();
    text.extend_from_slice(b"\n# changed\n");
    std::fs::write(&copy, text).unwrap();
    let only = SearchPath::only([folder.path().to_owned()]);
    assert!(matches!(scene::load("bunny", &only), Err(SceneError::WrongHash { .. })));
    let scene = scene::load(copy.to_str().unwrap(), &only).unwrap();
    assert_eq!(scene.positions.len() as u64, triangles);
    assert_eq!(scene.views.len(), 8);
    assert!(matches!(scene.provenance.origin, Origin::File { .. }));
}
