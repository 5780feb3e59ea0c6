//! A texture on one surface of one view: level, taps and coordinates are fixed when it is set up; a sample is integers only.

use std::sync::Arc;

use map3d_base::asset::Wrap;

use crate::sample::grid::{Grid, TEXEL_BITS};
use crate::sample::plan::TapPlan;
use crate::sample::tap::{FULL, PLACE_BITS, Placed, PlainSum, TAP_BITS, TapSum, WEIGHT_BITS};
use crate::sample::wide;
use crate::store::Level;
use map3d_image::srgb::LINEAR16;

/// Positions are given in 2^-POSITION_BITS pixel.
pub const POSITION_BITS: u32 = 8;

/// Texture coordinates over pixels (u right, v up, whole images): value at the origin, change per pixel to the right, per pixel down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvMap {
    pub u: [f64; 3],
    pub v: [f64; 3],
}

impl UvMap {
    /// Texels of level 0 (right, down) per pixel to the right and per pixel down.
    pub fn jacobian(&self, width: u32, height: u32) -> [[f64; 2]; 2] {
        let (w, h) = (f64::from(width), f64::from(height));
        [[self.u[1] * w, -self.v[1] * h], [self.u[2] * w, -self.v[2] * h]]
    }
}

/// What multiplies the texture, and what lies outside of it with `Wrap::Border` and `Wrap::None`. sRGB bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outside {
    pub diffuse: [u8; 4],
    pub border: [u8; 4],
}

/// Colour of a textured surface over whole pixels.
pub struct Sampler {
    grid: Grid,
    plan: Arc<TapPlan>,
    has_alpha: bool,
    /// Linear light.
    diffuse: [u16; 3],
    outside: [u16; 3],
}

impl Sampler {
    /// `level`: the plan's, of the texture.
    pub fn new(level: Arc<Level>, plan: Arc<TapPlan>, has_alpha: bool, uv: &UvMap, wrap: Wrap, outside: Outside) -> Self {
        let linear = |c: [u8; 4]| [c[0], c[1], c[2]].map(|b| LINEAR16[b as usize]);
        let around = if wrap == Wrap::Border { outside.border } else { outside.diffuse };
        Self { grid: Grid::new(level, wrap, uv), plan, has_alpha, diffuse: linear(outside.diffuse), outside: linear(around) }
    }

    /// Linear light, 16 bits, of the pixel's square around a position (2^-8 px from the map's origin).
    #[inline]
    pub fn sample(&self, x: i32, y: i32) -> [u16; 3] {
        wide::sample(self.plan.isa, self, x, y)
    }

    /// A row of pixels, the first around (x, y); full coverage.
    #[inline]
    pub fn row(&self, x: i32, y: i32, out: &mut [[u16; 4]]) {
        wide::row(self.plan.isa, self, x, y, out);
    }

    #[inline(always)]
    pub(super) fn sample_with<S: TapSum>(&self, x: i32, y: i32) -> [u16; 3] {
        let t = self.grid.at(x, y);
        match self.grid.is_inside(t, &self.plan.reach) {
            true => self.inner::<S>(t),
            false => self.outer(t),
        }
    }

    #[inline(always)]
    pub(super) fn row_with<S: TapSum>(&self, x: i32, y: i32, out: &mut [[u16; 4]]) {
        let Some(last) = out.len().checked_sub(1) else { return };
        let ([tx, ty], far) = (self.grid.at(x, y), self.grid.far_at(x, y));
        // Both ends in one period and inside: so is all between them.
        let end = self.grid.far_at(x + ((last as i32) << POSITION_BITS), y);
        let end = [end[0].wrapping_sub(far[0]).wrapping_add(tx), end[1].wrapping_sub(far[1]).wrapping_add(ty)];
        if self.grid.is_inside([tx, ty], &self.plan.reach) && self.grid.is_inside(end, &self.plan.reach) {
            self.inner_row::<S>([tx, ty], out);
        } else {
            for (k, pixel) in out.iter_mut().enumerate() {
                let [r, g, b] = self.sample_with::<S>(x + ((k as i32) << POSITION_BITS), y);
                *pixel = [r, g, b, 65_535];
            }
        }
    }

