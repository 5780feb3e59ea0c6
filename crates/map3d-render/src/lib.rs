//! Rendering: the visible surfaces of tiles are shaded to G-buffers, reduced and encoded as blocks (spec/pyramid.md §4–§8, §10), or to images of any view
//! (spec/cameras.md).

mod block;
mod clock;
mod cutout;
mod edge_samples;
mod fragments;
mod light;
mod material;
mod query;
mod scene;
mod shade;
mod subtile;
mod surface_order;
mod tile;
mod view;

pub use block::{Block, BlockStats, EncodedTile, TileSource, build_block, reduce_block};
pub use cutout::TextureCutout;
pub use map3d_trace::CPU;
pub use query::Pick;
pub use scene::{RenderScene, SceneStats};
pub use subtile::StageTimes;
pub use tile::TileRenderer;
pub use view::{HitSelection, RayHit, Region, ViewImage, ViewPixels, ViewRequest, ViewTimes};
