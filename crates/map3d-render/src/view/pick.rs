//! The surfaces on a line of sight of any view.

use map3d_base::vec3::{add, length, scale};
use map3d_base::{Box3, Camera, CameraKind, Error, Projection, Result, Vec3};
use map3d_trace::{HitQuery, Ray, Rays, ViewClip};

use super::request::{check_box, nearest_m, sorted};
use crate::cutout::TextureCutout;
use crate::scene::RenderScene;

/// Most hits of one query.
const HITS_MAX: usize = 10_000;

/// Which surfaces a query returns: at most `count`, inside a local box, of some objects.
#[derive(Clone, Debug)]
pub struct HitSelection {
    pub count: usize,
    pub cut: Option<Box3>,
    pub objects: Option<Vec<u32>>,
}

/// A surface on a line of sight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    pub id: u32,
    /// Metres along the line of sight from the camera's plane, in perspective from the point of the camera.
    pub distance_m: f64,
    /// Local position.
    pub position: Vec3,
    /// Geometric unit normal of the visible side, local axes.
    pub normal: Vec3,
}

impl RenderScene {
    /// Returns the first surfaces on the line of sight through (x, y) in pixels from the image's top left corner, from the near to the far distance. Pixel
    /// (i, j) has its centre at (i + ½, j + ½). `camera` is valid (`Camera::validated`).
    pub fn hits_at(&self, camera: &Camera, x_px: f64, y_px: f64, selection: &HitSelection) -> Result<Vec<RayHit>> {
        let is_inside = |v: f64, size: u32| v >= 0.0 && v <= f64::from(size);
        if !is_inside(x_px, camera.width_px) || !is_inside(y_px, camera.height_px) {
            let (w, h) = (camera.width_px, camera.height_px);
            return Err(Error::argument(format!("pick at ({x_px}, {y_px}): expected a point of the image, {w} × {h} px")));
        }
        if !(1..=HITS_MAX).contains(&selection.count) {
            return Err(Error::argument(format!("pick: count is {}, expected 1 to {HITS_MAX}", selection.count)));
        }
        check_box(selection.cut.as_ref())?;
        let bounds = self.store().bounds();
        if bounds.is_empty() {
            return Ok(Vec::new());
        }

        // The ray begins at the near distance or in front of the scene, in perspective at the point of the camera.
        let (point, direction) = camera.line_of_sight(x_px, y_px);
        let step = length(direction);
        let pixel = camera.pixel().into_iter().fold(0.0, f64::max);
        let (first_m, width_m, spread) = match camera.kind {
            CameraKind::Orthographic => (camera.near_m.max(nearest_m(camera, &bounds) - 1.0), pixel, 0.0),
            CameraKind::Perspective => (0.0, 0.0, pixel / step),
        };
        let ray = Ray { origin: add(point, scale(direction, first_m / step)), direction, width_m };

        let clip = ViewClip::new(camera, &Projection::of_camera(camera, 0.0), selection.cut.as_ref(), sorted(selection.objects.as_deref()));
        let accepts = |id: u32, position: Vec3| clip.selects(id) && clip.contains(position);
        let cutout = TextureCutout::new(self.textures());
        let hits = Rays::new(self.store()).first_hits(&ray, &HitQuery { count: selection.count, spread, accepts: &accepts }, &cutout)?;
        self.check_textures(&cutout)?;
        let hit = |h: map3d_trace::Hit| RayHit { id: h.object_id, distance_m: first_m + h.distance_m, position: h.position, normal: h.normal };
        Ok(hits.into_iter().map(hit).collect())
    }
}
