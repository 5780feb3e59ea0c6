//! One base tile: its sub-tiles, rendered into a G-buffer.

use map3d_base::{Error, Frame, Isa, Projection, Result};
use map3d_image::{Arrays, GBuffer};
use map3d_trace::SUBTILE_PX;

use crate::light::SubtilePosition;
use crate::scene::RenderScene;
use crate::shade::SampleSet;
use crate::subtile::{StageTimes, SubtileRenderer};

/// Renders base tiles of one view. Keep one per thread to reuse its buffers.
pub struct TileRenderer<'s> {
    frame: Frame,
    subtiles: SubtileRenderer<'s>,
}

impl<'s> TileRenderer<'s> {
    /// Fails for an invalid frame.
    pub fn new(scene: &'s RenderScene, frame: &Frame) -> Result<Self> {
        Self::with_isa(scene, frame, Isa::best())
    }

    /// Uses another instruction set than the best; the results are the same.
    pub fn with_isa(scene: &'s RenderScene, frame: &Frame, isa: Isa) -> Result<Self> {
        frame.validate()?;
        let subtiles = SubtileRenderer::new(scene, Projection::of_frame(frame), None, &frame.layers, SampleSet::ALL, isa)?;
        Ok(Self { frame: frame.clone(), subtiles })
    }

    pub fn times(&self) -> StageTimes {
        self.subtiles.times()
    }

    /// Returns the numbers of shaded (pixel, surface) pairs and of prepared surfaces so far.
    pub fn shade_counts(&self) -> (u64, u64) {
        self.subtiles.shade_counts()
    }

    /// Returns the G-buffer of base tile (x, y), or `None` for an empty tile.
    pub fn tile(&mut self, x: u32, y: u32) -> Result<Option<GBuffer>> {
        let side = self.frame.tile_px as usize;
        let count = 1u64 << self.frame.zmax;
        if u64::from(x) >= count || u64::from(y) >= count {
            return Err(Error::argument(format!("base tile ({x}, {y}) is out of range: level {} has {count} × {count} tiles", self.frame.zmax)));
        }
        let mut g = None;
        for number in 0..(side / SUBTILE_PX).pow(2) {
            let (left, top) = (number % (side / SUBTILE_PX) * SUBTILE_PX, number / (side / SUBTILE_PX) * SUBTILE_PX);
            let in_view = [(x, left), (y, top)].map(|(t, offset)| u64::from(t) * side as u64 + offset as u64);
            self.subtiles.render(SubtilePosition { in_tile: (left, top), in_view }, self.frame.tile_px, &mut g)?;
        }
        self.subtiles.check_textures()?;
        if let Some(g) = &mut g {
            g.keep(Arrays::of(&self.frame.layers));
        }
        Ok(g)
    }
}

impl RenderScene {
    /// Returns one base tile's G-buffer; an empty tile has no content in any array.
    pub fn gbuffer(&self, frame: &Frame, x: u32, y: u32) -> Result<GBuffer> {
        let tile = TileRenderer::new(self, frame)?.tile(x, y)?;
        Ok(tile.unwrap_or_else(|| GBuffer::with(frame.tile_px, frame.tile_px, Arrays::of(&frame.layers))))
    }
}
