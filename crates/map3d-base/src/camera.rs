//! Cameras: views of any kind, with three axes (spec/cameras.md).

use crate::error::{Error, Result};
use crate::vec3::{Vec3, cross, dot, length, normalized, scale, sub};
use crate::view::ViewAxes;

/// How lines of sight run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraKind {
    /// Parallel to `forward`.
    Orthographic,
    /// From the point of the camera.
    Perspective,
}

/// The edges of the image in the camera's plane, from the point of the camera: metres to the right and up in orthographic views; tangents, which are
/// metres at distance 1 m, in perspective.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    pub left: f64,
    pub right: f64,
    pub bottom: f64,
    pub top: f64,
}

/// A view of any kind, from any position in any direction. Local axes and metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    pub kind: CameraKind,
    /// The point of the camera.
    pub position: Vec3,
    pub axes: ViewAxes,
    pub window: Window,
    /// The least and greatest visible distance along `axes.forward`.
    pub near_m: f64,
    pub far_m: f64,
    pub width_px: u32,
    pub height_px: u32,
}

/// Minimum and maximum side of a view in pixels.
pub const VIEW_SIDE_PX: [u32; 2] = [1, 4096];
/// Greatest deviation of axes from orthonormal ones.
const AXES_TOLERANCE: f64 = 1e-6;
/// Axes that deviate by less are taken as they are.
const EXACT_AXES: f64 = 1e-14;
/// Greatest number in a camera; coordinates beyond it lose the millimetre in float64.
const COORDINATE_MAX_M: f64 = 1e9;
/// Least near distance in perspective.
const NEAR_MIN_M: f64 = 1e-3;

impl Camera {
    /// Returns the camera with exactly orthonormal axes. Fails for numbers that describe no view.
    pub fn validated(mut self) -> Result<Self> {
        self.check_numbers()?;
        self.axes = orthonormal(&self.axes)?;
        self.check_window()?;
        self.check_size()?;
        Ok(self)
    }

    fn check_numbers(&self) -> Result<()> {
        let w = &self.window;
        let named = [
            ("position", self.position.as_slice()),
            ("right", self.axes.right.as_slice()),
            ("up", self.axes.up.as_slice()),
            ("forward", self.axes.forward.as_slice()),
            ("window", &[w.left, w.right, w.bottom, w.top]),
            ("near_m", &[self.near_m]),
            ("far_m", &[self.far_m]),
        ];
        for (name, numbers) in named {
            if let Some(v) = numbers.iter().find(|v| v.is_nan() || v.abs() > COORDINATE_MAX_M) {
                return Err(Error::argument(format!("camera: {name} has {v}, expected a number from -1e9 to 1e9")));
            }
        }
        Ok(())
    }

    fn check_window(&self) -> Result<()> {
        let Window { left, right, bottom, top } = self.window;
        let least = 1e-9;
        if !(right - left >= least && top - bottom >= least) {
            let expected = "expected left < right and bottom < top";
            return Err(Error::argument(format!("camera: window is ({left}, {right}, {bottom}, {top}); {expected}")));
        }
        if self.kind == CameraKind::Perspective && self.near_m < NEAR_MIN_M {
            return Err(Error::argument(format!("camera: near_m is {}, expected at least {NEAR_MIN_M} in perspective", self.near_m)));
        }
        if self.near_m >= self.far_m {
            return Err(Error::argument(format!("camera: near_m is {} and far_m {}, expected near_m < far_m", self.near_m, self.far_m)));
        }
        Ok(())
    }

    fn check_size(&self) -> Result<()> {
        let (w, h) = (self.width_px, self.height_px);
        let [least, most] = VIEW_SIDE_PX;
        if !(least..=most).contains(&w) || !(least..=most).contains(&h) {
            return Err(Error::argument(format!("camera: {w} × {h} px, expected sides of {least} to {most} px")));
        }
        Ok(())
    }

    /// Returns the width and height of a pixel: metres, or tangents in perspective.
    pub fn pixel(&self) -> [f64; 2] {
        let w = &self.window;
        [(w.right - w.left) / f64::from(self.width_px), (w.top - w.bottom) / f64::from(self.height_px)]
    }

