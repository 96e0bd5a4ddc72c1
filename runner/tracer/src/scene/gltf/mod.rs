//! glTF 2.0, as `.glb` or `.gltf`: the whole node tree flattened into triangles in file order.
//!
//! The JSON is read by the `gltf` crate without its validation (which refuses compressed files); every
//! index is checked here instead. File order is: scenes in order, nodes depth first, then a mesh's
//! primitives, then their triangles.

mod accessor;
mod buffers;
mod meshopt;

use std::borrow::Cow;
use std::path::Path;

use glam::{DMat4, DQuat, DVec3};
use gltf::json::accessor::Type;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::scene::Node;
use gltf::json::validation::Checked;
use gltf::json::{Index, Root};
use rayon::prelude::*;

use self::buffers::Views;
use super::{Geometry, LoadReport, MAX_TRIANGLES, Material, SceneError};

/// Extensions that change geometry and are understood. Others that a file requires are refused if they
/// change geometry, and noted if they only change how a surface looks.
const UNDERSTOOD: [&str; 5] = [
    "KHR_mesh_quantization",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
    "EXT_mesh_gpu_instancing",
    "KHR_materials_emissive_strength",
];
const LOOKS: [&str; 8] = [
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
    "MSFT_texture_",
    "KHR_animation_",
    "KHR_xmp",
    "EXT_lights_",
];

/// Reads the file whose bytes are given; `path` is for messages and for buffers beside it.
pub(super) fn load(path: &Path, bytes: &[u8], report: &mut LoadReport) -> Result<Geometry, SceneError> {
    let (json, bin) = container(path, bytes)?;
    let root = Root::from_slice(&json)
        .map_err(|e| SceneError::format(path, format!("its JSON is not glTF 2.0: {e}")))?;
    check_extensions(path, &root, report)?;

    let (materials, default_material) = materials(&root, report);
    let buffers = buffers::load(path, &root, bin.as_deref())?;
    let views = Views::resolve(path, &root, &buffers, &needed_views(&root))?;
    let instances = instances(path, &root, &views, report)?;

    let mut total = 0u64;
    let mut work = Vec::new();
    for instance in &instances {
        let Some(mesh) = root.meshes.get(instance.mesh) else {
            return Err(SceneError::format(path, format!("there is no mesh {}", instance.mesh)));
        };
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            let triangles = triangle_count(&root, primitive).map_err(|e| {
                SceneError::format(path, format!("mesh {}, primitive {p}: {e}", instance.mesh))
            })?;
            match triangles {
                Some(count) => {
                    total = total.saturating_add(count);
                    work.push((instance, p, primitive));
                }
                None => report.skipped_primitives += 1,
            }
        }
        if total > MAX_TRIANGLES {
            return Err(SceneError::TooLarge {
                path: path.to_owned(),
                triangles: total,
                limit: MAX_TRIANGLES,
            });
        }
    }

    let parts = work
        .par_iter()
        .map(|&(instance, p, primitive)| {
            flatten(&root, primitive, &instance.transform, &views)
                .map_err(|e| SceneError::format(path, format!("mesh {}, primitive {p}: {e}", instance.mesh)))
        })
        .collect::<Result<Vec<Part>, SceneError>>()?;

    let kept = parts.iter().map(|part| part.triangles.len()).sum();
    let mut geometry =
        Geometry { positions: Vec::with_capacity(kept), material_ids: Vec::with_capacity(kept), materials };
    for (part, (_, _, primitive)) in parts.iter().zip(&work) {
        let id = match primitive.material {
            Some(index) if index.value() < root.materials.len() => index.value() as u32,
            Some(index) => {
                return Err(SceneError::format(path, format!("there is no material {}", index.value())));
            }
            None => default_material,
        };
        geometry.positions.extend_from_slice(&part.triangles);
        geometry.material_ids.resize(geometry.positions.len(), id);
        report.non_finite += part.non_finite;
        report.out_of_range += part.out_of_range;
    }
    Ok(geometry)
}

/// Bytes of the file itself or of a buffer beside it.
type Bytes<'a> = Cow<'a, [u8]>;

