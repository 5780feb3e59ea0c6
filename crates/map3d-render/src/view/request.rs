//! What is asked of a view, checked.

use std::sync::Arc;

use map3d_base::layers::LAYERS;
use map3d_base::{Box3, Camera, CameraKind, DEPTH_UNITS_PER_M, Error, LayerSpec, Projection, Result, vec3};
use map3d_trace::ViewClip;

use crate::shade::SampleSet;

/// Most threads of one view.
const THREADS_MAX: usize = 256;
/// Content at depths of less than this number of units takes the slow path of the beam.
const LEAST_DEPTH_UNITS: f64 = 2048.0;

/// A rectangle of an image in pixels from its top left corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    pub x: u32,
    pub y: u32,
    pub width: u32,
    pub height: u32,
}

/// What to render of a scene.
#[derive(Clone, Debug)]
pub struct ViewRequest {
    /// Valid (`Camera::validated`).
    pub camera: Camera,
    pub layers: Vec<LayerSpec>,
    /// Samples per pixel whose mean is its colour: 1, 4 or 16.
    pub samples: u32,
    /// Only what is inside this local box is drawn.
    pub cut: Option<Box3>,
    /// Only objects with these ids are drawn.
    pub objects: Option<Vec<u32>>,
    /// The part of the image that is rendered; `None`: all of it.
    pub region: Option<Region>,
    pub threads: usize,
    /// Seconds after which rendering fails.
    pub deadline_s: Option<f64>,
}

impl ViewRequest {
    pub(super) fn check(&self) -> Result<()> {
        LayerSpec::validate_all("view", &self.layers)?;
        if let Some(layer) = self.layers.iter().find(|l| !l.kind.row().view) {
            let kinds: Vec<_> = LAYERS.iter().filter(|row| row.view).map(|row| row.kind).collect();
            return Err(Error::argument(format!("view: layer {:?} exists only in pyramids; a view has {kinds:?}", layer.kind)));
        }
        if !(1..=THREADS_MAX).contains(&self.threads) {
            return Err(Error::argument(format!("view: threads is {}, expected 1 to {THREADS_MAX}", self.threads)));
        }
        if let Some(s) = self.deadline_s.filter(|s| !(*s > 0.0 && *s <= 1e6)) {
            return Err(Error::argument(format!("view: deadline_s is {s}, expected more than 0 and at most 1e6")));
        }
        check_box(self.cut.as_ref())?;
        self.sample_set()?;
        self.region().map(|_| ())
    }

    pub(super) fn sample_set(&self) -> Result<SampleSet> {
        match self.samples {
            1 => Ok(SampleSet::CENTER),
            4 => Ok(SampleSet::FOUR),
            16 => Ok(SampleSet::ALL),
            n => Err(Error::argument(format!("view: samples is {n}, expected 1, 4 or 16"))),
        }
    }

    /// Returns the part of the image that is rendered. Fails for one that is empty or not inside the image.
    pub(super) fn region(&self) -> Result<Region> {
        let (width, height) = (self.camera.width_px, self.camera.height_px);
        let Some(region) = self.region else { return Ok(Region { x: 0, y: 0, width, height }) };
        let fits = |from: u32, size: u32, all: u32| size > 0 && from.checked_add(size).is_some_and(|end| end <= all);
        match fits(region.x, region.width, width) && fits(region.y, region.height, height) {
            true => Ok(region),
            false => {
                let Region { x, y, width: w, height: h } = region;
                Err(Error::argument(format!("view: region is {w} × {h} px at ({x}, {y}), expected a part of {width} × {height} px")))
            }
        }
    }

    /// Returns the selection of objects in the order that searches need.
    pub(super) fn sorted_objects(&self) -> Option<Arc<[u32]>> {
        sorted(self.objects.as_deref())
    }
}

/// Fails for a box that is not finite or has no inside.
pub(super) fn check_box(cut: Option<&Box3>) -> Result<()> {
    let Some(b) = cut else { return Ok(()) };
    let is_finite = b.lo.iter().chain(&b.hi).all(|v| v.abs() <= 1e9);
    match is_finite && !b.is_empty() {
        true => Ok(()),
        false => Err(Error::argument(format!("view: box is {:?} to {:?}, expected finite numbers, least corner first", b.lo, b.hi))),
    }
}

pub(super) fn sorted(ids: Option<&[u32]>) -> Option<Arc<[u32]>> {
    ids.map(|ids| {
        let mut ids = ids.to_vec();
        ids.sort_unstable();
        ids.into()
    })
}

/// A camera over a scene: its projection, what it shows, and the depth in units at its plane.
pub(super) struct SceneCamera {
    pub view: Projection,
    pub clip: ViewClip,
    pub depth_zero_units: f64,
}

impl SceneCamera {
    /// `bounds`: the scene's local box, not empty.
    pub fn new(camera: &Camera, bounds: &Box3, cut: Option<&Box3>, objects: Option<Arc<[u32]>>) -> Self {
        let depth_zero_units = match camera.kind {
            CameraKind::Perspective => 0.0,
            CameraKind::Orthographic => {
                // The first metre that may have content, in whole units from the camera's plane.
                let first_m = (nearest_m(camera, bounds)).max(camera.near_m);
                (first_m * DEPTH_UNITS_PER_M).floor() - LEAST_DEPTH_UNITS
            }
        };
        let view = Projection::of_camera(camera, depth_zero_units);
        Self { view, clip: ViewClip::new(camera, &view, cut, objects), depth_zero_units }
    }

    /// Returns the distance along `forward` of a depth in units.
    pub fn depth_m(&self, units: u32) -> f32 {
        ((f64::from(units) + self.depth_zero_units) / DEPTH_UNITS_PER_M) as f32
    }
}

/// Returns the least distance of a box from the camera's plane.
pub(super) fn nearest_m(camera: &Camera, bounds: &Box3) -> f64 {
    let (forward, center, half) = (camera.axes.forward, bounds.center(), bounds.half_extents());
    let reach: f64 = (0..3).map(|k| forward[k].abs() * half[k]).sum();
    vec3::dot(forward, vec3::sub(center, camera.position)) - reach
}
