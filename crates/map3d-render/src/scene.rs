//! A built scene ready to render: geometry and textures behind one door, shared by threads.

use std::path::Path;

use map3d_base::tile::Tile;
use map3d_base::{Error, Frame, Result, Vec3};
use map3d_image::{Arrays, GBuffer};
use map3d_scene::{SceneStore, StoreStats};
use map3d_texture::{CacheStats, TextureCache};
use map3d_trace::{Ray, Rays};

use crate::block::{Block, render_block};
use crate::cutout::TextureCutout;
use crate::tile::TileRenderer;

pub struct RenderScene {
    store: SceneStore,
    textures: TextureCache,
}

/// What a ray through a view coordinate meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    pub id: u32,
    /// View coordinate D in metres.
    pub d_m: f64,
    /// Local position.
    pub position: Vec3,
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
        Ok(Self { store, textures: TextureCache::new(folder.join("textures"), cache_bytes - cache_bytes / 4) })
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

    /// Row-major [y, x] flags of the tiles of a level that may have content.
    pub fn occupied(&self, frame: &Frame, level: u8) -> Result<Vec<bool>> {
        frame.validate()?;
        map3d_trace::occupied(&self.store, frame, level)
    }

    /// The same within some blocks of a level above; false outside of them.
    pub fn occupied_within(&self, frame: &Frame, level: u8, block_level: u8, blocks: &[[u32; 2]]) -> Result<Vec<bool>> {
        map3d_trace::occupancy::occupied_within(&self.store, frame, level, block_level, blocks)
    }

    /// Hex hash over all that a base block's bytes depend on.
    pub fn block_key(&self, frame: &Frame, root: Tile) -> Result<String> {
        frame.validate()?;
        map3d_trace::block_key(&self.store, frame, root)
    }

    /// The keys of the blocks of a level at these (x, y).
    pub fn block_keys(&self, frame: &Frame, level: u8, blocks: &[[u32; 2]]) -> Result<Vec<String>> {
        map3d_trace::occupancy::block_keys(&self.store, frame, level, blocks)
    }

    /// A base block: its tiles of all layers of the frame, and its seam.
    pub fn render_block(&self, frame: &Frame, root: Tile) -> Result<Block> {
        render_block(self, frame, root)
    }

    /// One base tile's G-buffer; nothing anywhere when the tile is empty.
    pub fn gbuffer(&self, frame: &Frame, x: u32, y: u32) -> Result<GBuffer> {
        let tile = TileRenderer::new(self, frame)?.tile(x, y)?;
        Ok(tile.unwrap_or_else(|| GBuffer::with(frame.tile_px, frame.tile_px, Arrays::of(&frame.layers))))
    }

    /// What the line of sight through view coordinates (U, V) meets first.
    pub fn pick(&self, frame: &Frame, u_m: f64, v_m: f64) -> Result<Option<Pick>> {
        frame.validate()?;
        if !u_m.is_finite() || !v_m.is_finite() {
            return Err(Error::argument(format!("pick at ({u_m}, {v_m}): numbers must be finite")));
        }
        let axes = frame.axes();
        let ray = Ray { origin: axes.local_from_uvd([u_m, v_m, frame.d0_m]), direction: axes.forward, width_m: frame.pixel_m(frame.zmax) };
        let cutout = TextureCutout::new(&self.textures);
        let hit = Rays::new(&self.store).closest(&ray, &cutout)?;
        self.check(&cutout)?;
        Ok(hit.map(|h| Pick { id: h.object_id, d_m: frame.d0_m + h.distance_m, position: h.position }))
    }

    /// Which of the rays from local points meet anything within `max_m`.
    pub fn occluded(&self, origins: &[Vec3], direction: Vec3, max_m: f64) -> Result<Vec<bool>> {
        let numbers = origins.as_flattened().iter().chain(&direction);
        if !numbers.copied().all(f64::is_finite) || max_m.is_nan() || direction == [0.0; 3] {
            return Err(Error::argument("occluded: numbers must be finite, the direction not zero"));
        }
        let (rays, cutout) = (Rays::new(&self.store), TextureCutout::new(&self.textures));
        let ask = |origin: &Vec3| rays.any_hit(&Ray { origin: *origin, direction, width_m: 0.0 }, max_m, &cutout);
        let out = origins.iter().map(ask).collect::<Result<_>>()?;
        self.check(&cutout)?;
        Ok(out)
    }

    fn check(&self, cutout: &TextureCutout) -> Result<()> {
        match cutout.failures() {
            0 => Ok(()),
            _ => Err(Error::format(self.store.folder(), "a texture cannot be read")),
        }
    }
}
