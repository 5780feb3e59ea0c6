//! Single rays through the same trees, by the same rules (spec/pyramid.md §4).

use map3d_base::{Result, Vec3};
use map3d_scene::SceneStore;

use crate::cutout::Cutout;
use crate::surface::Surface;

/// A ray from a local point. `direction` need not be a unit vector; distances are in metres all the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    pub origin: Vec3,
    pub direction: Vec3,
    /// Width in metres over which cut-outs are filtered; a pixel's side for rays that stand for a pixel.
    pub width_m: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Hit {
    /// Metres along the ray.
    pub distance_m: f64,
    /// Local position.
    pub position: Vec3,
    pub object_id: u32,
    pub surface: Surface,
}

/// Ray queries on a scene.
pub struct Rays<'s> {
    scene: &'s SceneStore,
}

impl<'s> Rays<'s> {
    pub fn new(scene: &'s SceneStore) -> Self {
        Self { scene }
    }

    /// The surface that wins among those the ray meets at distances ≥ 0.
    pub fn closest(&self, ray: &Ray, cutout: &dyn Cutout) -> Result<Option<Hit>> {
        let _ = (self.scene, ray, cutout);
        todo!()
    }

    /// Whether the ray meets anything at a distance in (0, max_m].
    pub fn any_hit(&self, ray: &Ray, max_m: f64, cutout: &dyn Cutout) -> Result<bool> {
        let _ = (self.scene, ray, max_m, cutout);
        todo!()
    }
}
