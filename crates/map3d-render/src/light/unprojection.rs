//! The position of a sub-tile, and the local points of its pixels.

use map3d_base::{DEPTH_UNITS_PER_M, Projection, Vec3};
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
    view: Projection,
    corner_px: [f64; 2],
}

impl Unprojection {
    pub fn new(view: &Projection, position: SubtilePosition) -> Self {
        Self { view: *view, corner_px: position.in_view.map(|v| v as f64) }
    }

    /// Returns the local point of a surface at (x, y) in pixels from the sub-tile's corner.
    #[inline(always)]
    pub fn point(&self, x: f64, y: f64, depth: &DepthPlane) -> Vec3 {
        match (&self.view, depth) {
            (Projection::Parallel(view), DepthPlane::Parallel(depth)) => {
                let u = view.u0_m + (self.corner_px[0] + x) * view.pixel_m[0];
                let v = view.v0_m - (self.corner_px[1] + y) * view.pixel_m[1];
                let d = view.d0_m + depth.at(x, y) / DEPTH_UNITS_PER_M;
                let (r, up, f) = (&view.axes.right, &view.axes.up, &view.axes.forward);
                [r[0] * u + up[0] * v + f[0] * d, r[1] * u + up[1] * v + f[1] * d, r[2] * u + up[2] * v + f[2] * d]
            }
            (view, depth) => view.unproject([self.corner_px[0] + x, self.corner_px[1] + y, depth.at(x, y)]),
        }
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
