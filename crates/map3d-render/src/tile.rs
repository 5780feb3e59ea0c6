//! One base tile: sub-tiles traced and shaded into a G-buffer.

use map3d_base::tile::Tile;
use map3d_base::{Error, Frame, Isa, LayerKind, Result};
use map3d_image::{Arrays, GBuffer};
use map3d_trace::{BeamTracer, SUBTILE_PX};

use crate::clock::CpuClock;
use crate::cutout::TextureCutout;
use crate::light::{Lights, Place};
use crate::scene::RenderScene;
use crate::shade::Shader;

/// Renders base tiles of one view; one per thread, its buffers are reused.
pub struct TileRenderer<'s> {
    scene: &'s RenderScene,
    frame: Frame,
    tracer: BeamTracer<'s>,
    cutout: TextureCutout<'s>,
    shader: Shader,
    lights: Option<Lights<'s>>,
    /// What tiles keep, and what they are made with.
    kept: Arrays,
    made: Arrays,
    /// Seconds of the thread's CPU time.
    pub visibility_s: f64,
    pub shade_s: f64,
    pub light_s: f64,
}

impl<'s> TileRenderer<'s> {
    /// Fails for a frame that is not sound.
    pub fn new(scene: &'s RenderScene, frame: &Frame) -> Result<Self> {
        Self::with_isa(scene, frame, Isa::best())
    }

    /// With an instruction set other than the best; the results are the same.
    pub fn with_isa(scene: &'s RenderScene, frame: &Frame, isa: Isa) -> Result<Self> {
        frame.validate()?;
        let kept = Arrays::of(&frame.layers);
        let lights = Lights::new(scene.store(), frame, isa);
        let has_picture = kept.has(LayerKind::Picture);
        Ok(Self {
            scene,
            frame: frame.clone(),
            tracer: BeamTracer::with_isa(scene.store(), frame, isa)?,
            cutout: TextureCutout::new(scene.textures()),
            shader: Shader::new(isa, lights.is_some()),
            lights,
            kept,
            made: if has_picture { kept.and(LayerKind::Color) } else { kept },
            visibility_s: 0.0,
            shade_s: 0.0,
            light_s: 0.0,
        })
    }

    /// (pixel, surface) pairs shaded and surfaces set up so far.
    pub fn shade_counts(&self) -> (u64, u64) {
        (self.shader.shades, self.shader.setups)
    }

    /// The G-buffer of base tile (x, y); `None` when nothing is in it.
    pub fn tile(&mut self, x: u32, y: u32) -> Result<Option<GBuffer>> {
        let side = self.frame.tile_px as usize;
        let count = 1u64 << self.frame.zmax;
        if u64::from(x) >= count || u64::from(y) >= count {
            return Err(Error::argument(format!("base tile ({x}, {y}): there are {count} × {count}")));
        }
        let mut g = None;
        for sub in 0..(side / SUBTILE_PX).pow(2) {
            let (left, top) = (sub % (side / SUBTILE_PX) * SUBTILE_PX, sub / (side / SUBTILE_PX) * SUBTILE_PX);
            let corner = [(x, left), (y, top)].map(|(t, offset)| u64::from(t) * side as u64 + offset as u64);
            self.subtile(corner, (left, top), &mut g)?;
        }
        match self.cutout.failures() {
            0 => Ok(g.map(|mut g: GBuffer| {
                g.keep(self.kept);
                g
            })),
            n => Err(Error::format(self.scene.store().folder(), format!("{n} samples met a texture that cannot be read"))),
        }
    }

    fn subtile(&mut self, [x_px, y_px]: [u64; 2], place: (usize, usize), g: &mut Option<GBuffer>) -> Result<()> {
        let mut clock = CpuClock::start();
        let vis = self.tracer.trace(x_px, y_px, &self.cutout)?;
        self.visibility_s += clock.lap_s();
        if !vis.is_empty() {
            let g = g.get_or_insert_with(|| GBuffer::with(self.frame.tile_px, self.frame.tile_px, self.made));
            self.shader.subtile(vis, self.scene.textures(), g, place)?;
            self.shade_s += clock.lap_s();
            if let Some(lights) = &mut self.lights {
                lights.subtile(vis, &self.shader, g, Place { corner: place, corner_px: [x_px, y_px] }, &self.cutout)?;
                self.light_s += clock.lap_s();
            }
        }
        Ok(())
    }
}

/// Whether a tile is within its level.
pub(crate) fn check_tile(tile: Tile) -> Result<()> {
    let count = 1u64 << tile.z.min(map3d_base::tile::MAX_LEVEL);
    match tile.z <= map3d_base::tile::MAX_LEVEL && u64::from(tile.x) < count && u64::from(tile.y) < count {
        true => Ok(()),
        false => Err(Error::argument(format!("tile ({}, {}, {}): out of range", tile.z, tile.x, tile.y))),
    }
}
