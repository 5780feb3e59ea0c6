//! Rendering: what beams meet is shaded to G-buffers, reduced and encoded as blocks (spec/pyramid.md §4–§8).

mod block;
mod clock;
mod cutout;
mod light;
mod paint;
mod scene;
mod seen;
mod shade;
mod tile;

pub use block::{Block, BlockStats, EncodedTile, reduce_block};
pub use cutout::TextureCutout;
pub use scene::{Pick, RenderScene, SceneStats};
pub use tile::TileRenderer;
