//! Views of any kind: cameras, and images as NumPy arrays.

use std::time::{Duration, Instant};

use map3d_base::{Box3, CameraKind, Vec3, ViewAxes, Window};
use map3d_render::{HitSelection, Region, RenderScene, ViewImage, ViewPixels, ViewRequest};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::codec::{set2, set3};
use crate::errors::{invalid, to_python};
use crate::frame::name_of;

/// Time between two checks for signals: each takes the GIL.
const SIGNAL_CHECK: Duration = Duration::from_millis(50);

/// A vector as Python gets it.
type Tuple = (f64, f64, f64);

/// A view of any kind; valid.
#[pyclass(module = "map3d._core", frozen, eq)]
#[derive(PartialEq)]
pub struct Camera(pub map3d_base::Camera);

#[pymethods]
impl Camera {
    #[new]
    // The numbers of a camera, each by its name.
    #[allow(clippy::too_many_arguments)]
    fn new(
        projection: &str,
        position: Vec3,
        right: Vec3,
        up: Vec3,
        forward: Vec3,
        window: (f64, f64, f64, f64),
        near_m: f64,
        far_m: f64,
        width_px: i64,
        height_px: i64,
    ) -> PyResult<Self> {
        let kind = match projection {
            "orthographic" => CameraKind::Orthographic,
            "perspective" => CameraKind::Perspective,
            other => return Err(invalid(format!("camera: projection is {other:?}, expected orthographic or perspective"))),
        };
        let (left, right_edge, bottom, top) = window;
        let side = |px: i64| px.clamp(0, i64::from(u32::MAX)) as u32;
        let camera = map3d_base::Camera {
            kind,
            position,
            axes: ViewAxes { right, up, forward },
            window: Window { left, right: right_edge, bottom, top },
            near_m,
            far_m,
            width_px: side(width_px),
            height_px: side(height_px),
        };
        camera.validated().map(Self).map_err(to_python)
    }

    #[getter]
    fn projection(&self) -> &'static str {
        match self.0.kind {
            CameraKind::Orthographic => "orthographic",
            CameraKind::Perspective => "perspective",
        }
    }

    #[getter]
    fn position(&self) -> Tuple {
        self.0.position.into()
    }

    #[getter]
    fn right(&self) -> Tuple {
        self.0.axes.right.into()
    }

    #[getter]
    fn up(&self) -> Tuple {
        self.0.axes.up.into()
    }

    #[getter]
    fn forward(&self) -> Tuple {
        self.0.axes.forward.into()
    }

    #[getter]
    fn window(&self) -> (f64, f64, f64, f64) {
        let w = &self.0.window;
        (w.left, w.right, w.bottom, w.top)
    }

    #[getter]
    fn near_m(&self) -> f64 {
        self.0.near_m
    }

    #[getter]
    fn far_m(&self) -> f64 {
        self.0.far_m
    }

    #[getter]
    fn width_px(&self) -> u32 {
        self.0.width_px
    }

    #[getter]
    fn height_px(&self) -> u32 {
        self.0.height_px
    }

    /// Returns the line of sight through a point of the image: its point in the camera's plane, and its direction with a length of 1 along `forward`.
    fn line_of_sight(&self, x_px: f64, y_px: f64) -> (Tuple, Tuple) {
        let (point, direction) = self.0.line_of_sight(x_px, y_px);
        (point.into(), direction.into())
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}

/// Returns a box from its corners.
pub fn box_of(corners: Option<(Vec3, Vec3)>) -> Option<Box3> {
    corners.map(|(lo, hi)| Box3 { lo, hi })
}

/// Returns the region from x, y, width and height.
pub fn region_of(region: Option<(u32, u32, u32, u32)>) -> Option<Region> {
    region.map(|(x, y, width, height)| Region { x, y, width, height })
}

/// Renders without the GIL. Signals stop it between image tiles.
pub fn render_view<'py>(py: Python<'py>, scene: &RenderScene, request: &ViewRequest) -> PyResult<Bound<'py, PyDict>> {
    let (mut failure, mut last) = (None, Instant::now());
    let mut must_continue = || {
        if last.elapsed() < SIGNAL_CHECK {
            return true;
        }
        last = Instant::now();
        failure = Python::attach(|py| py.check_signals()).err();
        failure.is_none()
    };
    let image = py.detach(|| scene.render_view(request, &mut must_continue));
    match failure {
        Some(error) => Err(error),
        None => dict_of(py, image.map_err(to_python)?),
    }
}

/// (id, metres along the line of sight, local position, normal) of a hit.
pub type PickedHit = (u32, f64, Tuple, Tuple);

pub fn pick_ray(py: Python<'_>, scene: &RenderScene, camera: &Camera, at: [f64; 2], selection: &HitSelection) -> PyResult<Vec<PickedHit>> {
    let hits = py.detach(|| scene.hits_at(&camera.0, at[0], at[1], selection)).map_err(to_python)?;
    Ok(hits.into_iter().map(|h| (h.id, h.distance_m, h.position.into(), h.normal.into())).collect())
}

fn dict_of<'py>(py: Python<'py>, image: ViewImage) -> PyResult<Bound<'py, PyDict>> {
    let size = (image.height, image.width);
    let dict = PyDict::new(py);
    for (kind, pixels) in image.layers {
        let name = name_of(kind);
        match pixels {
            ViewPixels::Color(pixels) => set3(&dict, &name, size, pixels),
            ViewPixels::Normal(pixels) => set3(&dict, &name, size, pixels),
            ViewPixels::Metres(pixels) => set2(&dict, &name, size, pixels),
            ViewPixels::Numbers(pixels) => set2(&dict, &name, size, pixels),
            ViewPixels::Shades(pixels) => set2(&dict, &name, size, pixels),
        }?;
    }
    Ok(dict)
}
