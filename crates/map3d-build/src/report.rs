//! Counts of what a build wrote and what it optimised away.

use std::collections::BTreeMap;

use map3d_texture::TextureFault;
use serde::{Deserialize, Serialize};

/// Part of `scene.json`, and returned to the caller; contains every count, even 0, except for those of outliers and adjustments.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct BuildReport {
    /// Triangles of all assets, prototypes included.
    pub triangles_read: u64,
    /// Triangles in chunks and prototypes.
    pub triangles: u64,
    pub degenerate_triangles: u64,
    pub duplicate_faces: u64,
    pub duplicate_vertices: u64,
    pub merged_materials: u64,
    pub untextured_faces: u64,
    /// Additional triangles from splitting edges over 1,024 m.
    pub split_triangles: u64,
    pub ground_plane_triangles: u64,
    /// Materials whose image is missing or broken; they show their diffuse colour.
    pub materials_without_their_texture: u64,
    pub textures: u64,
    pub textures_kept: u64,
    pub chunks: u64,
    pub chunks_kept: u64,
    pub prototypes: u64,
    pub instances: u64,
    /// Instances of prototypes that have no triangles.
    pub instances_of_nothing: u64,
    /// Triangles and instances far from the rest that were left out.
    #[serde(skip_serializing_if = "is_zero")]
    pub outlier_triangles: u64,
    /// Triangles and instances of objects that are left out by adjustments, or that others stand for.
    #[serde(skip_serializing_if = "is_zero")]
    pub adjusted_away: u64,
    /// By reason, the number of images that failed and an example.
    pub texture_warnings: BTreeMap<String, String>,
    /// Why images cannot be used, by their keys in the assets.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub texture_faults: BTreeMap<String, TextureFault>,
}

impl BuildReport {
    /// Adds the counts of an asset.
    pub(crate) fn add(&mut self, asset: &Self) {
        self.triangles_read += asset.triangles_read;
        self.degenerate_triangles += asset.degenerate_triangles;
        self.duplicate_faces += asset.duplicate_faces;
        self.duplicate_vertices += asset.duplicate_vertices;
        self.untextured_faces += asset.untextured_faces;
        self.split_triangles += asset.split_triangles;
        self.materials_without_their_texture += asset.materials_without_their_texture;
        self.instances_of_nothing += asset.instances_of_nothing;
        self.outlier_triangles += asset.outlier_triangles;
        self.adjusted_away += asset.adjusted_away;
    }

    /// Returns the counts by name.
    pub fn counts(&self) -> BTreeMap<String, u64> {
        let value = serde_json::to_value(self).expect("counts are plain data");
        let object = value.as_object().expect("a struct is an object");
        object.iter().filter_map(|(k, v)| Some((k.clone(), v.as_u64()?))).collect()
    }
}

// Serde passes a reference.
#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_zero(count: &u64) -> bool {
    *count == 0
}
