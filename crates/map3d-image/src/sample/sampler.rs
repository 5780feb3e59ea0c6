//! A texture on one surface of one view: level, taps and coordinates are fixed when it is set up; a sample is integers only.

use std::sync::Arc;

use map3d_base::Result;
use map3d_base::asset::Wrap;

use crate::sample::footprint::{Footprint, Tuning, footprint};
use crate::sample::tap::{TAP_BITS, TapSum, WEIGHT_BITS};
use crate::srgb::{LINEAR16, UNIT15};
use crate::texture::mask::fold;
use crate::texture::{Level, Texture, TextureCache};

/// Positions are given in 2^-POSITION_BITS pixel.
pub const POSITION_BITS: u32 = 8;
/// Fraction bits of texel coordinates.
const TEXEL_BITS: u32 = 32;

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

/// Texel coordinates of a level over positions, and the lattice they live on.
struct Grid {
    level: Arc<Level>,
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

impl Grid {
    fn new(level: Arc<Level>, wrap: Wrap, uv: &UvMap) -> Self {
        let (w, h) = (f64::from(level.width), f64::from(level.height));
        // Whole periods are dropped, so that texel coordinates stay small.
        let home = |c: f64| match wrap {
            Wrap::Wrap => c - c.floor(),
            Wrap::Mirror => c - 2.0 * (c / 2.0).floor(),
            _ => c,
        };
        let unit = (1u64 << TEXEL_BITS) as f64;
        let fixed = |t: f64| if t.is_finite() { (t * unit).clamp(-4e18, 4e18).round() as i64 } else { 0 };
        let step = 1.0 / f64::from(1u32 << POSITION_BITS);
        let half_weight = 0.5 / f64::from(1u32 << WEIGHT_BITS);
        let line = |start: f64, dx: f64, dy: f64| [fixed(start - 0.5 + half_weight), fixed(dx * step), fixed(dy * step)];
        let x = line(home(uv.u[0]) * w, uv.u[1] * w, uv.u[2] * w);
        let y = line(home(1.0 - uv.v[0]) * h, -uv.v[1] * h, -uv.v[2] * h);
        let repeats = |n: u32| if wrap == Wrap::Wrap { i64::from(n) << TEXEL_BITS } else { 0 };
        let period = [repeats(level.width), repeats(level.height)];
        Self { level, wrap, x, y, period }
    }

    #[inline(always)]
    fn at(&self, x: i32, y: i32) -> (i64, i64) {
        let line = |c: &[i64; 3]| c[0].wrapping_add(c[1].wrapping_mul(i64::from(x))).wrapping_add(c[2].wrapping_mul(i64::from(y)));
        (at_home(line(&self.x), self.period[0]), at_home(line(&self.y), self.period[1]))
    }

    /// Whether all taps within `reach` (least and greatest offset, right and down) of a place lie on texels with a right and a lower neighbour.
    #[inline(always)]
    fn is_inside(&self, tx: i64, ty: i64, reach: &[[i64; 2]; 2]) -> bool {
        let inside =
            |t: i64, [least, most]: [i64; 2], n: u32| t.saturating_add(least) >= 0 && t.saturating_add(most) >> TEXEL_BITS < i64::from(n) - 1;
        inside(tx, reach[0], self.level.width) && inside(ty, reach[1], self.level.height)
    }

    /// Adds a bilinear tap that `is_inside`.
    #[inline(always)]
    fn inner_tap(&self, sum: &mut TapSum, tx: i64, ty: i64) {
        let fraction = |t: i64| (t >> (TEXEL_BITS - WEIGHT_BITS)) as u32 & ((1 << WEIGHT_BITS) - 1);
        let w = self.level.width as usize;
        let at = (ty >> TEXEL_BITS) as usize * w + (tx >> TEXEL_BITS) as usize;
        let upper: &[[u16; 4]] = &self.level.texels[at..at + w + 2];
        sum.add([upper[0], upper[1], upper[w], upper[w + 1]], fraction(tx), fraction(ty));
    }

