//! Decodes source images to sRGB bytes. Checks sizes in the header before decoding; a damaged image is an error, never a panic.

pub mod check;
mod jpeg;
mod jpeg_markers;

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use image::{DynamicImage, ImageFormat, ImageReader, Limits};
use map3d_base::limits::{MAX_IMAGE_PX, MAX_IMAGE_SIDE_PX};
use map3d_base::{Error, Result};

use self::jpeg_markers::{JpegColor, JpegHeader, JpegStructure, find_structure};
use crate::raster::Raster;

/// Limits of one image; the defaults are the specification's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageLimits {
    pub max_image_side_px: u64,
    pub max_image_px: u64,
    pub max_decoded_bytes: u64,
}

impl Default for ImageLimits {
    fn default() -> Self {
        Self { max_image_side_px: MAX_IMAGE_SIDE_PX, max_image_px: MAX_IMAGE_PX, max_decoded_bytes: 512 << 20 }
    }
}

/// Returns width and height as the header states them. `path` is for messages.
pub fn probe(path: &Path, bytes: &[u8], limits: &ImageLimits) -> Result<(u32, u32)> {
    let size = || match jpeg::is_jpeg(bytes) {
        true => jpeg::header(path, bytes).map(|header| (header.width, header.height)),
        false => other_size(path, bytes),
    };
    let (width, height) = guarded(path, size)?;
    check_limits(path, width, height, limits)?;
    Ok((width, height))
}

/// Decodes JPEG, PNG, GIF (first frame), BMP, TIFF, WebP or TGA, which it recognises by the first bytes.
pub fn decode(path: &Path, bytes: &[u8], limits: &ImageLimits) -> Result<Raster> {
    decode_reusing(path, bytes, limits, Vec::new())
}

/// As `decode`; a JPEG's pixels take the memory of `spare`, whatever it contains.
pub fn decode_reusing(path: &Path, bytes: &[u8], limits: &ImageLimits, spare: Vec<[u8; 4]>) -> Result<Raster> {
    let (width, height) = probe(path, bytes, limits)?;
    let raster = guarded(path, || match jpeg::is_jpeg(bytes) {
        true => jpeg::decode(path, bytes, &jpeg::header(path, bytes)?, spare),
        false => decode_other(path, bytes, limits),
    })?;
    if (raster.width, raster.height) != (width, height) {
        return Err(Error::format(path, format!("decodes to {} × {} px, its header says {width} × {height}", raster.width, raster.height)));
    }
    Ok(raster)
}

/// Returns a number that is part of the keys of textures whose pixels an earlier version of map3d read differently; 0 for all others.
pub fn reading_version(bytes: &[u8]) -> u8 {
    let is_new_color = || JpegHeader::parse(bytes).is_some_and(|header| matches!(header.color(), JpegColor::Rgb | JpegColor::Inks));
    u8::from(jpeg::is_jpeg(bytes) && (is_new_color() || find_structure(bytes) != JpegStructure::Whole))
}

fn check_limits(path: &Path, width: u32, height: u32, limits: &ImageLimits) -> Result<()> {
    let pixels = u64::from(width) * u64::from(height);
    let rows = [
        ("image side in px", u64::from(width.max(height)), "max_image_side_px", limits.max_image_side_px),
        ("image size in px", pixels, "max_image_px", limits.max_image_px),
        ("decoded image in bytes", pixels * 4, "max_decoded_bytes", limits.max_decoded_bytes),
    ];
    if pixels == 0 {
        return Err(Error::format(path, format!("an image of {width} × {height} px")));
    }
    match rows.into_iter().find(|(_, got, _, value)| got > value) {
        Some((what, got, limit, value)) => Err(Error::Limit { path: path.to_path_buf(), what, got, limit, value }),
        None => Ok(()),
    }
}

/// Turns a decoder's panic on damaged data into an error.
fn guarded<T>(path: &Path, work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| Err(Error::format(path, "the image decoder failed on damaged data")))
}

fn damaged(path: &Path, cause: impl std::fmt::Display) -> Error {
    Error::format(path, format!("damaged or unknown image: {cause}"))
}

/// Guesses the format; TGA, which has no magic number, if no other fits.
fn reader<'a>(path: &Path, bytes: &'a [u8]) -> Result<ImageReader<Cursor<&'a [u8]>>> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| Error::storage(path, e))?;
    if reader.format().is_none() {
        reader.set_format(ImageFormat::Tga);
    }
    Ok(reader)
}

fn other_size(path: &Path, bytes: &[u8]) -> Result<(u32, u32)> {
    reader(path, bytes)?.into_dimensions().map_err(|e| damaged(path, e))
}

fn decode_other(path: &Path, bytes: &[u8], limits: &ImageLimits) -> Result<Raster> {
    let mut reader = reader(path, bytes)?;
    let mut bounds = Limits::default();
    bounds.max_image_width = u32::try_from(limits.max_image_side_px).ok();
    bounds.max_image_height = bounds.max_image_width;
    // Decoding a 16-bit or float image takes up to four times the bytes of the result.
    bounds.max_alloc = Some(limits.max_decoded_bytes.saturating_mul(4));
    reader.limits(bounds);
    let image: DynamicImage = reader.decode().map_err(|e| damaged(path, e))?;
    let rgba = image.into_rgba8();
    Ok(Raster::new(rgba.width(), rgba.height(), bytemuck::cast_slice(rgba.as_raw()).to_vec()))
}
