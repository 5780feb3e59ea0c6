//! Assets: what a reader yields and what an asset folder holds (spec/scene.md).

mod gate;
mod mapped;
mod tables;
mod writer;

pub use gate::{GateLimits, Skips, pass};
pub use mapped::AssetMesh;
pub use tables::{AssetReport, Instance, Material, Materials, Object, Rank, Warning, Wrap};
pub use writer::AssetWriter;

use crate::vec3::Vec3;

/// Triangles of one or more objects in source order, in source coordinates. All per-triangle vectors have the length of `triangles`;
/// `uvs` and `normals` may be empty (none), else likewise. UVs: u right, v up, origin at the image's lower left corner.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
    pub uvs: Vec<[[f32; 2]; 3]>,
    pub normals: Vec<[[f32; 3]; 3]>,
    /// Index into the asset's materials.
    pub materials: Vec<u32>,
    /// Index into the asset's objects.
    pub objects: Vec<u32>,
    pub ranks: Vec<Rank>,
    /// 0: placed as it is; k > 0: geometry of prototype k, in its own frame.
    pub prototype: u32,
    /// Whoever made the batch has subtracted from `uvs` what each material's wrap mode allows: they are written as they are.
    pub uvs_shifted: bool,
}
