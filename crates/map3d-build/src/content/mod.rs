//! Where the content of assets is: counts and boxes by cell of a coarse grid, from which groups far from each other are found (spec/scene.md, Extent).
//! The result depends only on the content, not on its order; memory does not grow with it.

mod cells;
mod clusters;
mod measure;

pub use cells::{ContentCell, ContentCells};
pub use clusters::{Choice, Cluster, Content};
pub use measure::{CELLS_FILE, adjusted_heads, measure_asset, read_or_measure};
