//! Maps pixel positions to texels of a level, and gathers the texels of bilinear taps.

use std::sync::Arc;

use map3d_base::asset::Wrap;

use crate::sample::plan::{TapBatch, TapExtent};
use crate::sample::tap::{BilinearWeights, ResolvedTaps, TAP_POSITION_BITS, TapAccumulator, TexelQuad, WEIGHT_BITS, WEIGHT_ONE, bilinear_weights};
use crate::sample::uv_map::{POSITION_BITS, UvMap};
use crate::store::{AlphaCell, Level};
use crate::wrap::wrap_texel;

/// Fraction bits of texel coordinates.
const TEXEL_BITS: u32 = 32;
/// From texel coordinates to positions of taps.
const TAP_SHIFT: u32 = TEXEL_BITS - TAP_POSITION_BITS;
/// A tap that lies outside the texture by less than this, in 2^-TEXEL_BITS texel, is inside: an eighth of a texel, far more than float32 noise.
const EDGE_TOLERANCE: i64 = 1 << (TEXEL_BITS - 3);

/// Texel coordinates in 2^-TEXEL_BITS texel, right and down; whole numbers are texel centres. Also the distance between two points.
#[derive(Clone, Copy)]
pub(super) struct TexelPoint {
    pub x: i64,
    pub y: i64,
}

impl TexelPoint {
    #[inline(always)]
    pub fn offset(self, by: Self) -> Self {
        Self { x: self.x.wrapping_add(by.x), y: self.y.wrapping_add(by.y) }
    }

    #[inline(always)]
    pub fn minus(self, other: Self) -> Self {
        Self { x: self.x.wrapping_sub(other.x), y: self.y.wrapping_sub(other.y) }
    }

    /// Adds the offset of a tap in 2^-TAP_POSITION_BITS texel; drops the finer bits.
    #[inline(always)]
    pub fn offset_by_tap(self, x: i32, y: i32) -> Self {
        let add = |c: i64, d: i32| (c >> TAP_SHIFT).saturating_add(i64::from(d)) << TAP_SHIFT;
        Self { x: add(self.x, x), y: add(self.y, y) }
    }
}

/// A texel coordinate as an affine function of pixel positions.
struct Line {
    start: i64,
    /// Change per position to the right.
    right: i64,
    /// Change per position down.
    down: i64,
}

impl Line {
    #[inline(always)]
    fn at(&self, x: i32, y: i32) -> i64 {
        self.start.wrapping_add(self.right.wrapping_mul(i64::from(x))).wrapping_add(self.down.wrapping_mul(i64::from(y)))
    }

    fn change(&self, x: i32, y: i32) -> i64 {
        self.right.wrapping_mul(i64::from(x)).wrapping_add(self.down.wrapping_mul(i64::from(y)))
    }
}

/// A bilinear tap.
pub(super) struct Tap {
    pub texels: TexelQuad,
    pub weights: BilinearWeights,
    /// Whether the tap lies outside a texture that ends at its edges; its texels are zeros then.
    pub is_outside: bool,
}

/// Affine texel coordinates over the pixels of one surface, on one level.
pub(super) struct TexelMap {
    level: Arc<Level>,
    wrap: Wrap,
    x: Line,
    y: Line,
    /// Size of the texture where it repeats (`Wrap::Wrap`), else 0.
    period: TexelPoint,
}

impl TexelMap {
    pub fn new(level: Arc<Level>, wrap: Wrap, uv: &UvMap) -> Self {
        let (w, h) = (f64::from(level.width), f64::from(level.height));
        let per_position = 1.0 / f64::from(1u32 << POSITION_BITS);
        let start = texel_of_uv(&level, wrap, uv.u[0], uv.v[0]);
        let x = Line { start: start.x, right: fixed(uv.u[1] * w * per_position), down: fixed(uv.u[2] * w * per_position) };
        let y = Line { start: start.y, right: fixed(-uv.v[1] * h * per_position), down: fixed(-uv.v[2] * h * per_position) };
        let repeats = |n: u32| if wrap == Wrap::Wrap { i64::from(n) << TEXEL_BITS } else { 0 };
        let period = TexelPoint { x: repeats(level.width), y: repeats(level.height) };
        Self { level, wrap, x, y, period }
    }

