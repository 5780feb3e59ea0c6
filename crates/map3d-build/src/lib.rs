//! Builds a scene from its assets: optimises and snaps triangles, sorts them into cells and writes each cell with its BVH to a file (spec/scene.md).
//! `map3d-scene` maps what is built.

mod asset_summary;
mod assets;
mod buckets;
mod build_scene;
mod cells;
mod chunk_cache;
mod chunks;
pub mod coherence;
pub mod content;
mod encode;
mod files;
mod ground;
mod lows;
mod materials;
mod prototypes;
mod report;
mod request;
mod summarize;
mod surface_colors;
mod textures;
mod triangle;
mod triangle_source;
mod unpack;

pub use build_scene::build_scene;
pub use encode::{ChunkFile, ChunkInput, encode_chunk};
pub use report::BuildReport;
pub use request::{BuildOptions, BuildRequest, GroundPlane};
pub use surface_colors::StyleRule;
pub use triangle::BuildTriangle;

/// (stage, done, total) → false to stop.
pub type Progress<'a> = &'a mut dyn FnMut(&str, u64, u64) -> bool;
