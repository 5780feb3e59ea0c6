//! Encodes JPEG with libjpeg-turbo-rs, which writes the same bytes as libjpeg-turbo: 4:2:0 as in WebP, Huffman tables made for the image, alpha ignored.

use libjpeg_turbo_rs::{Encoder, PixelFormat, Subsampling};
use map3d_base::{Error, Result};

use crate::raster::Raster;

/// `quality` 1..=100.
pub fn encode_jpeg(image: &Raster, quality: u8) -> Result<Vec<u8>> {
    let (width, height) = (image.width as usize, image.height as usize);
    Encoder::new(image.pixels.as_flattened(), width, height, PixelFormat::Rgba)
        .quality(quality)
        .force_baseline(true)
        .subsampling(Subsampling::S420)
        .optimize_huffman(true)
        .encode()
        .map_err(|e| Error::argument(format!("jpeg {width} × {height}: {e}")))
}
