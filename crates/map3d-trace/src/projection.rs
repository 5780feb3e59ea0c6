//! From local positions to pixels of level zmax. All vertices are projected here or, eight at a time, in `beam/vertices.rs` by the same operations in the
//! same order.

use map3d_base::{DEPTH_NOTHING, Projection, Vec3};

/// A view, and the sub-tile from whose top left corner pixels are counted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SubtileProjection<'a> {
    pub view: &'a Projection,
    /// Top left pixel of the sub-tile.
    pub corner_px: [u64; 2],
}

impl SubtileProjection<'_> {
    /// Returns pixels right and down from the sub-tile's corner, and depth units; not snapped.
    pub fn project(&self, local: Vec3) -> Vec3 {
        let [x, y, d] = self.view.project(local);
        [x - self.corner_px[0] as f64, y - self.corner_px[1] as f64, d]
    }

    pub fn project_triangle(&self, local: [Vec3; 3]) -> ProjectedTriangle {
        ProjectedTriangle { local, pixel: local.map(|p| self.project(p)), forward: self.view.line_of_sight(local[0]) }
    }
}

/// A triangle in a view.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ProjectedTriangle {
    /// Local corners.
    pub local: [Vec3; 3],
    /// x and y in pixels from the sub-tile's top left corner, depth in units; not snapped.
    pub pixel: [Vec3; 3],
    /// Unit vector along a line of sight to the triangle, local axes.
    pub forward: Vec3,
}

/// Applies a function to the corners of a triangle. (`array::map` is compiled to a loop over memory here.)
#[inline(always)]
pub(crate) fn each_corner<T>(p: &[Vec3; 3], f: impl Fn(Vec3) -> T) -> [T; 3] {
    [f(p[0]), f(p[1]), f(p[2])]
}

/// The least and the greatest depth of a triangle's corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DepthRange {
    pub lo: f64,
    pub hi: f64,
}

impl DepthRange {
    #[inline(always)]
    pub fn of(pixel: &[Vec3; 3]) -> Self {
        let d = [pixel[0][2], pixel[1][2], pixel[2][2]];
        Self { lo: d[0].min(d[1]).min(d[2]), hi: d[0].max(d[1]).max(d[2]) }
    }

    #[inline(always)]
    pub fn clamp(&self, depth: f64) -> f64 {
        depth.clamp(self.lo, self.hi)
    }
}

/// Returns the depth gradient in units per pixel right and down, or `None` for a triangle seen edge-on.
#[inline(always)]
pub(crate) fn depth_gradient(p: &[Vec3; 3]) -> Option<[f64; 2]> {
    let a = [p[1][0] - p[0][0], p[1][1] - p[0][1], p[1][2] - p[0][2]];
    let b = [p[2][0] - p[0][0], p[2][1] - p[0][1], p[2][2] - p[0][2]];
    let inverse = 1.0 / (a[0] * b[1] - a[1] * b[0]);
    let g = [(a[2] * b[1] - a[1] * b[2]) * inverse, (a[0] * b[2] - a[2] * b[0]) * inverse];
    (inverse.is_finite() && g[0].is_finite() && g[1].is_finite()).then_some(g)
}

/// Returns the depth of a triangle's plane at pixel coordinates (x, y), clamped to the triangle's range. A triangle seen edge-on has the depth of its
/// nearest corner.
pub(crate) fn depth_at(pixel: &[Vec3; 3], x: f64, y: f64) -> f64 {
    let range = DepthRange::of(pixel);
    let Some(g) = depth_gradient(pixel) else { return range.lo };
    range.clamp(pixel[0][2] + g[0] * (x - pixel[0][0]) + g[1] * (y - pixel[0][1]))
}

/// Returns `depth_at` rounded to units, never `DEPTH_NOTHING`.
pub(crate) fn depth_units_at(pixel: &[Vec3; 3], x: f64, y: f64) -> u32 {
    (depth_at(pixel, x, y) + 0.5).floor().clamp(0.0, f64::from(DEPTH_NOTHING - 1)) as u32
}