    /// Returns the line of sight through (x, y) in pixels right and down from the image's top left corner: its point in the camera's plane, and its
    /// direction, which advances one metre along `forward`.
    pub fn line_of_sight(&self, x_px: f64, y_px: f64) -> (Vec3, Vec3) {
        let [px, py] = self.pixel();
        let (x, y) = (self.window.left + x_px * px, self.window.top - y_px * py);
        let ViewAxes { right, up, forward } = self.axes;
        let plane = crate::vec3::add(scale(right, x), scale(up, y));
        match self.kind {
            CameraKind::Orthographic => (crate::vec3::add(self.position, plane), forward),
            CameraKind::Perspective => (self.position, crate::vec3::add(forward, plane)),
        }
    }
}

/// Returns the axes if they are orthonormal already, else the nearest ones with the same `forward`. Fails for axes beyond the tolerance.
fn orthonormal(axes: &ViewAxes) -> Result<ViewAxes> {
    let ViewAxes { right, up, forward } = *axes;
    let lengths = [right, up, forward].map(|v| (length(v) - 1.0).abs());
    let angles = [dot(right, up).abs(), dot(up, forward).abs(), dot(forward, right).abs()];
    let deviation = lengths.into_iter().chain(angles).fold(0.0, f64::max);
    let wrong = || Error::argument(format!("camera: right {right:?}, up {up:?}, forward {forward:?} are not orthonormal to within {AXES_TOLERANCE}"));
    if deviation > AXES_TOLERANCE {
        return Err(wrong());
    }
    if length(sub(cross(right, forward), up)) > 4.0 * AXES_TOLERANCE {
        return Err(Error::argument(format!("camera: right × forward must be up; right {right:?}, up {up:?}, forward {forward:?} mirror the view")));
    }
    if deviation <= EXACT_AXES {
        return Ok(*axes);
    }
    let forward = normalized(forward).ok_or_else(wrong)?;
    let right = normalized(sub(right, scale(forward, dot(right, forward)))).ok_or_else(wrong)?;
    Ok(ViewAxes { right, up: cross(right, forward), forward })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera {
            kind: CameraKind::Perspective,
            position: [1.0, 2.0, 3.0],
            axes: ViewAxes::new(30.0, 20.0),
            window: Window { left: -1.0, right: 1.0, bottom: -0.75, top: 0.75 },
            near_m: 0.1,
            far_m: 1e4,
            width_px: 640,
            height_px: 480,
        }
    }

    #[test]
    fn wrong_numbers_are_refused() {
        assert!(camera().validated().is_ok());
        let changes: [fn(&mut Camera); 16] = [
            |c| c.position[1] = f64::NAN,
            |c| c.position[0] = f64::INFINITY,
            |c| c.position[2] = 1e300,
            |c| c.axes.right = [0.0; 3],
            |c| c.axes.up[0] += 1e-5,
            |c| c.axes.right = scale(c.axes.right, -1.0),
            |c| c.axes.forward = [f64::NAN; 3],
            |c| c.window.left = 1.0,
            |c| c.window.top = f64::NEG_INFINITY,
            |c| c.window.bottom = 0.75,
            |c| c.near_m = 0.0,
            |c| c.near_m = -1.0,
            |c| c.far_m = 0.1,
            |c| c.far_m = f64::NAN,
            |c| c.width_px = 0,
            |c| c.height_px = VIEW_SIDE_PX[1] + 1,
        ];
        for (number, change) in changes.iter().enumerate() {
            let mut changed = camera();
            change(&mut changed);
            assert!(matches!(changed.validated(), Err(Error::Argument(_))), "change {number}");
        }
    }

    #[test]
    fn nearly_orthonormal_axes_become_orthonormal() {
        let mut rounded = camera();
        rounded.axes = ViewAxes { right: [0.8660254, 0.5, 0.0], ..rounded.axes };
        let axes = rounded.validated().expect("within the tolerance").axes;
        assert!(dot(axes.right, axes.forward).abs() < 1e-15 && (length(axes.right) - 1.0).abs() < 1e-15 && dot(axes.up, axes.right).abs() < 1e-15);
        assert_eq!(camera().validated().expect("valid").axes, camera().axes);
    }

    #[test]
    fn line_of_sight_of_the_image_centre_is_forward() {
        let c = camera();
        assert_eq!(c.line_of_sight(320.0, 240.0), (c.position, c.axes.forward));
        let orthographic = Camera { kind: CameraKind::Orthographic, ..c };
        let (point, direction) = orthographic.line_of_sight(0.0, 0.0);
        let expected = crate::vec3::add(c.position, c.axes.local_from_uvd([-1.0, 0.75, 0.0]));
        assert!(length(sub(point, expected)) < 1e-12 && direction == c.axes.forward);
    }
}