    /// Returns the texel coordinates of texture coordinates: those of the origin of a map that begins there.
    pub fn of_uv(&self, u: f64, v: f64) -> TexelPoint {
        self.reduce_to_first_period(texel_of_uv(&self.level, self.wrap, u, v))
    }

    /// Returns the texel coordinates of a position, in the first period of a texture that repeats.
    #[inline(always)]
    pub fn at(&self, x: i32, y: i32) -> TexelPoint {
        self.reduce_to_first_period(self.unwrapped_at(x, y))
    }

    /// Returns the texel coordinates of a position, in any period.
    #[inline(always)]
    pub fn unwrapped_at(&self, x: i32, y: i32) -> TexelPoint {
        TexelPoint { x: self.x.at(x, y), y: self.y.at(x, y) }
    }

    #[inline(always)]
    pub fn reduce_to_first_period(&self, t: TexelPoint) -> TexelPoint {
        TexelPoint { x: modulo_period(t.x, self.period.x), y: modulo_period(t.y, self.period.y) }
    }

    /// Returns the change of texel coordinates over a distance of positions.
    pub fn change(&self, x: i32, y: i32) -> TexelPoint {
        TexelPoint { x: self.x.change(x, y), y: self.y.change(x, y) }
    }

    /// Returns the change from a pixel to the next one on its right.
    #[inline(always)]
    pub fn pixel_change(&self) -> TexelPoint {
        TexelPoint { x: self.x.right << POSITION_BITS, y: self.y.right << POSITION_BITS }
    }

    /// Returns the alpha that a bilinear tap finds; `Mixed` at the edges of the texture.
    #[inline(always)]
    pub fn alpha_cell(&self, t: TexelPoint) -> AlphaCell {
        let (x, y) = (t.x >> TEXEL_BITS, t.y >> TEXEL_BITS);
        let (w, h) = (i64::from(self.level.width), i64::from(self.level.height));
        let is_inside = (x as u64) < (w - 1) as u64 && (y as u64) < (h - 1) as u64;
        if is_inside { self.level.alpha_cell(x as i32, y as i32) } else { AlphaCell::Mixed }
    }

    /// Returns the alpha that all bilinear taps between two corners of a rectangle find, where they have it in common and lie inside the texture; else
    /// `Mixed`. The corners are relative to a point of the first period.
    #[inline(always)]
    pub fn common_alpha_cell(&self, t: TexelPoint, [low, high]: [TexelPoint; 2]) -> AlphaCell {
        let (low, high) = (t.offset(low), t.offset(high));
        let (x, y) = ([low.x, high.x].map(|c| c >> TEXEL_BITS), [low.y, high.y].map(|c| c >> TEXEL_BITS));
        let is_inside = |[low, high]: [i64; 2], n: u32| low >= 0 && low <= high && high < i64::from(n) - 1;
        match is_inside(x, self.level.width) && is_inside(y, self.level.height) {
            true => self.level.common_alpha_cell(x.map(|c| c as i32), y.map(|c| c as i32)),
            false => AlphaCell::Mixed,
        }
    }

    /// Whether all taps around a point touch only texels that have a right and a lower neighbour.
    #[inline(always)]
    pub fn is_inside(&self, t: TexelPoint, taps: &TapExtent) -> bool {
        let inside = |t: i64, [least, greatest]: [i32; 2], n: u32| {
            let t = t >> TAP_SHIFT;
            t + i64::from(least) >= 0 && (t + i64::from(greatest)) >> TAP_POSITION_BITS < i64::from(n) - 1
        };
        inside(t.x, taps.x, self.level.width) && inside(t.y, taps.y, self.level.height)
    }

    /// Finds the texels and weights of a batch of taps around a point for which `is_inside` holds; elsewhere the result must not be used.
    #[inline(always)]
    pub fn resolve<A: TapAccumulator>(&self, batch: &TapBatch, t: TexelPoint, out: &mut ResolvedTaps) {
        let center = [(t.x >> TAP_SHIFT) as i32, (t.y >> TAP_SHIFT) as i32];
        A::resolve(&batch.x, &batch.y, center, self.level.layout, out);
        out.count = batch.count;
    }

