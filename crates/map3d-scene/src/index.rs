//! `scene.json`: the scene index (spec/scene.md).

use std::collections::BTreeMap;
use std::path::Path;

use map3d_base::{Box3, Error, Result, Vec3};
use serde::{Deserialize, Serialize};

pub const FILE: &str = "scene.json";

/// A cell: level, column, row in the pinned square; x grows east, y grows north.
pub type Cell = [u32; 3];

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneIndex {
    pub map3d: String,
    pub version: u32,
    /// World coordinates of the local origin.
    pub origin: Vec3,
    /// Local box of all content, instances included: `[lo, hi]`; `null` when the scene is empty.
    #[serde(rename = "box")]
    pub bounds: Option<[Vec3; 2]>,
    /// Local x0, y0 (south-west corner) and side of the pinned square.
    pub square: [f64; 3],
    /// Pinned leaf cells in Morton order.
    pub cells: Vec<Cell>,
    pub chunks: Vec<ChunkEntry>,
    pub prototypes: Vec<ChunkEntry>,
    pub instances: InstancesEntry,
    pub options: serde_json::Value,
    pub report: BTreeMap<String, u64>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChunkEntry {
    /// Relative to the scene's folder.
    pub file: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cell: Option<Cell>,
    pub origin: Vec3,
    /// Local (a prototype's: in its own frame).
    #[serde(rename = "box")]
    pub bounds: [Vec3; 2],
    pub triangles: u64,
    pub bytes: u64,
    /// The file's xxh3-64, 16 hex digits.
    pub hash: String,
}

impl ChunkEntry {
    pub fn box3(&self) -> Box3 {
        Box3 { lo: self.bounds[0], hi: self.bounds[1] }
    }
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct InstancesEntry {
    pub file: String,
    pub count: u64,
}

impl SceneIndex {
    /// Reads and checks `scene.json` of a scene's folder.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(FILE);
        let text = std::fs::read_to_string(&path).map_err(|e| Error::storage(&path, e))?;
        let index: Self = serde_json::from_str(&text).map_err(|e| Error::format(&path, e.to_string()))?;
        index.validate(&path)?;
        Ok(index)
    }

    fn validate(&self, path: &Path) -> Result<()> {
        if self.map3d != "scene" || self.version != 1 {
            return Err(Error::format(path, format!("{:?} version {}, this program reads \"scene\" version 1", self.map3d, self.version)));
        }
        let boxes = self.chunks.iter().chain(&self.prototypes).flat_map(|c| c.bounds.iter().chain([&c.origin]));
        let numbers = boxes.flatten().chain(&self.square).chain(&self.origin);
        if !numbers.copied().all(f64::is_finite) || self.square[2] <= 0.0 {
            return Err(Error::format(path, "a number is not finite, or the square has no side"));
        }
        let files = self.chunks.iter().chain(&self.prototypes).map(|c| &c.file);
        match files.chain([&self.instances.file]).find(|f| !is_inside(f)) {
            Some(file) => Err(Error::format(path, format!("file name {file:?} leads out of the scene's folder"))),
            None => Ok(()),
        }
    }
}

/// Relative, without a step up.
fn is_inside(file: &str) -> bool {
    Path::new(file).components().all(|c| matches!(c, std::path::Component::Normal(_)))
}
