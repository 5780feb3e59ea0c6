//! Options and limits for reading one document.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use map3d_base::limits::{MAX_IMAGE_PX, MAX_IMAGE_SIDE_PX};
use map3d_base::{Error, Result};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use super::transparency::Transparency;

/// Positions in one coordinate system, from those in another: (source, target, x and y as documents write them) → x and y, or `None` if no transformation
/// is known.
type Transform = dyn Fn(&str, &str, &[[f64; 2]]) -> Result<Option<Vec<[f64; 2]>>> + Send + Sync;

/// Transforms positions between coordinate systems. The core knows none.
#[derive(Clone)]
pub struct PositionTransformer(Arc<Transform>);

impl PositionTransformer {
    pub fn new(transform: impl Fn(&str, &str, &[[f64; 2]]) -> Result<Option<Vec<[f64; 2]>>> + Send + Sync + 'static) -> Self {
        Self(Arc::new(transform))
    }

    /// Returns `None` if no transformation is known.
    pub fn transform(&self, source: &str, target: &str, positions: &[[f64; 2]]) -> Result<Option<Vec<[f64; 2]>>> {
        let found = (self.0)(source, target, positions)?;
        Ok(found.filter(|found| found.len() == positions.len()))
    }
}

impl fmt::Debug for PositionTransformer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("PositionTransformer")
    }
}

/// Options for one document. The limits guard against hostile input; raise one by its name for large data.
#[derive(Clone, Debug, Deserialize)]
#[serde(default)]
pub struct ReadOptions {
    pub transparency: Transparency,
    /// Makes the first broken part an error.
    pub strict: bool,
    /// Folder that file names in the document may lead to; by default, the document's own.
    pub folder: Option<PathBuf>,
    /// Transforms the place of textures to the coordinate system of surfaces.
    #[serde(skip)]
    pub transform: Option<PositionTransformer>,
    pub max_image_side_px: u64,
    pub max_image_px: u64,
    pub max_ring_vertices: u64,
    pub max_triangles: u64,
    pub max_instances: u64,
    /// Memory for appearances outside city objects, and for those of one city object.
    pub max_appearance_bytes: u64,
    /// Memory for the geometry of one city object.
    pub max_object_bytes: u64,
    /// Options that only the format has: all other members.
    #[serde(flatten)]
    pub of_format: Map<String, Value>,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            transparency: Transparency::default(),
            strict: false,
            folder: None,
            transform: None,
            max_image_side_px: MAX_IMAGE_SIDE_PX,
            max_image_px: MAX_IMAGE_PX,
            max_ring_vertices: 1_000_000,
            max_triangles: 200_000_000,
            max_instances: 10_000_000,
            max_appearance_bytes: 1 << 30,
            max_object_bytes: 1 << 30,
            of_format: Map::new(),
        }
    }
}

impl ReadOptions {
    /// Parses options from JSON. Absent members have their defaults; members that only one format has are checked when a document is opened.
    pub fn from_json(text: &str) -> Result<Self> {
        serde_json::from_str(text).map_err(|e| Error::argument(format!("reader options: {e}")))
    }

    /// Parses the options that only the format has; unknown members are an error.
    pub fn parse_of_format<T: DeserializeOwned>(&self) -> Result<T> {
        serde_json::from_value(Value::Object(self.of_format.clone())).map_err(|e| Error::argument(format!("reader options: {e}")))
    }

    /// Returns the options for a document in another format that this one names.
    pub fn without_format(&self) -> Self {
        Self { of_format: Map::new(), ..self.clone() }
    }
}
