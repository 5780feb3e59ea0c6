//! Validation of geometry on its way into an asset: triangles that are not finite, out of range or without area are skipped and counted.

use super::Batch;
use super::stray_vertices::leave_out_strays;
use crate::Reason;
use crate::vec3::{Vec3, length, triangle_normal};

/// Limits of one asset's geometry.
#[derive(Clone, Copy, Debug)]
pub struct GeometryLimits {
    /// |coordinate| in metres.
    pub coordinate_m: f64,
}

impl Default for GeometryLimits {
    fn default() -> Self {
        Self { coordinate_m: 1e8 }
    }
}

/// Skipped triangles and dropped texture coordinates, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SkippedGeometry {
    pub index_out_of_range: u64,
    pub not_finite: u64,
    pub too_far: u64,
    pub zero_area: u64,
    pub bad_uv: u64,
    /// Triangles that reach to a stray vertex, and the object of the first one.
    pub stray: u64,
    pub stray_object: Option<u32>,
}

impl SkippedGeometry {
    /// Returns (reason, count) of every reason.
    pub fn reasons(&self) -> [(Reason, u64); 5] {
        [
            (Reason::IndexOutOfRange, self.index_out_of_range),
            (Reason::CoordinateNotFinite, self.not_finite),
            (Reason::CoordinateTooFar, self.too_far),
            (Reason::ZeroArea, self.zero_area),
            (Reason::TextureCoordinateNotFinite, self.bad_uv),
        ]
    }
}

/// Returns which triangles of a batch are valid, in order. UVs that are not finite do not make a triangle invalid: the writer drops them.
pub fn valid_triangles(batch: &Batch, limits: GeometryLimits, skipped: &mut SkippedGeometry) -> Vec<bool> {
    let mut keep: Vec<bool> = batch.triangles.iter().map(|t| is_valid(&batch.positions, *t, limits, skipped)).collect();
    let (stray, object) = leave_out_strays(batch, &mut keep);
    skipped.stray += stray;
    skipped.stray_object = skipped.stray_object.or(object);
    keep
}

fn is_valid(positions: &[Vec3], t: [u32; 3], limits: GeometryLimits, skipped: &mut SkippedGeometry) -> bool {
    let corners = t.map(|v| positions.get(v as usize).copied());
    let [Some(a), Some(b), Some(c)] = corners else {
        skipped.index_out_of_range += 1;
        return false;
    };
    let values = || [a, b, c].into_iter().flatten();
    let area = length(triangle_normal([a, b, c]));
    let counter = if !values().all(f64::is_finite) {
        &mut skipped.not_finite
    } else if values().any(|v| v.abs() > limits.coordinate_m) {
        &mut skipped.too_far
    } else if area == 0.0 || area.is_nan() {
        &mut skipped.zero_area
    } else {
        return true;
    };
    *counter += 1;
    false
}
