//! Materials, objects and reports of an asset, as written to its JSON files.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Class rank: settles coplanar surfaces (spec/glossary.md).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Rank {
    Terrain = 0,
    Road = 1,
    Ground = 2,
    Other = 3,
    Installation = 4,
    Opening = 5,
}

/// What lies outside [0, 1] of a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Wrap {
    #[default]
    Wrap,
    Mirror,
    Clamp,
    Border,
    None,
}

/// `texture` and `alpha` are keys: the first 32 hex digits of the SHA-256 of the image's bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    pub name: String,
    /// sRGB and opacity, 0..1.
    pub diffuse: [f32; 4],
    pub texture: Option<String>,
    pub alpha: Option<String>,
    pub wrap: Wrap,
    /// sRGB and opacity, 0..1; used by `Wrap::Border`.
    pub border: [f32; 4],
    /// Texture or alpha image has transparent texels.
    pub cutout: bool,
}

impl Default for Material {
    fn default() -> Self {
        Self { name: String::new(), diffuse: [0.8, 0.8, 0.8, 1.0], texture: None, alpha: None, wrap: Wrap::Wrap, border: [0.0; 4], cutout: false }
    }
}

/// A placement of a prototype: row-major 3 × 4, prototype → world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Instance {
    pub prototype: u32,
    pub object: u32,
    pub transform: [f64; 12],
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Materials {
    pub materials: Vec<Material>,
    #[serde(default)]
    pub instances: Vec<Instance>,
}

/// A city object of the source. `parent` is an index into the asset's objects.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Object {
    pub name: String,
    pub class: String,
    pub parent: Option<u32>,
    pub lod: Option<String>,
    pub attributes: BTreeMap<String, serde_json::Value>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Warning {
    pub reason: String,
    pub count: u64,
    /// Where it happened first: a name, a line, a file.
    pub example: String,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AssetReport {
    pub format: String,
    pub objects: u64,
    pub triangles: u64,
    pub skipped: BTreeMap<String, u64>,
    pub warnings: Vec<Warning>,
    /// The CRS as the source writes it.
    pub crs: Option<String>,
    /// Box of what was kept, in the coordinates that were written.
    pub box_source: Option<[[f64; 3]; 2]>,
}

impl AssetReport {
    /// Counts `n` more of a reason to skip.
    pub fn skip(&mut self, reason: &str, n: u64) {
        if n > 0 {
            *self.skipped.entry(reason.to_owned()).or_default() += n;
        }
    }

    /// Counts one more of a warning; the first example is kept.
    pub fn warn(&mut self, reason: &str, example: impl Into<String>) {
        match self.warnings.iter_mut().find(|w| w.reason == reason) {
            Some(w) => w.count += 1,
            None => self.warnings.push(Warning { reason: reason.to_owned(), count: 1, example: example.into() }),
        }
    }
}
