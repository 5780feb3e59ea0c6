//! The depth of one surface over the pixels of a sub-tile, for shaders that ask it pixel by pixel.

use map3d_base::{DEPTH_NOTHING, Frame, Vec3, ViewAxes};

use crate::beam::project::{Projection, depth_gradient, depth_range};

/// Depth units from D0 over pixel coordinates of the sub-tile: affine, clamped to the triangle's range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthPlane {
    corner: Vec3,
    gradient: [f64; 2],
    range: (f64, f64),
}

impl DepthPlane {
    /// Of a triangle with local corners, over the pixels of level zmax right and down of `corner_px`.
    pub fn of_corners(frame: &Frame, axes: &ViewAxes, corners: &[Vec3; 3], corner_px: [u64; 2]) -> Self {
        let projection = Projection { frame, axes, corner_px };
        Self::new(&corners.map(|p| projection.pixel(p)))
    }

    pub(crate) fn new(pixel: &[Vec3; 3]) -> Self {
        let range = depth_range(pixel);
        match depth_gradient(pixel) {
            Some(gradient) => Self { corner: pixel[0], gradient, range },
            None => Self { corner: [0.0, 0.0, range.0], gradient: [0.0; 2], range },
        }
    }

    /// Depth at the centre of pixel (i, j), in whole units: the same as `VisBuf::depth`.
    #[inline(always)]
    pub fn units(&self, i: usize, j: usize) -> u32 {
        let (dx, dy) = (i as f64 + 0.5 - self.corner[0], j as f64 + 0.5 - self.corner[1]);
        let plane = self.corner[2] + self.gradient[0] * dx + self.gradient[1] * dy;
        units_of(plane.clamp(self.range.0, self.range.1))
    }

    /// Depth in units, not rounded, at (x, y) in pixels from the sub-tile's corner.
    #[inline(always)]
    pub fn at(&self, x: f64, y: f64) -> f64 {
        let plane = self.corner[2] + self.gradient[0] * (x - self.corner[0]) + self.gradient[1] * (y - self.corner[1]);
        plane.clamp(self.range.0, self.range.1)
    }

    /// `units` of a row of pixels, the first of which is (i, j).
    #[inline(always)]
    pub fn row(&self, i: usize, j: usize, out: &mut [u32]) {
        let dy = j as f64 + 0.5 - self.corner[1];
        for (k, units) in out.iter_mut().enumerate() {
            let dx = (i + k) as f64 + 0.5 - self.corner[0];
            let plane = self.corner[2] + self.gradient[0] * dx + self.gradient[1] * dy;
            *units = units_of(plane.clamp(self.range.0, self.range.1));
        }
    }
}

/// To the nearest whole unit, never `DEPTH_NOTHING`.
#[inline(always)]
fn units_of(depth: f64) -> u32 {
    // Not negative, so cutting off is rounding down.
    (depth + 0.5).max(0.0).min(f64::from(DEPTH_NOTHING - 1)) as i64 as u32
}
