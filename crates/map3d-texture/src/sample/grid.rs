//! Texel coordinates of a level over the pixels of a surface, and the lattice they live on.

use std::sync::Arc;

use map3d_base::asset::Wrap;

use crate::sample::plan::Batch;
use crate::sample::sampler::{POSITION_BITS, UvMap};
use crate::sample::tap::{BATCH, PLACE_BITS, Pair, Placed, TapSum, WEIGHT_BITS, Weights, weights};
use crate::store::{AlphaCell, Level};
use crate::wrap::wrap_texel;

/// Fraction bits of texel coordinates.
pub(super) const TEXEL_BITS: u32 = 32;

/// Affine texel coordinates: start, change per position right and down.
pub(super) struct Grid {
    pub level: Arc<Level>,
    wrap: Wrap,
    x: [i64; 3],
    y: [i64; 3],
    /// Where the texture repeats: after how many 2^-TEXEL_BITS texels, right and down; else 0.
    period: [i64; 2],
}

/// Into [0, period); a period of 0 is none.
#[inline(always)]
fn at_home(t: i64, period: i64) -> i64 {
    match period & (period - 1) == 0 {
        true => t & period.wrapping_sub(1),
        false if (0..period).contains(&t) => t,
        false => t.rem_euclid(period),
    }
}

fn fixed(texels: f64) -> i64 {
    let unit = (1u64 << TEXEL_BITS) as f64;
    if texels.is_finite() { (texels * unit).clamp(-4e18, 4e18).round() as i64 } else { 0 }
}

/// Texel coordinates of texture coordinates, without whole periods, so that they stay small.
fn start(level: &Level, wrap: Wrap, u: f64, v: f64) -> [i64; 2] {
    let home = |c: f64| match wrap {
        Wrap::Wrap => c - c.floor(),
        Wrap::Mirror => c - 2.0 * (c / 2.0).floor(),
        _ => c,
    };
    let half_weight = 0.5 / f64::from(1u32 << WEIGHT_BITS);
    [(home(u), level.width), (home(1.0 - v), level.height)].map(|(c, n)| fixed(c * f64::from(n) - 0.5 + half_weight))
}

impl Grid {
    pub fn new(level: Arc<Level>, wrap: Wrap, uv: &UvMap) -> Self {
        let (w, h) = (f64::from(level.width), f64::from(level.height));
        let step = 1.0 / f64::from(1u32 << POSITION_BITS);
        let [x, y] = start(&level, wrap, uv.u[0], uv.v[0]);
        let x = [x, fixed(uv.u[1] * w * step), fixed(uv.u[2] * w * step)];
        let y = [y, fixed(-uv.v[1] * h * step), fixed(-uv.v[2] * h * step)];
        let repeats = |n: u32| if wrap == Wrap::Wrap { i64::from(n) << TEXEL_BITS } else { 0 };
        let period = [repeats(level.width), repeats(level.height)];
        Self { level, wrap, x, y, period }
    }

    /// Texel coordinates of texture coordinates: as those of the origin of a map that begins there.
    pub fn of_uv(&self, u: f64, v: f64) -> [i64; 2] {
        self.home(start(&self.level, self.wrap, u, v))
    }

    /// Texel coordinates of a position, where the texture repeats in its first period.
    #[inline(always)]
    pub fn at(&self, x: i32, y: i32) -> [i64; 2] {
        self.home(self.far_at(x, y))
    }

    /// In the first period.
    #[inline(always)]
    pub fn home(&self, [tx, ty]: [i64; 2]) -> [i64; 2] {
        [at_home(tx, self.period[0]), at_home(ty, self.period[1])]
    }

    /// Change of texel coordinates over a distance of positions.
    pub fn step(&self, x: i32, y: i32) -> [i64; 2] {
        let line = |c: &[i64; 3]| c[1].wrapping_mul(i64::from(x)).wrapping_add(c[2].wrapping_mul(i64::from(y)));
        [line(&self.x), line(&self.y)]
    }

    /// What a bilinear tap at a place meets, if that is known beforehand.
    #[inline(always)]
    pub fn cell(&self, [tx, ty]: [i64; 2]) -> AlphaCell {
        let (x, y) = (tx >> TEXEL_BITS, ty >> TEXEL_BITS);
        let (w, h) = (i64::from(self.level.width), i64::from(self.level.height));
        let is_inside = (x as u64) < (w - 1) as u64 && (y as u64) < (h - 1) as u64;
        if is_inside { self.level.alpha_cell((y * w + x) as usize) } else { AlphaCell::Mixed }
    }

