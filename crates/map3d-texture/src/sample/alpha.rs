//! The alpha of a texture on one surface, for cut-outs.

use std::sync::Arc;

use map3d_base::asset::Wrap;
use map3d_base::samples::SAMPLES;

use crate::sample::grid::Grid;
use crate::sample::sampler::{POSITION_BITS, UvMap};
use crate::sample::tap::{FULL, TAP_BITS, WEIGHT_BITS, single};
use crate::store::{AlphaCell, Level, Texture};

/// Positions a 1/16 pixel.
const STEP: i32 = 1 << (POSITION_BITS - 4);

/// Whether a cut-out surface covers a sample: alpha ≥ ½, filtered at about a sample's footprint (a quarter pixel).
pub struct AlphaSampler {
    grid: Grid,
    /// From a pixel's origin to its samples.
    steps: [[i64; 2]; 16],
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
        let grid = Grid::new(level, wrap, uv);
        let steps = SAMPLES.map(|(x, y)| grid.step(i32::from(x) * STEP, i32::from(y) * STEP));
        Self { grid, steps, outside: (u32::from(alpha) * FULL + 127) / 255 }
    }

    /// At a position in 2^-8 px from the map's origin.
    #[inline(always)]
    pub fn covers(&self, x: i32, y: i32) -> bool {
        self.covers_texel(self.grid.at(x, y))
    }

    /// Those of the `asked` samples of pixel (i, j) that are covered; bit k is sample k.
    pub fn covered(&self, i: i32, j: i32, asked: u32) -> u32 {
        let [x, y] = self.grid.far_at(i << POSITION_BITS, j << POSITION_BITS);
        let mut rest = asked & 0xFFFF;
        let mut covered = 0;
        while rest != 0 {
            let k = rest.trailing_zeros();
            rest &= rest - 1;
            let [dx, dy] = self.steps[k as usize];
            let texel = self.grid.home([x.wrapping_add(dx), y.wrapping_add(dy)]);
            let is_covered = match self.grid.cell(texel) {
                AlphaCell::Clear => false,
                AlphaCell::Solid => true,
                AlphaCell::Mixed => self.covers_texel(texel),
            };
            covered |= u32::from(is_covered) << k;
        }
        covered
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
