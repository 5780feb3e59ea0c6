//! A built scene that is open for rendering: geometry and textures, shared by threads.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use map3d_base::{Error, Frame, Result};
use map3d_scene::{SceneStore, StoreStats};
use map3d_texture::{CacheStats, TextureCache};

use crate::cutout::TextureCutout;
use crate::view::ViewTimes;

pub struct RenderScene {
    store: SceneStore,
    textures: TextureCache,
    view_times: Mutex<ViewTimes>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneStats {
    pub chunks: StoreStats,
    pub textures: CacheStats,
}

impl RenderScene {
    /// Opens a built scene's folder. A quarter of `cache_bytes` bounds the mapped chunks, the rest the texture levels.
    pub fn open(folder: &Path, cache_bytes: u64) -> Result<Self> {
        let store = SceneStore::open(folder, cache_bytes / 4)?;
        let textures = TextureCache::new(folder.join("textures"), cache_bytes - cache_bytes / 4);
        Ok(Self { store, textures, view_times: Mutex::default() })
    }

    pub fn store(&self) -> &SceneStore {
        &self.store
    }

    pub fn textures(&self) -> &TextureCache {
        &self.textures
    }

    pub fn stats(&self) -> SceneStats {
        SceneStats { chunks: self.store.stats(), textures: self.textures.stats() }
    }

    /// Returns the time of all views so far.
    pub fn view_times(&self) -> ViewTimes {
        *self.view_times.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn add_view_times(&self, times: &ViewTimes) {
        self.view_times.lock().unwrap_or_else(PoisonError::into_inner).add(times);
    }

    /// Returns the tiles of a level that may have content, as sorted Morton numbers.
    pub fn occupied(&self, frame: &Frame, level: u8) -> Result<Vec<u64>> {
        map3d_trace::occupied(&self.store, frame, level)
    }

    /// Returns those of `occupied` that lie in some blocks of a level above, (x, y) each.
    pub fn occupied_within(&self, frame: &Frame, level: u8, block_level: u8, blocks: &[[u32; 2]]) -> Result<Vec<u64>> {
        map3d_trace::occupied_within(&self.store, frame, level, block_level, blocks)
    }

    /// Returns the keys of the blocks of a level at (x, y) each.
    pub fn block_keys(&self, frame: &Frame, device: &str, level: u8, blocks: &[[u32; 2]]) -> Result<Vec<String>> {
        map3d_trace::block_keys(&self.store, frame, device, level, blocks)
    }

    /// Fails if a texture could not be read.
    pub(crate) fn check_textures(&self, cutout: &TextureCutout) -> Result<()> {
        match cutout.failures() {
            0 => Ok(()),
            n => Err(Error::format(self.store.folder(), format!("{n} samples need a texture that cannot be read"))),
        }
    }
}
