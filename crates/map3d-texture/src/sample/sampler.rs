//! The colour of a textured surface over pixels: footprint → level → taps → sum.
//!
//! Setting up a sampler fixes the level and the taps (`footprint`, `plan`) and the texel coordinates (`texel_map`); sampling then uses integers only.

use std::sync::Arc;

use map3d_base::Isa;
use map3d_base::asset::Wrap;
use map3d_image::srgb::LINEAR16;

use crate::sample::plan::TapPlan;
#[cfg(target_arch = "x86_64")]
use crate::sample::tap::Avx2Accumulator;
use crate::sample::tap::{FULL, ResolvedTaps, ScalarAccumulator, TAP_BITS, TapAccumulator};
use crate::sample::texel_map::{TexelMap, TexelPoint};
use crate::sample::uv_map::{POSITION_BITS, UvMap};
use crate::store::Level;

/// sRGB colours of a textured surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfaceColors {
    /// Multiplies the texture; with `Wrap::None` also shows at coordinates outside [0,1].
    pub diffuse: [u8; 4],
    /// Shows at coordinates outside [0,1] with `Wrap::Border`.
    pub border: [u8; 4],
}

/// Samples the colour of one textured surface in one view.
pub struct Sampler {
    map: TexelMap,
    plan: Arc<TapPlan>,
    has_alpha: bool,
    /// Linear light.
    diffuse: [u16; 3],
    /// Linear light outside the texture.
    outside: [u16; 3],
}

impl Sampler {
    /// `level`: the plan's level of the texture.
    pub fn new(level: Arc<Level>, plan: Arc<TapPlan>, has_alpha: bool, uv: &UvMap, wrap: Wrap, colors: SurfaceColors) -> Self {
        let linear = |c: [u8; 4]| [c[0], c[1], c[2]].map(|b| LINEAR16[b as usize]);
        let outside = if wrap == Wrap::Border { colors.border } else { colors.diffuse };
        Self { map: TexelMap::new(level, wrap, uv), plan, has_alpha, diffuse: linear(colors.diffuse), outside: linear(outside) }
    }

    /// Returns linear light, 16 bits, of a pixel's square around a position (2^-8 px from the map's origin).
    #[inline]
    pub fn sample(&self, x: i32, y: i32) -> [u16; 3] {
        match self.plan.isa {
            Isa::Scalar => self.sample_with::<ScalarAccumulator>(x, y),
            // SAFETY: a plan is made only with an instruction set that the processor has; both have AVX2.
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 | Isa::Avx512 => unsafe { self.sample_avx2(x, y) },
        }
    }

    /// Samples around each position; faster than one call for each.
    pub fn sample_each(&self, positions: &[[i32; 2]], out: &mut [[u16; 3]]) {
        match self.plan.isa {
            Isa::Scalar => self.sample_each_with::<ScalarAccumulator>(positions, out),
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 | Isa::Avx512 => unsafe { self.sample_each_avx2(positions, out) },
        }
    }

