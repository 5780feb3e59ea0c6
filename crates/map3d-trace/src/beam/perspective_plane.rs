//! The depth keys of a triangle in perspective: 1/z is affine over pixels, in float32; depth and bias follow for each sample by the visibility rule
//! (spec/pyramid.md §4, spec/cameras.md §3).

use super::key_plane::KeyPlane;
use super::pixels::{PixelBox, SAMPLE_X, SAMPLE_Y};
use crate::depth_key::{BIAS_UNITS, STEEPNESS_MAX, UNBIASED_RANK};
use crate::lanes::{Floats, Lanes};
use crate::perspective::{Linear, at};
use crate::projection::DepthRange;

/// Least distance of a plane from the camera for its bias, in units; nearer ones take the bias of this distance, so that keys grow with depth.
const PLANE_DISTANCE_MIN: f64 = 16.0;
/// More than the relative error of a depth in float32.
const DEPTH_ERROR: f32 = 1.0 / (1 << 20) as f32;
/// Makes a bias positive before it is truncated.
const POSITIVE: f32 = 128.0;

/// `z = 1 / clamp(w + gx·(i − x0) + gy·(j − y0) + offset, lo, hi)`; key: `round(z) − round(min(z·steepness, 16)·bias) − 2^31`.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(crate) struct PerspectiveKeyPlane {
    /// From the pixel's centre to each sample.
    offsets: [f32; 16],
    w: f32,
    gx: f32,
    gy: f32,
    x0: i32,
    y0: i32,
    /// Bounds of 1/z.
    lo: f32,
    hi: f32,
    /// Greatest of `offsets`; the least is its opposite.
    offset: f32,
    /// Bias in units of a surface that faces the camera; 0 for walls and roofs.
    bias: f32,
    /// 1/|n·d| of a surface at a depth of one unit.
    steepness: f32,
}

impl PerspectiveKeyPlane {
    /// `inverse`: 1/z over the pixels of the sub-tile, `None` for a triangle seen edge-on, which has the depth of its nearest corner. `plane_distance`: the
    /// distance of its plane from the camera in units.
    #[inline(always)]
    pub fn new(inverse: Option<Linear>, range: &DepthRange, plane_distance: f64, rank: u8, pixels: &PixelBox) -> Self {
        let (lo, hi) = ((1.0 / range.hi) as f32, (1.0 / range.lo) as f32);
        let inverse = inverse.unwrap_or([0.0, 0.0, 1.0 / range.lo]);
        let (gx, gy) = (inverse[0] as f32, inverse[1] as f32);
        let mut offsets = [0.0; 16];
        for k in 0..16 {
            offsets[k] = (SAMPLE_X[k] - 8) as f32 / 16.0 * gx + (SAMPLE_Y[k] - 8) as f32 / 16.0 * gy;
        }
        Self {
            offsets,
            w: at(&inverse, f64::from(pixels.x0) + 0.5, f64::from(pixels.y0) + 0.5) as f32,
            gx,
            gy,
            x0: pixels.x0,
            y0: pixels.y0,
            lo,
            hi,
            offset: 0.5 * (gx.abs() + gy.abs()),
            bias: ((f64::from(rank) - UNBIASED_RANK) * BIAS_UNITS) as f32,
            steepness: (1.0 / plane_distance.max(PLANE_DISTANCE_MIN)) as f32,
        }
    }

    #[inline(always)]
    fn center(&self, i: i32, j: i32) -> f32 {
        self.w + self.gx * (i - self.x0) as f32 + self.gy * (j - self.y0) as f32
    }

    #[inline(always)]
    fn keys<L: Lanes>(&self, w: L::Floats16) -> L {
        let z = L::Floats16::splat(1.0).div(w.max(L::Floats16::splat(self.lo)).min(L::Floats16::splat(self.hi)));
        let units = L::truncated(z.add(L::Floats16::splat(0.5)));
        if self.bias == 0.0 {
            return units.max(L::splat(0)).add(L::splat(i32::MIN));
        }
        let steepness = z.mul(L::Floats16::splat(self.steepness)).min(L::Floats16::splat(STEEPNESS_MAX as f32));
        let bias = L::truncated(steepness.mul(L::Floats16::splat(self.bias)).add(L::Floats16::splat(POSITIVE + 0.5)));
        units.add(L::splat(POSITIVE as i32)).sub(bias).max(L::splat(0)).add(L::splat(i32::MIN))
    }

    /// Returns the same as `keys` for one value.
    #[inline(always)]
    fn key(&self, w: f32) -> i32 {
        let z = 1.0 / (if w > self.lo { w } else { self.lo }).min(self.hi);
        let steepness = (z * self.steepness).min(STEEPNESS_MAX as f32);
        let bias = (steepness * self.bias + (POSITIVE + 0.5)) as i32;
        ((z + 0.5) as i32 + POSITIVE as i32 - bias).max(0).wrapping_add(i32::MIN)
    }
}

