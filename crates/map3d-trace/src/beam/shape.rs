//! A triangle made ready for a sub-tile: its box of pixels, three integer edges, and its key as a fixed-point plane.

use map3d_base::samples::SAMPLES;

use super::buffer::KeyPlane;
use super::project::{depth_gradient, depth_range};
use crate::lanes::Lanes;
use crate::visbuf::SUBTILE_PX;

/// Corners farther from the sub-tile than this many lattice steps take the exact slow path.
pub(crate) const REACH_STEPS: f64 = (1 << 24) as f64;
/// Depth that a triangle may change by within a sub-tile, in units, on the fast path.
const DEPTH_REACH: f64 = (1 << 20) as f64;
/// Bias in units per rank above that of walls and roofs.
const BIAS_UNITS: f64 = 2.0;
/// Rank of walls, roofs and all that is nothing else: most of a city, and never moved.
const RANK_AT_REST: f64 = 3.0;
const STEEPEST: f64 = 16.0;
/// Depths in units for which no key overflows, whatever its bias.
const DEPTHS: std::ops::Range<f64> = 1024.0..4_294_966_000.0;
/// No bias is greater.
pub(crate) const BIAS_MAX: i64 = (5 - 3) * 2 * 16;

const fn sample_lanes(axis: usize) -> [i32; 16] {
    let mut out = [0; 16];
    let mut k = 0;
    while k < 16 {
        out[k] = if axis == 0 { SAMPLES[k].0 as i32 } else { SAMPLES[k].1 as i32 };
        k += 1;
    }
    out
}

pub(crate) const SAMPLE_X: [i32; 16] = sample_lanes(0);
pub(crate) const SAMPLE_Y: [i32; 16] = sample_lanes(1);

/// Pixels of a sub-tile, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PixelBox {
    pub x0: i32,
    pub y0: i32,
    pub x1: i32,
    pub y1: i32,
}

impl PixelBox {
    /// Pixels with a sample inside the box of the snapped corners; `None` when there are none in the sub-tile.
    #[inline(always)]
    pub fn of(s: &[[i64; 2]; 3]) -> Option<Self> {
        let lo = |k: usize| s[0][k].min(s[1][k]).min(s[2][k]);
        let hi = |k: usize| s[0][k].max(s[1][k]).max(s[2][k]);
        let first = |k: usize| ((lo(k) + 15) >> 8).max(0);
        let last = |k: usize| (hi(k) >> 8).min(SUBTILE_PX as i64 - 1);
        let (x0, y0, x1, y1) = (first(0), first(1), last(0), last(1));
        (x0 <= x1 && y0 <= y1).then_some(Self { x0: x0 as i32, y0: y0 as i32, x1: x1 as i32, y1: y1 as i32 })
    }
}

/// Edge function in sixteenths: `at + x·i + y·j + offsets[sample]` ≥ 0 where the sample of pixel (i, j) is inside. Exact.
#[derive(Clone, Copy)]
pub(crate) struct Edge<L> {
    pub at: i64,
    pub x: i64,
    pub y: i64,
    pub offsets: L,
    /// Bounds of `offsets`.
    pub lo: i32,
    pub hi: i32,
}

/// Twice the signed area in square steps; positive when the corners run clockwise on the screen.
#[inline(always)]
pub(crate) fn area2(s: &[[i64; 2]; 3]) -> i128 {
    let e = |k: usize, axis: usize| i128::from(s[k][axis] - s[0][axis]);
    e(1, 0) * e(2, 1) - e(1, 1) * e(2, 0)
}

impl<L: Lanes> Edge<L> {
    /// From a to b with the inside on the right-hand side of the screen; the top-left rule is a bias of one.
    #[inline(always)]
    fn new(a: [i64; 2], b: [i64; 2]) -> Self {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let top_left = dy < 0 || (dy == 0 && dx > 0);
        let at_corner = dy * a[0] - dx * a[1] - i64::from(!top_left);
        let (kx, ky) = (-dy as i32, dx as i32);
        let offsets = L::load(&SAMPLE_X).mul(L::splat(kx)).add(L::load(&SAMPLE_Y).mul(L::splat(ky)));
        // Every lattice column and row holds a sample, so these bounds are near the true ones, and safe.
        let (lo, hi) = (15 * (kx.min(0) + ky.min(0)), 15 * (kx.max(0) + ky.max(0)));
        Self { at: at_corner >> 4, x: -dy * 16, y: dx * 16, offsets, lo, hi }
    }

    /// Values at the samples of a pixel.
    #[inline(always)]
    pub fn samples(&self, i: i32, j: i32) -> L {
        L::splat(self.corner(i, j)).add(self.offsets)
    }

    /// Value at the top left corner of a pixel, limited so that adding offsets neither overflows nor changes sign.
    #[inline(always)]
    fn corner(&self, i: i32, j: i32) -> i32 {
        const LIMIT: i64 = 1 << 30;
        (self.at + self.x * i64::from(i) + self.y * i64::from(j)).clamp(-LIMIT, LIMIT) as i32
    }
}

/// The three edges of a triangle whose corners are within `REACH_STEPS`; `None` without area.
#[inline(always)]
pub(crate) fn edges<L: Lanes>(s: &[[i64; 2]; 3]) -> Option<[Edge<L>; 3]> {
    let e = |k: usize, axis: usize| s[k][axis] - s[0][axis];
    let area = e(1, 0) * e(2, 1) - e(1, 1) * e(2, 0);
    if area == 0 {
        return None;
    }
    let (b, c) = if area > 0 { (s[1], s[2]) } else { (s[2], s[1]) };
    Some([Edge::new(s[0], b), Edge::new(b, c), Edge::new(c, s[0])])
}

