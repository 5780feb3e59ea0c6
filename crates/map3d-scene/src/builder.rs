//! Builds a scene from its assets: optimised, snapped, cut into cells, each cell with its tree in a file of its own (spec/scene.md).

mod assets;
mod cells;
mod chunks;
mod encode;
mod files;
mod ground;
mod materials;
mod prototypes;
mod report;
mod request;
mod run;
mod shelf;
mod source;
mod spill;
mod survey;
mod textures;
mod triangle;
mod unpack;
mod vertices;

pub use encode::{ChunkFile, Input, encode_chunk};
pub use report::BuildReport;
pub use request::{BuildOptions, BuildRequest, GroundPlane};
pub use run::build_scene;
pub use triangle::BuildTriangle;

/// (stage, done, total) → false to stop.
pub type Progress<'a> = &'a mut dyn FnMut(&str, u64, u64) -> bool;
