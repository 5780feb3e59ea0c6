//! JPEG by libjpeg-turbo: 4:4:4; alpha is left out.

use map3d_base::{Error, Result};

use crate::raster::Raster;

/// `quality` 1..=100; `small`: with codes of its own, progressive.
pub fn encode_jpeg(image: &Raster, quality: u8, small: bool) -> Result<Vec<u8>> {
    let fail = |e: turbojpeg::Error| Error::argument(format!("jpeg {} × {}: {e}", image.width, image.height));
    let mut encoder = turbojpeg::Compressor::new().map_err(fail)?;
    encoder.set_quality(i32::from(quality)).map_err(fail)?;
    encoder.set_subsamp(turbojpeg::Subsamp::None).map_err(fail)?;
    encoder.set_optimize(small).map_err(fail)?;
    encoder.set_progressive(small).map_err(fail)?;
    let pixels = turbojpeg::Image {
        pixels: image.pixels.as_flattened(),
        width: image.width as usize,
        pitch: image.width as usize * 4,
        height: image.height as usize,
        format: turbojpeg::PixelFormat::RGBA,
    };
    encoder.compress_to_vec(pixels).map_err(fail)
}
