//! Scenes: builds chunks with a BVH from assets (`builder`) and maps them for tracing (`SceneStore`). File formats: spec/scene.md.

pub mod builder;
pub mod bvh;
pub mod chunk;
pub mod content;
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
