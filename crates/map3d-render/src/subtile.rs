//! One sub-tile: its visible surfaces are traced, shaded and lit into a G-buffer.

use map3d_base::{Isa, LayerKind, LayerSpec, Projection, Result};
use map3d_image::{Arrays, GBuffer};
use map3d_trace::{BeamTracer, ViewClip};

use crate::clock::CpuClock;
use crate::cutout::TextureCutout;
use crate::light::{LightTracer, SubtilePosition};
use crate::scene::RenderScene;
use crate::shade::{SampleSet, Shader};

/// Renders sub-tiles of one view. Keep one per thread to reuse its buffers.
pub struct SubtileRenderer<'s> {
    scene: &'s RenderScene,
    tracer: BeamTracer<'s>,
    cutout: TextureCutout<'s>,
    shader: Shader,
    light: Option<LightTracer<'s>>,
    /// Those of the layers, and those that only computing needs.
    arrays: Arrays,
    times: StageTimes,
}

/// Seconds of the thread's CPU time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes {
    pub visibility_s: f64,
    pub shade_s: f64,
    /// Ray packets: suns, ambient occlusion, second surfaces.
    pub light_s: f64,
}

impl<'s> SubtileRenderer<'s> {
    /// `clip`: needed in perspective (`BeamTracer::of_view`); `samples`: those whose mean is a pixel's colour.
    pub fn new(scene: &'s RenderScene, view: Projection, clip: Option<ViewClip>, layers: &[LayerSpec], samples: SampleSet, isa: Isa) -> Result<Self> {
        let light = LightTracer::new(scene.store(), layers, view, isa);
        let arrays = Arrays::of(layers);
        Ok(Self {
            scene,
            tracer: BeamTracer::of_view(scene.store(), view, clip, isa)?,
            cutout: TextureCutout::new(scene.textures()),
            shader: Shader::new(isa, &view, light.is_some(), samples),
            light,
            arrays: if arrays.has(LayerKind::Picture) { arrays.and(LayerKind::Color) } else { arrays },
            times: StageTimes::default(),
        })
    }

    /// Traces, shades and lights a sub-tile; the first one with content creates the G-buffer, of `side` × `side` px.
    pub fn render(&mut self, position: SubtilePosition, side: u32, g: &mut Option<GBuffer>) -> Result<()> {
        let mut clock = CpuClock::start();
        let [x_px, y_px] = position.in_view;
        let vis = self.tracer.trace(x_px, y_px, &self.cutout)?;
        self.times.visibility_s += clock.lap_s();
        if vis.is_empty() {
            return Ok(());
        }
        let g = g.get_or_insert_with(|| GBuffer::with(side, side, self.arrays));
        self.shader.shade_subtile(vis, self.scene.textures(), g, position.in_tile)?;
        self.times.shade_s += clock.lap_s();
        if let Some(light) = &mut self.light {
            light.trace_subtile(vis, &self.shader, g, position, &self.cutout)?;
            self.times.light_s += clock.lap_s();
        }
        Ok(())
    }

    /// Fails if a texture could not be read.
    pub fn check_textures(&self) -> Result<()> {
        self.scene.check_textures(&self.cutout)
    }

    pub fn times(&self) -> StageTimes {
        self.times
    }

    /// Returns the numbers of shaded (pixel, surface) pairs and of prepared surfaces so far.
    pub fn shade_counts(&self) -> (u64, u64) {
        (self.shader.shades, self.shader.setups)
    }
}
