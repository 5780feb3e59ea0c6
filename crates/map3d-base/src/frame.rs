//! The pinned frame of a view with the layers of a pass (spec/pyramid.md §2, §8).

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::layers::{LayerFormat, LayerKind};
use crate::limits::{AO_RADIUS_M, DEEPEST_LEVEL, QUALITY, TILE_PX};
use crate::tile::Tile;
use crate::vec3::{Vec3, length};
use crate::view::ViewAxes;

/// How a layer is made and sent (spec/pyramid.md §6, §10).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LayerSpec {
    pub kind: LayerKind,
    pub format: LayerFormat,
    /// For lossy formats, 1..=100.
    #[serde(default = "default_quality")]
    pub quality: u8,
    /// Trades encoding time for fewer bytes.
    #[serde(default)]
    pub small: bool,
    /// Unit vectors towards the suns, local axes; as many as the kind's row says.
    #[serde(default)]
    pub suns: Vec<Vec3>,
    /// Radius of ambient occlusion, for the kinds that have one.
    #[serde(default)]
    pub radius_m: f64,
}

fn default_quality() -> u8 {
    80
}

impl LayerSpec {
    /// Returns a layer of quality 80 without suns.
    pub fn new(kind: LayerKind, format: LayerFormat) -> Self {
        Self { kind, format, quality: default_quality(), small: false, suns: Vec::new(), radius_m: 0.0 }
    }

    /// Fails for layers that cannot be rendered together. `what` has the layers.
    pub fn validate_all(what: &str, layers: &[Self]) -> Result<()> {
        let twice = (1..layers.len()).find(|k| layers[..*k].iter().any(|l| l.kind == layers[*k].kind));
        if let Some(k) = twice {
            return Err(Error::argument(format!("{what}: two layers are {:?}; a pass has one of a kind", layers[k].kind)));
        }
        layers.iter().try_for_each(Self::validate)
    }

    fn validate(&self) -> Result<()> {
        let kind = self.kind;
        let row = kind.row();
        if !row.formats.contains(&self.format) {
            return Err(Error::argument(format!("layer {kind:?}: its format is {:?}, expected one of {:?}", self.format, row.formats)));
        }
        let [least, most] = row.suns;
        if !(least..=most).contains(&self.suns.len()) {
            return Err(Error::argument(format!("layer {kind:?}: {} suns, expected {least} to {most}", self.suns.len())));
        }
        let is_unit = |v: &Vec3| (length(*v) - 1.0).abs() < 1e-6;
        if let Some(sun) = self.suns.iter().find(|s| !is_unit(s)) {
            return Err(Error::argument(format!("layer {kind:?}: {sun:?} is not a unit vector")));
        }
        let [least, most] = AO_RADIUS_M;
        if row.radius && !(least..=most).contains(&self.radius_m) {
            return Err(Error::argument(format!("layer {kind:?}: radius_m is {}, expected {least} to {most}", self.radius_m)));
        }
        let [least, most] = QUALITY;
        if !(least..=most).contains(&self.quality) {
            return Err(Error::argument(format!("layer {kind:?}: quality is {}, expected {least} to {most}", self.quality)));
        }
        Ok(())
    }
}

/// A view's square, pinned when the rendering was created, and the layers of a pass. Local metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    pub look_at_deg: f64,
    pub pitch_deg: f64,
    pub u0_m: f64,
    pub v0_m: f64,
    pub d0_m: f64,
    pub size_m: f64,
    pub tile_px: u32,
    pub zmax: u8,
    #[serde(default)]
    pub layers: Vec<LayerSpec>,
}

impl Frame {
    pub fn validate(&self) -> Result<()> {
        let numbers = [self.look_at_deg, self.pitch_deg, self.u0_m, self.v0_m, self.d0_m, self.size_m];
        if !numbers.iter().all(|v| v.is_finite()) || self.size_m <= 0.0 {
            return Err(Error::argument("frame: numbers must be finite and size_m > 0"));
        }
        if !(self.pitch_deg > 0.0 && self.pitch_deg <= 90.0) {
            return Err(Error::argument(format!("frame: pitch_deg is {}, expected 0 < pitch <= 90", self.pitch_deg)));
        }
        if !TILE_PX.contains(&self.tile_px) {
            return Err(Error::argument(format!("frame: tile_px is {}, expected one of {TILE_PX:?}", self.tile_px)));
        }
        if self.zmax > DEEPEST_LEVEL {
            return Err(Error::argument(format!("frame: zmax is {}, expected at most {DEEPEST_LEVEL}", self.zmax)));
        }
        LayerSpec::validate_all("frame", &self.layers)
    }

    /// Returns the layer of a kind.
    pub fn layer(&self, kind: LayerKind) -> Option<&LayerSpec> {
        self.layers.iter().find(|l| l.kind == kind)
    }

    pub fn axes(&self) -> ViewAxes {
        ViewAxes::new(self.look_at_deg, self.pitch_deg)
    }

    /// Returns the side of a pixel of a level in metres.
    pub fn pixel_m(&self, z: u8) -> f64 {
        self.size_m / (f64::from(self.tile_px) * f64::from(2u32.pow(u32::from(z))))
    }

    /// Returns pixel coordinates of level zmax (right, down, from the square's top left corner) and depth units from D0 of a local point.
    pub fn pixel_from_local(&self, axes: &ViewAxes, p: Vec3) -> Vec3 {
        let [u, v, d] = axes.uvd_from_local(p);
        let pixel = self.pixel_m(self.zmax);
        [(u - self.u0_m) / pixel, (self.v0_m - v) / pixel, (d - self.d0_m) * crate::DEPTH_UNITS_PER_M]
    }

    /// Returns view coordinates (U, V) of the centre of pixel (i, j) of a tile.
    pub fn uv_of_pixel(&self, tile: Tile, i: u32, j: u32) -> (f64, f64) {
        let px = self.pixel_m(tile.z);
        let column = f64::from(tile.x) * f64::from(self.tile_px) + f64::from(i) + 0.5;
        let row = f64::from(tile.y) * f64::from(self.tile_px) + f64::from(j) + 0.5;
        (self.u0_m + column * px, self.v0_m - row * px)
    }
}
