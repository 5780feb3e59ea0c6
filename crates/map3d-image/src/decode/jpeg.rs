//! Decodes JPEG with libjpeg-turbo-rs, which yields the same pixels as libjpeg-turbo; falls back to zune-jpeg for files that it rejects.

use std::io::Cursor;
use std::panic::catch_unwind;
use std::path::Path;

use libjpeg_turbo_rs::{Decoder, PixelFormat};
use map3d_base::Result;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::damaged;
use crate::raster::Raster;

/// More scans than any legitimate progressive JPEG has.
const MAX_SCANS: u32 = 200;

pub fn is_jpeg(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0xFF, 0xD8, 0xFF])
}

/// Returns width and height as the frame header states them.
pub fn size(path: &Path, bytes: &[u8]) -> Result<(u32, u32)> {
    let mut decoder = JpegDecoder::new_with_options(Cursor::new(bytes), lenient());
    decoder.decode_headers().map_err(|e| damaged(path, e))?;
    let info = decoder.info().ok_or_else(|| damaged(path, "no frame header"))?;
    Ok((u32::from(info.width), u32::from(info.height)))
}

/// Decodes a JPEG whose header states `size` (width, height) into the memory of `spare`. A panic on damaged bytes counts as a refusal.
pub fn decode(path: &Path, bytes: &[u8], size: (u32, u32), spare: Vec<[u8; 4]>) -> Result<Raster> {
    match catch_unwind(|| decode_sound(bytes, size, spare)) {
        Ok(Some(raster)) => Ok(raster),
        _ => decode_lenient(path, bytes),
    }
}

/// Decodes grey and YCbCr images of 8 bits; `None` for anything else, CMYK among them.
fn decode_sound(bytes: &[u8], (width, height): (u32, u32), spare: Vec<[u8; 4]>) -> Option<Raster> {
    let mut decoder = Decoder::new(bytes).ok()?;
    decoder.set_scan_limit(MAX_SCANS);
    decoder.set_output_format(PixelFormat::Rgba);
    let header = decoder.header();
    let is_expected = (usize::from(header.width), usize::from(header.height)) == (width as usize, height as usize);
    if !is_expected || header.precision != 8 || header.components.len() > 3 {
        return None;
    }
    let mut pixels = resized(spare, width as usize * height as usize);
    let written = decoder.decode_image_into(pixels.as_flattened_mut()).ok()?.bytes_written;
    (written == 4 * pixels.len()).then(|| Raster::new(width, height, pixels))
}

/// Returns some pixels in the memory of `spare` if it is large enough. Their values are arbitrary.
fn resized(mut spare: Vec<[u8; 4]>, count: usize) -> Vec<[u8; 4]> {
    if spare.capacity() < count {
        return vec![[0; 4]; count];
    }
    spare.resize(count, [0; 4]);
    spare
}

fn decode_lenient(path: &Path, bytes: &[u8]) -> Result<Raster> {
    let mut decoder = JpegDecoder::new_with_options(Cursor::new(bytes), lenient());
    let rgba = decoder.decode().map_err(|e| damaged(path, e))?;
    let info = decoder.info().ok_or_else(|| damaged(path, "no frame header"))?;
    let (width, height) = (u32::from(info.width), u32::from(info.height));
    if rgba.len() != width as usize * height as usize * 4 {
        return Err(damaged(path, format!("{} bytes for {width} × {height} px", rgba.len())));
    }
    Ok(Raster::new(width, height, bytemuck::cast_slice(&rgba).to_vec()))
}

fn lenient() -> DecoderOptions {
    DecoderOptions::default()
        .set_strict_mode(false)
        .set_max_width(65_535)
        .set_max_height(65_535)
        .jpeg_set_max_scans(MAX_SCANS as usize)
        .jpeg_set_out_colorspace(ColorSpace::RGBA)
}