/// The JSON and the GLB's binary chunk.
fn container<'a>(path: &Path, bytes: &'a [u8]) -> Result<(Bytes<'a>, Option<Bytes<'a>>), SceneError> {
    if !bytes.starts_with(b"glTF") {
        return Ok((Cow::Borrowed(bytes), None));
    }
    let length = bytes.get(8..12).map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    if (length as usize) < 20 || length as usize > bytes.len() {
        let reason = format!("its header promises {length} bytes, the file has {}", bytes.len());
        return Err(SceneError::format(path, reason));
    }
    let glb = gltf::binary::Glb::from_slice(bytes)
        .map_err(|e| SceneError::format(path, format!("not a GLB: {e}")))?;
    Ok((glb.json, glb.bin))
}

fn check_extensions(path: &Path, root: &Root, report: &mut LoadReport) -> Result<(), SceneError> {
    for name in &root.extensions_required {
        if UNDERSTOOD.contains(&name.as_str()) {
            continue;
        }
        if LOOKS.iter().any(|prefix| name.starts_with(prefix)) {
            report
                .notes
                .push(format!("{name} is required by the file and ignored: surfaces are plain Lambertian"));
        } else {
            return Err(SceneError::Unsupported { path: path.to_owned(), feature: name.clone() });
        }
    }
    if !root.skins.is_empty() {
        report.notes.push("skins are ignored: meshes are traced in their rest pose".to_owned());
    }
    Ok(())
}

/// Materials of the file, with a default one appended where a primitive has none; and the default's index.
fn materials(root: &Root, report: &mut LoadReport) -> (Vec<Material>, u32) {
    let unit = |value: f32| {
        if value.is_finite() { value.clamp(0.0, 1.0) } else { 0.5 }
    };
    let mut textured = 0;
    let mut materials: Vec<Material> = root
        .materials
        .iter()
        .map(|material| {
            let pbr = &material.pbr_metallic_roughness;
            textured += u32::from(pbr.base_color_texture.is_some());
            let colour = pbr.base_color_factor.0;
            let strength = material
                .extensions
                .as_ref()
                .and_then(|all| all.emissive_strength.as_ref())
                .map_or(1.0, |extension| extension.emissive_strength.0);
            let radiance = |factor: f32| {
                let value = factor * strength;
                if value.is_finite() { value.max(0.0) } else { 0.0 }
            };
            Material {
                name: material.name.clone().unwrap_or_default(),
                albedo: [unit(colour[0]), unit(colour[1]), unit(colour[2])],
                emission: material.emissive_factor.0.map(radiance),
                phong: None,
            }
        })
        .collect();
    if textured > 0 {
        report.notes.push(format!(
            "{textured} materials have textures, which are not read; their plain colour is used"
        ));
    }
    let default_material = materials.len() as u32;
    if materials.is_empty()
        || root.meshes.iter().flat_map(|mesh| &mesh.primitives).any(|p| p.material.is_none())
    {
        materials.push(super::load::default_material());
    }
    (materials, default_material)
}

/// Which buffer views hold positions, indices or instance transforms.
fn needed_views(root: &Root) -> Vec<bool> {
    let mut needed = vec![false; root.buffer_views.len()];
    let mut need = |view: usize| {
        if let Some(flag) = needed.get_mut(view) {
            *flag = true;
        }
    };
    let mut accessors: Vec<usize> = root
        .meshes
        .iter()
        .flat_map(|mesh| &mesh.primitives)
        .flat_map(|primitive| positions_of(primitive).into_iter().chain(primitive.indices))
        .map(|index| index.value())
        .collect();
    accessors.extend(root.nodes.iter().filter_map(gpu_instances).flat_map(|attributes| {
        attributes
            .values()
            .filter_map(serde_json::Value::as_u64)
            .map(|index| index as usize)
            .collect::<Vec<_>>()
    }));
    for accessor in accessors.into_iter().filter_map(|index| root.accessors.get(index)) {
        if let Some(view) = accessor.buffer_view {
            need(view.value());
        }
        if let Some(sparse) = &accessor.sparse {
            need(sparse.indices.buffer_view.value());
            need(sparse.values.buffer_view.value());
        }
    }
    needed
}

