//! EXT_meshopt_compression (and its successor KHR_meshopt_compression): a buffer view's bytes are
//! packed, and are unpacked here into what the view would have held without the extension.

use bytemuck::{Pod, Zeroable};
use serde::Deserialize;

/// One element of a packed vertex stream: `N` words of four bytes.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(transparent)]
struct Words<const N: usize>([u32; N]);

impl<const N: usize> Default for Words<N> {
    fn default() -> Self {
        Self([0; N])
    }
}

/// The extension's JSON object on a buffer view.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Packed {
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: u64,
    pub byte_length: u64,
    pub byte_stride: u64,
    pub count: u64,
    pub mode: String,
    #[serde(default)]
    pub filter: Option<String>,
}

impl Packed {
    /// Unpacks `bytes`, which are the packed part of the buffer.
    ///
    /// Sizes are checked against what the codecs can express before memory is allocated: an index
    /// triangle takes at least one byte, a vertex block of 256 elements at least a quarter of a byte for
    /// each byte of an element. A forged count is refused instead of filling memory with zeros.
    pub fn decode(&self, bytes: &[u8]) -> Result<Vec<u8>, String> {
        let filter = self.filter.as_deref().unwrap_or("NONE");
        let too_many = || format!("{} elements cannot come out of {} packed bytes", self.count, bytes.len());
        let count = usize::try_from(self.count).map_err(|_| too_many())?;
        let failed = |e: meshopt::Error| format!("its meshopt data is damaged ({e})");
        if count == 0 {
            return Ok(Vec::new());
        }
        match self.mode.as_str() {
            "ATTRIBUTES" => {
                if self.byte_stride == 0 || !self.byte_stride.is_multiple_of(4) || self.byte_stride > 256 {
                    return Err(format!(
                        "a packed stride of {} bytes is not a multiple of 4 up to 256",
                        self.byte_stride
                    ));
                }
                if self.count.saturating_mul(self.byte_stride) / 1024 > bytes.len() as u64 {
                    return Err(too_many());
                }
                vertices(self.byte_stride, count, filter, bytes)
            }
            "TRIANGLES" | "INDICES" if filter != "NONE" => Err(format!("filter {filter} on packed indices")),
            mode @ ("TRIANGLES" | "INDICES") => {
                let triangles = mode == "TRIANGLES";
                if triangles && !self.count.is_multiple_of(3) {
                    return Err(format!("{} packed indices are not whole triangles", self.count));
                }
                if self.count / 3 > bytes.len() as u64 {
                    return Err(too_many());
                }
                match (triangles, self.byte_stride) {
                    (true, 2) => meshopt::decode_index_buffer::<u16>(bytes, count).map(to_bytes),
                    (true, 4) => meshopt::decode_index_buffer::<u32>(bytes, count).map(to_bytes),
                    (false, 2) => meshopt::decode_index_sequence::<u16>(bytes, count).map(to_bytes),
                    (false, 4) => meshopt::decode_index_sequence::<u32>(bytes, count).map(to_bytes),
                    (_, stride) => return Err(format!("packed indices of {stride} bytes")),
                }
                .map_err(failed)
            }
            other => Err(format!("unknown meshopt mode {other}")),
        }
    }
}

fn to_bytes<T: Pod>(values: Vec<T>) -> Vec<u8> {
    bytemuck::cast_slice(&values).to_vec()
}

/// The codec is compiled for each element size, because its safe interface takes the size from a type.
fn vertices(stride: u64, count: usize, filter: &str, bytes: &[u8]) -> Result<Vec<u8>, String> {
    macro_rules! sizes {
        ($($n:literal)*) => {
            match stride / 4 {
                $($n => vertices_of::<$n>(count, filter, bytes),)*
                _ => Err(format!("a packed stride of {stride} bytes")),
            }
        };
    }
    sizes!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32
           33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64)
}

