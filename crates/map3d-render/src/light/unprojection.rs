//! The position of a sub-tile, and the local points of its pixels.

use map3d_base::{DEPTH_UNITS_PER_M, Frame, Vec3, ViewAxes};
use map3d_trace::{DepthPlane, SUBTILE_PX};

/// A sub-tile's first pixel in its tile and in the view.
#[derive(Clone, Copy)]
pub struct SubtilePosition {
    /// Left and top in the G-buffer.
    pub in_tile: (usize, usize),
    /// The same pixel at level zmax, from the square's top left corner.
    pub in_view: [u64; 2],
}

impl SubtilePosition {
    /// Returns the index of pixel (i, j) of the sub-tile in a G-buffer of a width.
    pub fn index(&self, width: u32, i: usize, j: usize) -> usize {
        (self.in_tile.1 + j) * width as usize + self.in_tile.0 + i
    }
}

/// x, y and z of up to a row of points.
pub(super) type PointRow = [[f64; SUBTILE_PX]; 3];

/// Maps pixels of a sub-tile and depths to local points.
pub(super) struct Unprojection {
    axes: ViewAxes,
    origin_m: [f64; 3],
    pixel_m: f64,
    corner_px: [f64; 2],
}

impl Unprojection {
    pub fn new(frame: &Frame, axes: ViewAxes, position: SubtilePosition) -> Self {
        let corner_px = position.in_view.map(|v| v as f64);
        Self { axes, origin_m: [frame.u0_m, frame.v0_m, frame.d0_m], pixel_m: frame.pixel_m(frame.zmax), corner_px }
    }

    /// Returns the local point of a surface at (x, y) in pixels from the sub-tile's corner.
    #[inline(always)]
    pub fn point(&self, x: f64, y: f64, depth: &DepthPlane) -> Vec3 {
        let u = self.origin_m[0] + (self.corner_px[0] + x) * self.pixel_m;
        let v = self.origin_m[1] - (self.corner_px[1] + y) * self.pixel_m;
        let d = self.origin_m[2] + depth.at(x, y) / DEPTH_UNITS_PER_M;
        let (r, up, f) = (&self.axes.right, &self.axes.up, &self.axes.forward);
        [r[0] * u + up[0] * v + f[0] * d, r[1] * u + up[1] * v + f[1] * d, r[2] * u + up[2] * v + f[2] * d]
    }

    /// Writes the local points of a surface at the centres of `count` pixels of a row that starts at (i, j).
    #[inline(always)]
    pub fn row(&self, [i, j]: [usize; 2], count: usize, depth: &DepthPlane, out: &mut PointRow) {
        let y = j as f64 + 0.5;
        let count = count.min(SUBTILE_PX);
        for k in 0..count {
            let [px, py, pz] = self.point((i + k) as i32 as f64 + 0.5, y, depth);
            (out[0][k], out[1][k], out[2][k]) = (px, py, pz);
        }
    }
}
