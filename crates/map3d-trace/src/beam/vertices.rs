//! The corners of a leaf's eight triangles in pixels of a sub-tile, all lanes at once; the same operations in the same order as
//! `SubtileProjection::project`.

use map3d_base::{DEPTH_UNITS_PER_M, ParallelProjection, PerspectiveProjection, Projection, Vec3};
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
        let left = [projection.corner_px[0] as f64, projection.corner_px[1] as f64];
        match projection.view {
            Projection::Parallel(view) => self.project_parallel(corner, p, view, left),
            Projection::Perspective(view) => self.project_perspective(corner, p, view, left),
        }
    }

    #[inline(always)]
    fn project_parallel(&mut self, corner: usize, p: &[[f64; 8]; 3], view: &ParallelProjection, left: [f64; 2]) {
        let (r, u, d) = (view.axes.right, view.axes.up, view.axes.forward);
        for k in 0..8 {
            let x = (r[0] * p[0][k] + r[1] * p[1][k] + r[2] * p[2][k] - view.u0_m) / view.pixel_m[0];
            let y = (view.v0_m - (u[0] * p[0][k] + u[1] * p[1][k] + u[2] * p[2][k])) / view.pixel_m[1];
            let depth = d[0] * p[0][k] + d[1] * p[1][k] + d[2] * p[2][k];
            self.set(corner, k, [x, y, (depth - view.d0_m) * DEPTH_UNITS_PER_M], left);
        }
    }

    #[inline(always)]
    fn project_perspective(&mut self, corner: usize, p: &[[f64; 8]; 3], view: &PerspectiveProjection, left: [f64; 2]) {
        let (r, u, d, o) = (view.axes.right, view.axes.up, view.axes.forward, view.position);
        for k in 0..8 {
            let q = [p[0][k] - o[0], p[1][k] - o[1], p[2][k] - o[2]];
            let z = d[0] * q[0] + d[1] * q[1] + d[2] * q[2];
            let x = ((r[0] * q[0] + r[1] * q[1] + r[2] * q[2]) / z - view.left) / view.pixel[0];
            let y = (view.top - (u[0] * q[0] + u[1] * q[1] + u[2] * q[2]) / z) / view.pixel[1];
            self.set(corner, k, [x, y, z * DEPTH_UNITS_PER_M], left);
        }
    }

    #[inline(always)]
    fn set(&mut self, corner: usize, k: usize, [x, y, depth]: [f64; 3], left: [f64; 2]) {
        self.pixel[corner * 3][k] = x - left[0];
        self.pixel[corner * 3 + 1][k] = y - left[1];
        self.pixel[corner * 3 + 2][k] = depth;
        self.snapped[corner * 2][k] = snap(x) - left[0] * f64::from(STEPS_PER_PX);
        self.snapped[corner * 2 + 1][k] = snap(y) - left[1] * f64::from(STEPS_PER_PX);
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

    /// Returns the mask of the lanes with a corner at less than `near` units; their pixels mean nothing.
    #[inline(always)]
    pub fn near_lanes(&self, near: f64) -> u32 {
        let mut mask = 0;
        for k in 0..8 {
            let p = &self.pixel;
            mask |= u32::from((p[2][k] < near) | (p[5][k] < near) | (p[8][k] < near)) << k;
        }
        mask
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

/// Returns the corners of a triangle in pixels of the sub-tile, as they are and snapped.
pub(crate) fn project_corners(local: [Vec3; 3], projection: &SubtileProjection) -> ([Vec3; 3], SnappedCorners) {
    let left = projection.corner_px.map(|v| v as f64);
    let view = local.map(|p| projection.view.project(p));
    let pixel = view.map(|[x, y, depth]| [x - left[0], y - left[1], depth]);
    let step = |px: f64, left: f64| (snap(px) - left * f64::from(STEPS_PER_PX)) as i64;
    (pixel, view.map(|[x, y, _]| [step(x, left[0]), step(y, left[1])]))
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
