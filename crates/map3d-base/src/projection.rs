//! From local positions to the pixels and depth units of a view, and back (spec/pyramid.md §1–4, spec/cameras.md).

use crate::DEPTH_UNITS_PER_M;
use crate::camera::{Camera, CameraKind};
use crate::frame::Frame;
use crate::vec3::{Vec3, add, dot, normalized, scale, sub};
use crate::view::ViewAxes;

/// Pixels are counted right and down from the image's top left corner, at level zmax for a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    Parallel(ParallelProjection),
    Perspective(PerspectiveProjection),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParallelProjection {
    pub axes: ViewAxes,
    /// View coordinates of the top left corner, and of depth 0.
    pub u0_m: f64,
    pub v0_m: f64,
    pub d0_m: f64,
    /// Width and height of a pixel.
    pub pixel_m: [f64; 2],
}

/// Depth is counted from the camera's plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerspectiveProjection {
    pub axes: ViewAxes,
    /// The point of the camera.
    pub position: Vec3,
    /// Tangents of the top left corner.
    pub left: f64,
    pub top: f64,
    /// Width and height of a pixel as tangents.
    pub pixel: [f64; 2],
    /// Least distance along `forward` that is drawn.
    pub near_m: f64,
}

impl Projection {
    pub fn of_frame(frame: &Frame) -> Self {
        let (axes, pixel_m) = (frame.axes(), frame.pixel_m(frame.zmax));
        Self::Parallel(ParallelProjection { axes, u0_m: frame.u0_m, v0_m: frame.v0_m, d0_m: frame.d0_m, pixel_m: [pixel_m; 2] })
    }

    /// Returns the projection of a valid camera. Depth 0 is `depth_zero_units` behind the camera's plane; 0 in perspective.
    pub fn of_camera(camera: &Camera, depth_zero_units: f64) -> Self {
        let (axes, window, position) = (camera.axes, camera.window, camera.position);
        match camera.kind {
            CameraKind::Orthographic => {
                let [u, v, d] = axes.uvd_from_local(position);
                let d0_m = d + depth_zero_units / DEPTH_UNITS_PER_M;
                Self::Parallel(ParallelProjection { axes, u0_m: u + window.left, v0_m: v + window.top, d0_m, pixel_m: camera.pixel() })
            }
            CameraKind::Perspective => {
                let (left, top, pixel, near_m) = (window.left, window.top, camera.pixel(), camera.near_m);
                Self::Perspective(PerspectiveProjection { axes, position, left, top, pixel, near_m })
            }
        }
    }

    pub fn axes(&self) -> &ViewAxes {
        match self {
            Self::Parallel(p) => &p.axes,
            Self::Perspective(p) => &p.axes,
        }
    }

    /// Returns pixels right and down, and depth units. In perspective, the depth must be greater than 0.
    #[inline(always)]
    pub fn project(&self, local: Vec3) -> Vec3 {
        match self {
            Self::Parallel(p) => p.project(local),
            Self::Perspective(p) => p.project(local),
        }
    }

    /// Returns the local point at pixel coordinates and a depth in units.
    #[inline(always)]
    pub fn unproject(&self, [x, y, depth]: Vec3) -> Vec3 {
        let metres = depth / DEPTH_UNITS_PER_M;
        match self {
            Self::Parallel(p) => p.axes.local_from_uvd([p.u0_m + x * p.pixel_m[0], p.v0_m - y * p.pixel_m[1], p.d0_m + metres]),
            Self::Perspective(p) => {
                let (tx, ty) = (p.left + x * p.pixel[0], p.top - y * p.pixel[1]);
                add(p.position, p.axes.local_from_uvd([tx * metres, ty * metres, metres]))
            }
        }
    }

    /// Returns the larger side of a pixel in metres at a depth in units.
    pub fn pixel_m(&self, depth: f64) -> f64 {
        match self {
            Self::Parallel(p) => p.pixel_m[0].max(p.pixel_m[1]),
            Self::Perspective(p) => p.pixel[0].max(p.pixel[1]) * depth.max(1.0) / DEPTH_UNITS_PER_M,
        }
    }

    /// Returns the unit vector along the line of sight through a local point.
    pub fn line_of_sight(&self, local: Vec3) -> Vec3 {
        match self {
            Self::Parallel(p) => p.axes.forward,
            Self::Perspective(p) => normalized(sub(local, p.position)).unwrap_or(p.axes.forward),
        }
    }
}

impl ParallelProjection {
    #[inline(always)]
    fn project(&self, local: Vec3) -> Vec3 {
        let [u, v, d] = self.axes.uvd_from_local(local);
        [(u - self.u0_m) / self.pixel_m[0], (self.v0_m - v) / self.pixel_m[1], (d - self.d0_m) * DEPTH_UNITS_PER_M]
    }
}

impl PerspectiveProjection {
    /// Returns metres right, up and forward from the point of the camera.
    #[inline(always)]
    pub fn camera_from_local(&self, local: Vec3) -> Vec3 {
        self.axes.uvd_from_local(sub(local, self.position))
    }

    #[inline(always)]
    fn project(&self, local: Vec3) -> Vec3 {
        let [x, y, z] = self.camera_from_local(local);
        [(x / z - self.left) / self.pixel[0], (self.top - y / z) / self.pixel[1], z * DEPTH_UNITS_PER_M]
    }

    /// Returns the coefficients of a local point (three, then the constant) in `x − t·z`, with x to the right and t a tangent.
    pub fn beside(&self, t: f64) -> [f64; 4] {
        self.half_space(sub(self.axes.right, scale(self.axes.forward, t)))
    }

    /// As `beside`, with y up.
    pub fn above(&self, t: f64) -> [f64; 4] {
        self.half_space(sub(self.axes.up, scale(self.axes.forward, t)))
    }

    /// As `beside`, of the distance along `forward`.
    pub fn ahead(&self) -> [f64; 4] {
        self.half_space(self.axes.forward)
    }

    fn half_space(&self, normal: Vec3) -> [f64; 4] {
        [normal[0], normal[1], normal[2], -dot(normal, self.position)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Window;
    use crate::vec3::length;

    fn camera(kind: CameraKind) -> Camera {
        let window = Window { left: -0.5, right: 1.5, bottom: -0.5, top: 0.25 };
        Camera { kind, position: [10.0, -20.0, 5.0], axes: ViewAxes::new(77.0, 33.0), window, near_m: 0.1, far_m: 1e4, width_px: 200, height_px: 75 }
    }

    #[test]
    fn a_point_on_a_line_of_sight_projects_to_its_pixel_and_back() {
        for kind in [CameraKind::Orthographic, CameraKind::Perspective] {
            let camera = camera(kind);
            let projection = Projection::of_camera(&camera, 0.0);
            for (x, y, depth_m) in [(0.5, 0.5, 3.0), (100.0, 60.25, 700.0), (-40.0, 90.0, 12.5)] {
                let (origin, direction) = camera.line_of_sight(x, y);
                let point = add(origin, scale(direction, depth_m));
                let [px, py, units] = projection.project(point);
                assert!((px - x).abs() < 1e-9 && (py - y).abs() < 1e-9 && (units - depth_m * 1024.0).abs() < 1e-6, "{kind:?} {px} {py} {units}");
                assert!(length(sub(projection.unproject([x, y, units]), point)) < 1e-9);
            }
        }
    }
}
