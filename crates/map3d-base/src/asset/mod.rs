//! Assets: the batches that a reader yields, and the files of an asset folder (spec/scene.md).

mod adjustments;
mod boxes;
mod mapped;
mod stray_vertices;
mod tables;
mod validation;
mod writer;

pub use adjustments::{ADJUSTMENTS_FILE, ADJUSTMENTS_MAGIC, ADJUSTMENTS_VERSION, Adjustments};
pub use boxes::MeshBoxes;
pub use mapped::{AssetMesh, DRAPED_FILE, MESH_MAGIC, MESH_VERSION};
pub use tables::{AssetReport, Finding, Instance, Material, Materials, Object, Rank, SurfaceClass, Wrap};
pub use validation::{GeometryLimits, SkippedGeometry};
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
    /// 0: world geometry; k > 0: geometry of prototype k, in its own frame.
    pub prototype: u32,
    /// For world geometry, the number of its coordinate system among those of the reader (0: the document's).
    pub crs: u16,
    /// The reader has already moved `uvs` as far as each material's wrap mode allows; the writer keeps them.
    pub uvs_shifted: bool,
}
