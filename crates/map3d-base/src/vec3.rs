//! Vectors and boxes in float64.

pub type Vec3 = [f64; 3];

#[inline]
pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline]
pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline]
pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline]
pub fn scale(a: Vec3, s: f64) -> Vec3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline]
pub fn length(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

/// Unit vector, or `None` for a vector without a direction (zero, NaN, infinite).
#[inline]
pub fn normalized(a: Vec3) -> Option<Vec3> {
    let l = length(a);
    (l > 0.0 && l.is_finite()).then(|| scale(a, 1.0 / l))
}

/// Geometric normal of a triangle, not normalised: twice its area long, by the right-hand rule.
#[inline]
pub fn triangle_normal(p: [Vec3; 3]) -> Vec3 {
    cross(sub(p[1], p[0]), sub(p[2], p[0]))
}

/// An axis-aligned box; empty when any `lo > hi`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Box3 {
    pub lo: Vec3,
    pub hi: Vec3,
}

impl Box3 {
    pub const EMPTY: Self = Self { lo: [f64::INFINITY; 3], hi: [f64::NEG_INFINITY; 3] };

    pub fn is_empty(&self) -> bool {
        (0..3).any(|k| self.lo[k] > self.hi[k])
    }

    pub fn add_point(&mut self, p: Vec3) {
        self.add_box(&Self { lo: p, hi: p });
    }

    pub fn add_box(&mut self, other: &Self) {
        self.lo = [0, 1, 2].map(|k| self.lo[k].min(other.lo[k]));
        self.hi = [0, 1, 2].map(|k| self.hi[k].max(other.hi[k]));
    }

    pub fn center(&self) -> Vec3 {
        scale(add(self.lo, self.hi), 0.5)
    }

    pub fn half_extents(&self) -> Vec3 {
        scale(sub(self.hi, self.lo), 0.5)
    }
}
