//! Triangles in perspective. In coordinates (x·z, y·z, z), with x and y in pixels and z the depth, projection is linear: depth and weights over pixels are
//! ratios of affine functions (spec/cameras.md §3), also for triangles that are partly behind the camera.

use map3d_base::vec3::{cross, dot, length, scale, sub};
use map3d_base::{DEPTH_UNITS_PER_M, PerspectiveProjection, Vec3};

use crate::projection::{DepthRange, each_corner};
use crate::surface::Affine;

/// `x·c[0] + y·c[1] + c[2]`: x and y in pixels right and down from a sub-tile's corner.
pub(crate) type Linear = [f64; 3];

#[inline(always)]
pub(crate) fn at(c: &Linear, x: f64, y: f64) -> f64 {
    x * c[0] + y * c[1] + c[2]
}

/// Returns (x·z, y·z, z) of a local point: x and y in pixels from the sub-tile's corner, z in depth units.
#[inline(always)]
pub(crate) fn homogeneous(view: &PerspectiveProjection, corner_px: [u64; 2], local: Vec3) -> Vec3 {
    let [x, y, z] = scale(view.camera_from_local(local), DEPTH_UNITS_PER_M);
    let px = (x - view.left * z) / view.pixel[0] - corner_px[0] as f64 * z;
    let py = (view.top * z - y) / view.pixel[1] - corner_px[1] as f64 * z;
    [px, py, z]
}

/// Returns the function 1/z of a triangle's plane; `None` for a plane through the point of the camera, which is seen edge-on.
#[inline(always)]
pub(crate) fn inverse_depth(p: &[Vec3; 3]) -> Option<Linear> {
    let n = cross(sub(p[1], p[0]), sub(p[2], p[0]));
    let inverse = 1.0 / dot(n, p[0]);
    let out = scale(n, inverse);
    (inverse.is_finite() && out.iter().all(|c| c.is_finite())).then_some(out)
}

/// Returns the distance of a plane from the camera in units; `inverse` is its 1/z over the pixels of a sub-tile.
#[inline(always)]
pub(crate) fn plane_distance(view: &PerspectiveProjection, corner_px: [u64; 2], inverse: &Linear) -> f64 {
    // Over tangents instead of pixels, 1/z is (normal · line of sight) / distance.
    let (x0, y0) = (-view.left / view.pixel[0] - corner_px[0] as f64, view.top / view.pixel[1] - corner_px[1] as f64);
    1.0 / length([inverse[0] / view.pixel[0], inverse[1] / view.pixel[1], at(inverse, x0, y0)])
}

/// Returns the range of the corners' depths, from `near` units on.
pub(crate) fn depth_range(p: &[Vec3; 3], near: f64) -> DepthRange {
    DepthRange::of(&each_corner(p, |[x, y, z]| [x, y, z.max(near)]))
}

/// Greatest displacement of texture by an affine approximation, in pixels.
const DISPLACEMENT_MAX: f64 = 1.0 / 8.0;

/// The weights of a triangle's corners over the pixels of a sub-tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerspectiveMap {
    /// Weights of corners 1 and 2 times 1/z; the three weights sum to 1.
    weights: [Linear; 2],
    /// 1/z.
    inverse: Linear,
    /// The pixels of the sub-tile that the triangle may cover: least x and y, greatest x and y.
    pixels: [f64; 4],
}

impl PerspectiveMap {
    /// Returns `None` for a triangle seen edge-on. `side`: that of a sub-tile.
    pub(crate) fn new(p: &[Vec3; 3], near: f64, side: f64) -> Option<Self> {
        Self::with_inverse(p, inverse_depth(p)?, near, side)
    }

    /// `inverse`: that of `inverse_depth`.
    pub(crate) fn with_inverse(p: &[Vec3; 3], inverse: Linear, near: f64, side: f64) -> Option<Self> {
        let (e1, e2) = (sub(p[1], p[0]), sub(p[2], p[0]));
        let scaled = 1.0 / dot(cross(e1, e2), p[0]);
        let weights = [scale(cross(e2, p[0]), scaled), scale(cross(p[0], e1), scaled)];
        weights.as_flattened().iter().all(|c| c.is_finite()).then(|| Self { weights, inverse, pixels: pixel_box(p, near, side) })
    }

    /// Returns the weights of corners 1 and 2 at pixel coordinates (x, y), and their derivatives right and down.
    #[inline(always)]
    fn weights_at(&self, x: f64, y: f64) -> [[f64; 3]; 2] {
        let z = 1.0 / at(&self.inverse, x, y);
        let weight = |w: &Linear| {
            let value = at(w, x, y) * z;
            [value, (w[0] - value * self.inverse[0]) * z, (w[1] - value * self.inverse[1]) * z]
        };
        [weight(&self.weights[0]), weight(&self.weights[1])]
    }

