//! Decodes JPEG with libjpeg-turbo-rs, which yields the same pixels as libjpeg-turbo; falls back to zune-jpeg for whole files that it rejects.

use std::borrow::Cow;
use std::io::Cursor;
use std::panic::catch_unwind;
use std::path::Path;

use libjpeg_turbo_rs::{DecodeWarning, Decoder, PixelFormat};
use map3d_base::{Error, Result};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::damaged;
use super::jpeg_markers::{JpegColor, JpegHeader, JpegStructure, find_structure};
use crate::raster::Raster;

/// More scans than any legitimate progressive JPEG has.
const MAX_SCANS: u32 = 200;
const DAMAGED: &str = "the file is cut or damaged";
const END_MARK: &[u8] = &[0xFF, 0xD9];
/// More than a decoder reads ahead.
const PADDING_BYTES: usize = 256;
/// An Adobe marker that says: RGB.
const RGB_MARKER: &[u8] = b"\xFF\xEE\x00\x0EAdobe\x00\x64\x00\x00\x00\x00\x00";

pub fn is_jpeg(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0xFF, 0xD8, 0xFF])
}

pub fn header(path: &Path, bytes: &[u8]) -> Result<JpegHeader> {
    JpegHeader::parse(bytes).ok_or_else(|| damaged(path, "no frame header"))
}

/// Decodes a JPEG into the memory of `spare`. A panic on damaged bytes counts as a refusal. A cut or damaged file is an error, as are the kinds
/// that browsers do not show.
pub fn decode(path: &Path, bytes: &[u8], header: &JpegHeader, spare: Vec<[u8; 4]>) -> Result<Raster> {
    if let Some(kind) = header.unread_kind() {
        return Err(Error::format(path, format!("{kind}, which is not read")));
    }
    match find_structure(bytes) {
        JpegStructure::Whole => match catch_unwind(|| decode_sound(bytes, header, spare)) {
            Ok(Some(raster)) => Ok(raster),
            _ => decode_lenient(path, bytes, header),
        },
        JpegStructure::WithoutEnd => decode_without_end(bytes, header).ok_or_else(|| damaged(path, DAMAGED)),
        JpegStructure::BrokenScan => Err(damaged(path, DAMAGED)),
    }
}

/// Decodes a file that lacks nothing but its end mark: whatever follows its bytes, the pixels are the same.
fn decode_without_end(bytes: &[u8], header: &JpegHeader) -> Option<Raster> {
    let decode = |padding: u8| {
        let padded = [bytes, &[padding; PADDING_BYTES], END_MARK].concat();
        catch_unwind(|| decode_sound(&padded, header, Vec::new())).ok().flatten()
    };
    let first = decode(0x00)?;
    (decode(0xAA)? == first).then_some(first)
}

fn decode_sound(bytes: &[u8], header: &JpegHeader, spare: Vec<[u8; 4]>) -> Option<Raster> {
    if header.color() == JpegColor::Rgb {
        return decode_rgb(bytes, header);
    }
    let decoder = open(bytes, header, PixelFormat::Rgba)?;
    let mut pixels = resized(spare, header.width as usize * header.height as usize);
    let written = decoder.decode_image_into(pixels.as_flattened_mut()).ok()?.bytes_written;
    (written == 4 * pixels.len()).then(|| Raster::new(header.width, header.height, pixels))
}

/// Decodes components that are red, green and blue. The decoder knows them by an Adobe marker only, and without an alpha channel.
fn decode_rgb(bytes: &[u8], header: &JpegHeader) -> Option<Raster> {
    let bytes = match header.adobe_transform {
        Some(0) => Cow::Borrowed(bytes),
        _ => Cow::Owned([&bytes[..2], RGB_MARKER, &bytes[2..]].concat()),
    };
    let image = open(&bytes, header, PixelFormat::Rgb)?.decode_image().ok()?;
    let pixels: Vec<[u8; 4]> = image.data.as_chunks::<3>().0.iter().map(|[r, g, b]| [*r, *g, *b, 255]).collect();
    (pixels.len() == header.width as usize * header.height as usize).then(|| Raster::new(header.width, header.height, pixels))
}

/// Opens a file for decoding if the decoder reads the same header.
fn open<'a>(bytes: &'a [u8], header: &JpegHeader, format: PixelFormat) -> Option<Decoder<'a>> {
    let mut decoder = Decoder::new(bytes).ok()?;
    decoder.set_scan_limit(MAX_SCANS);
    decoder.set_output_format(format);
    let found = decoder.header();
    let is_expected = (u32::from(found.width), u32::from(found.height)) == (header.width, header.height);
    (is_expected && found.components.len() == header.components.len()).then_some(decoder)
}

/// Returns some pixels in the memory of `spare` if it is large enough. Their values are arbitrary.
fn resized(mut spare: Vec<[u8; 4]>, count: usize) -> Vec<[u8; 4]> {
    if spare.capacity() < count {
        return vec![[0; 4]; count];
    }
    spare.resize(count, [0; 4]);
    spare
}

/// Decodes a whole file that the strict decoder rejects, such as one with stray bytes between its markers.
fn decode_lenient(path: &Path, bytes: &[u8], header: &JpegHeader) -> Result<Raster> {
    if header.color() == JpegColor::Inks || catch_unwind(|| has_broken_scan(bytes, header)).unwrap_or(true) {
        return Err(damaged(path, DAMAGED));
    }
    let mut decoder = JpegDecoder::new_with_options(Cursor::new(bytes), lenient());
    let rgba = decoder.decode().map_err(|e| damaged(path, e))?;
    if rgba.len() != header.width as usize * header.height as usize * 4 {
        return Err(damaged(path, format!("{} bytes for {} × {} px", rgba.len(), header.width, header.height)));
    }
    Ok(Raster::new(header.width, header.height, bytemuck::cast_slice(&rgba).to_vec()))
}

/// Returns true if a decoder that continues after faults finds one in the coded pixels.
fn has_broken_scan(bytes: &[u8], header: &JpegHeader) -> bool {
    let Some(mut decoder) = open(bytes, header, PixelFormat::Rgba) else { return false };
    decoder.set_lenient(true);
    let is_fault = |w: &DecodeWarning| matches!(w, DecodeWarning::HuffmanError { .. } | DecodeWarning::TruncatedData { .. });
    decoder.decode_image().is_ok_and(|image| image.warnings.iter().any(is_fault))
}

fn lenient() -> DecoderOptions {
    DecoderOptions::default()
        .set_strict_mode(false)
        .set_max_width(65_535)
        .set_max_height(65_535)
        .jpeg_set_max_scans(MAX_SCANS as usize)
        .jpeg_set_out_colorspace(ColorSpace::RGBA)
}