fn positions_of(primitive: &Primitive) -> Option<Index<gltf::json::Accessor>> {
    primitive.attributes.get(&Checked::Valid(Semantic::Positions)).copied()
}

/// A mesh with the transform it appears under.
struct Instance {
    mesh: usize,
    transform: DMat4,
}

/// Walks the node tree of every scene. A node counts once, however often it is reached, so that a file
/// whose nodes form a loop or share children ends.
fn instances(
    path: &Path,
    root: &Root,
    views: &Views<'_>,
    report: &mut LoadReport,
) -> Result<Vec<Instance>, SceneError> {
    let mut roots: Vec<usize> =
        root.scenes.iter().flat_map(|scene| &scene.nodes).map(|index| index.value()).collect();
    if root.scenes.is_empty() {
        let mut is_child = vec![false; root.nodes.len()];
        for child in root.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
            if let Some(flag) = is_child.get_mut(child.value()) {
                *flag = true;
            }
        }
        roots = (0..root.nodes.len()).filter(|&i| !is_child[i]).collect();
    }

    let mut seen = vec![false; root.nodes.len()];
    let mut again = 0u64;
    let mut instances = Vec::new();
    let mut stack: Vec<(usize, DMat4)> = roots.into_iter().rev().map(|i| (i, DMat4::IDENTITY)).collect();
    while let Some((index, parent)) = stack.pop() {
        let Some(node) = root.nodes.get(index) else {
            return Err(SceneError::format(path, format!("there is no node {index}")));
        };
        if std::mem::replace(&mut seen[index], true) {
            again += 1;
            continue;
        }
        let transform = parent * local_transform(node);
        if let Some(mesh) = node.mesh {
            match gpu_instances(node) {
                None => instances.push(Instance { mesh: mesh.value(), transform }),
                Some(attributes) => {
                    let copies = copies(root, views, attributes)
                        .map_err(|e| SceneError::format(path, format!("instances of node {index}: {e}")))?;
                    instances.extend(
                        copies
                            .into_iter()
                            .map(|copy| Instance { mesh: mesh.value(), transform: transform * copy }),
                    );
                }
            }
        }
        let children = node.children.iter().flatten().rev();
        stack.extend(children.map(|child| (child.value(), transform)));
    }
    if again > 0 {
        report.notes.push(format!("{again} nodes were reached twice and counted once"));
    }
    Ok(instances)
}

fn local_transform(node: &Node) -> DMat4 {
    if let Some(matrix) = node.matrix {
        return DMat4::from_cols_array(&matrix.map(f64::from));
    }
    let vector = |v: Option<[f32; 3]>, default| v.map_or(default, |v| DVec3::from_array(v.map(f64::from)));
    let turn = node.rotation.map_or(DQuat::IDENTITY, |q| rotation(q.0));
    DMat4::from_scale_rotation_translation(
        vector(node.scale, DVec3::ONE),
        turn,
        vector(node.translation, DVec3::ZERO),
    )
}

/// Exporters write quaternions that are a little off unit length; a zero one means no turn.
fn rotation(q: [f32; 4]) -> DQuat {
    let q = DQuat::from_array(q.map(f64::from));
    if q.length_squared() > 0.0 && q.is_finite() { q.normalize() } else { DQuat::IDENTITY }
}

fn gpu_instances(node: &Node) -> Option<&serde_json::Map<String, serde_json::Value>> {
    node.extensions.as_ref()?.others.get("EXT_mesh_gpu_instancing")?.get("attributes")?.as_object()
}