    /// Returns the affine functions that equal the weights and their derivatives at (x, y).
    pub fn affine_weights(&self, [x, y]: [f64; 2]) -> [Affine; 2] {
        let affine = |[value, dx, dy]: [f64; 3]| Affine { dx: dx as f32, dy: dy as f32, at0: (value - dx * x - dy * y) as f32 };
        let [b, c] = self.weights_at(x, y);
        [affine(b), affine(c)]
    }

    /// Returns the weights at (x, y).
    #[inline(always)]
    pub fn weights(&self, x: f64, y: f64) -> [f64; 2] {
        self.weights_at(x, y).map(|w| w[0])
    }

    /// Returns the centre of the pixels that the triangle may cover.
    pub fn center(&self) -> [f64; 2] {
        let [x0, y0, x1, y1] = self.pixels;
        [(x0 + x1) / 2.0, (y0 + y1) / 2.0]
    }

    /// Returns half the sides of the pixels that the triangle may cover.
    pub fn half_size(&self) -> [f64; 2] {
        let [x0, y0, x1, y1] = self.pixels;
        [(x1 - x0) / 2.0, (y1 - y0) / 2.0]
    }

    /// Returns whether the affine functions at (x, y) show every point within a distance in pixels right and down less than `DISPLACEMENT_MAX` beside
    /// its place.
    pub fn is_nearly_affine(&self, [x, y]: [f64; 2], [dx, dy]: [f64; 2]) -> bool {
        let here = at(&self.inverse, x, y).abs();
        let change = (self.inverse[0] * dx).abs() + (self.inverse[1] * dy).abs();
        // The affine functions miss the relative change of the depth.
        change * (dx + dy) < DISPLACEMENT_MAX * (here - change)
    }

    /// Returns the greatest number of pixels from (x, y) to the right over which the affine functions at their middle are near enough; at least one.
    pub fn affine_pixels(&self, x: f64, y: f64) -> usize {
        let slope = self.inverse[0].abs() / at(&self.inverse, x, y).abs();
        // Half a span h has a change of slope·h and a displacement of slope·h².
        let half = (DISPLACEMENT_MAX / slope).sqrt() / (1.0 + (DISPLACEMENT_MAX * slope).sqrt());
        if half.is_finite() { (2.0 * half).max(1.0) as usize } else { usize::MAX }
    }
}

/// Returns the pixels of a sub-tile in the box of a triangle's corners; all pixels for a triangle that is partly nearer than `near`.
fn pixel_box(p: &[Vec3; 3], near: f64, side: f64) -> [f64; 4] {
    if p.iter().any(|c| c[2] < near) {
        return [0.0, 0.0, side, side];
    }
    let bounds = |axis: usize| {
        let v = each_corner(p, |c| c[axis] / c[2]);
        [v[0].min(v[1]).min(v[2]).clamp(0.0, side), v[0].max(v[1]).max(v[2]).clamp(0.0, side)]
    };
    let ([x0, x1], [y0, y1]) = (bounds(0), bounds(1));
    [x0, y0, x1, y1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use map3d_base::ViewAxes;
    use map3d_base::vec3::add;

    /// Returns the point of a triangle with the weights of corners 1 and 2.
    fn point(p: &[Vec3; 3], [b, c]: [f64; 2]) -> Vec3 {
        add(p[0], add(scale(sub(p[1], p[0]), b), scale(sub(p[2], p[0]), c)))
    }

    #[test]
    fn weights_and_depth_are_those_of_the_point_on_the_line_of_sight() {
        let view = PerspectiveProjection {
            axes: ViewAxes::new(20.0, 30.0),
            position: [5.0, 6.0, 70.0],
            left: -0.8,
            top: 0.6,
            pixel: [0.01, 0.02],
            near_m: 0.1,
        };
        let local = [[0.0, 40.0, 10.0], [60.0, 90.0, 20.0], [-3.0, 70.0, 55.0]];
        let p = local.map(|c| homogeneous(&view, [3, 4], c));
        let map = PerspectiveMap::new(&p, 1.0, 64.0).expect("seen from its side");
        for (b, c) in [(0.2, 0.3), (0.0, 1.0), (0.7, 0.1)] {
            let [x, y, z] = homogeneous(&view, [3, 4], point(&local, [b, c]));
            let got = map.weights(x / z, y / z);
            assert!((got[0] - b).abs() < 1e-9 && (got[1] - c).abs() < 1e-9, "{got:?}");
            assert!((at(&inverse_depth(&p).expect("a plane"), x / z, y / z) * z - 1.0).abs() < 1e-9);
            let affine = map.affine_weights([x / z, y / z])[0];
            let step = map.weights(x / z + 1e-3, y / z)[0];
            assert!(
                (f64::from(affine.at((x / z) as f32, (y / z) as f32)) - b).abs() < 1e-4 && ((step - b) / 1e-3 - f64::from(affine.dx)).abs() < 1e-4
            );
        }
    }
}
