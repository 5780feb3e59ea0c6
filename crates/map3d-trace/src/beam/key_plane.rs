//! The depth keys of a triangle over the pixels of a sub-tile: a trait for both projections, and the fixed-point plane of parallel ones.

use super::edges::COLUMNS;
use super::pixels::{PixelBox, SAMPLE_X, SAMPLE_Y};
use crate::depth_key::depth_bias;
use crate::lanes::Lanes;
use crate::projection::{DepthRange, depth_gradient};

/// Limit of the depth change of a triangle over its pixel box, in units. Steeper triangles take the exact path.
const DEPTH_CHANGE_MAX: f64 = (1 << 20) as f64;
/// Depths in units for which no key overflows, whatever its bias.
const SAFE_DEPTHS: std::ops::Range<f64> = 1024.0..4_294_966_000.0;

/// The affine depth key of a surface, evaluated at the pixel centres of its box:
/// `clamp((z0 + gx·(i − x0) + gy·(j − y0) + offset) >> shift, lo, hi) + base`.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(crate) struct DepthKeyPlane {
    /// From the pixel's centre to each sample.
    offsets: [i32; 16],
    z0: i32,
    gx: i32,
    gy: i32,
    x0: i32,
    y0: i32,
    shift: u32,
    lo: i32,
    hi: i32,
    base: i32,
    /// Bounds of `offsets`.
    offset_lo: i32,
    offset_hi: i32,
}

/// The depth keys of one surface over pixels. `Values` are numbers of 16 pixels or samples from which the keys follow.
pub(crate) trait KeyPlane: Copy + Default {
    type Values<L: Lanes>: Copy;

    /// Returns the change of the values from the first pixel of a span to each of its pixels.
    fn along<L: Lanes>(&self) -> Self::Values<L>;

    /// Returns the values at the centres of the 16 pixels from (i, j) on.
    fn span<L: Lanes>(&self, along: Self::Values<L>, i: i32, j: i32) -> Self::Values<L>;

    /// Returns a lower bound of the keys of each pixel's samples.
    fn least<L: Lanes>(&self, span: Self::Values<L>) -> L;

    /// Returns an upper bound of the keys of each pixel's samples.
    fn greatest<L: Lanes>(&self, span: Self::Values<L>) -> L;

    /// Returns the keys of the 16 samples of pixel (i, j).
    fn sample_keys<L: Lanes>(&self, i: i32, j: i32) -> L;

    /// Returns a lower bound of the keys of pixel (i, j).
    fn near_key(&self, i: i32, j: i32) -> i32;

    /// Returns an upper bound of the keys of pixel (i, j).
    fn far_key(&self, i: i32, j: i32) -> i32;
}

impl DepthKeyPlane {
    /// Returns the fixed-point value at the centre of pixel (i, j).
    #[inline(always)]
    fn center(&self, i: i32, j: i32) -> i32 {
        let across = self.gx.wrapping_mul(i - self.x0);
        self.z0.wrapping_add(across).wrapping_add(self.gy.wrapping_mul(j - self.y0))
    }

    /// Converts a fixed-point value to a key. A key fits int32, but `base` alone may not where the plane leaves the range of depths before the triangle
    /// ends: the sum therefore wraps.
    #[inline(always)]
    fn key(&self, fixed: i32) -> i32 {
        (fixed >> self.shift).max(self.lo).min(self.hi).wrapping_add(self.base)
    }

    /// Converts fixed-point values to keys.
    #[inline(always)]
    fn keys<L: Lanes>(&self, fixed: L) -> L {
        fixed.shift_right(self.shift).max(L::splat(self.lo)).min(L::splat(self.hi)).add(L::splat(self.base))
    }
}

impl KeyPlane for DepthKeyPlane {
    type Values<L: Lanes> = L;

    #[inline(always)]
    fn along<L: Lanes>(&self) -> L {
        L::load(&COLUMNS).mul(L::splat(self.gx))
    }

    #[inline(always)]
    fn span<L: Lanes>(&self, along: L, i: i32, j: i32) -> L {
        L::splat(self.center(i, j)).add(along)
    }

    #[inline(always)]
    fn least<L: Lanes>(&self, span: L) -> L {
        self.keys(span.add(L::splat(self.offset_lo)))
    }

    #[inline(always)]
    fn greatest<L: Lanes>(&self, span: L) -> L {
        self.keys(span.add(L::splat(self.offset_hi)))
    }

    #[inline(always)]
    fn sample_keys<L: Lanes>(&self, i: i32, j: i32) -> L {
        self.keys(L::splat(self.center(i, j)).add(L::load(&self.offsets)))
    }