    /// Samples a row of pixels, the first around (x, y); coverage is full.
    #[inline]
    pub fn sample_row(&self, x: i32, y: i32, out: &mut [[u16; 4]]) {
        match self.plan.isa {
            Isa::Scalar => self.sample_row_with::<ScalarAccumulator>(x, y, out),
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 | Isa::Avx512 => unsafe { self.sample_row_avx2(x, y, out) },
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn sample_avx2(&self, x: i32, y: i32) -> [u16; 3] {
        self.sample_with::<Avx2Accumulator>(x, y)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn sample_each_avx2(&self, positions: &[[i32; 2]], out: &mut [[u16; 3]]) {
        self.sample_each_with::<Avx2Accumulator>(positions, out);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn sample_row_avx2(&self, x: i32, y: i32, out: &mut [[u16; 4]]) {
        self.sample_row_with::<Avx2Accumulator>(x, y, out);
    }

    #[inline(always)]
    fn sample_with<A: TapAccumulator>(&self, x: i32, y: i32) -> [u16; 3] {
        let t = self.map.at(x, y);
        match self.map.is_inside(t, &self.plan.extent) {
            true => self.sum_inside::<A>(t),
            false => self.sum_at_edge(t),
        }
    }

    /// Resolves each batch while the one before it is added, as `sum_row_inside` does.
    #[inline(always)]
    fn sample_each_with<A: TapAccumulator>(&self, positions: &[[i32; 2]], out: &mut [[u16; 3]]) {
        let Some([x, y]) = positions.first() else { return };
        let batches = self.plan.batches.as_slice();
        let mut t = self.map.at(*x, *y);
        let mut ring = [ResolvedTaps::NONE; 2];
        self.map.resolve::<A>(&batches[0], t, &mut ring[0]);
        let mut turn = 0;
        for (number, color) in out.iter_mut().enumerate() {
            let next = positions.get(number + 1).map_or(t, |[x, y]| self.map.at(*x, *y));
            let mut sum = A::new();
            let is_inside = self.map.is_inside(t, &self.plan.extent);
            for k in 1..if is_inside { batches.len() } else { 0 } {
                self.map.resolve::<A>(&batches[k], t, &mut ring[(turn + 1) & 1]);
                self.map.accumulate(&ring[turn & 1], &mut sum);
                turn += 1;
            }
            // The next position may be the last one again, or at an edge; its batch is not used then.
            self.map.resolve::<A>(&batches[0], next, &mut ring[(turn + 1) & 1]);
            *color = match is_inside {
                true => {
                    self.map.accumulate(&ring[turn & 1], &mut sum);
                    self.color_inside(sum.channels())
                }
                false => self.sum_at_edge(t),
            };
            turn += 1;
            t = next;
        }
    }

    #[inline(always)]
    fn sample_row_with<A: TapAccumulator>(&self, x: i32, y: i32, out: &mut [[u16; 4]]) {
        let Some(last) = out.len().checked_sub(1) else { return };
        // The row is inside where both its ends are, within one period.
        let (start, unwrapped) = (self.map.at(x, y), self.map.unwrapped_at(x, y));
        let end = self.map.unwrapped_at(x + ((last as i32) << POSITION_BITS), y).minus(unwrapped).offset(start);
        if self.map.is_inside(start, &self.plan.extent) && self.map.is_inside(end, &self.plan.extent) {
            return self.sum_row_inside::<A>(start, out);
        }
        // Otherwise each pixel decides for itself.
        for (k, pixel) in out.iter_mut().enumerate() {
            let [r, g, b] = self.sample_with::<A>(x + ((k as i32) << POSITION_BITS), y);
            *pixel = [r, g, b, 65_535];
        }
    }

    /// Sums taps that all lie inside the texture.
    #[inline(always)]
    fn sum_inside<A: TapAccumulator>(&self, t: TexelPoint) -> [u16; 3] {
        let (mut sum, mut taps) = (A::new(), ResolvedTaps::NONE);
        for batch in &self.plan.batches {
            self.map.resolve::<A>(batch, t, &mut taps);
            self.map.accumulate(&taps, &mut sum);
        }
        self.color_inside(sum.channels())
    }

    /// Samples a row of pixels whose taps all lie inside, the first around `t`. Resolves each batch while the one before it is added.
    #[inline(always)]
    fn sum_row_inside<A: TapAccumulator>(&self, mut t: TexelPoint, out: &mut [[u16; 4]]) {
        let change = self.map.pixel_change();
        let batches = self.plan.batches.as_slice();
        let mut ring = [ResolvedTaps::NONE; 2];
        self.map.resolve::<A>(&batches[0], t, &mut ring[0]);
        let mut turn = 0;
        for pixel in out {
            let next = t.offset(change);
            let mut sum = A::new();
            // By index: an iterator over the batches costs a third more time here.
            for k in 1..batches.len() {
                self.map.resolve::<A>(&batches[k], t, &mut ring[(turn + 1) & 1]);
                self.map.accumulate(&ring[turn & 1], &mut sum);
                turn += 1;
            }
            // The batch of the pixel after the last one may lie outside; it is not used.
            self.map.resolve::<A>(&batches[0], next, &mut ring[(turn + 1) & 1]);
            self.map.accumulate(&ring[turn & 1], &mut sum);
            turn += 1;
            let [r, g, b] = self.color_inside(sum.channels());
            *pixel = [r, g, b, 65_535];
            t = next;
        }
    }

    /// Sums taps that may cross the edges of the texture, one by one.
    #[inline(never)]
    fn sum_at_edge(&self, t: TexelPoint) -> [u16; 3] {
        let mut sum = ScalarAccumulator::new();
        let mut outside = 0;
        for batch in &self.plan.batches {
            for k in 0..batch.count {
                let tap = self.map.tap(t.offset_by_tap(batch.x[k], batch.y[k]));
                sum.add(tap.texels, tap.weights);
                outside += u32::from(tap.is_outside);
            }
            sum.flush();
        }
        match outside == 0 && !self.has_alpha {
            true => self.opaque_color(sum.channels()),
            false => self.blended_color(sum.channels(), outside),
        }
    }

    #[inline(always)]
    fn color_inside(&self, channels: [u32; 4]) -> [u16; 3] {
        match self.has_alpha {
            false => self.opaque_color(channels),
            true => self.blended_color(channels, 0),
        }
    }

    /// Scales a sum of opaque texels and multiplies it by the diffuse colour.
    #[inline(always)]
    fn opaque_color(&self, channels: [u32; 4]) -> [u16; 3] {
        let (scale, mut out) = (self.plan.scale, [0; 3]);
        for c in 0..3 {
            out[c] = multiply(((u64::from(channels[c]) * scale + (1 << 39)) >> 40) as u32, self.diffuse[c]);
        }
        out
    }

    /// Divides a sum by its alpha; `outside`: the number of taps outside the texture, which add the colour there.
    #[inline(never)]
    fn blended_color(&self, channels: [u32; 4], outside: u32) -> [u16; 3] {
        let around = (u64::from(outside) * u64::from(FULL)) << TAP_BITS;
        let total = u64::from(channels[3]) + around;
        if total == 0 {
            return [0; 3];
        }
        std::array::from_fn(|c| {
            let inside = u64::from(channels[c]) * u64::from(self.diffuse[c]);
            let rest = around * u64::from(self.outside[c]);
            ((inside + rest + total / 2) / total).min(65_535) as u16
        })
    }
}

#[inline(always)]
fn multiply(c: u32, d: u16) -> u16 {
    if d == 65_535 { c as u16 } else { ((u64::from(c) * u64::from(d) + 32_767) / 65_535) as u16 }
}
