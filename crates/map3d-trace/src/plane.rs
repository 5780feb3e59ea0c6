//! The depth of one surface over the pixels of a sub-tile, for shaders that ask it pixel by pixel.

use map3d_base::{DEPTH_NOTHING, Vec3};

use crate::beam::project::{depth_gradient, depth_range};
use crate::visbuf::VisBuf;

/// Depth units from D0 over pixel coordinates of the sub-tile: affine, clamped to the triangle's range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthPlane {
    corner: Vec3,
    gradient: [f64; 2],
    range: (f64, f64),
}

impl DepthPlane {
    fn new(pixel: &[Vec3; 3]) -> Self {
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
        (plane.clamp(self.range.0, self.range.1) + 0.5).floor().clamp(0.0, f64::from(DEPTH_NOTHING - 1)) as u32
    }
}

impl VisBuf {
    /// The depth plane of a slot; set up once per surface, some 100 ns.
    pub fn depth_plane(&self, slot: u32) -> DepthPlane {
        DepthPlane::new(&self.placed_corners(slot))
    }
}