    /// Adds a bilinear tap; returns the weight (of 2^14) that fell outside the texture, where there is an outside.
    #[inline(always)]
    fn tap(&self, sum: &mut TapSum, tx: i64, ty: i64) -> u32 {
        if self.is_inside(tx, ty, &[[0; 2]; 2]) {
            self.inner_tap(sum, tx, ty);
            return 0;
        }
        let fraction = |t: i64| (t >> (TEXEL_BITS - WEIGHT_BITS)) as u32 & ((1 << WEIGHT_BITS) - 1);
        self.edge_tap(sum, [tx >> TEXEL_BITS, ty >> TEXEL_BITS], [fraction(tx), fraction(ty)])
    }

    #[inline(never)]
    fn edge_tap(&self, sum: &mut TapSum, [ix, iy]: [i64; 2], [fx, fy]: [u32; 2]) -> u32 {
        let (w, h) = (self.level.width, self.level.height);
        let near = |i: i64, n: u32| match self.wrap {
            Wrap::Wrap if i < 0 && i >= -i64::from(n) => Some((i + i64::from(n)) as u32),
            Wrap::Wrap if i >= i64::from(n) && i < 2 * i64::from(n) => Some((i - i64::from(n)) as u32),
            _ if (0..i64::from(n)).contains(&i) => Some(i as u32),
            wrap => fold(i, n, wrap),
        };
        let columns = [near(ix, w), near(ix.saturating_add(1), w)];
        let rows = [near(iy, h), near(iy.saturating_add(1), h)];
        let mut outside = 0;
        let one = 1 << WEIGHT_BITS;
        let texels: [[u16; 4]; 4] = std::array::from_fn(|k| {
            let weight = (if k % 2 == 0 { one - fx } else { fx }) * (if k < 2 { one - fy } else { fy });
            match (columns[k % 2], rows[k / 2]) {
                (Some(x), Some(y)) => self.level.texels[y as usize * w as usize + x as usize],
                _ => {
                    outside += weight;
                    [0; 4]
                }
            }
        });
        sum.add(texels, fx, fy);
        outside
    }
}

/// Colour of a textured surface over whole pixels.
pub struct Sampler {
    grid: Grid,
    taps: Vec<[i64; 2]>,
    reach: [[i64; 2]; 2],
    has_alpha: bool,
    /// From a sum of taps to 16 bits, times 2^40.
    scale: u64,
    /// Linear light.
    diffuse: [u16; 3],
    outside: [u16; 3],
}

impl Sampler {
    /// Sets up a surface: chooses its level and taps, and takes the level from the cache.
    pub fn new(cache: &TextureCache, texture: &Texture, uv: &UvMap, wrap: Wrap, outside: Outside) -> Result<Self> {
        let file = &texture.file;
        let plan = footprint(uv.jacobian(file.width, file.height), file.levels, &Tuning::default());
        let level = cache.level(texture, plan.level)?;
        Ok(Self::with(level, &plan, file.has_alpha, uv, wrap, outside))
    }

    /// The same of a level at hand.
    pub fn with(level: Arc<Level>, plan: &Footprint, has_alpha: bool, uv: &UvMap, wrap: Wrap, outside: Outside) -> Self {
        let unit = (1u64 << TEXEL_BITS) as f64;
        let taps: Vec<[i64; 2]> = plan.taps.iter().map(|t| t.map(|c| (c * unit).round() as i64)).collect();
        let bounds = |k: usize| taps.iter().fold([0, 0], |[lo, hi], t: &[i64; 2]| [t[k].min(lo), t[k].max(hi)]);
        let reach = [bounds(0), bounds(1)];
        let full = (taps.len() as u64) * (u64::from(UNIT15) << TAP_BITS);
        let scale = ((65_535u64 << 40) + full / 2) / full;
        let linear = |c: [u8; 4]| [c[0], c[1], c[2]].map(|b| LINEAR16[b as usize]);
        let around = if wrap == Wrap::Border { outside.border } else { outside.diffuse };
        Self { grid: Grid::new(level, wrap, uv), taps, reach, has_alpha, scale, diffuse: linear(outside.diffuse), outside: linear(around) }
    }

