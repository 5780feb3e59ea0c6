//! Which tiles can have content, and what a block's bytes depend on.

use map3d_base::tile::Tile;
use map3d_base::{Frame, Result};
use map3d_scene::SceneStore;

/// Row-major flags of the 2^level × 2^level tiles of a level: false only where there is nothing.
pub fn occupied(scene: &SceneStore, frame: &Frame, level: u8) -> Result<Vec<bool>> {
    let _ = (scene, frame, level);
    todo!()
}

/// Hex hash over all that the bytes of the base block rooted at `root` depend on.
pub fn block_key(scene: &SceneStore, frame: &Frame, root: Tile) -> Result<String> {
    let _ = (scene, frame, root);
    todo!()
}