/// The transforms of EXT_mesh_gpu_instancing.
fn copies(
    root: &Root,
    views: &Views<'_>,
    attributes: &serde_json::Map<String, serde_json::Value>,
) -> Result<Vec<DMat4>, String> {
    let find = |name: &str| -> Result<_, String> {
        let Some(index) = attributes.get(name) else {
            return Ok(None);
        };
        let index =
            index.as_u64().and_then(|i| u32::try_from(i).ok()).ok_or("an accessor that is not a number")?;
        accessor::get(root, Index::new(index)).map(Some)
    };
    let translations =
        find("TRANSLATION")?.map(|a| accessor::vectors::<3>(a, Type::Vec3, views)).transpose()?;
    let rotations = find("ROTATION")?.map(|a| accessor::vectors::<4>(a, Type::Vec4, views)).transpose()?;
    let scales = find("SCALE")?.map(|a| accessor::vectors::<3>(a, Type::Vec3, views)).transpose()?;
    let counts = [
        translations.as_ref().map(Vec::len),
        rotations.as_ref().map(Vec::len),
        scales.as_ref().map(Vec::len),
    ];
    let count = counts.into_iter().flatten().min().unwrap_or(0);
    Ok((0..count)
        .map(|i| {
            let vector = |all: &Option<Vec<[f32; 3]>>, default| {
                all.as_ref().map_or(default, |v| DVec3::from_array(v[i].map(f64::from)))
            };
            let turn = rotations.as_ref().map_or(DQuat::IDENTITY, |all| rotation(all[i]));
            DMat4::from_scale_rotation_translation(
                vector(&scales, DVec3::ONE),
                turn,
                vector(&translations, DVec3::ZERO),
            )
        })
        .collect())
}

/// How many triangles a primitive has; `None` if it has none by its kind, or no positions.
fn triangle_count(root: &Root, primitive: &Primitive) -> Result<Option<u64>, String> {
    let Some(positions) = positions_of(primitive) else {
        return Ok(None);
    };
    let corners = accessor::get(root, primitive.indices.unwrap_or(positions))?.count.0;
    Ok(match primitive.mode {
        Checked::Valid(Mode::Triangles) => Some(corners / 3),
        Checked::Valid(Mode::TriangleStrip | Mode::TriangleFan) => Some(corners.saturating_sub(2)),
        Checked::Valid(_) => None,
        Checked::Invalid => return Err("an unknown primitive mode".to_owned()),
    })
}

/// One primitive's triangles in the scene's space.
struct Part {
    triangles: Vec<[[f32; 3]; 3]>,
    non_finite: u64,
    out_of_range: u64,
}

fn flatten(root: &Root, primitive: &Primitive, transform: &DMat4, views: &Views<'_>) -> Result<Part, String> {
    let positions = positions_of(primitive).ok_or("no positions")?;
    let mut points = accessor::vectors::<3>(accessor::get(root, positions)?, Type::Vec3, views)?;
    if *transform != DMat4::IDENTITY {
        for point in &mut points {
            let moved = transform.transform_point3(DVec3::from_array(point.map(f64::from)));
            *point = moved.to_array().map(|x| x as f32);
        }
    }
    let mirrored = transform.determinant() < 0.0;
    let indices = match primitive.indices {
        Some(index) => Some(accessor::indices(accessor::get(root, index)?, views)?),
        None => None,
    };
    let corners = indices.as_ref().map_or(points.len(), Vec::len);
    let mut part = Part { triangles: Vec::new(), non_finite: 0, out_of_range: 0 };
    let mut push = |a: usize, b: usize, c: usize| {
        let (b, c) = if mirrored { (c, b) } else { (b, c) };
        let corner = |i: usize| match &indices {
            Some(list) => points.get(list[i] as usize),
            None => points.get(i),
        };
        let (Some(&a), Some(&b), Some(&c)) = (corner(a), corner(b), corner(c)) else {
            part.out_of_range += 1;
            return;
        };
        if [a, b, c].iter().flatten().all(|x| x.is_finite()) {
            part.triangles.push([a, b, c]);
        } else {
            part.non_finite += 1;
        }
    };
    match primitive.mode {
        Checked::Valid(Mode::TriangleStrip) => {
            for i in 0..corners.saturating_sub(2) {
                push(i, i + 1 + i % 2, i + 2 - i % 2);
            }
        }
        Checked::Valid(Mode::TriangleFan) => {
            for i in 0..corners.saturating_sub(2) {
                push(i + 1, i + 2, 0);
            }
        }
        _ => {
            for i in 0..corners / 3 {
                push(3 * i, 3 * i + 1, 3 * i + 2);
            }
        }
    }
    Ok(part)
}