fn vertices_of<const N: usize>(count: usize, filter: &str, bytes: &[u8]) -> Result<Vec<u8>, String> {
    let mut elements: Vec<Words<N>> = meshopt::decode_vertex_buffer(bytes, count)
        .map_err(|e| format!("its meshopt data is damaged ({e})"))?;
    let wrong_stride = || format!("filter {filter} on elements of {} bytes", 4 * N);
    match filter {
        "NONE" => {}
        "EXPONENTIAL" => {
            meshopt::decode_filter_exp::<N>(bytemuck::cast_slice_mut(&mut elements));
        }
        "OCTAHEDRAL" | "COLOR" => {
            let octahedral = filter == "OCTAHEDRAL";
            match N {
                1 if octahedral => meshopt::decode_filter_oct::<i8>(bytemuck::cast_slice_mut(&mut elements)),
                2 if octahedral => meshopt::decode_filter_oct::<i16>(bytemuck::cast_slice_mut(&mut elements)),
                1 => meshopt::decode_filter_color::<u8>(bytemuck::cast_slice_mut(&mut elements)),
                2 => meshopt::decode_filter_color::<u16>(bytemuck::cast_slice_mut(&mut elements)),
                _ => return Err(wrong_stride()),
            }
        }
        "QUATERNION" => match N {
            2 => meshopt::decode_filter_quat(bytemuck::cast_slice_mut(&mut elements)),
            _ => return Err(wrong_stride()),
        },
        other => return Err(format!("unknown meshopt filter {other}")),
    }
    Ok(to_bytes(elements))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packed(mode: &str, stride: u64, count: u64, filter: Option<&str>) -> Packed {
        Packed {
            buffer: 0,
            byte_offset: 0,
            byte_length: 0,
            byte_stride: stride,
            count,
            mode: mode.to_owned(),
            filter: filter.map(str::to_owned),
        }
    }

    #[test]
    fn every_stride_comes_back() {
        fn round<const N: usize>() {
            let data: Vec<Words<N>> = (0..300u32)
                .map(|i| Words(std::array::from_fn(|k| i.wrapping_mul(2_654_435_761) >> (k % 7))))
                .collect();
            let bytes = meshopt::encode_vertex_buffer(&data).unwrap();
            let back = packed("ATTRIBUTES", 4 * N as u64, 300, None).decode(&bytes).unwrap();
            assert_eq!(back, bytemuck::cast_slice::<_, u8>(&data), "stride {}", 4 * N);
        }
        round::<1>();
        round::<3>();
        round::<8>();
        round::<33>();
        round::<64>();
    }

    #[test]
    fn the_exponential_filter_gives_floats() {
        // 0xff is exponent -1, mantissa 3: 1.5. 0x02 is exponent 2, mantissa -9: -36.
        let data = [Words([0xff00_0003, 0x02ff_fff7, 0u32])];
        let bytes = meshopt::encode_vertex_buffer(&data).unwrap();
        let back = packed("ATTRIBUTES", 12, 1, Some("EXPONENTIAL")).decode(&bytes).unwrap();
        let floats: Vec<f32> =
            back.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!(floats, [1.5, -36.0, 0.0]);
    }

    fn words(bytes: &[u8]) -> Vec<u32> {
        bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    }

    #[test]
    fn indices_of_both_widths_and_modes_come_back() {
        let indices = [0u32, 1, 2, 2, 1, 3, 4, 3, 5];
        let rotated = |v: &[u32]| -> Vec<Vec<u32>> {
            v.chunks(3)
                .map(|t| {
                    let at = (0..3).min_by_key(|&k| t[k]).unwrap();
                    (0..3).map(|k| t[(at + k) % 3]).collect()
                })
                .collect()
        };
        let triangles = meshopt::encode_index_buffer(&indices, 6).unwrap();
        let sequence = meshopt::encode_index_sequence(&indices, 6).unwrap();
        let wide = packed("TRIANGLES", 4, 9, None).decode(&triangles).unwrap();
        assert_eq!(rotated(&words(&wide)), rotated(&indices));
        let narrow = packed("TRIANGLES", 2, 9, None).decode(&triangles).unwrap();
        let widened: Vec<u32> =
            narrow.chunks_exact(2).map(|b| u32::from(u16::from_le_bytes([b[0], b[1]]))).collect();
        assert_eq!(rotated(&widened), rotated(&indices));
        let wide = packed("INDICES", 4, 9, None).decode(&sequence).unwrap();
        assert_eq!(words(&wide), indices);
    }

    #[test]
    fn forged_counts_and_wrong_strides_are_refused() {
        let bytes = meshopt::encode_vertex_buffer(&[Words([1u32, 2, 3]); 40]).unwrap();
        assert!(packed("ATTRIBUTES", 12, u64::MAX / 2, None).decode(&bytes).is_err());
        assert!(packed("ATTRIBUTES", 12, 4_000_000_000, None).decode(&bytes).is_err());
        assert!(packed("ATTRIBUTES", 6, 40, None).decode(&bytes).is_err());
        assert!(packed("ATTRIBUTES", 0, 40, None).decode(&bytes).is_err());
        assert!(packed("ATTRIBUTES", 12, 40, Some("OCTAHEDRAL")).decode(&bytes).is_err());
        assert!(packed("ATTRIBUTES", 12, 40, Some("NEW")).decode(&bytes).is_err());
        assert!(packed("TRIANGLES", 4, 3_000_000_000, None).decode(&bytes).is_err());
        assert!(packed("TRIANGLES", 4, 4, None).decode(&bytes).is_err());
        assert!(packed("POINTS", 4, 4, None).decode(&bytes).is_err());
        assert!(packed("ATTRIBUTES", 12, 40, None).decode(&bytes[..bytes.len() / 2]).is_err());
    }
}
