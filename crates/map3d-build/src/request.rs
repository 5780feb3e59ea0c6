//! The request for a build, in JSON.

use std::path::{Path, PathBuf};

use map3d_base::{Error, Result, Vec3};
use serde::{Deserialize, Serialize};

use crate::content::Choice;
use crate::surface_colors::StyleRule;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BuildRequest {
    /// Names of folders under `assets/`, in the order of the registry.
    pub assets: Vec<String>,
    /// World coordinates of the local origin.
    pub origin: Vec3,
    #[serde(default)]
    pub options: BuildOptions,
    /// Object of the ground plane; required when the build makes one.
    #[serde(default)]
    pub ground_id: u32,
    /// 0: one per core.
    #[serde(default)]
    pub threads: usize,
    /// 0: 1 GiB.
    #[serde(default)]
    pub max_memory_bytes: u64,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BuildOptions {
    /// Counts equal vertices. (Chunks store positions and no vertex indices.)
    pub merge_vertices: bool,
    /// Merges faces of the same object and material with the same three corners in any order.
    pub merge_faces: bool,
    /// Drops triangles without area after snapping.
    pub drop_degenerate: bool,
    /// Merges equal materials.
    pub merge_materials: bool,
    /// Drops triangles without a texture.
    pub drop_untextured: bool,
    pub ground_plane: GroundPlane,
    /// Keeps content however far it is from the rest.
    #[serde(skip_serializing_if = "is_default")]
    pub keep_outliers: bool,
    /// The cluster of content to build, counted from 1; 0: the largest.
    #[serde(skip_serializing_if = "is_default")]
    pub cluster: u32,
    /// Colours of surfaces to which the source gives none: the first rule that holds counts.
    #[serde(skip_serializing_if = "is_default")]
    pub style: Vec<StyleRule>,
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
        Self {
            merge_vertices: on,
            merge_faces: on,
            drop_degenerate: on,
            merge_materials: on,
            drop_untextured: false,
            ground_plane: GroundPlane::Auto,
            keep_outliers: false,
            cluster: 0,
            style: Vec::new(),
        }
    }
}

impl BuildOptions {
    /// Returns which clusters of content the scene consists of.
    pub fn choice(&self) -> Choice {
        match (self.keep_outliers, self.cluster) {
            (true, _) => Choice::All,
            (false, 0) => Choice::Largest,
            (false, number) => Choice::Number(number),
        }
    }
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

const DEFAULT_MEMORY_BYTES: u64 = 1 << 30;

impl BuildRequest {
    pub fn from_json(text: &str) -> Result<Self> {
        let request: Self = serde_json::from_str(text).map_err(|e| Error::argument(format!("build request: {e}")))?;
        request.validate()?;
        Ok(request)
    }

    pub(crate) fn validate(&self) -> Result<()> {
        if !self.origin.iter().all(|v| v.is_finite()) {
            return Err(Error::argument("build request: origin must be finite"));
        }
        let plain = |name: &String| !name.is_empty() && !name.starts_with('.') && !name.contains(['/', '\\']);
        match self.assets.iter().find(|a| !plain(a)) {
            Some(name) => Err(Error::argument(format!("build request: {name:?} is not the name of an asset's folder"))),
            None => Ok(()),
        }
    }

    pub(crate) fn asset_folders(&self, folder: &Path) -> Vec<PathBuf> {
        self.assets.iter().map(|name| folder.join("assets").join(name)).collect()
    }

    pub(crate) fn memory_bytes(&self) -> u64 {
        if self.max_memory_bytes == 0 { DEFAULT_MEMORY_BYTES } else { self.max_memory_bytes }
    }

    pub(crate) fn thread_count(&self) -> usize {
        if self.threads == 0 { std::thread::available_parallelism().map_or(1, usize::from) } else { self.threads }
    }
}
