//! Buffers and buffer views: the bytes behind accessors.

use std::borrow::Cow;
use std::path::Path;

use gltf::json::{Root, buffer};
use rayon::prelude::*;

use super::meshopt::Packed;
use crate::scene::SceneError;

/// The bytes of each buffer view, unpacked where it was compressed; `None` for views nobody asked for.
pub(super) struct Views<'a> {
    bytes: Vec<Option<Cow<'a, [u8]>>>,
    stride: Vec<Option<usize>>,
}

impl<'a> Views<'a> {
    /// Resolves the `needed` views, each once and in parallel.
    pub fn resolve(
        path: &Path,
        root: &Root,
        buffers: &'a [Option<Cow<'a, [u8]>>],
        needed: &[bool],
    ) -> Result<Self, SceneError> {
        let bytes = root
            .buffer_views
            .par_iter()
            .enumerate()
            .map(|(i, view)| {
                if !needed.get(i).copied().unwrap_or(false) {
                    return Ok(None);
                }
                view_bytes(view, buffers)
                    .map(Some)
                    .map_err(|reason| SceneError::format(path, format!("buffer view {i}: {reason}")))
            })
            .collect::<Result<Vec<_>, SceneError>>()?;
        let stride = root.buffer_views.iter().map(|view| view.byte_stride.map(|s| s.0)).collect();
        Ok(Self { bytes, stride })
    }

    /// `count` elements of `size` bytes in view `view` from `offset`: the bytes from the first element
    /// on, and the distance between elements. Fails where they do not fit.
    pub fn elements(
        &self,
        view: usize,
        offset: u64,
        count: u64,
        size: usize,
    ) -> Result<(&[u8], usize), String> {
        let bytes = self
            .bytes
            .get(view)
            .and_then(Option::as_deref)
            .ok_or_else(|| format!("there is no buffer view {view}"))?;
        let stride = self.stride.get(view).copied().flatten().unwrap_or(size);
        if stride < size {
            return Err(format!("elements of {size} bytes overlap at a stride of {stride}"));
        }
        let end = match count {
            0 => Some(offset),
            n => (n - 1)
                .checked_mul(stride as u64)
                .and_then(|span| span.checked_add(size as u64))
                .and_then(|span| span.checked_add(offset)),
        };
        match end {
            Some(end) if end <= bytes.len() as u64 => Ok((&bytes[offset as usize..], stride)),
            _ => Err(format!(
                "{count} elements do not fit into the {} bytes of buffer view {view}",
                bytes.len()
            )),
        }
    }
}

fn view_bytes<'a>(
    view: &buffer::View,
    buffers: &'a [Option<Cow<'a, [u8]>>],
) -> Result<Cow<'a, [u8]>, String> {
    let extension = view.extensions.as_ref().and_then(|all| {
        ["EXT_meshopt_compression", "KHR_meshopt_compression"].iter().find_map(|name| all.others.get(*name))
    });
    let Some(json) = extension else {
        let offset = view.byte_offset.map_or(0, |o| o.0);
        return part(buffers, view.buffer.value(), offset, view.byte_length.0).map(Cow::Borrowed);
    };
    let packed: Packed = serde::Deserialize::deserialize(json)
        .map_err(|e| format!("its compression is not described ({e})"))?;
    packed.decode(part(buffers, packed.buffer, packed.byte_offset, packed.byte_length)?).map(Cow::Owned)
}

fn part<'a>(
    buffers: &'a [Option<Cow<'a, [u8]>>],
    index: usize,
    offset: u64,
    length: u64,
) -> Result<&'a [u8], String> {
    let bytes =
        buffers.get(index).and_then(Option::as_deref).ok_or_else(|| format!("buffer {index} has no data"))?;
    let end = offset.checked_add(length).filter(|&end| end <= bytes.len() as u64).ok_or_else(|| {
        format!(
            "bytes {offset} to {} of buffer {index}, which has {}",
            offset.saturating_add(length),
            bytes.len()
        )
    })?;
    Ok(&bytes[offset as usize..end as usize])
}

