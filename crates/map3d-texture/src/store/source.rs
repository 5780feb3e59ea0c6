//! Level 0 of a texture: the source image with its alpha image merged and its unused texels filled.

use std::path::Path;

use map3d_base::Result;

use map3d_image::Filler;
use map3d_image::PixelMask;
use map3d_image::Raster;
use map3d_image::decode::{self, ImageLimits};

/// Returns the size of a texture: that of its image, or of its alpha image when there is no image (the texture is then white).
pub fn probe(path: &Path, image: &[u8], alpha: &[u8], limits: &ImageLimits) -> Result<(u32, u32)> {
    if !alpha.is_empty() && !image.is_empty() {
        decode::probe(path, alpha, limits)?;
    }
    decode::probe(path, if image.is_empty() { alpha } else { image }, limits)
}

/// Decodes images one after another and reuses its buffers. One per thread.
#[derive(Default)]
pub struct Level0Decoder {
    filler: Filler,
    /// The memory of the next image.
    spare: Vec<[u8; 4]>,
}

/// Buffers for an image up to this size are kept; larger ones are freed.
const KEPT_PX: usize = 4 << 20;

impl Level0Decoder {
    /// Decodes the image, merges its alpha image, fills texels within a distance of the used ones. `mask`: mask and distance; `None` when every texel is
    /// used.
    pub fn decode(&mut self, path: &Path, image: &[u8], alpha: &[u8], mask: Option<(&PixelMask, u32)>, limits: &ImageLimits) -> Result<Raster> {
        let mut raster = match image.is_empty() {
            true => {
                let (width, height) = decode::probe(path, alpha, limits)?;
                Raster::filled(width, height, [255; 4])
            }
            false => decode::decode_reusing(path, image, limits, std::mem::take(&mut self.spare))?,
        };
        if !alpha.is_empty() {
            merge_alpha(&mut raster, &decode::decode(path, alpha, limits)?);
        }
        if let Some((mask, reach)) = mask {
            self.filler.fill_unmarked(&mut raster, mask, reach);
        }
        Ok(raster)
    }

    /// Takes back the memory of an image that is no longer needed.
    pub fn recycle(&mut self, raster: Raster) {
        match raster.pixels.len() <= KEPT_PX {
            true => self.spare = raster.pixels,
            false => *self = Self::default(),
        }
    }
}

/// Multiplies alpha by the grey of another image (Rec. 709 luma, times its own alpha), which may differ in size: takes its nearest texel.
fn merge_alpha(raster: &mut Raster, grey: &Raster) {
    let (w, h) = (raster.width as u64, raster.height as u64);
    for (i, pixel) in raster.pixels.iter_mut().enumerate() {
        let (x, y) = (i as u64 % w, i as u64 / w);
        let gx = (2 * x + 1) * u64::from(grey.width) / (2 * w);
        let gy = (2 * y + 1) * u64::from(grey.height) / (2 * h);
        let p = grey.pixels[(gy * u64::from(grey.width) + gx) as usize].map(u32::from);
        let luma = (p[0] * 2126 + p[1] * 7152 + p[2] * 722 + 5000) / 10_000;
        let alpha = (luma * p[3] + 127) / 255;
        pixel[3] = ((u32::from(pixel[3]) * alpha + 127) / 255) as u8;
    }
}