    pub fn tap_count(&self) -> usize {
        self.taps.len()
    }

    /// Linear light, 16 bits, of the pixel's square around a position (2^-8 px from the map's origin).
    #[inline(always)]
    pub fn sample(&self, x: i32, y: i32) -> [u16; 3] {
        let (tx, ty) = self.grid.at(x, y);
        let mut sum = TapSum::new();
        let mut outside = 0;
        if self.grid.is_inside(tx, ty, &self.reach) {
            for [dx, dy] in &self.taps {
                self.grid.inner_tap(&mut sum, tx + dx, ty + dy);
            }
        } else {
            outside = self.edge_taps(&mut sum, tx, ty);
        }
        let channels = sum.channels();
        if outside == 0 && !self.has_alpha {
            return [self.full(channels, 0), self.full(channels, 1), self.full(channels, 2)];
        }
        self.mixed(channels, outside)
    }

    /// A channel of an opaque sum.
    #[inline(always)]
    fn full(&self, channels: [u32; 4], c: usize) -> u16 {
        multiplied(((u64::from(channels[c]) * self.scale + (1 << 39)) >> 40) as u32, self.diffuse[c])
    }

    #[inline(never)]
    fn edge_taps(&self, sum: &mut TapSum, tx: i64, ty: i64) -> u32 {
        self.taps.iter().map(|[dx, dy]| self.grid.tap(sum, tx.saturating_add(*dx), ty.saturating_add(*dy))).sum()
    }

    /// Weighs by alpha, and with what lies outside the texture.
    fn mixed(&self, channels: [u32; 4], outside: u32) -> [u16; 3] {
        let around = (u64::from(outside) * u64::from(UNIT15)) >> (2 * WEIGHT_BITS - TAP_BITS);
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

/// Whether a cut-out surface covers a sample: alpha ≥ ½, filtered at about a sample's footprint (a quarter pixel).
pub struct AlphaSampler {
    grid: Grid,
    /// Alpha outside the texture, 15 bits.
    outside: u32,
}

impl AlphaSampler {
    pub fn new(cache: &TextureCache, texture: &Texture, uv: &UvMap, wrap: Wrap, border_alpha: u8) -> Result<Self> {
        let level = cache.level(texture, Self::level_for(texture, uv))?;
        Ok(Self::with(level, uv, wrap, border_alpha))
    }

    /// The level whose texels are about as large as a sample's footprint.
    pub fn level_for(texture: &Texture, uv: &UvMap) -> u32 {
        let file = &texture.file;
        let [a, b] = uv.jacobian(file.width, file.height);
        let side = (a[0] * b[1] - a[1] * b[0]).abs().sqrt() / 4.0;
        if side > 1.0 && side.is_finite() { (side.log2().round() as u32).min(file.levels - 1) } else { 0 }
    }

    pub fn with(level: Arc<Level>, uv: &UvMap, wrap: Wrap, border_alpha: u8) -> Self {
        let alpha = if wrap == Wrap::Border { border_alpha } else { 255 };
        Self { grid: Grid::new(level, wrap, uv), outside: (u32::from(alpha) * UNIT15 + 127) / 255 }
    }

    /// At a position in 2^-8 px from the map's origin.
    #[inline(always)]
    pub fn covers(&self, x: i32, y: i32) -> bool {
        let (tx, ty) = self.grid.at(x, y);
        let mut sum = TapSum::new();
        let outside = self.grid.tap(&mut sum, tx, ty);
        let around = (outside * self.outside) >> (2 * WEIGHT_BITS - TAP_BITS);
        (sum.channels()[3] + around) * 2 >= UNIT15 << TAP_BITS
    }
}
