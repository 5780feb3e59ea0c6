//! Ray queries on a scene: picking and occlusion.

use map3d_base::{Error, Frame, Result, Vec3};
use map3d_trace::{Ray, Rays};

use crate::cutout::TextureCutout;
use crate::scene::RenderScene;

/// The object that a line of sight hits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    pub id: u32,
    /// View coordinate D in metres.
    pub d_m: f64,
    /// Local position.
    pub position: Vec3,
}

impl RenderScene {
    /// Returns the first object on the line of sight through view coordinates (U, V).
    pub fn pick(&self, frame: &Frame, u_m: f64, v_m: f64) -> Result<Option<Pick>> {
        frame.validate()?;
        if !u_m.is_finite() || !v_m.is_finite() {
            return Err(Error::argument(format!("pick at ({u_m}, {v_m}): numbers must be finite")));
        }
        let axes = frame.axes();
        let ray = Ray { origin: axes.local_from_uvd([u_m, v_m, frame.d0_m]), direction: axes.forward, width_m: frame.pixel_m(frame.zmax) };
        let cutout = TextureCutout::new(self.textures());
        let hit = Rays::new(self.store()).closest_hit(&ray, &cutout)?;
        self.check_textures(&cutout)?;
        Ok(hit.map(|h| Pick { id: h.object_id, d_m: frame.d0_m + h.distance_m, position: h.position }))
    }

    /// Returns for each ray from a local point whether it hits anything within `max_m`.
    pub fn occluded(&self, origins: &[Vec3], direction: Vec3, max_m: f64) -> Result<Vec<bool>> {
        let numbers = origins.as_flattened().iter().chain(&direction);
        if !numbers.copied().all(f64::is_finite) || max_m.is_nan() || direction == [0.0; 3] {
            return Err(Error::argument("occluded: numbers must be finite, the direction not zero"));
        }
        let (rays, cutout) = (Rays::new(self.store()), TextureCutout::new(self.textures()));
        let is_occluded = |origin: &Vec3| rays.any_hit(&Ray { origin: *origin, direction, width_m: 0.0 }, max_m, &cutout);
        let out = origins.iter().map(is_occluded).collect::<Result<_>>()?;
        self.check_textures(&cutout)?;
        Ok(out)
    }
}
