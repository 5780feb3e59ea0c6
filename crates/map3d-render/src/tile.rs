//! One base tile: sub-tiles traced and shaded into a G-buffer.

use map3d_base::{Error, Frame, Isa, LayerKind, Projection, Result};
use map3d_image::{Arrays, GBuffer};
use map3d_trace::{BeamTracer, SUBTILE_PX};

use crate::clock::CpuClock;
use crate::cutout::TextureCutout;
use crate::light::{LightTracer, SubtilePosition};
use crate::scene::RenderScene;
use crate::shade::Shader;

/// Renders base tiles of one view. Keep one per thread to reuse its buffers.
pub struct TileRenderer<'s> {
    scene: &'s RenderScene,
    frame: Frame,
    tracer: BeamTracer<'s>,
    cutout: TextureCutout<'s>,
    shader: Shader,
    light: Option<LightTracer<'s>>,
    /// Arrays of the tiles that the renderer returns.
    output: Arrays,
    /// `output` and the arrays that only computing needs.
    working: Arrays,
    /// Seconds of the thread's CPU time.
    pub visibility_s: f64,
    pub shade_s: f64,
    pub light_s: f64,
}

impl<'s> TileRenderer<'s> {
    /// Fails for an invalid frame.
    pub fn new(scene: &'s RenderScene, frame: &Frame) -> Result<Self> {
        Self::with_isa(scene, frame, Isa::best())
    }

    /// Uses another instruction set than the best; the results are the same.
    pub fn with_isa(scene: &'s RenderScene, frame: &Frame, isa: Isa) -> Result<Self> {
        frame.validate()?;
        let output = Arrays::of(&frame.layers);
        let light = LightTracer::new(scene.store(), &frame.layers, Projection::of_frame(frame), isa);
        let has_picture = output.has(LayerKind::Picture);
        Ok(Self {
            scene,
            frame: frame.clone(),
            tracer: BeamTracer::with_isa(scene.store(), frame, isa)?,
            cutout: TextureCutout::new(scene.textures()),
            shader: Shader::new(isa, light.is_some()),
            light,
            output,
            working: if has_picture { output.and(LayerKind::Color) } else { output },
            visibility_s: 0.0,
            shade_s: 0.0,
            light_s: 0.0,
        })
    }

    /// Returns the numbers of shaded (pixel, surface) pairs and of prepared surfaces so far.
    pub fn shade_counts(&self) -> (u64, u64) {
        (self.shader.shades, self.shader.setups)
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
            self.render_subtile(SubtilePosition { in_tile: (left, top), in_view }, &mut g)?;
        }
        self.scene.check_textures(&self.cutout)?;
        Ok(g.map(|mut g: GBuffer| {
            g.keep(self.output);
            g
        }))
    }

    /// Traces, shades and lights a sub-tile; the first one with content creates the G-buffer.
    fn render_subtile(&mut self, position: SubtilePosition, g: &mut Option<GBuffer>) -> Result<()> {
        let mut clock = CpuClock::start();
        let [x_px, y_px] = position.in_view;
        let vis = self.tracer.trace(x_px, y_px, &self.cutout)?;
        self.visibility_s += clock.lap_s();
        if !vis.is_empty() {
            let g = g.get_or_insert_with(|| GBuffer::with(self.frame.tile_px, self.frame.tile_px, self.working));
            self.shader.shade_subtile(vis, self.scene.textures(), g, position.in_tile)?;
            self.shade_s += clock.lap_s();
            if let Some(light) = &mut self.light {
                light.trace_subtile(vis, &self.shader, g, position, &self.cutout)?;
                self.light_s += clock.lap_s();
            }
        }
        Ok(())
    }
}

impl RenderScene {
    /// Returns one base tile's G-buffer; an empty tile has no content in any array.
    pub fn gbuffer(&self, frame: &Frame, x: u32, y: u32) -> Result<GBuffer> {
        let tile = TileRenderer::new(self, frame)?.tile(x, y)?;
        Ok(tile.unwrap_or_else(|| GBuffer::with(frame.tile_px, frame.tile_px, Arrays::of(&frame.layers))))
    }
}
