//! The alpha of a texture on one surface, for cut-outs.

use std::sync::Arc;

use map3d_base::asset::Wrap;
use map3d_base::samples::SAMPLES;

use crate::sample::tap::{FULL, TAP_BITS, sum_single_tap};
use crate::sample::texel_map::{TexelMap, TexelPoint};
use crate::sample::uv_map::{POSITION_BITS, UvMap};
use crate::store::{AlphaCell, Level, Texture};

/// A sixteenth of a pixel in positions.
const SIXTEENTH: i32 = 1 << (POSITION_BITS - 4);

/// Tests whether a cut-out surface covers a sample: alpha ≥ ½, filtered over about a sample's footprint (a quarter pixel).
pub struct AlphaSampler {
    map: TexelMap,
    /// From a pixel's origin to its samples.
    sample_offsets: [TexelPoint; 16],
    /// The least and the greatest of them in each axis.
    extent: [TexelPoint; 2],
    /// Whether the surface covers the texels outside the texture.
    covers_outside: bool,
}

impl AlphaSampler {
    /// Returns the level whose texels are about as large as a sample's footprint.
    pub fn level_for(texture: &Texture, uv: &UvMap) -> u32 {
        let file = &texture.file;
        let [a, b] = uv.jacobian(file.width, file.height);
        let side = (a[0] * b[1] - a[1] * b[0]).abs().sqrt() / 4.0;
        if side > 1.0 && side.is_finite() { (side.log2().round() as u32).min(file.levels - 1) } else { 0 }
    }

    /// `outside_alpha`: the alpha outside a texture that ends at its edges.
    pub fn new(level: Arc<Level>, uv: &UvMap, wrap: Wrap, outside_alpha: u8) -> Self {
        let map = TexelMap::new(level, wrap, uv);
        let sample_offsets = SAMPLES.map(|(x, y)| map.change(i32::from(x) * SIXTEENTH, i32::from(y) * SIXTEENTH));
        let extreme = |of: fn(i64, i64) -> i64| {
            let join = |a: TexelPoint, b: &TexelPoint| TexelPoint { x: of(a.x, b.x), y: of(a.y, b.y) };
            sample_offsets.iter().fold(sample_offsets[0], join)
        };
        let extent = [extreme(i64::min), extreme(i64::max)];
        Self { map, sample_offsets, extent, covers_outside: outside_alpha >= 128 }
    }

    /// Whether the surface covers a position in 2^-8 px from the map's origin.
    #[inline(always)]
    pub fn covers(&self, x: i32, y: i32) -> bool {
        self.covers_texel(self.map.at(x, y))
    }

    /// Whether the surface covers texture coordinates (u right, v up), as `covers` says for the origin of a map that begins there.
    pub fn covers_uv(&self, [u, v]: [f64; 2]) -> bool {
        self.covers_texel(self.map.of_uv(u, v))
    }

    /// Returns those of the given samples of pixel (i, j) that the surface covers; bit k is sample k.
    pub fn covered_samples(&self, i: i32, j: i32, samples: u32) -> u32 {
        let origin = self.map.unwrapped_at(i << POSITION_BITS, j << POSITION_BITS);
        // Most pixels lie within the leaves or beside them.
        match self.map.common_alpha_cell(self.map.reduce_to_first_period(origin), self.extent) {
            AlphaCell::Transparent => return 0,
            AlphaCell::Opaque => return samples & 0xFFFF,
            AlphaCell::Mixed => {}
        }
        let mut rest = samples & 0xFFFF;
        let mut covered = 0;
        while rest != 0 {
            let k = rest.trailing_zeros();
            rest &= rest - 1;
            let texel = self.map.reduce_to_first_period(origin.offset(self.sample_offsets[k as usize]));
            let is_covered = match self.map.alpha_cell(texel) {
                AlphaCell::Transparent => false,
                AlphaCell::Opaque => true,
                AlphaCell::Mixed => self.covers_texel(texel),
            };
            covered |= u32::from(is_covered) << k;
        }
        covered
    }

    #[inline(always)]
    fn covers_texel(&self, texel: TexelPoint) -> bool {
        let tap = self.map.tap(texel);
        match tap.is_outside {
            true => self.covers_outside,
            false => sum_single_tap(tap.texels, 3, tap.weights) * 2 >= FULL << TAP_BITS,
        }
    }
}
