//! Built scenes, mapped for tracing (`SceneStore`): chunks, instances, the index, and the BVH. File formats: spec/scene.md. `map3d-build` writes them.

pub mod bvh;
pub mod chunk;
pub mod index;
pub mod instances;
pub mod lattice;
pub mod records;
pub mod store;
pub mod surfaces;
pub mod top;

pub use chunk::{Chunk, LazyChunk};
pub use index::SceneIndex;
pub use records::{ChunkObject, InstanceRecord, Leaf, MaterialRecord, Node, TriangleRecord};
pub use store::{ScenePart, SceneStore, StoreStats};
pub use surfaces::SurfaceSample;