impl KeyPlane for PerspectiveKeyPlane {
    type Values<L: Lanes> = L::Floats16;

    #[inline(always)]
    fn along<L: Lanes>(&self) -> L::Floats16 {
        const COLUMNS: [f32; 16] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];
        L::Floats16::load(&COLUMNS).mul(L::Floats16::splat(self.gx))
    }

    #[inline(always)]
    fn span<L: Lanes>(&self, along: L::Floats16, i: i32, j: i32) -> L::Floats16 {
        L::Floats16::splat(self.center(i, j)).add(along)
    }

    #[inline(always)]
    fn least<L: Lanes>(&self, span: L::Floats16) -> L {
        let w = span.add(L::Floats16::splat(self.offset));
        self.keys::<L>(w.add(w.mul(L::Floats16::splat(DEPTH_ERROR)))).max(L::splat(i32::MIN + 1)).add(L::splat(-1))
    }

    #[inline(always)]
    fn greatest<L: Lanes>(&self, span: L::Floats16) -> L {
        let w = span.sub(L::Floats16::splat(self.offset));
        self.keys::<L>(w.sub(w.mul(L::Floats16::splat(DEPTH_ERROR)))).add(L::splat(1))
    }

    #[inline(always)]
    fn sample_keys<L: Lanes>(&self, i: i32, j: i32) -> L {
        self.keys::<L>(L::Floats16::splat(self.center(i, j)).add(L::Floats16::load(&self.offsets)))
    }

    #[inline(always)]
    fn near_key(&self, i: i32, j: i32) -> i32 {
        let most = self.center(i, j) + self.offset;
        self.key(most + most * DEPTH_ERROR).max(i32::MIN + 1) - 1
    }

    #[inline(always)]
    fn far_key(&self, i: i32, j: i32) -> i32 {
        let least = self.center(i, j) - self.offset;
        self.key(least - least * DEPTH_ERROR) + 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Scalar;

    fn keys(plane: &PerspectiveKeyPlane, i: i32, j: i32) -> [i32; 16] {
        let mut out = [0; 16];
        plane.sample_keys::<Scalar>(i, j).store(&mut out);
        out
    }

    #[test]
    fn keys_are_depth_less_bias_within_their_bounds() {
        let pixels = PixelBox { x0: 3, y0: 5, x1: 40, y1: 60 };
        for (rank, distance) in [(3, 5_000.0), (0, 40_000.0), (5, 300.0), (1, 0.0)] {
            let inverse = [1e-8, -3e-8, 1.0 / 100_000.0];
            let plane = PerspectiveKeyPlane::new(Some(inverse), &DepthRange { lo: 90_000.0, hi: 140_000.0 }, distance, rank, &pixels);
            for (i, j) in [(3, 5), (40, 60), (20, 31)] {
                let (near, far) = (plane.near_key(i, j), plane.far_key(i, j));
                for (k, key) in keys(&plane, i, j).into_iter().enumerate() {
                    let (x, y) = (f64::from(i) + f64::from(SAMPLE_X[k]) / 16.0, f64::from(j) + f64::from(SAMPLE_Y[k]) / 16.0);
                    let z = (1.0 / at(&inverse, x, y)).clamp(90_000.0, 140_000.0);
                    let bias = (f64::from(rank) - 3.0) * 2.0 * (z / distance.max(16.0)).min(16.0);
                    let expected = (z + 0.5).floor() - (bias + 0.5).floor();
                    assert!((f64::from(key) + 2f64.powi(31) - expected).abs() <= 1.0, "rank {rank} ({i}, {j}) {k}: {key} {expected}");
                    assert!((near..=far).contains(&key));
                }
            }
        }
    }

    #[test]
    fn spans_bound_the_keys_of_their_pixels() {
        let pixels = PixelBox { x0: 0, y0: 0, x1: 63, y1: 63 };
        let plane = PerspectiveKeyPlane::new(Some([4e-7, 2e-6, 1e-5]), &DepthRange { lo: 2_000.0, hi: 90_000.0 }, 1_500.0, 0, &pixels);
        let span = plane.span::<Scalar>(plane.along::<Scalar>(), 16, 9);
        let (mut least, mut greatest) = ([0; 16], [0; 16]);
        plane.least::<Scalar>(span).store(&mut least);
        plane.greatest::<Scalar>(span).store(&mut greatest);
        for c in 0..16 {
            assert!(keys(&plane, 16 + c as i32, 9).iter().all(|key| (least[c]..=greatest[c]).contains(key)));
        }
    }
}
