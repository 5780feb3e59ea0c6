//! Beams: all samples of a sub-tile at once through the BVHs of all parts that it overlaps, front to back.

mod child_boxes;
mod edges;
mod exact;
mod key_plane;
mod pixels;
mod rasterizer;
mod sample_buffer;
mod traversal;
mod vertices;
mod visbuf;

use map3d_base::{Box3, DEPTH_UNITS_PER_M, Error, Frame, Isa, Result};
use map3d_scene::SceneStore;

use crate::cutout::Cutout;
use crate::depth_key::least_depth_key;
use crate::lanes::{Scalar, dispatch};
use crate::part::LoadedPart;
use crate::projection::SubtileProjection;
pub use pixels::SUBTILE_PX;
use rasterizer::Rasterizer;
use sample_buffer::GroupBox;
pub use sample_buffer::{MIXED, NOTHING};
use traversal::{BeamEntry, BeamTraversal};
pub use visbuf::{Pixel, VisBuf};

/// Traces sub-tiles of one view. Keep one per thread to reuse its buffers.
pub struct BeamTracer<'s> {
    scene: &'s SceneStore,
    result: VisBuf,
    isa: Isa,
    candidates: Vec<u32>,
    stack: Vec<BeamEntry>,
}

/// A part whose box overlaps the sub-tile.
#[derive(Clone, Copy)]
struct PartHit {
    /// Lower bound of the depth keys in the box.
    least_key: i32,
    groups: GroupBox,
    /// Index into `SceneStore::parts`.
    part: u32,
}

impl<'s> BeamTracer<'s> {
    /// Fails for an invalid frame.
    pub fn new(scene: &'s SceneStore, frame: &Frame) -> Result<Self> {
        Self::with_isa(scene, frame, Isa::best())
    }

    /// Uses another instruction set than the best; the results are the same.
    pub fn with_isa(scene: &'s SceneStore, frame: &Frame, isa: Isa) -> Result<Self> {
        frame.validate()?;
        if !Isa::available().contains(&isa) {
            return Err(Error::argument(format!("this machine does not support the instruction set {isa:?}; use one of {:?}", Isa::available())));
        }
        Ok(Self { scene, result: VisBuf::new(frame), isa, candidates: Vec::new(), stack: Vec::new() })
    }

    /// Traces `SUBTILE_PX`² pixels. The top left pixel is (x_px, y_px) at level zmax, counted from the square's top left corner.
    pub fn trace(&mut self, x_px: u64, y_px: u64, cutout: &dyn Cutout) -> Result<&VisBuf> {
        self.result.restart([x_px, y_px]);
        for hit in self.find_parts() {
            self.trace_part(&hit, cutout)?;
        }
        Ok(&self.result)
    }

    /// Returns the parts whose boxes overlap the sub-tile, nearest first.
    fn find_parts(&mut self) -> Vec<PartHit> {
        let result = &self.result;
        self.scene.candidate_parts(|b| hit_box(result, b).is_some(), &mut self.candidates);
        let parts = self.scene.parts();
        let hit = |part: &u32| hit_box(result, &parts[*part as usize].bounds).map(|(least_key, groups)| PartHit { least_key, groups, part: *part });
        let mut out: Vec<PartHit> = self.candidates.iter().filter_map(hit).collect();
        out.sort_unstable_by_key(|hit| (hit.least_key, hit.part));
        out
    }

    /// Opens a part's chunk only if it can still win a sample.
    fn trace_part(&mut self, hit: &PartHit, cutout: &dyn Cutout) -> Result<()> {
        let VisBuf { samples, triangles, parts, frame, axes, corner_px } = &mut self.result;
        if !samples.can_win::<Scalar>(hit.least_key, hit.groups) {
            return Ok(());
        }
        parts.push(LoadedPart::load(self.scene, hit.part)?);
        let part_index = parts.len() - 1;
        let projection = SubtileProjection { frame, axes, corner_px: *corner_px };
        let rasterizer = Rasterizer { samples, triangles, cutout };
        dispatch(BeamTraversal::new(&parts[part_index], part_index as u32, projection, rasterizer, &mut self.stack), self.isa);
        Ok(())
    }
}

/// Returns the least depth key and the pixel groups of a local box, or `None` if it does not overlap the sub-tile. Computes in float64.
fn hit_box(result: &VisBuf, b: &Box3) -> Option<(i32, GroupBox)> {
    let (frame, axes, corner_px) = (&result.frame, &result.axes, result.corner_px);
    let pixel_m = frame.pixel_m(frame.zmax);
    let (center, half) = (b.center(), b.half_extents());

    // The box's centre and half extents in the view, widened for snapping and rounding.
    let half_extent = |axis: [f64; 3]| (0..3).map(|k| axis[k].abs() * half[k]).sum::<f64>() * (1.0 + 1e-12) + 1e-6;
    let [u, v, d] = axes.uvd_from_local(center);
    let (eu, ev, ed) = (half_extent(axes.right) / pixel_m + 1.0 / 64.0, half_extent(axes.up) / pixel_m + 1.0 / 64.0, half_extent(axes.forward));
    let x = (u - frame.u0_m) / pixel_m - corner_px[0] as f64;
    let y = (frame.v0_m - v) / pixel_m - corner_px[1] as f64;

    // Overlap with the sub-tile.
    let side = SUBTILE_PX as f64;
    let overlaps = x + eu >= 0.0 && x - eu <= side && y + ev >= 0.0 && y - ev <= side;
    let near = (d - ed - frame.d0_m) * DEPTH_UNITS_PER_M - 2.0;
    let groups = GroupBox::new([(x - eu) as f32, (y - ev) as f32, (x + eu) as f32, (y + ev) as f32]);
    overlaps.then(|| (least_depth_key((near as f32).next_down()), groups))
}
