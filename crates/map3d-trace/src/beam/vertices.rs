//! The corners of a leaf's eight triangles in pixels of a sub-tile, all lanes at once; the same operations in the same order as
//! `SubtileProjection::project`.

use map3d_base::DEPTH_UNITS_PER_M;
use map3d_scene::Leaf;

use super::pixels::{STEPS_PER_PX, SUBTILE_PX, SnappedCorners};
use crate::part::LoadedPart;
use crate::projection::SubtileProjection;

/// A leaf's triangles in pixels; the lanes of unused triangles are NaN.
pub(crate) struct ProjectedLeaf {
    /// Rows: x, y, depth of corner 0, then of corners 1 and 2; pixels from the sub-tile's corner and depth units, not snapped.
    pixel: [[f64; 8]; 9],
    /// Rows: x, y of corner 0, then of corners 1 and 2 in lattice steps from the sub-tile's corner; whole numbers.
    snapped: [[f64; 8]; 6],
}

impl ProjectedLeaf {
    #[inline(always)]
    pub fn new(leaf: &Leaf, part: &LoadedPart, projection: &SubtileProjection) -> Self {
        let (origin, transform) = (part.chunk.origin(), part.transform());
        let mut out = Self { pixel: [[0.0; 8]; 9], snapped: [[0.0; 8]; 6] };
        for corner in 0..3 {
            let mut p = [[0f64; 8]; 3];
            for axis in 0..3 {
                for k in 0..8 {
                    p[axis][k] = origin[axis] + f64::from(leaf.corners[corner * 3 + axis][k]);
                }
            }
            if let Some(t) = transform {
                p = transform_points(t, &p);
            }
            out.project_corner(corner, &p, projection);
        }
        out
    }

    #[inline(always)]
    fn project_corner(&mut self, corner: usize, p: &[[f64; 8]; 3], projection: &SubtileProjection) {
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
            self.snapped[corner * 2][k] = snap(x) - left[0] * f64::from(STEPS_PER_PX);
            self.snapped[corner * 2 + 1][k] = snap(y) - left[1] * f64::from(STEPS_PER_PX);
        }
    }

    /// Returns the corners of one triangle, not snapped.
    #[inline(always)]
    pub fn corners(&self, lane: usize) -> [[f64; 3]; 3] {
        let mut out = [[0.0; 3]; 3];
        for corner in 0..3 {
            for k in 0..3 {
                out[corner][k] = self.pixel[corner * 3 + k][lane];
            }
        }
        out
    }

    #[inline(always)]
    pub fn snapped_corners(&self, lane: usize) -> SnappedCorners {
        let s = &self.snapped;
        [[s[0][lane] as i64, s[1][lane] as i64], [s[2][lane] as i64, s[3][lane] as i64], [s[4][lane] as i64, s[5][lane] as i64]]
    }

    /// Returns the mask of the lanes whose snapped boxes overlap the sub-tile.
    #[inline(always)]
    pub fn overlapping_lanes(&self) -> u32 {
        let side = f64::from(STEPS_PER_PX) * SUBTILE_PX as f64;
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

/// Returns the lattice step nearest to a pixel coordinate; halves round up.
#[inline(always)]
fn snap(pixel: f64) -> f64 {
    (f64::from(STEPS_PER_PX) * pixel + 0.5).floor()
}

#[inline(always)]
fn transform_points(t: &[f64; 12], p: &[[f64; 8]; 3]) -> [[f64; 8]; 3] {
    let mut out = [[0.0; 8]; 3];
    for axis in 0..3 {
        for k in 0..8 {
            let row = axis * 4;
            out[axis][k] = t[row] * p[0][k] + t[row + 1] * p[1][k] + t[row + 2] * p[2][k] + t[row + 3];
        }
    }
    out
}