/// What the winner rule needs of a triangle's depth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Depth {
    pub gradient: [f64; 2],
    pub lo: f64,
    pub hi: f64,
    pub bias: i64,
}

impl Depth {
    /// `pixel_units`: depth units in a pixel's side. `None`: seen edge-on.
    #[inline(always)]
    pub fn of(pixel: &[[f64; 3]; 3], rank: u8, pixel_units: f64) -> Option<Self> {
        let gradient = depth_gradient(pixel)?;
        let (lo, hi) = depth_range(pixel);
        Some(Self { gradient, lo, hi, bias: bias(gradient, rank, pixel_units) })
    }
}

/// `round((rank − 3)·b/max(|n·d|, 1/16))`; |n·d| follows from the gradient.
#[inline(always)]
pub(crate) fn bias(gradient: [f64; 2], rank: u8, pixel_units: f64) -> i64 {
    let above = f64::from(rank) - RANK_AT_REST;
    if above == 0.0 {
        return 0;
    }
    let slope = [gradient[0] / pixel_units, gradient[1] / pixel_units];
    let steep = (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt().min(STEEPEST);
    (above * BIAS_UNITS * steep + 0.5).floor() as i64
}

/// How a triangle's keys are found.
pub(crate) enum Keys {
    Plane(KeyPlane),
    /// Its plane nowhere in the box comes near the triangle's own depths: it covers nothing there.
    Nowhere,
    /// Too steep for fixed point.
    Exact,
}

/// The fixed-point key plane over a box of pixels.
#[inline(always)]
pub(crate) fn key_plane<L: Lanes>(pixel: &[[f64; 3]; 3], depth: &Depth, b: &PixelBox) -> Keys {
    let [gx, gy] = depth.gradient;
    let (ax, ay) = (gx.abs(), gy.abs());
    let reach = ax * f64::from(b.x1 - b.x0 + 1) + ay * f64::from(b.y1 - b.y0 + 1) + 1.0;
    if !(reach < DEPTH_REACH && DEPTHS.contains(&depth.lo) && DEPTHS.contains(&depth.hi)) {
        return Keys::Exact;
    }
    let first = pixel[0][2] + gx * (f64::from(b.x0) + 0.5 - pixel[0][0]) + gy * (f64::from(b.y0) + 0.5 - pixel[0][1]);
    let room = reach + ax + ay + 2.0;
    if first < depth.lo - room || first > depth.hi + room {
        return Keys::Nowhere;
    }
    let shift = (28 - exponent(reach)).clamp(8, 14);
    let scale = f64::from(1u32 << shift);
    let whole = first.floor();
    let fixed = |v: f64| (v * scale + 0.5).floor() as i32;
    let (gx, gy) = (fixed(gx), fixed(gy));
    let (sx, sy) = (gx >> 4, gy >> 4);
    let offsets = L::load(&CENTERED_X).mul(L::splat(sx)).add(L::load(&CENTERED_Y).mul(L::splat(sy)));
    let mut lanes = [0; 16];
    offsets.store(&mut lanes);
    let side = sx.abs() * 8 + sy.abs() * 8;
    let rounded = |v: f64| (v + 0.5).floor() as i64 - whole as i64;
    const LIMIT: i64 = 1 << 30;
    Keys::Plane(KeyPlane {
        offsets: lanes,
        // Half a unit more, so that shifting rounds to the nearest.
        z0: fixed(first - whole) + (1 << (shift - 1)),
        gx,
        gy,
        x0: b.x0,
        y0: b.y0,
        shift: shift as u32,
        lo: rounded(depth.lo).clamp(-LIMIT, LIMIT) as i32,
        hi: rounded(depth.hi).clamp(-LIMIT, LIMIT) as i32,
        base: (whole as i64 - depth.bias - (1 << 31)) as i32,
        offset_lo: -side,
        offset_hi: side,
    })
}

/// The least e with v < 2^e, for v ≥ 1.
#[inline(always)]
fn exponent(v: f64) -> i32 {
    (v.to_bits() >> 52) as i32 - 1022
}

const fn centered(from: [i32; 16]) -> [i32; 16] {
    let mut out = from;
    let mut k = 0;
    while k < 16 {
        out[k] -= 8;
        k += 1;
    }
    out
}

const CENTERED_X: [i32; 16] = centered(SAMPLE_X);
const CENTERED_Y: [i32; 16] = centered(SAMPLE_Y);

/// Snapped corners as whole numbers.
#[inline(always)]
pub(crate) fn whole_steps(snapped: &[[f64; 8]; 6], lane: usize) -> [[i64; 2]; 3] {
    [
        [snapped[0][lane] as i64, snapped[1][lane] as i64],
        [snapped[2][lane] as i64, snapped[3][lane] as i64],
        [snapped[4][lane] as i64, snapped[5][lane] as i64],
    ]
}

/// All corners are near enough for 32-bit edge offsets.
#[inline(always)]
pub(crate) fn is_near(s: &[[i64; 2]; 3]) -> bool {
    s.iter().flatten().all(|v| v.unsigned_abs() < REACH_STEPS as u64)
}
