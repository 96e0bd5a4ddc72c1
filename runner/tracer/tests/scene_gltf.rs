//! glTF files made here, feature by feature, and damaged in every way that comes to mind.

use std::path::PathBuf;

use proptest::prelude::*;
use tempfile::TempDir;
use tracer::scene::{self, Scene, SceneError, SearchPath};

/// A binary chunk that grows, with a buffer view and an accessor for each piece.
#[derive(Default)]
struct Builder {
    bin: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Builder {
    fn view(&mut self, bytes: &[u8], extra: &str) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        self.views
            .push(format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{}{extra}}}"#, bytes.len()));
        self.views.len() - 1
    }

    fn accessor(&mut self, view: usize, kind: u32, count: usize, of: &str, extra: &str) -> usize {
        self.accessors.push(format!(
            r#"{{"bufferView":{view},"componentType":{kind},"count":{count},"type":"{of}"{extra}}}"#
        ));
        self.accessors.len() - 1
    }

    fn points(&mut self, points: &[[f32; 3]]) -> usize {
        let bytes: Vec<u8> = points.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let view = self.view(&bytes, "");
        self.accessor(view, 5126, points.len(), "VEC3", "")
    }

    fn indices16(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let view = self.view(&bytes, "");
        self.accessor(view, 5123, indices.len(), "SCALAR", "")
    }

    fn json(&self, rest: &str) -> String {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{}}}],"bufferViews":[{}],"accessors":[{}],{rest}}}"#,
            self.bin.len(),
            self.views.join(","),
            self.accessors.join(",")
        )
    }

    fn glb(&self, rest: &str) -> Vec<u8> {
        glb(&self.json(rest), &self.bin)
    }
}

fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bin = bin.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut file = b"glTF".to_vec();
    for number in [2, (28 + json.len() + bin.len()) as u32, json.len() as u32] {
        file.extend_from_slice(&number.to_le_bytes());
    }
    file.extend_from_slice(b"JSON");
    file.extend_from_slice(&json);
    file.extend_from_slice(&(bin.len() as u32).to_le_bytes());
    file.extend_from_slice(b"BIN\0");
    file.extend_from_slice(&bin);
    file
}

fn write(bytes: &[u8], name: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn load_bytes(bytes: &[u8]) -> Result<Scene, SceneError> {
    let (_folder, path) = write(bytes, "test.glb");
    scene::load(path.to_str().unwrap(), &SearchPath::only([]))
}

const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

fn one_mesh(primitives: &str) -> String {
    format!(r#""meshes":[{{"primitives":[{primitives}]}}],"nodes":[{{"mesh":0}}],"scenes":[{{"nodes":[0]}}]"#)
}

fn normal([a, b, c]: [[f32; 3]; 3]) -> [f32; 3] {
    let u: [f32; 3] = std::array::from_fn(|k| b[k] - a[k]);
    let v: [f32; 3] = std::array::from_fn(|k| c[k] - a[k]);
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

#[test]
fn triangles_with_indices_of_every_width_and_none() {
    for kind in [None, Some(5121u32), Some(5123), Some(5125)] {
        let mut b = Builder::default();
        let corners = [0usize, 1, 2, 0, 2, 3];
        let expanded: Vec<[f32; 3]> = corners.iter().map(|&i| SQUARE[i]).collect();
        let primitive = match kind {
            None => format!(r#"{{"attributes":{{"POSITION":{}}}}}"#, b.points(&expanded)),
            Some(kind) => {
                let points = b.points(&SQUARE);
                let width = match kind {
                    5121 => 1,
                    5123 => 2,
                    _ => 4,
                };
                let bytes: Vec<u8> =
                    corners.iter().flat_map(|&i| (i as u32).to_le_bytes()[..width].to_vec()).collect();
                let view = b.view(&bytes, "");
                let indices = b.accessor(view, kind, 6, "SCALAR", "");
                format!(r#"{{"attributes":{{"POSITION":{points}}},"indices":{indices}}}"#)
            }
        };
        let scene = load_bytes(&b.glb(&one_mesh(&primitive))).unwrap();
        assert_eq!(scene.positions.concat(), expanded, "{kind:?}");
        assert!(scene.report.is_clean());
        assert_eq!(scene.views.len(), 8);
    }
}

#[test]
fn strips_and_fans_keep_their_winding() {
    let mut b = Builder::default();
    let points = b.points(&SQUARE);
    // A strip goes zigzag, a fan around its first corner.
    let strip = b.indices16(&[0, 1, 3, 2]);
    let fan = b.indices16(&[0, 1, 2, 3]);
    let rest = one_mesh(&format!(
        r#"{{"attributes":{{"POSITION":{points}}},"indices":{strip},"mode":5}},
        {{"attributes":{{"POSITION":{points}}},"indices":{fan},"mode":6}},
        {{"attributes":{{"POSITION":{points}}},"mode":1}}"#
    ));
    let scene = load_bytes(&b.glb(&rest)).unwrap();
    assert_eq!(scene.positions.len(), 4);
    for triangle in &scene.positions {
        assert_eq!(normal(*triangle), [0.0, 0.0, 1.0], "{triangle:?}");
    }
    assert_eq!(scene.report.skipped_primitives, 1);
}

#[test]
fn nodes_nest_repeat_and_mirror() {
    let mut b = Builder::default();
    let points = b.points(&SQUARE[..3]);
    let rest = format!(
        r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{points}}}}}]}}],
        "nodes":[{{"children":[1,2,3],"translation":[10,0,0]}},{{"mesh":0,"scale":[2,2,2]}},
        {{"mesh":0,"scale":[-1,1,1]}},{{"mesh":0,"rotation":[0,0,0.70710678,0.70710678]}},
        {{"mesh":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,7,1]}}],
        "scenes":[{{"nodes":[0]}},{{"nodes":[4]}}]"#
    );
    let scene = load_bytes(&b.glb(&rest)).unwrap();
    assert_eq!(scene.positions.len(), 4);
    assert_eq!(scene.positions[0][1], [12.0, 0.0, 0.0]);
    // Mirrored: two corners change places so that the front stays the front.
    assert!(normal(scene.positions[1])[2] > 0.0);
    assert!(scene.positions[1].contains(&[9.0, 0.0, 0.0]));
    let turned = scene.positions[2][1];
    assert!((turned[0] - 10.0).abs() < 1e-6 && (turned[1] - 1.0).abs() < 1e-6, "{turned:?}");
    assert_eq!(scene.positions[3][0], [0.0, 0.0, 7.0]);
}

