//! Seam files: the lossless G-buffer of a block's root tile (spec/pyramid.md §8).

use std::io::Read;

use map3d_base::{Error, Result};
use twox_hash::XxHash3_64;

use crate::gbuffer::{Arrays, GBuffer};
use crate::pixel_array::PixelArray;

const MAGIC: &[u8; 4] = b"M3DG";
const VERSION: u32 = 2;
const HEADER_BYTES: usize = 20;
const MAX_SIDE_PX: u32 = 4_096;
const ZSTD_LEVEL: i32 = 1;

/// Encodes a G-buffer.
pub fn write_seam(g: &GBuffer) -> Vec<u8> {
    let mut out = Vec::new();
    out.extend_from_slice(MAGIC);
    for n in [VERSION, g.width, g.height, g.arrays().bits()] {
        out.extend_from_slice(&n.to_le_bytes());
    }
    for bytes in g.by_code().iter().map(PixelArray::bytes).filter(|bytes| !bytes.is_empty()) {
        let frame = zstd::bulk::compress(bytes, ZSTD_LEVEL).expect("memory to memory");
        out.extend_from_slice(&(frame.len() as u32).to_le_bytes());
        out.extend_from_slice(&frame);
    }
    let checksum = XxHash3_64::oneshot(&out);
    out.extend_from_slice(&checksum.to_le_bytes());
    out
}

/// Decodes a seam; `name` identifies it in messages. Damaged files, other versions and invalid sizes are errors.
pub fn read_seam(name: &str, bytes: &[u8]) -> Result<GBuffer> {
    let refuse = |what: String| Error::format(name, what);
    if bytes.len() < HEADER_BYTES + 8 || &bytes[..4] != MAGIC {
        return Err(refuse("not a M3DG seam".into()));
    }
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes"));
    if number(4) != VERSION {
        return Err(refuse(format!("version {}, this program reads {VERSION}", number(4))));
    }
    let (body, tail) = bytes.split_at(bytes.len() - 8);
    let (stored, actual) = (u64::from_le_bytes(tail.try_into().expect("8 bytes")), XxHash3_64::oneshot(body));
    if stored != actual {
        return Err(refuse(format!("checksum {actual:016x}, expected {stored:016x}: the seam is damaged")));
    }
    let (width, height) = (number(8), number(12));
    if !(1..=MAX_SIDE_PX).contains(&width) || !(1..=MAX_SIDE_PX).contains(&height) {
        return Err(refuse(format!("{width} × {height} px, at most {MAX_SIDE_PX}")));
    }
    let Some(arrays) = Arrays::from_bits(number(16)) else {
        return Err(refuse(format!("arrays {:#x}, some of them unknown", number(16))));
    };
    let mut g = GBuffer::with(width, height, arrays);
    let mut rest = &body[HEADER_BYTES..];
    for array in g.by_code_mut() {
        fill(array.bytes_mut(), &mut rest).map_err(&refuse)?;
    }
    if !rest.is_empty() {
        return Err(refuse(format!("{} bytes after the last array", rest.len())));
    }
    Ok(g)
}

#[cfg(target_endian = "big")]
compile_error!("seams and textures have the byte order of memory: little-endian machines only");

/// Reads one array (length, zstd frame) unless it is empty; the frame must have exactly its length.
fn fill(into: &mut [u8], rest: &mut &[u8]) -> std::result::Result<(), String> {
    if into.is_empty() {
        return Ok(());
    }
    let (length, tail) = rest.split_first_chunk::<4>().ok_or("truncated")?;
    let length = u32::from_le_bytes(*length) as usize;
    let frame = tail.get(..length).ok_or("truncated")?;
    *rest = &tail[length..];
    let mut decoder = zstd::stream::read::Decoder::with_buffer(frame).map_err(|e| e.to_string())?;
    decoder.read_exact(into).map_err(|e| format!("array of {} bytes: {e}", into.len()))?;
    match decoder.read(&mut [0]).map_err(|e| e.to_string())? {
        0 => Ok(()),
        _ => Err(format!("array is longer than {} bytes", into.len())),
    }
}
