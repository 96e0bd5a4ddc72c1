//! Files of rays and of hits, for checking against other ray tracers.
//!
//! Little-endian. `RAYS`, u32 version 1, u64 count, then eight f32 a ray: origin, tmin, direction, tmax.
//! `HITS`, u32 version 1, u64 count, then f32 t and u32 triangle in file order a hit; a miss is infinity
//! and 0xFFFFFFFF.

use anyhow::{Context, bail};
use std::{
    fs::File,
    io::{BufWriter, Read, Write},
    path::Path,
};
use tracer::traverse::{Hit, Ray};

const VERSION: u32 = 1;

/// Writes a file of rays.
///
/// # Errors
/// The file cannot be written.
pub fn write_rays(path: &Path, rays: &[Ray]) -> anyhow::Result<()> {
    write(path, b"RAYS", rays.len(), rays.iter().map(|r| bytemuck::cast::<Ray, [u32; 8]>(*r)))
}

/// Writes a file of hits.
///
/// # Errors
/// The file cannot be written.
pub fn write_hits(path: &Path, hits: &[Hit]) -> anyhow::Result<()> {
    write(path, b"HITS", hits.len(), hits.iter().map(|h| [h.t.to_bits(), h.triangle]))
}

/// Reads a file of rays.
///
/// # Errors
/// Not such a file, cut short, or with rays that cannot be traced.
pub fn read_rays(path: &Path) -> anyhow::Result<Vec<Ray>> {
    let rays: Vec<Ray> = read(path, b"RAYS")?.into_iter().map(bytemuck::cast::<[u32; 8], Ray>).collect();
    let sound = |r: &Ray| {
        r.origin.iter().chain(&r.direction).all(|x| x.is_finite())
            && r.direction != [0.0; 3]
            && !r.t_min.is_nan()
            && !r.t_max.is_nan()
    };
    match rays.iter().position(|r| !sound(r)) {
        Some(i) => bail!("{}: ray {i} is not finite or has no direction", path.display()),
        None => Ok(rays),
    }
}

fn write<const N: usize>(
    path: &Path,
    magic: &[u8; 4],
    count: usize,
    items: impl Iterator<Item = [u32; N]>,
) -> anyhow::Result<()> {
    let cannot = || format!("cannot write {}", path.display());
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).with_context(cannot)?;
    }
    let mut file = BufWriter::new(File::create(path).with_context(cannot)?);
    let mut put = |bytes: &[u8]| file.write_all(bytes);
    put(magic)
        .and_then(|()| put(&VERSION.to_le_bytes()))
        .and_then(|()| put(&(count as u64).to_le_bytes()))
        .with_context(cannot)?;
    for item in items {
        for word in item {
            put(&word.to_le_bytes()).with_context(cannot)?;
        }
    }
    file.flush().with_context(cannot)
}

fn read<const N: usize>(path: &Path, magic: &[u8; 4]) -> anyhow::Result<Vec<[u32; N]>> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|mut f| f.read_to_end(&mut bytes))
        .with_context(|| format!("cannot read {}", path.display()))?;
    let name = path.display();
    let kind = String::from_utf8_lossy(magic);
    let Some((head, body)) = bytes.split_at_checked(16) else {
        bail!("{name}: {} bytes are too few for a {kind} file", bytes.len());
    };
    if &head[..4] != magic {
        bail!("{name}: not a {kind} file: it begins with {:?}", String::from_utf8_lossy(&head[..4]));
    }
    let version = u32::from_le_bytes(head[4..8].try_into().expect("four bytes"));
    if version != VERSION {
        bail!("{name}: version {version} of the {kind} format; this program reads version {VERSION}");
    }
    let count = u64::from_le_bytes(head[8..16].try_into().expect("eight bytes"));
    if count.checked_mul(4 * N as u64) != Some(body.len() as u64) {
        bail!(
            "{name}: says it holds {count} items, but {} bytes follow the head; it may be cut short",
            body.len()
        );
    }
    if count > u64::from(u32::MAX / 2) {
        bail!("{name}: {count} items are too many");
    }
    let word = |b: &[u8]| u32::from_le_bytes(b.try_into().expect("four bytes"));
    Ok(body.chunks_exact(4 * N).map(|item| std::array::from_fn(|i| word(&item[4 * i..4 * i + 4]))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(x: f32) -> Ray {
        Ray { origin: [x, 2.0, 3.0], t_min: 0.0, direction: [0.0, 0.0, -1.0], t_max: f32::INFINITY }
    }

    #[test]
    fn rays_come_back_as_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/r.rays");
        let rays = vec![ray(1.0), ray(-0.0), ray(1e30)];
        write_rays(&path, &rays).unwrap();
        assert_eq!(read_rays(&path).unwrap(), rays);
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(bytes[..16], *b"RAYS\x01\0\0\0\x03\0\0\0\0\0\0\0");
        assert_eq!(bytes[16..20], 1.0f32.to_le_bytes());
        assert_eq!(bytes.len(), 16 + 3 * 32);
    }

    #[test]
    fn hits_are_stored_as_the_format_says() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("h.hits");
        write_hits(&path, &[Hit { t: 1.5, triangle: 7 }, Hit::NONE]).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(bytes[..16], *b"HITS\x01\0\0\0\x02\0\0\0\0\0\0\0");
        assert_eq!(bytes[16..], [0, 0, 0xc0, 0x3f, 7, 0, 0, 0, 0, 0, 0x80, 0x7f, 255, 255, 255, 255]);
    }

    #[test]
    fn a_damaged_file_is_refused_with_its_fault() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.rays");
        write_rays(&path, &[ray(1.0), ray(2.0)]).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for cut in 0..whole.len() {
            std::fs::write(&path, &whole[..cut]).unwrap();
            assert!(read_rays(&path).is_err(), "cut at {cut}");
        }
        let mut huge = whole.clone();
        huge[8..16].fill(0xFF);
        std::fs::write(&path, &huge).unwrap();
        assert!(read_rays(&path).is_err());
        write_rays(&path, &[ray(f32::NAN)]).unwrap();
        assert!(read_rays(&path).unwrap_err().to_string().contains("ray 0"));
        write_hits(&path, &[Hit::NONE]).unwrap();
        assert!(read_rays(&path).unwrap_err().to_string().contains("HITS"));
    }
}