#[test]
fn instances_by_extension_are_flattened() {
    let mut b = Builder::default();
    let points = b.points(&SQUARE[..3]);
    let places = b.points(&[[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 0.0, -5.0]]);
    let rest = format!(
        r#""extensionsRequired":["EXT_mesh_gpu_instancing"],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":{points}}}}}]}}],
        "nodes":[{{"mesh":0,"translation":[0,1,0],
        "extensions":{{"EXT_mesh_gpu_instancing":{{"attributes":{{"TRANSLATION":{places}}}}}}}}}],
        "scenes":[{{"nodes":[0]}}]"#
    );
    let scene = load_bytes(&b.glb(&rest)).unwrap();
    let first: Vec<[f32; 3]> = scene.positions.iter().map(|t| t[0]).collect();
    assert_eq!(first, [[0.0, 1.0, 0.0], [5.0, 1.0, 0.0], [0.0, 1.0, -5.0]]);
}

#[test]
fn quantised_positions_are_integers_or_fractions() {
    for (normalised, expected) in [(false, 32767.0), (true, 1.0)] {
        let mut b = Builder::default();
        // Each point is padded to eight bytes.
        let points: [[i16; 4]; 3] = [[0, 0, 0, 9], [32767, 0, 0, 9], [0, -32768, 0, 9]];
        let bytes: Vec<u8> = points.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let view = b.view(&bytes, r#","byteStride":8"#);
        let accessor =
            b.accessor(view, 5122, 3, "VEC3", if normalised { r#","normalized":true"# } else { "" });
        let mesh = one_mesh(&format!(r#"{{"attributes":{{"POSITION":{accessor}}}}}"#));
        let scene =
            load_bytes(&b.glb(&format!(r#""extensionsRequired":["KHR_mesh_quantization"],{mesh}"#))).unwrap();
        assert_eq!(scene.positions[0][1], [expected, 0.0, 0.0]);
        assert_eq!(scene.positions[0][2][1], if normalised { -1.0 } else { -32768.0 });
    }
    let mut b = Builder::default();
    let bytes = [0u8, 0, 0, 0, 255, 0, 0, 0, 0, 255, 0, 0];
    let view = b.view(&bytes, r#","byteStride":4"#);
    let accessor = b.accessor(view, 5121, 3, "VEC3", r#","normalized":true"#);
    let scene =
        load_bytes(&b.glb(&one_mesh(&format!(r#"{{"attributes":{{"POSITION":{accessor}}}}}"#)))).unwrap();
    assert_eq!(scene.positions[0], [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
}

/// Positions and indices packed by meshoptimizer, both in the GLB's buffer.
fn packed_file() -> Vec<u8> {
    let side = 20u32;
    let points: Vec<[f32; 3]> = (0..side * side)
        .map(|i| [(i % side) as f32, ((i * 7) % 5) as f32 / 8.0, (i / side) as f32])
        .collect();
    let indices: Vec<u32> = (0..(side - 1) * (side - 1))
        .map(|i| i % (side - 1) + i / (side - 1) * side)
        .flat_map(|v| [v, v + side, v + 1, v + 1, v + side, v + side + 1])
        .collect();
    let filtered = meshopt::encode_filter_exp(&points, 20, meshopt::EncodeExpMode::SharedVector);
    let mut bin = meshopt::encode_vertex_buffer(&filtered).unwrap();
    let packed_points = bin.len();
    bin.resize(packed_points.next_multiple_of(4), 0);
    let start = bin.len();
    let packed_indices = meshopt::encode_index_buffer(&indices, points.len()).unwrap();
    bin.extend_from_slice(&packed_indices);
    let (np, ni) = (points.len(), indices.len());
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["EXT_meshopt_compression"],
        "buffers":[{{"byteLength":{}}},
        {{"byteLength":{},"extensions":{{"EXT_meshopt_compression":{{"fallback":true}}}}}}],
        "bufferViews":[
        {{"buffer":1,"byteLength":{},"byteStride":12,"extensions":{{"EXT_meshopt_compression":
        {{"buffer":0,"byteLength":{packed_points},"byteStride":12,"count":{np},"mode":"ATTRIBUTES","filter":"EXPONENTIAL"}}}}}},
        {{"buffer":1,"byteOffset":{},"byteLength":{},"extensions":{{"EXT_meshopt_compression":
        {{"buffer":0,"byteOffset":{start},"byteLength":{},"byteStride":2,"count":{ni},"mode":"TRIANGLES"}}}}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{np},"type":"VEC3"}},
        {{"bufferView":1,"componentType":5123,"count":{ni},"type":"SCALAR"}}],{}}}"#,
        bin.len(),
        12 * np + 2 * ni,
        12 * np,
        12 * np,
        2 * ni,
        packed_indices.len(),
        one_mesh(r#"{"attributes":{"POSITION":0},"indices":1}"#)
    );
    glb(&json, &bin)
}

fn plain_file() -> Vec<u8> {
    let mut b = Builder::default();
    let points = b.points(&SQUARE);
    let indices = b.indices16(&[0, 1, 2, 0, 2, 3]);
    b.glb(&one_mesh(&format!(r#"{{"attributes":{{"POSITION":{points}}},"indices":{indices}}}"#)))
}

#[test]
fn packed_buffers_come_back() {
    let scene = load_bytes(&packed_file()).unwrap();
    assert_eq!(scene.positions.len(), 2 * 19 * 19);
    assert_eq!(scene.bounds(), ([0.0, 0.0, 0.0], [19.0, 0.5, 19.0]));
    assert_eq!(scene.report.degenerate, 0);
}

#[test]
fn external_buffers_and_data_uris_are_read() {
    let mut b = Builder::default();
    let points = b.points(&SQUARE[..3]);
    let json = b.json(&one_mesh(&format!(r#"{{"attributes":{{"POSITION":{points}}}}}"#)));
    let at = r#""buffers":[{"#;
    let external = json.replace(at, &format!(r#"{at}"uri":"my%20data.bin","#));
    let (folder, path) = write(external.as_bytes(), "test.gltf");
    let missing = scene::load(path.to_str().unwrap(), &SearchPath::only([])).unwrap_err().to_string();
    assert!(missing.contains("my data.bin"), "{missing}");
    std::fs::write(folder.path().join("my data.bin"), &b.bin).unwrap();
    let scene = scene::load(path.to_str().unwrap(), &SearchPath::only([])).unwrap();
    assert_eq!(scene.positions[0], SQUARE[..3]);

    // Nine little-endian floats: 0 0 0, 1 0 0, 1 1 0. One is the bytes 00 00 80 3f.
    let data = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAA";
    let inline = json.replace(at, &format!(r#"{at}"uri":"data:application/octet-stream;base64,{data}","#));
    let (_folder, path) = write(inline.as_bytes(), "test.gltf");
    let scene = scene::load(path.to_str().unwrap(), &SearchPath::only([])).unwrap();
    assert_eq!(scene.positions[0], SQUARE[..3]);
}

#[test]
fn sparse_accessors_replace_elements() {
    let mut b = Builder::default();
    let base = b.view(&[0u8; 36], "");
    let at = b.view(&[1u8, 2], "");
    let bytes: Vec<u8> = [1.0f32, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let with = b.view(&bytes, "");
    let sparse = format!(
        r#","sparse":{{"count":2,"indices":{{"bufferView":{at},"byteOffset":0,"componentType":5121}},
        "values":{{"bufferView":{with},"byteOffset":0}}}}"#
    );
    let points = b.accessor(base, 5126, 3, "VEC3", &sparse);
    let scene =
        load_bytes(&b.glb(&one_mesh(&format!(r#"{{"attributes":{{"POSITION":{points}}}}}"#)))).unwrap();
    assert_eq!(scene.positions[0], [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
}

#[test]
fn materials_give_albedo_and_emission() {
    let mut b = Builder::default();
    let points = b.points(&SQUARE[..3]);
    let rest = format!(
        r#""materials":[{{"name":"lamp","pbrMetallicRoughness":{{"baseColorFactor":[0.5,0.25,0.125,1]}},
        "emissiveFactor":[1,0.5,0],"extensions":{{"KHR_materials_emissive_strength":{{"emissiveStrength":8}}}}}}],{}"#,
        one_mesh(&format!(
            r#"{{"attributes":{{"POSITION":{points}}},"material":0}},{{"attributes":{{"POSITION":{points}}}}}"#
        ))
    );
    let scene = load_bytes(&b.glb(&rest)).unwrap();
    assert_eq!(scene.material_ids, [0, 1]);
    assert_eq!(scene.materials[0].name, "lamp");
    assert_eq!(scene.materials[0].albedo, [0.5, 0.25, 0.125]);
    assert_eq!(scene.materials[0].emission, [8.0, 4.0, 0.0]);
    assert_eq!(scene.materials[1].emission, [0.0; 3]);
}

#[test]
fn bad_triangles_are_counted() {
    let mut b = Builder::default();
    let mut points = SQUARE.to_vec();
    points.push([f32::NAN, 0.0, 0.0]);
    points.push([0.0, f32::INFINITY, 0.0]);
    let points = b.points(&points);
    let indices = b.indices16(&[0, 1, 2, 0, 1, 4, 0, 5, 1, 0, 1, 99, 1, 1, 2, 0, 2]);
    let rest = one_mesh(&format!(r#"{{"attributes":{{"POSITION":{points}}},"indices":{indices}}}"#));
    let scene = load_bytes(&b.glb(&rest)).unwrap();
    assert_eq!(scene.positions.len(), 2);
    assert_eq!((scene.report.non_finite, scene.report.out_of_range, scene.report.degenerate), (2, 1, 1));
}

#[test]
fn loops_and_shared_nodes_end() {
    let mut b = Builder::default();
    let points = b.points(&SQUARE[..3]);
    let mesh = format!(r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{points}}}}}]}}]"#);
    let ring = r#""nodes":[{"mesh":0,"children":[1]},{"children":[0]}],"scenes":[{"nodes":[0]}]"#;
    assert_eq!(load_bytes(&b.glb(&format!("{mesh},{ring}"))).unwrap().positions.len(), 1);
    // Each node names the next twice: two to the power of sixty copies, were they followed.
    let mut nodes: Vec<String> = (0..60).map(|i| format!(r#"{{"children":[{0},{0}]}}"#, i + 1)).collect();
    nodes.push(r#"{"mesh":0}"#.into());
    let doubling = format!(r#""nodes":[{}],"scenes":[{{"nodes":[0]}}]"#, nodes.join(","));
    let scene = load_bytes(&b.glb(&format!("{mesh},{doubling}"))).unwrap();
    assert_eq!(scene.positions.len(), 1);
    assert!(!scene.report.notes.is_empty());
}

#[test]
fn impossible_files_are_refused_with_a_reason() {
    let mut b = Builder::default();
    let points = b.points(&SQUARE[..3]);
    let huge = b.accessor(0, 5126, usize::MAX / 2, "VEC3", "");
    let beyond = b.accessor(0, 5126, 4, "VEC3", "");
    b.accessors.push(r#"{"componentType":5126,"count":40000000,"type":"VEC3"}"#.into());
    let no_data = b.accessors.len() - 1;
    let position = |i: usize| one_mesh(&format!(r#"{{"attributes":{{"POSITION":{i}}}}}"#));
    let with = |rest: &str| one_mesh(&format!(r#"{{"attributes":{{"POSITION":{points}}}{rest}}}"#));
    for (rest, part) in [
        (position(huge), "triangles after instancing"),
        (position(beyond), "do not fit"),
        (position(no_data), "without data"),
        (position(77), "no accessor 77"),
        (with(&format!(r#","indices":{points}"#)), "scalars"),
        (with(r#","material":3"#), "no material 3"),
        (one_mesh(r#"{"attributes":{}}"#), "no triangles"),
        (r#""scenes":[]"#.to_owned(), "no triangles"),
        (r#""nodes":[{"mesh":9}],"scenes":[{"nodes":[0]}]"#.to_owned(), "no mesh 9"),
        (r#""scenes":[{"nodes":[9]}]"#.to_owned(), "no node 9"),
        (
            format!(r#""extensionsRequired":["KHR_draco_mesh_compression"],{}"#, with("")),
            "KHR_draco_mesh_compression",
        ),
    ] {
        let message = load_bytes(&b.glb(&rest)).unwrap_err().to_string();
        assert!(message.contains(part), "{part}: {message}");
    }
    for garbage in [
        &b""[..],
        b"glTF",
        b"glTF\x02\0\0\0\xff\xff\xff\xff",
        b"{}",
        b"[1,2",
        b"glTF\x02\0\0\0\0\0\0\0JSONJSON",
    ] {
        assert!(load_bytes(garbage).is_err(), "{garbage:?}");
    }
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    for file in [packed_file(), plain_file()] {
        assert!(load_bytes(&file).is_ok());
        for length in (0..file.len()).step_by(97) {
            assert!(load_bytes(&file[..length]).is_err(), "{length} of {} bytes", file.len());
        }
    }
}

/// As if a tool had cut the file and repaired the length in its header.
#[test]
fn a_cut_file_with_a_matching_header_is_refused() {
    for file in [packed_file(), plain_file()] {
        for length in (20..file.len() - 4).step_by(53) {
            let mut cut = file[..length].to_vec();
            cut[8..12].copy_from_slice(&(length as u32).to_le_bytes());
            assert!(load_bytes(&cut).is_err(), "{length} of {} bytes", file.len());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever bytes change, loading returns, and what it returns is sound.
    #[test]
    fn changed_bytes_never_crash(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        packed: bool,
    ) {
        let mut file = if packed { packed_file() } else { plain_file() };
        for (at, value) in changes {
            let at = at.index(file.len());
            file[at] = value;
        }
        if let Ok(scene) = load_bytes(&file) {
            prop_assert!(!scene.positions.is_empty() && scene.positions.len() == scene.material_ids.len());
            prop_assert!(scene.positions.iter().flatten().flatten().all(|x| x.is_finite()));
            prop_assert!(scene.material_ids.iter().all(|&id| (id as usize) < scene.materials.len()));
            prop_assert_eq!(scene.views.len(), 8);
        }
    }

    /// A number in the JSON changes: counts, offsets, indices and strides of every size.
    #[test]
    fn changed_numbers_never_crash(at in any::<prop::sample::Index>(), number in "[0-9]{1,19}", packed: bool) {
        let file = if packed { packed_file() } else { plain_file() };
        let length = u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
        let json = String::from_utf8(file[20..20 + length].to_vec()).unwrap();
        let starts: Vec<usize> = json
            .char_indices()
            .filter(|&(i, c)| c.is_ascii_digit() && !json[..i].ends_with(|c: char| c.is_ascii_digit()))
            .map(|(i, _)| i)
            .collect();
        let start = starts[at.index(starts.len())];
        let end = start + json[start..].find(|c: char| !c.is_ascii_digit()).unwrap();
        let changed = format!("{}{number}{}", &json[..start], &json[end..]);
        let loaded = load_bytes(&glb(&changed, &file[28 + length..]));
        prop_assert!(loaded.is_err() || !loaded.unwrap().positions.is_empty());
    }

    #[test]
    fn any_text_is_an_obj_or_an_error(text in "([vf] ?[-0-9./ naif]{0,12}\n|[a-z #]{0,9}\n){0,30}") {
        let (_folder, path) = write(text.as_bytes(), "test.obj");
        let loaded = scene::load(path.to_str().unwrap(), &SearchPath::only([]));
        prop_assert!(loaded.is_err() || !loaded.unwrap().positions.is_empty());
    }
}
