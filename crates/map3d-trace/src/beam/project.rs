//! From chunk positions to pixels of level zmax: the one place where vertices are projected, for beams as for results.

use map3d_base::{DEPTH_NOTHING, Frame, Vec3, ViewAxes};
use map3d_scene::Leaf;
use map3d_scene::instances::place;

/// A view and the sub-tile relative to which pixels are counted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Projection<'a> {
    pub frame: &'a Frame,
    pub axes: &'a ViewAxes,
    pub corner_px: [u64; 2],
}

impl Projection<'_> {
    /// Pixels right and down from the sub-tile's corner, and depth units from D0; unsnapped.
    pub fn pixel(&self, local: Vec3) -> Vec3 {
        let [x, y, d] = self.frame.pixel_from_local(self.axes, local);
        [x - self.corner_px[0] as f64, y - self.corner_px[1] as f64, d]
    }

    /// Local corners of a leaf's triangle; a chunk's origin + position is exact.
    pub fn local_corners(&self, leaf: &Leaf, lane: usize, origin: Vec3, transform: Option<&[f64; 12]>) -> [Vec3; 3] {
        [0, 3, 6].map(|c| {
            let p = [0, 1, 2].map(|k| origin[k] + f64::from(leaf.corners[c + k][lane]));
            transform.map_or(p, |t| place(t, p))
        })
    }
}

/// Least and greatest depth of a triangle's corners.
#[inline(always)]
pub(crate) fn depth_range(pixel: &[Vec3; 3]) -> (f64, f64) {
    let d = [pixel[0][2], pixel[1][2], pixel[2][2]];
    (d[0].min(d[1]).min(d[2]), d[0].max(d[1]).max(d[2]))
}

/// Depth gradient in units per pixel right and down; `None` for a triangle seen edge-on.
#[inline(always)]
pub(crate) fn depth_gradient(p: &[Vec3; 3]) -> Option<[f64; 2]> {
    let a = [p[1][0] - p[0][0], p[1][1] - p[0][1], p[1][2] - p[0][2]];
    let b = [p[2][0] - p[0][0], p[2][1] - p[0][1], p[2][2] - p[0][2]];
    let inverse = 1.0 / (a[0] * b[1] - a[1] * b[0]);
    let g = [(a[2] * b[1] - a[1] * b[2]) * inverse, (a[0] * b[2] - a[2] * b[0]) * inverse];
    (inverse.is_finite() && g[0].is_finite() && g[1].is_finite()).then_some(g)
}

/// Depth of the triangle's plane at pixel coordinates (x, y), clamped to the triangle's range; its nearest corner's when seen edge-on.
pub(crate) fn depth_of_plane(pixel: &[Vec3; 3], x: f64, y: f64) -> f64 {
    let (lo, hi) = depth_range(pixel);
    let Some(g) = depth_gradient(pixel) else { return lo };
    (pixel[0][2] + g[0] * (x - pixel[0][0]) + g[1] * (y - pixel[0][1])).clamp(lo, hi)
}

/// `depth_of_plane` rounded to units, never `DEPTH_NOTHING`.
pub(crate) fn units_of_plane(pixel: &[Vec3; 3], x: f64, y: f64) -> u32 {
    (depth_of_plane(pixel, x, y) + 0.5).floor().clamp(0.0, f64::from(DEPTH_NOTHING - 1)) as u32
}
