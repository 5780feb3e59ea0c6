//! The parallel camera: three orthonormal axes (spec/pyramid.md §1).

use crate::vec3::{Vec3, add, dot, scale};

/// Axes of a view in local coordinates: right, up, forward (into the scene); orthonormal, right × forward = up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewAxes {
    pub right: Vec3,
    pub up: Vec3,
    pub forward: Vec3,
}

/// Cosine and sine of an angle in degrees; exact at multiples of 90°, and where they are ±½.
pub fn cos_sin_deg(deg: f64) -> (f64, f64) {
    let a = deg.rem_euclid(360.0);
    let rad = a.to_radians();
    let (c, s) = (rad.cos(), rad.sin());
    match a {
        0.0 => (1.0, 0.0),
        90.0 => (0.0, 1.0),
        180.0 => (-1.0, 0.0),
        270.0 => (0.0, -1.0),
        30.0 | 150.0 => (c, 0.5),
        210.0 | 330.0 => (c, -0.5),
        60.0 | 300.0 => (0.5, s),
        120.0 | 240.0 => (-0.5, s),
        _ => (c, s),
    }
}

impl ViewAxes {
    /// Look-at angle counter-clockwise from north and pitch below the horizon, in degrees.
    pub fn new(look_at_deg: f64, pitch_deg: f64) -> Self {
        let (ca, sa) = cos_sin_deg(look_at_deg);
        let (cp, sp) = cos_sin_deg(pitch_deg);
        Self { right: [ca, sa, 0.0], up: [-sp * sa, sp * ca, cp], forward: [-cp * sa, cp * ca, -sp] }
    }

    /// View coordinates (U, V, D) of a local point.
    pub fn uvd_from_local(&self, p: Vec3) -> Vec3 {
        [dot(self.right, p), dot(self.up, p), dot(self.forward, p)]
    }

    /// Local point of view coordinates (U, V, D).
    pub fn local_from_uvd(&self, q: Vec3) -> Vec3 {
        add(add(scale(self.right, q[0]), scale(self.up, q[1])), scale(self.forward, q[2]))
    }
}