    /// The same in whatever period.
    #[inline(always)]
    pub fn far_at(&self, x: i32, y: i32) -> [i64; 2] {
        let line = |c: &[i64; 3]| c[0].wrapping_add(c[1].wrapping_mul(i64::from(x))).wrapping_add(c[2].wrapping_mul(i64::from(y)));
        [line(&self.x), line(&self.y)]
    }

    /// Change from a pixel to the next one on its right.
    #[inline(always)]
    pub fn pixel_step(&self) -> [i64; 2] {
        [self.x[1] << POSITION_BITS, self.y[1] << POSITION_BITS]
    }

    /// Whether all taps within `reach` of a place (least and greatest offset, right and down, in 2^-PLACE_BITS texel) lie on texels with a right
    /// and a lower neighbour.
    #[inline(always)]
    pub fn is_inside(&self, [tx, ty]: [i64; 2], reach: &[[i32; 2]; 2]) -> bool {
        let inside = |t: i64, [least, most]: [i32; 2], n: u32| {
            let t = t >> (TEXEL_BITS - PLACE_BITS);
            t + i64::from(least) >= 0 && (t + i64::from(most)) >> PLACE_BITS < i64::from(n) - 1
        };
        inside(tx, reach[0], self.level.width) && inside(ty, reach[1], self.level.height)
    }

    /// Finds the texels and weights of a batch of taps around a place; they may be used if `is_inside` holds there.
    #[inline(always)]
    pub fn place<S: TapSum>(&self, batch: &Batch, [tx, ty]: [i64; 2], out: &mut Placed) {
        let center = [(tx >> (TEXEL_BITS - PLACE_BITS)) as i32, (ty >> (TEXEL_BITS - PLACE_BITS)) as i32];
        S::place(&batch.x, &batch.y, center, self.level.width as i32, out);
        out.count = batch.count;
    }

    /// Adds a batch that was placed.
    #[inline(always)]
    pub fn add<S: TapSum>(&self, placed: &Placed, sum: &mut S) {
        let w = self.level.width as usize;
        for k in 0..placed.count.min(BATCH) {
            let rows = &self.level.texels[placed.at[k] as usize..][..w + 2];
            sum.add([rows[0], rows[1]], [rows[w], rows[w + 1]], placed.weights[k]);
        }
        sum.settle();
    }

    /// The texels of a bilinear tap as an upper and a lower pair, its weights, and the weight (of 2^14) that falls outside the texture, where there
    /// is an outside.
    #[inline(always)]
    pub fn tap(&self, [tx, ty]: [i64; 2]) -> ([Pair; 2], Weights, u32) {
        const ONE: u32 = 1 << WEIGHT_BITS;
        let fraction = |t: i64| (t >> (TEXEL_BITS - WEIGHT_BITS)) as u32 & (ONE - 1);
        let (fx, fy) = (fraction(tx), fraction(ty));
        let w = self.level.width as usize;
        if self.is_inside([tx, ty], &[[0; 2]; 2]) {
            let at = (ty >> TEXEL_BITS) as usize * w + (tx >> TEXEL_BITS) as usize;
            let rows = &self.level.texels[at..][..w + 2];
            return ([[rows[0], rows[1]], [rows[w], rows[w + 1]]], weights(fx, fy), 0);
        }
        let (texels, outside) = self.edge_tap([tx >> TEXEL_BITS, ty >> TEXEL_BITS], [fx, fy]);
        (texels, weights(fx, fy), outside)
    }

    #[inline(never)]
    fn edge_tap(&self, [ix, iy]: [i64; 2], [fx, fy]: [u32; 2]) -> ([Pair; 2], u32) {
        let (w, h) = (self.level.width, self.level.height);
        let near = |i: i64, n: u32| match self.wrap {
            Wrap::Wrap if i < 0 && i >= -i64::from(n) => Some((i + i64::from(n)) as u32),
            Wrap::Wrap if i >= i64::from(n) && i < 2 * i64::from(n) => Some((i - i64::from(n)) as u32),
            _ if (0..i64::from(n)).contains(&i) => Some(i as u32),
            wrap => wrap_texel(i, n, wrap),
        };
        let columns = [near(ix, w), near(ix.saturating_add(1), w)];
        let rows = [near(iy, h), near(iy.saturating_add(1), h)];
        let mut outside = 0;
        let one = 1 << WEIGHT_BITS;
        let mut texel = |column: usize, row: usize| match (columns[column], rows[row]) {
            (Some(x), Some(y)) => self.level.texels[y as usize * w as usize + x as usize],
            _ => {
                outside += (if column == 0 { one - fx } else { fx }) * (if row == 0 { one - fy } else { fy });
                [0; 4]
            }
        };
        let texels = [[texel(0, 0), texel(1, 0)], [texel(0, 1), texel(1, 1)]];
        (texels, outside)
    }
}
