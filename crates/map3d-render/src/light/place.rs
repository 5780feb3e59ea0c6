//! Where the pixels of a sub-tile lie: in its tile, and in space.

use map3d_base::{DEPTH_UNITS_PER_M, Frame, Vec3, ViewAxes};
use map3d_trace::{DepthPlane, SUBTILE_PX};

/// A sub-tile's place in its tile and in the view.
#[derive(Clone, Copy)]
pub struct Place {
    /// First pixel in the G-buffer: left, top.
    pub corner: (usize, usize),
    /// The same pixel of level zmax, from the square's top left corner.
    pub corner_px: [u64; 2],
}

impl Place {
    /// Index of pixel (i, j) of the sub-tile in the G-buffer.
    pub fn index(&self, width: u32, i: usize, j: usize) -> usize {
        (self.corner.1 + j) * width as usize + self.corner.0 + i
    }
}

/// x, y and z of up to a row of points.
pub(super) type Row = [[f64; SUBTILE_PX]; 3];

/// From the pixels of a sub-tile to local points.
pub(super) struct Locator {
    axes: ViewAxes,
    origin_m: [f64; 3],
    pixel_m: f64,
    corner_px: [f64; 2],
}

impl Locator {
    pub fn new(frame: &Frame, axes: ViewAxes, place: Place) -> Self {
        let corner_px = place.corner_px.map(|v| v as f64);
        Self { axes, origin_m: [frame.u0_m, frame.v0_m, frame.d0_m], pixel_m: frame.pixel_m(frame.zmax), corner_px }
    }

    /// Of a surface at (x, y) in pixels from the sub-tile's corner.
    #[inline(always)]
    pub fn at(&self, x: f64, y: f64, depth: &DepthPlane) -> Vec3 {
        let u = self.origin_m[0] + (self.corner_px[0] + x) * self.pixel_m;
        let v = self.origin_m[1] - (self.corner_px[1] + y) * self.pixel_m;
        let d = self.origin_m[2] + depth.at(x, y) / DEPTH_UNITS_PER_M;
        let (r, up, f) = (&self.axes.right, &self.axes.up, &self.axes.forward);
        [r[0] * u + up[0] * v + f[0] * d, r[1] * u + up[1] * v + f[1] * d, r[2] * u + up[2] * v + f[2] * d]
    }

    /// Of a surface at the centres of pixels of a row, the first of which is (i, j): the same as `at`.
    #[inline(always)]
    pub fn row(&self, [i, j]: [usize; 2], count: usize, depth: &DepthPlane, out: &mut Row) {
        let y = j as f64 + 0.5;
        let count = count.min(SUBTILE_PX);
        for k in 0..count {
            let [px, py, pz] = self.at((i + k) as i32 as f64 + 0.5, y, depth);
            (out[0][k], out[1][k], out[2][k]) = (px, py, pz);
        }
    }
}