    #[inline(always)]
    fn inner<S: TapSum>(&self, t: [i64; 2]) -> [u16; 3] {
        let (mut sum, mut placed) = (S::new(), Placed::NONE);
        for batch in &self.plan.batches {
            self.grid.place::<S>(batch, t, &mut placed);
            self.grid.add(&placed, &mut sum);
        }
        self.finished(sum.channels())
    }

    /// A row of pixels that are all inside, the first around a place. Each batch is placed while the one before it is added.
    #[inline(always)]
    fn inner_row<S: TapSum>(&self, [mut tx, mut ty]: [i64; 2], out: &mut [[u16; 4]]) {
        let [dx, dy] = self.grid.pixel_step();
        let batches = self.plan.batches.as_slice();
        let mut ring = [Placed::NONE; 2];
        self.grid.place::<S>(&batches[0], [tx, ty], &mut ring[0]);
        let mut turn = 0;
        for pixel in out {
            let next = [tx.wrapping_add(dx), ty.wrapping_add(dy)];
            let mut sum = S::new();
            for k in 1..batches.len() {
                self.grid.place::<S>(&batches[k], [tx, ty], &mut ring[(turn + 1) & 1]);
                self.grid.add(&ring[turn & 1], &mut sum);
                turn += 1;
            }
            // That of the pixel after the last is not used: its place may be outside.
            self.grid.place::<S>(&batches[0], next, &mut ring[(turn + 1) & 1]);
            self.grid.add(&ring[turn & 1], &mut sum);
            turn += 1;
            let [r, g, b] = self.finished(sum.channels());
            *pixel = [r, g, b, 65_535];
            [tx, ty] = next;
        }
    }

    #[inline(always)]
    fn finished(&self, channels: [u32; 4]) -> [u16; 3] {
        match self.has_alpha {
            false => self.full(channels),
            true => self.mixed(channels, 0),
        }
    }

    /// Taps that may fall over the texture's edges, one by one.
    #[inline(never)]
    fn outer(&self, t: [i64; 2]) -> [u16; 3] {
        let mut sum = PlainSum::new();
        let mut outside = 0;
        for batch in &self.plan.batches {
            for k in 0..batch.count {
                let at = |c: i64, d: i32| (c >> (TEXEL_BITS - PLACE_BITS)).saturating_add(i64::from(d)) << (TEXEL_BITS - PLACE_BITS);
                let ([upper, lower], weights, beyond) = self.grid.tap([at(t[0], batch.x[k]), at(t[1], batch.y[k])]);
                sum.add(upper, lower, weights);
                outside += beyond;
            }
            sum.settle();
        }
        match outside == 0 && !self.has_alpha {
            true => self.full(sum.channels()),
            false => self.mixed(sum.channels(), outside),
        }
    }

    /// An opaque sum.
    #[inline(always)]
    fn full(&self, channels: [u32; 4]) -> [u16; 3] {
        let (scale, mut out) = (self.plan.scale, [0; 3]);
        for c in 0..3 {
            out[c] = multiplied(((u64::from(channels[c]) * scale + (1 << 39)) >> 40) as u32, self.diffuse[c]);
        }
        out
    }

    /// Weighs by alpha, and with what lies outside the texture.
    #[inline(never)]
    fn mixed(&self, channels: [u32; 4], outside: u32) -> [u16; 3] {
        let around = (u64::from(outside) * u64::from(FULL)) >> (2 * WEIGHT_BITS - TAP_BITS);
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
fn multiplied(c: u32, d: u16) -> u16 {
    if d == 65_535 { c as u16 } else { ((u64::from(c) * u64::from(d) + 32_767) / 65_535) as u16 }
}
