//! The corners of a leaf's eight triangles in pixels of a sub-tile, all lanes at once; the same operations in the same order as `Projection::pixel`.

use map3d_base::DEPTH_UNITS_PER_M;
use map3d_scene::Leaf;

use super::project::Projection;
use crate::visbuf::SUBTILE_PX;

/// Steps of the snapping lattice per pixel: pixel numbers are steps >> 8.
pub(crate) const STEPS: i32 = 256;

/// Rows: x, y of corner 0, then depth, then corner 1, 2. Lanes: the leaf's triangles; NaN when unused.
pub(crate) struct Corners {
    /// Pixels from the sub-tile's corner and depth units, unsnapped.
    pub pixel: [[f64; 8]; 9],
    /// x and y of corner 0, 1, 2 in lattice steps from the sub-tile's corner: whole numbers.
    pub snapped: [[f64; 8]; 6],
}

impl Corners {
    #[inline(always)]
    pub fn of(leaf: &Leaf, projection: &Projection, origin: [f64; 3], transform: Option<&[f64; 12]>) -> Self {
        let mut out = Self { pixel: [[0.0; 8]; 9], snapped: [[0.0; 8]; 6] };
        for corner in 0..3 {
            let mut p = [[0f64; 8]; 3];
            for axis in 0..3 {
                for k in 0..8 {
                    p[axis][k] = origin[axis] + f64::from(leaf.corners[corner * 3 + axis][k]);
                }
            }
            if let Some(t) = transform {
                p = place(t, &p);
            }
            out.project(corner, &p, projection);
        }
        out
    }

    #[inline(always)]
    fn project(&mut self, corner: usize, p: &[[f64; 8]; 3], projection: &Projection) {
        let frame = projection.frame;
        let pixel_m = frame.pixel_m(frame.zmax);
        let (r, u, d) = (projection.axes.right, projection.axes.up, projection.axes.forward);
        let left = [projection.corner_px[0] as f64, projection.corner_px[1] as f64];
        for k in 0..8 {
            let x = (r[0] * p[0][k] + r[1] * p[1][k] + r[2] * p[2][k] - frame.u0_m) / pixel_m;
            let y = (frame.v0_m - (u[0] * p[0][k] + u[1] * p[1][k] + u[2] * p[2][k])) / pixel_m;
            let depth = d[0] * p[0][k] + d[1] * p[1][k] + d[2] * p[2][k];
            self.pixel[corner * 3][k] = x - left[0];
            self.pixel[corner * 3 + 1][k] = y - left[1];
            self.pixel[corner * 3 + 2][k] = (depth - frame.d0_m) * DEPTH_UNITS_PER_M;
            self.snapped[corner * 2][k] = snap(x) - left[0] * f64::from(STEPS);
            self.snapped[corner * 2 + 1][k] = snap(y) - left[1] * f64::from(STEPS);
        }
    }

    /// Unsnapped corners of one triangle.
    #[inline(always)]
    pub fn of_lane(&self, lane: usize) -> [[f64; 3]; 3] {
        let mut out = [[0.0; 3]; 3];
        for corner in 0..3 {
            for k in 0..3 {
                out[corner][k] = self.pixel[corner * 3 + k][lane];
            }
        }
        out
    }

    /// Lanes whose snapped box meets the sub-tile.
    #[inline(always)]
    pub fn touching(&self) -> u32 {
        let side = f64::from(STEPS) * SUBTILE_PX as f64;
        let mut flags = [0u32; 8];
        for k in 0..8 {
            let s = &self.snapped;
            let (x0, y0) = (least(s[0][k], s[2][k], s[4][k]), least(s[1][k], s[3][k], s[5][k]));
            let (x1, y1) = (-least(-s[0][k], -s[2][k], -s[4][k]), -least(-s[1][k], -s[3][k], -s[5][k]));
            flags[k] = u32::from((x1 >= 0.0) & (x0 < side) & (y1 >= 0.0) & (y0 < side));
        }
        let mut mask = 0;
        for k in 0..8 {
            mask |= flags[k] << k;
        }
        mask
    }
}

#[inline(always)]
fn least(a: f64, b: f64, c: f64) -> f64 {
    let ab = if b < a { b } else { a };
    if c < ab { c } else { ab }
}

/// Nearest lattice step of an absolute pixel coordinate, halves up.
#[inline(always)]
pub(crate) fn snap(pixel: f64) -> f64 {
    (f64::from(STEPS) * pixel + 0.5).floor()
}

#[inline(always)]
fn place(t: &[f64; 12], p: &[[f64; 8]; 3]) -> [[f64; 8]; 3] {
    let mut out = [[0.0; 8]; 3];
    for axis in 0..3 {
        for k in 0..8 {
            let row = axis * 4;
            out[axis][k] = t[row] * p[0][k] + t[row + 1] * p[1][k] + t[row + 2] * p[2][k] + t[row + 3];
        }
    }
    out
}
