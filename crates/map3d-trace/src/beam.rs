//! Beams: all samples of a sub-tile at once, through the trees of all parts that it meets, front to back.

pub(crate) mod boxes;
pub(crate) mod buffer;
mod canvas;
mod corners;
mod descent;
mod dispatch;
pub(crate) mod exact;
pub(crate) mod project;
pub(crate) mod shape;

use map3d_base::{Box3, DEPTH_UNITS_PER_M, Error, Frame, Isa, Result};
use map3d_scene::SceneStore;

use crate::cutout::Cutout;
use crate::visbuf::{MetPart, SUBTILE_PX, VisBuf};
use boxes::least_key;
use descent::Descent;
use project::Projection;

/// Traces sub-tiles of one view; keep one per thread, its buffers are reused.
pub struct BeamTracer<'s> {
    scene: &'s SceneStore,
    result: VisBuf,
    isa: Isa,
    candidates: Vec<u32>,
    stack: Vec<descent::Entry>,
}

/// A part that the sub-tile may see.
#[derive(Clone, Copy)]
struct Sighting {
    key: i32,
    part: u32,
    groups: [u8; 4],
}

impl<'s> BeamTracer<'s> {
    /// Fails for a frame that is not sound.
    pub fn new(scene: &'s SceneStore, frame: &Frame) -> Result<Self> {
        Self::with_isa(scene, frame, Isa::best())
    }

    /// With an instruction set other than the best; the results are the same.
    pub fn with_isa(scene: &'s SceneStore, frame: &Frame, isa: Isa) -> Result<Self> {
        frame.validate()?;
        if !Isa::available().contains(&isa) {
            return Err(Error::argument(format!("{isa:?}: this machine does not have it")));
        }
        Ok(Self { scene, result: VisBuf::new(frame), isa, candidates: Vec::new(), stack: Vec::new() })
    }

    /// Traces the `SUBTILE_PX`² pixels whose top left one is (x_px, y_px), counted at level zmax from the square's top left corner.
    pub fn trace(&mut self, x_px: u64, y_px: u64, cutout: &dyn Cutout) -> Result<&VisBuf> {
        self.result.restart([x_px, y_px]);
        for sighting in self.sightings() {
            self.trace_part(&sighting, cutout)?;
        }
        Ok(&self.result)
    }

    /// Parts whose boxes meet the sub-tile, nearest first.
    fn sightings(&mut self) -> Vec<Sighting> {
        let view = BoxView { frame: &self.result.frame, result: &self.result };
        self.scene.candidate_parts(|b| view.meets(b).is_some(), &mut self.candidates);
        let parts = self.scene.parts();
        let see = |part: &u32| view.meets(&parts[*part as usize].bounds).map(|(key, groups)| Sighting { key, part: *part, groups });
        let mut out: Vec<Sighting> = self.candidates.iter().filter_map(see).collect();
        out.sort_unstable_by_key(|s| (s.key, s.part));
        out
    }

    /// Opens a part's chunk only if something in it can still be seen.
    fn trace_part(&mut self, sighting: &Sighting, cutout: &dyn Cutout) -> Result<()> {
        if !self.result.samples.can_win::<crate::lanes::Plain>(sighting.key, sighting.groups) {
            return Ok(());
        }
        let part = &self.scene.parts()[sighting.part as usize];
        let chunk = self.scene.chunk(part.chunk)?;
        let instance = part.instance.map(|k| (k, self.scene.instances()[k as usize]));
        self.result.parts.push(MetPart { chunk: chunk.clone(), instance });
        let result = &mut self.result;
        let projection = Projection { frame: &result.frame, axes: &result.axes, corner_px: result.corner_px };
        let part = result.parts.len() as u32 - 1;
        let canvas = canvas::Canvas { samples: &mut result.samples, tracks: &mut result.tracks, cutout };
        let placement = instance.as_ref().map(|(_, record)| record);
        Descent::new(&chunk, placement, projection, (part, sighting.part), canvas, &mut self.stack).run(self.isa);
        Ok(())
    }
}

/// Float64 boxes against the sub-tile.
struct BoxView<'a> {
    frame: &'a Frame,
    result: &'a VisBuf,
}

impl BoxView<'_> {
    /// The least key and the groups of a local box that meets the sub-tile.
    fn meets(&self, b: &Box3) -> Option<(i32, [u8; 4])> {
        let (axes, pixel_m) = (&self.result.axes, self.frame.pixel_m(self.frame.zmax));
        let (center, half) = (b.center(), b.half_extents());
        let spread = |axis: [f64; 3]| (0..3).map(|k| axis[k].abs() * half[k]).sum::<f64>() * (1.0 + 1e-12) + 1e-6;
        let [u, v, d] = axes.uvd_from_local(center);
        let (eu, ev, ed) = (spread(axes.right) / pixel_m + 1.0 / 64.0, spread(axes.up) / pixel_m + 1.0 / 64.0, spread(axes.forward));
        let x = (u - self.frame.u0_m) / pixel_m - self.result.corner_px[0] as f64;
        let y = (self.frame.v0_m - v) / pixel_m - self.result.corner_px[1] as f64;
        let side = SUBTILE_PX as f64;
        let meets = x + eu >= 0.0 && x - eu <= side && y + ev >= 0.0 && y - ev <= side;
        let near = (d - ed - self.frame.d0_m) * DEPTH_UNITS_PER_M - 2.0;
        let groups = descent::groups([(x - eu) as f32, (y - ev) as f32, (x + eu) as f32, (y + ev) as f32]);
        meets.then(|| (least_key((near as f32).next_down()), groups))
    }
}
