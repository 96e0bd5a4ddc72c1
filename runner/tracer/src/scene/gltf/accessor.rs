//! Accessors: typed elements in buffer views.

use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Index, Root};

use super::buffers::Views;

/// Elements of a sparse accessor that starts from zeros need no bytes in the file, so they are bounded here.
const MAX_ZEROS: u64 = 1 << 24;

/// The accessor at `index`, or a sentence about its absence.
pub(super) fn get(root: &Root, index: Index<Accessor>) -> Result<&Accessor, String> {
    root.accessors.get(index.value()).ok_or_else(|| format!("there is no accessor {}", index.value()))
}

fn component(accessor: &Accessor) -> Result<ComponentType, String> {
    match accessor.component_type {
        Checked::Valid(kind) => Ok(kind.0),
        Checked::Invalid => Err("an unknown component type".to_owned()),
    }
}

/// Vectors of `N` floats. Integers are converted as KHR_mesh_quantization says: as they are, or divided
/// by their largest value where the accessor is normalised.
pub(super) fn vectors<const N: usize>(
    accessor: &Accessor,
    kind: Type,
    views: &Views<'_>,
) -> Result<Vec<[f32; N]>, String> {
    if accessor.type_ != Checked::Valid(kind) {
        return Err(format!("expected {kind:?} elements"));
    }
    let component = component(accessor)?;
    let mut values = match accessor.buffer_view {
        Some(view) => {
            let offset = accessor.byte_offset.map_or(0, |o| o.0);
            read_vectors(component, accessor.normalized, views, view.value(), offset, accessor.count.0)?
        }
        None if accessor.sparse.is_some() && accessor.count.0 <= MAX_ZEROS => {
            vec![[0.0; N]; accessor.count.0 as usize]
        }
        None => return Err(format!("{} elements without data", accessor.count.0)),
    };
    if let Some(sparse) = &accessor.sparse {
        let Checked::Valid(index_type) = sparse.indices.component_type else {
            return Err("sparse indices of an unknown type".to_owned());
        };
        let at = read_indices(
            index_type.0,
            views,
            sparse.indices.buffer_view.value(),
            sparse.indices.byte_offset.0,
            sparse.count.0,
        )?;
        let with: Vec<[f32; N]> = read_vectors(
            component,
            accessor.normalized,
            views,
            sparse.values.buffer_view.value(),
            sparse.values.byte_offset.0,
            sparse.count.0,
        )?;
        for (&i, value) in at.iter().zip(with) {
            *values.get_mut(i as usize).ok_or_else(|| format!("a sparse index {i} beyond the accessor"))? =
                value;
        }
    }
    Ok(values)
}

/// Vertex indices of 8, 16 or 32 bits.
pub(super) fn indices(accessor: &Accessor, views: &Views<'_>) -> Result<Vec<u32>, String> {
    if accessor.type_ != Checked::Valid(Type::Scalar) || accessor.sparse.is_some() {
        return Err("indices must be plain scalars".to_owned());
    }
    let view = accessor.buffer_view.ok_or("indices without data")?;
    read_indices(
        component(accessor)?,
        views,
        view.value(),
        accessor.byte_offset.map_or(0, |o| o.0),
        accessor.count.0,
    )
}

fn read_indices(
    kind: ComponentType,
    views: &Views<'_>,
    view: usize,
    offset: u64,
    count: u64,
) -> Result<Vec<u32>, String> {
    let decode: fn(&[u8]) -> u32 = match kind {
        ComponentType::U8 => |b| u32::from(b[0]),
        ComponentType::U16 => |b| u32::from(u16::from_le_bytes([b[0], b[1]])),
        ComponentType::U32 => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        other => return Err(format!("indices of type {other:?}")),
    };
    let (bytes, stride) = views.elements(view, offset, count, kind.size())?;
    Ok((0..count as usize).map(|i| decode(&bytes[i * stride..])).collect())
}

fn read_vectors<const N: usize>(
    kind: ComponentType,
    normalised: bool,
    views: &Views<'_>,
    view: usize,
    offset: u64,
    count: u64,
) -> Result<Vec<[f32; N]>, String> {
    let size = kind.size();
    let (bytes, stride) = views.elements(view, offset, count, size * N)?;
    let each = |decode: fn(&[u8]) -> f32| -> Vec<[f32; N]> {
        (0..count as usize)
            .map(|i| std::array::from_fn(|k| decode(&bytes[i * stride + k * size..])))
            .collect()
    };
    Ok(match (kind, normalised) {
        (ComponentType::F32, _) => each(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        (ComponentType::I8, false) => each(|b| f32::from(b[0] as i8)),
        (ComponentType::I8, true) => each(|b| (f32::from(b[0] as i8) / 127.0).max(-1.0)),
        (ComponentType::U8, false) => each(|b| f32::from(b[0])),
        (ComponentType::U8, true) => each(|b| f32::from(b[0]) / 255.0),
        (ComponentType::I16, false) => each(|b| f32::from(i16::from_le_bytes([b[0], b[1]]))),
        (ComponentType::I16, true) => {
            each(|b| (f32::from(i16::from_le_bytes([b[0], b[1]])) / 32767.0).max(-1.0))
        }
        (ComponentType::U16, false) => each(|b| f32::from(u16::from_le_bytes([b[0], b[1]]))),
        (ComponentType::U16, true) => each(|b| f32::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0),
        (ComponentType::U32, _) => return Err("vectors of 32-bit integers".to_owned()),
    })
}
