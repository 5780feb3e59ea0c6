//! Builds a scene from its assets.

use std::collections::BTreeMap;
use std::path::Path;

use map3d_base::{Result, Vec3};
use serde::{Deserialize, Serialize};

/// What to build.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BuildRequest {
    /// Names of folders under `assets/`, in the order of the registry.
    pub assets: Vec<String>,
    /// World coordinates of the local origin.
    pub origin: Vec3,
    #[serde(default)]
    pub options: BuildOptions,
    /// Object of the ground plane; needed when one is made.
    #[serde(default)]
    pub ground_id: u32,
    /// 0: one per core.
    #[serde(default)]
    pub threads: usize,
    /// 0: 1 GiB.
    #[serde(default)]
    pub max_memory_bytes: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BuildOptions {
    pub merge_vertices: bool,
    pub merge_faces: bool,
    pub drop_degenerate: bool,
    pub merge_materials: bool,
    pub drop_untextured: bool,
    pub ground_plane: GroundPlane,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GroundPlane {
    /// When the scene has no terrain.
    #[default]
    Auto,
    On,
    Off,
}

impl Default for BuildOptions {
    fn default() -> Self {
        let on = true;
        Self { merge_vertices: on, merge_faces: on, drop_degenerate: on, merge_materials: on, drop_untextured: false, ground_plane: GroundPlane::Auto }
    }
}

/// Counts of what was built and optimised away.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BuildReport {
    pub counts: BTreeMap<String, u64>,
}

/// (stage, done, total) → false to stop.
pub type Progress<'a> = &'a mut dyn FnMut(&str, u64, u64) -> bool;

/// Builds chunks, textures, instances and `scene.json` of a scene's folder.
pub fn build_scene(folder: &Path, request: &BuildRequest, progress: Progress) -> Result<BuildReport> {
    let _ = (folder, request, progress);
    todo!()
}
