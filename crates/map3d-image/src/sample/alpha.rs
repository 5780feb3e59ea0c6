//! The alpha of a texture on one surface, for cut-outs.

use std::sync::Arc;

use map3d_base::asset::Wrap;

use crate::sample::grid::Grid;
use crate::sample::sampler::UvMap;
use crate::sample::tap::{FULL, TAP_BITS, WEIGHT_BITS, single};
use crate::texture::{Level, Texture};

/// Whether a cut-out surface covers a sample: alpha ≥ ½, filtered at about a sample's footprint (a quarter pixel).
pub struct AlphaSampler {
    grid: Grid,
    /// Alpha outside the texture; `FULL` = 1.
    outside: u32,
}

impl AlphaSampler {
    /// The level whose texels are about as large as a sample's footprint.
    pub fn level_for(texture: &Texture, uv: &UvMap) -> u32 {
        let file = &texture.file;
        let [a, b] = uv.jacobian(file.width, file.height);
        let side = (a[0] * b[1] - a[1] * b[0]).abs().sqrt() / 4.0;
        if side > 1.0 && side.is_finite() { (side.log2().round() as u32).min(file.levels - 1) } else { 0 }
    }

    pub fn with(level: Arc<Level>, uv: &UvMap, wrap: Wrap, border_alpha: u8) -> Self {
        let alpha = if wrap == Wrap::Border { border_alpha } else { 255 };
        Self { grid: Grid::new(level, wrap, uv), outside: (u32::from(alpha) * FULL + 127) / 255 }
    }

    /// At a position in 2^-8 px from the map's origin.
    #[inline(always)]
    pub fn covers(&self, x: i32, y: i32) -> bool {
        self.covers_texel(self.grid.at(x, y))
    }

    /// At texture coordinates (u right, v up): as a sampler whose map has them for its origin covers that.
    pub fn covers_at(&self, [u, v]: [f64; 2]) -> bool {
        self.covers_texel(self.grid.of_uv(u, v))
    }

    #[inline(always)]
    fn covers_texel(&self, texel: [i64; 2]) -> bool {
        let ([upper, lower], weights, outside) = self.grid.tap(texel);
        let around = (outside * self.outside) >> (2 * WEIGHT_BITS - TAP_BITS);
        (single(upper, lower, 3, weights) + around) * 2 >= FULL << TAP_BITS
    }
}
