//! Checks whether an image file is whole, by the structure of its format: a search through the bytes instead of decoding. Only what looks cut or
//! damaged is decoded, since many a decoder reads files that lack nothing but their end mark.

use std::path::Path;

use super::jpeg::is_jpeg;
use super::jpeg_markers::{JpegHeader, JpegStructure, find_structure};
use super::{ImageLimits, decode};

/// Why an image is not drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFault {
    /// The file is cut, or its content is damaged.
    Damaged,
    /// A kind of image that is not read.
    Kind(&'static str),
}

/// Largest image that is decoded to decide whether it is damaged; a larger one that looks so counts as damaged.
const MAX_DECODED_PX: u64 = 24 << 20;

/// Returns what is wrong with an image file, as far as its structure shows. `path` is for messages only.
pub fn find_fault(path: &Path, bytes: &[u8]) -> Option<ImageFault> {
    if is_jpeg(bytes)
        && let Some(kind) = JpegHeader::parse(bytes).and_then(|header| header.unread_kind())
    {
        return Some(ImageFault::Kind(kind));
    }
    let limits = ImageLimits { max_image_px: MAX_DECODED_PX, ..ImageLimits::default() };
    (!is_complete(bytes) && decode(path, bytes, &limits).is_err()).then_some(ImageFault::Damaged)
}

/// Returns false if the structure of a file breaks off or is broken; also for a format without a structure that tells.
fn is_complete(bytes: &[u8]) -> bool {
    match bytes {
        _ if is_jpeg(bytes) => find_structure(bytes) == JpegStructure::Whole,
        [0x89, b'P', b'N', b'G', 0x0D, 0x0A, 0x1A, 0x0A, chunks @ ..] => is_png_complete(chunks),
        [b'G', b'I', b'F', b'8', ..] => is_gif_complete(bytes).is_some(),
        [b'R', b'I', b'F', b'F', rest @ ..] => u32_le(rest, 0).is_some_and(|size| size as usize + 8 <= bytes.len() + bytes.len() % 2),
        [b'B', b'M', ..] => is_bmp_complete(bytes).unwrap_or(false),
        [b'I', b'I', 42, 0, ..] | [b'M', b'M', 0, 42, ..] => is_tiff_complete(bytes).unwrap_or(false),
        _ => is_tga_complete(bytes).unwrap_or(false),
    }
}

/// Walks the chunks up to the end mark, with the checksums of those that are not ancillary.
fn is_png_complete(mut chunks: &[u8]) -> bool {
    let mut has_data = false;
    while let Some(length) = u32_be(chunks, 0).map(|length| length as usize) {
        let (Some(body), Some(sum)) = (chunks.get(4..8 + length), u32_be(chunks, 8 + length)) else { return false };
        let kind = &body[..4];
        if kind[0].is_ascii_uppercase() && crc32fast::hash(body) != sum {
            return false;
        }
        match kind {
            b"IEND" => return has_data,
            b"IDAT" => has_data = true,
            _ => {}
        }
        chunks = &chunks[12 + length..];
    }
    false
}

/// Walks the blocks up to the end of the first picture; `None` if they break off before.
fn is_gif_complete(bytes: &[u8]) -> Option<()> {
    let table = |flags: u8| if flags & 0x80 == 0 { 0 } else { 3 << ((flags & 7) + 1) };
    let skip_blocks = |mut at: usize| {
        while let length @ 1.. = usize::from(*bytes.get(at)?) {
            at += 1 + length;
        }
        Some(at + 1)
    };
    let mut at = 13 + table(*bytes.get(10)?);
    loop {
        match *bytes.get(at)? {
            b'!' => at = skip_blocks(at + 2)?,
            b',' => return skip_blocks(at + 11 + table(*bytes.get(at + 9)?)).map(|_| ()),
            _ => return None,
        }
    }
}

/// Compares the size of uncompressed pixels with that of the file; `None` for compressed ones.
fn is_bmp_complete(bytes: &[u8]) -> Option<bool> {
    let (start, header) = (u32_le(bytes, 10)? as usize, u32_le(bytes, 14)?);
    if header < 40 || !matches!(u32_le(bytes, 30)?, 0 | 3 | 6) {
        return None;
    }
    let (width, height) = (u64::from(u32_le(bytes, 18)?), u64::from(u32_le(bytes, 22)?.cast_signed().unsigned_abs()));
    let row = (width * u64::from(u16_le(bytes, 28)?)).div_ceil(32) * 4;
    Some(start as u64 + row * height <= bytes.len() as u64)
}

/// Compares the size of uncompressed pixels with that of the file; `None` for compressed ones.
fn is_tga_complete(bytes: &[u8]) -> Option<bool> {
    let (kind, size) = (*bytes.get(2)?, |at| u16_le(bytes, at).map(usize::from));
    if !(1..=3).contains(&kind) {
        return None;
    }
    let colors = usize::from(bytes[1]) * size(5)? * usize::from(*bytes.get(7)?).div_ceil(8);
    let pixels = size(12)? * size(14)? * usize::from(*bytes.get(16)?).div_ceil(8);
    Some(18 + usize::from(bytes[0]) + colors + pixels <= bytes.len())
}

const STRIP_OFFSETS: u16 = 273;
const STRIP_SIZES: u16 = 279;
const TILE_OFFSETS: u16 = 324;
const TILE_SIZES: u16 = 325;

/// Compares the places of the strips or tiles of the first picture with the size of the file.
fn is_tiff_complete(bytes: &[u8]) -> Option<bool> {
    let is_big_endian = bytes[0] == b'M';
    let short = |at| if is_big_endian { u16_be(bytes, at) } else { u16_le(bytes, at) };
    let long = |at| if is_big_endian { u32_be(bytes, at) } else { u32_le(bytes, at) };
    let directory = long(4)? as usize;
    let entries = (0..usize::from(short(directory)?)).map(|k| directory + 2 + 12 * k);
    let values = |tag: u16| -> Option<Vec<u64>> {
        let Some(entry) = entries.clone().find(|at| short(*at) == Some(tag)) else { return Some(Vec::new()) };
        let (kind, count) = (short(entry + 2)?, long(entry + 4)? as usize);
        let size = if kind == 3 { 2 } else { 4 };
        let start = if count * size <= 4 { entry + 8 } else { long(entry + 8)? as usize };
        bytes.get(start..start + count.checked_mul(size)?)?;
        (0..count).map(|k| if kind == 3 { short(start + 2 * k).map(u64::from) } else { long(start + 4 * k).map(u64::from) }).collect()
    };
    let (offsets, sizes) = match (values(STRIP_OFFSETS)?, values(STRIP_SIZES)?) {
        (offsets, sizes) if !offsets.is_empty() => (offsets, sizes),
        _ => (values(TILE_OFFSETS)?, values(TILE_SIZES)?),
    };
    let are_inside = offsets.iter().zip(&sizes).all(|(offset, size)| offset + size <= bytes.len() as u64);
    Some(!offsets.is_empty() && offsets.len() == sizes.len() && are_inside)
}

fn u16_le(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..)?.first_chunk().map(|b| u16::from_le_bytes(*b))
}

fn u16_be(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..)?.first_chunk().map(|b| u16::from_be_bytes(*b))
}

fn u32_le(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|b| u32::from_le_bytes(*b))
}

fn u32_be(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|b| u32::from_be_bytes(*b))
}
