//! The depth of one surface over the pixels of a sub-tile, for shaders that evaluate it pixel by pixel.

use map3d_base::{DEPTH_NOTHING, DEPTH_UNITS_PER_M, Projection, Vec3};

use crate::perspective::{Linear, at, depth_range, homogeneous, inverse_depth};
use crate::projection::{DepthRange, SubtileProjection, depth_gradient, each_corner};

/// Depth units over the pixel coordinates of a sub-tile, clamped to the triangle's range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DepthPlane {
    Parallel(AffineDepth),
    Perspective(PerspectiveDepth),
}

/// An affine depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AffineDepth {
    corner: Vec3,
    gradient: [f64; 2],
    range: DepthRange,
}

/// A depth whose inverse is affine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerspectiveDepth {
    inverse: Linear,
    range: DepthRange,
}

impl DepthPlane {
    /// Returns the plane of a triangle with local corners. `corner_px` is the sub-tile's top left pixel.
    pub fn of_corners(view: &Projection, corners: &[Vec3; 3], corner_px: [u64; 2]) -> Self {
        match view {
            Projection::Parallel(_) => {
                let projection = SubtileProjection { view, corner_px };
                Self::Parallel(AffineDepth::new(&each_corner(corners, |p| projection.project(p))))
            }
            Projection::Perspective(view) => {
                let p = each_corner(corners, |p| homogeneous(view, corner_px, p));
                Self::of_homogeneous(&p, inverse_depth(&p), view.near_m * DEPTH_UNITS_PER_M)
            }
        }
    }

    /// Returns the plane of a triangle with homogeneous corners and its `inverse_depth`; nothing nearer than `near` units is drawn.
    pub(crate) fn of_homogeneous(p: &[Vec3; 3], inverse: Option<Linear>, near: f64) -> Self {
        let range = depth_range(p, near);
        Self::Perspective(PerspectiveDepth { inverse: inverse.unwrap_or([0.0, 0.0, 1.0 / range.lo]), range })
    }

    /// Returns the depth at the centre of pixel (i, j) in whole units, equal to `VisBuf::depth`.
    #[inline(always)]
    pub fn units(&self, i: usize, j: usize) -> u32 {
        round_to_units(self.at(i as f64 + 0.5, j as f64 + 0.5))
    }

    /// Returns the depth in units, not rounded, at (x, y) in pixels from the sub-tile's corner.
    #[inline(always)]
    pub fn at(&self, x: f64, y: f64) -> f64 {
        match self {
            Self::Parallel(depth) => depth.at(x, y),
            Self::Perspective(depth) => depth.at(x, y),
        }
    }

    /// Writes `units` of a row of pixels that starts at (i, j).
    #[inline(always)]
    pub fn row(&self, i: usize, j: usize, out: &mut [u32]) {
        match self {
            Self::Parallel(depth) => depth.row(i, j, out),
            Self::Perspective(depth) => {
                for (k, units) in out.iter_mut().enumerate() {
                    *units = round_to_units(depth.at((i + k) as f64 + 0.5, j as f64 + 0.5));
                }
            }
        }
    }
}

impl AffineDepth {
    pub(crate) fn new(pixel: &[Vec3; 3]) -> Self {
        let range = DepthRange::of(pixel);
        match depth_gradient(pixel) {
            Some(gradient) => Self { corner: pixel[0], gradient, range },
            None => Self { corner: [0.0, 0.0, range.lo], gradient: [0.0; 2], range },
        }
    }

    /// Returns the depth in units, not rounded, at (x, y) in pixels from the sub-tile's corner.
    #[inline(always)]
    pub fn at(&self, x: f64, y: f64) -> f64 {
        self.range.clamp(self.corner[2] + self.gradient[0] * (x - self.corner[0]) + self.gradient[1] * (y - self.corner[1]))
    }

    #[inline(always)]
    fn row(&self, i: usize, j: usize, out: &mut [u32]) {
        let dy = j as f64 + 0.5 - self.corner[1];
        for (k, units) in out.iter_mut().enumerate() {
            let dx = (i + k) as f64 + 0.5 - self.corner[0];
            *units = round_to_units(self.range.clamp(self.corner[2] + self.gradient[0] * dx + self.gradient[1] * dy));
        }
    }
}

impl PerspectiveDepth {
    #[inline(always)]
    fn at(&self, x: f64, y: f64) -> f64 {
        let w = at(&self.inverse, x, y);
        // Beyond the plane's horizon, the plane is behind the camera.
        if w > 0.0 { self.range.clamp(1.0 / w) } else { self.range.hi }
    }
}

/// Rounds to the nearest unit, never to `DEPTH_NOTHING`.
#[inline(always)]
fn round_to_units(depth: f64) -> u32 {
    // For a value that is not negative, truncation rounds down.
    (depth + 0.5).max(0.0).min(f64::from(DEPTH_NOTHING - 1)) as i64 as u32
}
