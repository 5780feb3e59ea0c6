//! The depth of one surface over the pixels of a sub-tile, for shaders that evaluate it pixel by pixel.

use map3d_base::{DEPTH_NOTHING, Frame, Vec3, ViewAxes};

use crate::projection::{DepthRange, SubtileProjection, depth_gradient};

/// Depth units from D0 over the pixel coordinates of a sub-tile: affine, clamped to the triangle's range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthPlane {
    corner: Vec3,
    gradient: [f64; 2],
    range: DepthRange,
}

impl DepthPlane {
    /// Returns the plane of a triangle with local corners. `corner_px` is the sub-tile's top left pixel of level zmax.
    pub fn of_corners(frame: &Frame, axes: &ViewAxes, corners: &[Vec3; 3], corner_px: [u64; 2]) -> Self {
        let projection = SubtileProjection { frame, axes, corner_px };
        Self::new(&corners.map(|p| projection.project(p)))
    }

    pub(crate) fn new(pixel: &[Vec3; 3]) -> Self {
        let range = DepthRange::of(pixel);
        match depth_gradient(pixel) {
            Some(gradient) => Self { corner: pixel[0], gradient, range },
            None => Self { corner: [0.0, 0.0, range.lo], gradient: [0.0; 2], range },
        }
    }

    /// Returns the depth at the centre of pixel (i, j) in whole units, equal to `VisBuf::depth`.
    #[inline(always)]
    pub fn units(&self, i: usize, j: usize) -> u32 {
        let (dx, dy) = (i as f64 + 0.5 - self.corner[0], j as f64 + 0.5 - self.corner[1]);
        round_to_units(self.range.clamp(self.corner[2] + self.gradient[0] * dx + self.gradient[1] * dy))
    }

    /// Returns the depth in units, not rounded, at (x, y) in pixels from the sub-tile's corner.
    #[inline(always)]
    pub fn at(&self, x: f64, y: f64) -> f64 {
        self.range.clamp(self.corner[2] + self.gradient[0] * (x - self.corner[0]) + self.gradient[1] * (y - self.corner[1]))
    }

    /// Writes `units` of a row of pixels that starts at (i, j).
    #[inline(always)]
    pub fn row(&self, i: usize, j: usize, out: &mut [u32]) {
        let dy = j as f64 + 0.5 - self.corner[1];
        for (k, units) in out.iter_mut().enumerate() {
            let dx = (i + k) as f64 + 0.5 - self.corner[0];
            *units = round_to_units(self.range.clamp(self.corner[2] + self.gradient[0] * dx + self.gradient[1] * dy));
        }
    }
}

/// Rounds to the nearest unit, never to `DEPTH_NOTHING`.
#[inline(always)]
fn round_to_units(depth: f64) -> u32 {
    // For a value that is not negative, truncation rounds down.
    (depth + 0.5).max(0.0).min(f64::from(DEPTH_NOTHING - 1)) as i64 as u32
}
