//! The one gate through which all geometry passes: what is not finite, not in range or has no area stays outside, counted.

use super::Batch;
use crate::vec3::{Vec3, length, triangle_normal};

/// Limits of one asset's geometry.
#[derive(Clone, Copy, Debug)]
pub struct GateLimits {
    /// |coordinate| in metres.
    pub coordinate_m: f64,
}

impl Default for GateLimits {
    fn default() -> Self {
        Self { coordinate_m: 1e8 }
    }
}

/// Triangles kept out, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Skips {
    pub index_out_of_range: u64,
    pub not_finite: u64,
    pub too_far: u64,
    pub zero_area: u64,
    pub bad_uv: u64,
}

impl Skips {
    /// (reason, count) of every reason.
    pub fn reasons(&self) -> [(&'static str, u64); 5] {
        [
            ("index out of range", self.index_out_of_range),
            ("coordinate is not a finite number", self.not_finite),
            ("coordinate too far from the origin", self.too_far),
            ("zero area", self.zero_area),
            ("texture coordinate is not a finite number", self.bad_uv),
        ]
    }
}

/// Which triangles of a batch are sound, in order. UVs that are not finite do not cost the triangle: the caller drops the texture there.
pub fn pass(batch: &Batch, limits: GateLimits, skips: &mut Skips) -> Vec<bool> {
    batch.triangles.iter().map(|t| is_sound(&batch.positions, *t, limits, skips)).collect()
}

fn is_sound(positions: &[Vec3], t: [u32; 3], limits: GateLimits, skips: &mut Skips) -> bool {
    let corners = t.map(|v| positions.get(v as usize).copied());
    let [Some(a), Some(b), Some(c)] = corners else {
        skips.index_out_of_range += 1;
        return false;
    };
    let values = || [a, b, c].into_iter().flatten();
    let area = length(triangle_normal([a, b, c]));
    let counter = if !values().all(f64::is_finite) {
        &mut skips.not_finite
    } else if values().any(|v| v.abs() > limits.coordinate_m) {
        &mut skips.too_far
    } else if area == 0.0 || area.is_nan() {
        &mut skips.zero_area
    } else {
        return true;
    };
    *counter += 1;
    false
}
