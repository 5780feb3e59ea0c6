//! What a caller may choose, and the limits of one document.

use std::path::PathBuf;

use map3d_base::{Error, Result};
use serde::Deserialize;

/// Axis of an OBJ that points up; with `y`, (x, y, z) becomes (x, −z, y).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    Y,
    #[default]
    Z,
}

/// What becomes one object of an OBJ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    #[default]
    File,
    Group,
}

/// Options of one document; the limits are those of the safety rules and may be raised by name.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReadOptions {
    pub up: Up,
    pub split: Split,
    /// Appearance theme of a CityGML document; none: the first in the file.
    pub theme: Option<String>,
    /// Level of detail of a CityGML document; none: the best of each object.
    pub lod: Option<String>,
    /// The first broken part is an error.
    pub strict: bool,
    /// Folder that names in the document may lead to; none: the document's own.
    pub folder: Option<PathBuf>,
    pub max_image_side_px: u64,
    pub max_image_px: u64,
    pub max_ring_vertices: u64,
    pub max_triangles: u64,
    pub max_instances: u64,
    /// Memory for appearances that stand outside of the city objects.
    pub max_appearance_bytes: u64,
    /// Memory for the geometry of one city object.
    pub max_object_bytes: u64,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            up: Up::default(),
            split: Split::default(),
            theme: None,
            lod: None,
            strict: false,
            folder: None,
            max_image_side_px: 16_384,
            max_image_px: 128_000_000,
            max_ring_vertices: 1_000_000,
            max_triangles: 200_000_000,
            max_instances: 10_000_000,
            max_appearance_bytes: 1 << 30,
            max_object_bytes: 1 << 30,
        }
    }
}

impl ReadOptions {
    /// From JSON; an absent member has its default, an unknown one is an error.
    pub fn from_json(text: &str) -> Result<Self> {
        serde_json::from_str(text).map_err(|e| Error::argument(format!("reader options: {e}")))
    }
}