/// Loads every buffer: the GLB's own, data URIs, and files beside the glTF. A buffer without data (the
/// fallback of a compressed file) is `None`.
pub(super) fn load<'a>(
    path: &Path,
    root: &Root,
    bin: Option<&'a [u8]>,
) -> Result<Vec<Option<Cow<'a, [u8]>>>, SceneError> {
    root.buffers
        .iter()
        .enumerate()
        .map(|(i, buffer)| match buffer.uri.as_deref() {
            None if i == 0 => Ok(bin.map(Cow::Borrowed)),
            None => Ok(None),
            Some(uri) => from_uri(path, uri).map(|bytes| Some(Cow::Owned(bytes))),
        })
        .collect()
}

fn from_uri(path: &Path, uri: &str) -> Result<Vec<u8>, SceneError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (kind, payload) =
            data.split_once(',').ok_or_else(|| SceneError::format(path, "a data URI without a comma"))?;
        if !kind.ends_with(";base64") {
            return Err(SceneError::format(path, "a data URI that is not base64"));
        }
        return base64(payload).ok_or_else(|| SceneError::format(path, "a data URI with damaged base64"));
    }
    if uri.contains("://") {
        return Err(SceneError::Unsupported {
            path: path.to_owned(),
            feature: format!("the remote buffer {uri}"),
        });
    }
    let name = percent_decoded(uri)
        .ok_or_else(|| SceneError::format(path, format!("the buffer name {uri} is damaged")))?;
    let file = path.parent().unwrap_or(Path::new("")).join(name);
    std::fs::read(&file).map_err(|source| SceneError::Read { path: file, source })
}

fn percent_decoded(text: &str) -> Option<String> {
    let mut bytes = text.bytes();
    let mut decoded = Vec::with_capacity(text.len());
    while let Some(byte) = bytes.next() {
        decoded.push(if byte == b'%' {
            let mut digit = || char::from(bytes.next()?).to_digit(16);
            (digit()? * 16 + digit()?) as u8
        } else {
            byte
        });
    }
    String::from_utf8(decoded).ok()
}

/// Standard base64 with or without padding; `None` for any other character.
fn base64(text: &str) -> Option<Vec<u8>> {
    let text = text.trim_end_matches('=').as_bytes();
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 3);
    for group in text.chunks(4) {
        let mut bits = 0u32;
        for &letter in group {
            let value = match letter {
                b'A'..=b'Z' => letter - b'A',
                b'a'..=b'z' => letter - b'a' + 26,
                b'0'..=b'9' => letter - b'0' + 52,
                b'+' | b'-' => 62,
                b'/' | b'_' => 63,
                _ => return None,
            };
            bits = bits << 6 | u32::from(value);
        }
        let missing = 4 - group.len();
        if missing == 3 {
            return None;
        }
        bits <<= 6 * missing;
        bytes.extend_from_slice(&bits.to_be_bytes()[1..4 - missing]);
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_every_length() {
        assert_eq!(base64("").unwrap(), b"");
        assert_eq!(base64("TQ==").unwrap(), b"M");
        assert_eq!(base64("TWE=").unwrap(), b"Ma");
        assert_eq!(base64("TWFu").unwrap(), b"Man");
        assert_eq!(base64("TWFuTQ").unwrap(), b"ManM");
        assert_eq!(base64("/+8A").unwrap(), [0xff, 0xef, 0x00]);
        assert_eq!(base64("TWFuT"), None);
        assert_eq!(base64("T?Fu"), None);
    }

    #[test]
    fn percent_signs_are_decoded() {
        assert_eq!(percent_decoded("a%20b%C3%A9.bin").unwrap(), "a bé.bin");
        assert_eq!(percent_decoded("a%2"), None);
        assert_eq!(percent_decoded("a%zz"), None);
    }
}
