//! Encodes JPEG with libjpeg-turbo-rs, which writes the same bytes as libjpeg-turbo: 4:4:4, alpha ignored.

use libjpeg_turbo_rs::{Encoder, PixelFormat, Subsampling};
use map3d_base::{Error, Result};

use crate::raster::Raster;

/// `quality` 1..=100; `small`: progressive, with Huffman tables made for the image.
pub fn encode_jpeg(image: &Raster, quality: u8, small: bool) -> Result<Vec<u8>> {
    let (width, height) = (image.width as usize, image.height as usize);
    Encoder::new(image.pixels.as_flattened(), width, height, PixelFormat::Rgba)
        .quality(quality)
        .force_baseline(true)
        .subsampling(Subsampling::S444)
        .optimize_huffman(small)
        .progressive(small)
        .encode()
        .map_err(|e| Error::argument(format!("jpeg {width} × {height}: {e}")))
}