    #[inline(always)]
    fn near_key(&self, i: i32, j: i32) -> i32 {
        self.key(self.center(i, j).wrapping_add(self.offset_lo))
    }

    #[inline(always)]
    fn far_key(&self, i: i32, j: i32) -> i32 {
        self.key(self.center(i, j).wrapping_add(self.offset_hi))
    }
}

/// The depth of a triangle over pixels, and its bias in the visibility rule.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TriangleDepth {
    gradient: [f64; 2],
    range: DepthRange,
    pub bias: i64,
}

impl TriangleDepth {
    /// `pixel_units`: depth units in a pixel's width and height. Returns `None` for a triangle seen edge-on.
    #[inline(always)]
    pub fn new(pixel: &[[f64; 3]; 3], rank: u8, pixel_units: [f64; 2]) -> Option<Self> {
        let gradient = depth_gradient(pixel)?;
        Some(Self { gradient, range: DepthRange::of(pixel), bias: depth_bias(gradient, rank, pixel_units) })
    }
}

/// The way in which the depth keys of a triangle are computed.
pub(crate) enum KeySetup {
    Plane(DepthKeyPlane),
    /// In the whole box the plane is far from the triangle's own depths: the triangle covers no sample there.
    Outside,
    /// The plane is too steep for fixed point.
    Exact,
}

impl KeySetup {
    /// Computes the fixed-point plane over a box of pixels.
    #[inline(always)]
    pub fn new<L: Lanes>(pixel: &[[f64; 3]; 3], depth: &TriangleDepth, pixels: &PixelBox) -> Self {
        // Reject planes that do not fit 32 bits.
        let [gx, gy] = depth.gradient;
        let (ax, ay) = (gx.abs(), gy.abs());
        let change = ax * f64::from(pixels.width()) + ay * f64::from(pixels.height()) + 1.0;
        if !(change < DEPTH_CHANGE_MAX && SAFE_DEPTHS.contains(&depth.range.lo) && SAFE_DEPTHS.contains(&depth.range.hi)) {
            return Self::Exact;
        }

        // Reject planes that miss the triangle's depths in the whole box.
        let first = pixel[0][2] + gx * (f64::from(pixels.x0) + 0.5 - pixel[0][0]) + gy * (f64::from(pixels.y0) + 0.5 - pixel[0][1]);
        let margin = change + ax + ay + 2.0;
        if first < depth.range.lo - margin || first > depth.range.hi + margin {
            return Self::Outside;
        }

        // Choose as many fractional bits as the change over the box allows.
        let shift = (28 - exponent(change)).clamp(8, 14);
        let scale = f64::from(1u32 << shift);
        let fixed = |v: f64| (v * scale + 0.5).floor() as i32;
        let (gx, gy) = (fixed(gx), fixed(gy));

        // Offsets from the pixel's centre to its samples, and their bounds.
        let (sx, sy) = (gx >> 4, gy >> 4);
        let offsets = L::load(&CENTERED_X).mul(L::splat(sx)).add(L::load(&CENTERED_Y).mul(L::splat(sy)));
        let mut lanes = [0; 16];
        offsets.store(&mut lanes);
        let side = sx.abs() * 8 + sy.abs() * 8;

        // Depths relative to the whole units at the first pixel.
        let whole = first.floor();
        let rounded = |v: f64| (v + 0.5).floor() as i64 - whole as i64;
        const LIMIT: i64 = 1 << 30;
        Self::Plane(DepthKeyPlane {
            offsets: lanes,
            // Half a unit more, so that the shift rounds to the nearest.
            z0: fixed(first - whole) + (1 << (shift - 1)),
            gx,
            gy,
            x0: pixels.x0,
            y0: pixels.y0,
            shift: shift as u32,
            lo: rounded(depth.range.lo).clamp(-LIMIT, LIMIT) as i32,
            hi: rounded(depth.range.hi).clamp(-LIMIT, LIMIT) as i32,
            base: (whole as i64 - depth.bias - (1 << 31)) as i32,
            offset_lo: -side,
            offset_hi: side,
        })
    }
}

/// Returns the least e with v < 2^e, for v ≥ 1.
#[inline(always)]
fn exponent(v: f64) -> i32 {
    (v.to_bits() >> 52) as i32 - 1022
}

const fn from_center(positions: [i32; 16]) -> [i32; 16] {
    let mut out = positions;
    let mut k = 0;
    while k < 16 {
        out[k] -= 8;
        k += 1;
    }
    out
}

/// Sample positions in 1/16 pixel from a pixel's centre.
const CENTERED_X: [i32; 16] = from_center(SAMPLE_X);
const CENTERED_Y: [i32; 16] = from_center(SAMPLE_Y);