    /// Adds a batch of resolved taps.
    #[inline(always)]
    pub fn accumulate<A: TapAccumulator>(&self, taps: &ResolvedTaps, sum: &mut A) {
        sum.add_batch(&self.level.texels, taps);
        sum.flush();
    }

    /// Returns a bilinear tap at any point.
    #[inline(always)]
    pub fn tap(&self, t: TexelPoint) -> Tap {
        let fraction = |t: i64| (t >> (TEXEL_BITS - WEIGHT_BITS)) as u32 & (WEIGHT_ONE - 1);
        let (fx, fy) = (fraction(t.x), fraction(t.y));
        let (x, y) = (t.x >> TEXEL_BITS, t.y >> TEXEL_BITS);
        let (texels, is_outside) = match self.is_inside(t, &TapExtent::POINT) {
            true => (TexelQuad::at(&self.level.texels, self.level.layout.index(x as i32, y as i32) as usize), false),
            false if self.is_beyond_edges(t) => (TexelQuad::ZERO, true),
            false => (self.edge_quad([x, y]), false),
        };
        Tap { texels, weights: bilinear_weights(fx, fy), is_outside }
    }

    /// Whether the texture ends at its edges and a point lies beyond them.
    #[inline(never)]
    fn is_beyond_edges(&self, t: TexelPoint) -> bool {
        let is_beyond = |t: i64, n: u32| {
            let edges = [-(1 << (TEXEL_BITS - 1)), (i64::from(n) << TEXEL_BITS) - (1 << (TEXEL_BITS - 1))];
            t < edges[0] - EDGE_TOLERANCE || t > edges[1] + EDGE_TOLERANCE
        };
        matches!(self.wrap, Wrap::Border | Wrap::None) && (is_beyond(t.x, self.level.width) || is_beyond(t.y, self.level.height))
    }

    /// Returns a texel with its right and lower neighbours as the wrap mode continues the texture. Beyond the edges of a texture that ends there, its last texels
    /// repeat, so that a tap within them takes in nothing from outside.
    #[inline(never)]
    fn edge_quad(&self, [ix, iy]: [i64; 2]) -> TexelQuad {
        let (w, h) = (self.level.width, self.level.height);
        let columns = [self.wrapped(ix, w), self.wrapped(ix.saturating_add(1), w)];
        let rows = [self.wrapped(iy, h), self.wrapped(iy.saturating_add(1), h)];
        let texel = |column: usize, row: usize| self.level.texel(columns[column], rows[row]);
        TexelQuad { upper: [texel(0, 0), texel(1, 0)], lower: [texel(0, 1), texel(1, 1)] }
    }

    /// `wrap_texel` without a division for texels near the texture.
    fn wrapped(&self, i: i64, n: u32) -> u32 {
        let size = i64::from(n);
        match self.wrap {
            Wrap::Wrap if i < 0 && i >= -size => (i + size) as u32,
            Wrap::Wrap if i >= size && i < 2 * size => (i - size) as u32,
            wrap => wrap_texel(i, n, wrap).unwrap_or(i.clamp(0, size - 1) as u32),
        }
    }
}

/// Reduces to [0, period); a period of 0 leaves the coordinate as it is.
#[inline(always)]
fn modulo_period(t: i64, period: i64) -> i64 {
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

/// Returns the texel coordinates of texture coordinates, less whole periods so that they stay small.
fn texel_of_uv(level: &Level, wrap: Wrap, u: f64, v: f64) -> TexelPoint {
    let reduced = |c: f64| match wrap {
        Wrap::Wrap => c - c.floor(),
        Wrap::Mirror => c - 2.0 * (c / 2.0).floor(),
        _ => c,
    };
    let half_weight = 0.5 / f64::from(WEIGHT_ONE);
    let texel = |c: f64, n: u32| fixed(reduced(c) * f64::from(n) - 0.5 + half_weight);
    TexelPoint { x: texel(u, level.width), y: texel(1.0 - v, level.height) }
}
