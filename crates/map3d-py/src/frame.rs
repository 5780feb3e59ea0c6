//! Frames of views with the layers of a pass, as the core takes them.

use map3d_base::limits::DEEPEST_LEVEL;
use map3d_base::tile::Tile;
use map3d_base::{Box3, LayerFormat, LayerKind, Vec3};
use pyo3::prelude::*;
use serde::de::DeserializeOwned;

use crate::errors::{invalid, to_python};

/// Least and greatest corner.
pub type Corners = ((f64, f64, f64), (f64, f64, f64));

/// Returns the corners of a box; `None` for an empty one.
pub fn corners_of(bounds: &Box3) -> Option<Corners> {
    (!bounds.is_empty()).then(|| (bounds.lo.into(), bounds.hi.into()))
}

/// Returns a tile that exists.
pub fn tile_at(z: u8, x: u32, y: u32) -> PyResult<Tile> {
    if z > DEEPEST_LEVEL || x >> z != 0 || y >> z != 0 {
        return Err(invalid(format!("tile {z}/{x}/{y} does not exist")));
    }
    Ok(Tile { z, x, y })
}

pub fn parse_kind(kind: &str) -> PyResult<LayerKind> {
    parse("kind", kind)
}

pub fn parse_format(format: &str) -> PyResult<LayerFormat> {
    parse("format", format)
}

fn parse<T: DeserializeOwned>(what: &str, name: &str) -> PyResult<T> {
    serde_json::from_value(serde_json::Value::String(name.to_owned())).map_err(|e| invalid(format!("{what}: {e}")))
}

pub fn name_of(value: impl serde::Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|v| v.as_str().map(str::to_owned)).expect("the variants are names")
}

/// How a layer is made and encoded.
#[pyclass(module = "map3d._core", frozen, eq)]
#[derive(PartialEq)]
pub struct LayerSpec(pub map3d_base::LayerSpec);

#[pymethods]
impl LayerSpec {
    #[new]
    #[pyo3(signature = (kind, format, quality=80, small=false, suns=Vec::new(), radius_m=0.0))]
    fn new(kind: &str, format: &str, quality: u8, small: bool, suns: Vec<Vec3>, radius_m: f64) -> PyResult<Self> {
        let (kind, format) = (parse_kind(kind)?, parse_format(format)?);
        Ok(Self(map3d_base::LayerSpec { kind, format, quality, small, suns, radius_m }))
    }

    #[getter]
    fn kind(&self) -> String {
        name_of(self.0.kind)
    }

    #[getter]
    fn format(&self) -> String {
        name_of(self.0.format)
    }

    #[getter]
    fn quality(&self) -> u8 {
        self.0.quality
    }

    #[getter]
    fn small(&self) -> bool {
        self.0.small
    }

    #[getter]
    fn suns(&self) -> Vec<(f64, f64, f64)> {
        self.0.suns.iter().map(|s| (*s).into()).collect()
    }

    #[getter]
    fn radius_m(&self) -> f64 {
        self.0.radius_m
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}

/// A view's pinned frame with the layers of a pass; valid.
#[pyclass(module = "map3d._core", frozen, eq)]
#[derive(PartialEq)]
pub struct Frame(pub map3d_base::Frame);

#[pymethods]
impl Frame {
    #[new]
    #[pyo3(signature = (look_at_deg, pitch_deg, u0_m, v0_m, d0_m, size_m, tile_px, zmax, layers=Vec::new()))]
    // The numbers of a frame, each by its name.
    #[allow(clippy::too_many_arguments)]
    fn new(
        look_at_deg: f64,
        pitch_deg: f64,
        u0_m: f64,
        v0_m: f64,
        d0_m: f64,
        size_m: f64,
        tile_px: u32,
        zmax: u8,
        layers: Vec<Bound<'_, LayerSpec>>,
    ) -> PyResult<Self> {
        let layers = layers.iter().map(|l| l.get().0.clone()).collect();
        let frame = map3d_base::Frame { look_at_deg, pitch_deg, u0_m, v0_m, d0_m, size_m, tile_px, zmax, layers };
        frame.validate().map_err(to_python)?;
        Ok(Self(frame))
    }

    #[getter]
    fn look_at_deg(&self) -> f64 {
        self.0.look_at_deg
    }

    #[getter]
    fn pitch_deg(&self) -> f64 {
        self.0.pitch_deg
    }

    #[getter]
    fn u0_m(&self) -> f64 {
        self.0.u0_m
    }

    #[getter]
    fn v0_m(&self) -> f64 {
        self.0.v0_m
    }

    #[getter]
    fn d0_m(&self) -> f64 {
        self.0.d0_m
    }

    #[getter]
    fn size_m(&self) -> f64 {
        self.0.size_m
    }

    #[getter]
    fn tile_px(&self) -> u32 {
        self.0.tile_px
    }

    #[getter]
    fn zmax(&self) -> u8 {
        self.0.zmax
    }

    #[getter]
    fn layers(&self) -> Vec<LayerSpec> {
        self.0.layers.iter().cloned().map(LayerSpec).collect()
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}
