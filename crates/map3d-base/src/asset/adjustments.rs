//! Adjustments of an asset: how far each object is moved in height, and which objects are left out (spec/scene.md, Adjustments).

use std::path::Path;

use crate::error::{Error, Result};
use crate::file::{self, HEADER_BYTES, aligned, header_start};
use crate::vec3::Vec3;

pub const ADJUSTMENTS_FILE: &str = "adjustments.m3h";
pub const ADJUSTMENTS_MAGIC: &[u8; 4] = b"M3DH";
pub const ADJUSTMENTS_VERSION: u32 = 1;

/// Heights as drawn are z · `scale` + the shift of the object, in metres; objects whose shift is NaN are left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Adjustments {
    pub scale: f64,
    pub shifts: Vec<f64>,
}

impl Adjustments {
    /// Reads the adjustments beside a mesh; `None` without any.
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(ADJUSTMENTS_FILE);
        let bytes = match std::fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(Error::storage(&path, error)),
        };
        file::check_header(&path, &bytes, ADJUSTMENTS_MAGIC, ADJUSTMENTS_VERSION, true)?;
        let word = |at: usize| bytes[at..at + 8].try_into().expect("8 bytes");
        let (count, scale) = (u64::from_le_bytes(word(16)), f64::from_le_bytes(word(24)));
        let count = usize::try_from(count).ok().filter(|n| n.checked_mul(8).is_some_and(|b| b < bytes.len()));
        let Some(body) = count.and_then(|n| bytes.get(HEADER_BYTES..HEADER_BYTES + 8 * n)) else {
            return Err(Error::format(&path, "truncated"));
        };
        let shifts: Vec<f64> = body.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().expect("8 bytes"))).collect();
        if !(scale.is_finite() && scale > 0.0) || shifts.iter().any(|s| s.is_infinite()) {
            return Err(Error::format(&path, "a scale or shift is out of range"));
        }
        Ok(Some(Self { scale, shifts }))
    }

    /// Writes the adjustments beside a mesh, in one step.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let path = folder.join(ADJUSTMENTS_FILE);
        let mut bytes = vec![0; HEADER_BYTES];
        bytes[16..24].copy_from_slice(&(self.shifts.len() as u64).to_le_bytes());
        bytes[24..32].copy_from_slice(&self.scale.to_le_bytes());
        bytes.extend(self.shifts.iter().flat_map(|s| s.to_le_bytes()));
        bytes.resize(aligned(bytes.len()), 0);
        let start = header_start(ADJUSTMENTS_MAGIC, ADJUSTMENTS_VERSION, file::checksum(&bytes[HEADER_BYTES..]));
        bytes[..16].copy_from_slice(&start);
        let part = path.with_extension("part");
        std::fs::write(&part, &bytes).and_then(|()| std::fs::rename(&part, &path)).map_err(|e| Error::storage(&path, e))
    }

    /// Returns a point of an object as drawn; `None` if the object is left out.
    pub fn place(&self, object: u32, p: Vec3) -> Option<Vec3> {
        self.shift(object).map(|shift| [p[0], p[1], p[2] * self.scale + shift])
    }

    /// Returns the transform, row-major 3 × 4, of an instance of an object as drawn; `None` if the object is left out.
    pub fn place_instance(&self, object: u32, transform: &[f64; 12]) -> Option<[f64; 12]> {
        let shift = self.shift(object)?;
        let mut out = transform.map(|v| v);
        out[8..].iter_mut().for_each(|v| *v *= self.scale);
        out[11] += shift;
        Some(out)
    }

    /// Returns a normal as drawn: steeper surfaces than before have flatter normals.
    pub fn turn_normal(&self, n: [f32; 3]) -> [f32; 3] {
        if self.scale == 1.0 || n == [0.0; 3] {
            return n;
        }
        let turned = [n[0], n[1], n[2] / self.scale as f32];
        let length = turned.iter().map(|v| v * v).sum::<f32>().sqrt();
        turned.map(|v| v / length)
    }

    fn shift(&self, object: u32) -> Option<f64> {
        self.shifts.get(object as usize).copied().filter(|s| !s.is_nan())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adjustments_survive_a_round_trip_and_damaged_ones_are_refused() {
        let folder = std::env::temp_dir().join(format!("map3d-adjustments-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        assert_eq!(Adjustments::read(&folder).expect("none"), None);
        let adjustments = Adjustments { scale: 0.3048, shifts: vec![1.5, f64::NAN, -505.0] };
        adjustments.write(&folder).expect("write");
        let back = Adjustments::read(&folder).expect("read").expect("some");
        assert_eq!((back.scale, back.shifts[0], back.shifts[2]), (0.3048, 1.5, -505.0));
        assert!(back.shifts[1].is_nan());
        let good = std::fs::read(folder.join(ADJUSTMENTS_FILE)).expect("read");
        for cut in [0, 20, 64, good.len() - 1] {
            std::fs::write(folder.join(ADJUSTMENTS_FILE), &good[..cut]).expect("write");
            assert!(Adjustments::read(&folder).is_err(), "cut at {cut}");
        }
        std::fs::remove_dir_all(&folder).expect("remove");
    }

    #[test]
    fn an_object_is_moved_as_a_rigid_body_or_left_out() {
        let adjustments = Adjustments { scale: 1.0, shifts: vec![10.0, f64::NAN] };
        assert_eq!(adjustments.place(0, [1.0, 2.0, 3.0]), Some([1.0, 2.0, 13.0]));
        assert_eq!((adjustments.place(1, [0.0; 3]), adjustments.place(2, [0.0; 3])), (None, None));
        let identity = [1.0, 0.0, 0.0, 5.0, 0.0, 1.0, 0.0, 6.0, 0.0, 0.0, 1.0, 7.0];
        assert_eq!(adjustments.place_instance(0, &identity).expect("placed")[11], 17.0);
        assert!(adjustments.place_instance(1, &identity).is_none());
    }

    #[test]
    fn normals_stay_perpendicular_to_scaled_surfaces() {
        let adjustments = Adjustments { scale: 0.5, shifts: vec![0.0] };
        let n = adjustments.turn_normal([0.6, 0.0, 0.8]);
        let along = [0.8, 0.0, -0.6 * 0.5];
        assert!((n[0] * along[0] + n[2] * along[2]).abs() < 1e-6);
        assert_eq!(adjustments.turn_normal([0.0; 3]), [0.0; 3]);
    }
}
