//! Beams: all samples of a sub-tile at once through the BVHs of all parts that it overlaps, front to back.
//!
//! The contract of `BeamTracer::trace`, which every back end that replaces it fulfils:
//!
//! * It takes a square of `SUBTILE_PX`² pixels, 16 samples each (spec/pyramid.md §4), and a `Cutout` that says which points of textures are transparent.
//! * It returns a `VisBuf`: for each sample the surface with the least depth key. Surfaces with equal keys are ordered by class rank, object id and
//!   triangle number, never by the order of traversal, so that neighbouring sub-tiles agree along their border.
//! * A slot stands for one triangle; slots are valid until the next call.
//! * The result depends on scene, view, clip and position alone: not on the instruction set, the thread or earlier calls.
//! * It opens the chunk of a part only if the part can still win a sample, and fails only if a chunk cannot be read.

mod child_boxes;
mod clip;
mod edges;
mod exact;
mod key_plane;
mod perspective_plane;
mod pixels;
mod rasterizer;
mod sample_buffer;
mod traversal;
mod vertices;
mod visbuf;

use map3d_base::{Box3, DEPTH_UNITS_PER_M, Error, Frame, Isa, ParallelProjection, PerspectiveProjection, Projection, Result};
use map3d_scene::SceneStore;

use crate::cutout::Cutout;
use crate::depth_key::least_depth_key;
use crate::lanes::{Scalar, dispatch};
use crate::part::LoadedPart;
use crate::projection::SubtileProjection;
pub use clip::ViewClip;
use key_plane::DepthKeyPlane;
use perspective_plane::PerspectiveKeyPlane;
pub use pixels::SUBTILE_PX;
use rasterizer::Rasterizer;
use sample_buffer::GroupBox;
pub use sample_buffer::{MIXED, NOTHING};
use traversal::{BeamEntry, BeamTraversal};
pub use visbuf::{CurvedSurface, Pixel, VisBuf};

/// Traces sub-tiles of one view. Keep one per thread to reuse its buffers.
pub struct BeamTracer<'s> {
    scene: &'s SceneStore,
    result: VisBuf,
    isa: Isa,
    clip: Option<ViewClip>,
    candidates: Vec<u32>,
    stack: Vec<BeamEntry>,
    planes: Planes,
}

/// Depth keys by slot, of the view's projection.
#[derive(Default)]
struct Planes {
    parallel: Vec<DepthKeyPlane>,
    perspective: Vec<PerspectiveKeyPlane>,
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
        Self::of_view(scene, Projection::of_frame(frame), None, isa)
    }

    /// Returns a tracer of any view. In perspective, `clip` is needed: it cuts what is nearer than the projection's near distance.
    pub fn of_view(scene: &'s SceneStore, view: Projection, clip: Option<ViewClip>, isa: Isa) -> Result<Self> {
        if !Isa::available().contains(&isa) {
            return Err(Error::argument(format!("this machine does not support the instruction set {isa:?}; use one of {:?}", Isa::available())));
        }
        if clip.is_none() && matches!(view, Projection::Perspective(_)) {
            return Err(Error::argument("a beam in perspective needs a clip"));
        }
        Ok(Self { scene, result: VisBuf::new(view), isa, clip, candidates: Vec::new(), stack: Vec::new(), planes: Planes::default() })
    }

    /// Traces `SUBTILE_PX`² pixels. The top left pixel is (x_px, y_px), counted from the view's top left corner, at level zmax of a frame.
    pub fn trace(&mut self, x_px: u64, y_px: u64, cutout: &dyn Cutout) -> Result<&VisBuf> {
        self.result.restart([x_px, y_px]);
        self.planes.parallel.clear();
        self.planes.perspective.clear();
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
        let VisBuf { samples, triangles, parts, view, corner_px } = &mut self.result;
        // Skip a part behind all samples
        if !samples.can_win::<Scalar>(hit.least_key, hit.groups) {
            return Ok(());
        }

        // Find the planes that cut the part
        let clip = match &self.clip {
            None => None,
            Some(clip) => match clip.for_part(&self.scene.parts()[hit.part as usize].bounds) {
                None => return Ok(()),
                Some(clip) => Some(clip).filter(|clip| !clip.is_trivial()),
            },
        };

        // Open the chunk
        parts.push(LoadedPart::load(self.scene, hit.part)?);
        let part_index = parts.len() - 1;
        let (part, number, clip, stack) = (&parts[part_index], part_index as u32, clip.as_ref(), &mut self.stack);
        let projection = SubtileProjection { view, corner_px: *corner_px };

        // Traverse its BVH with depth keys of the view's projection
        match view {
            Projection::Parallel(_) => {
                let rasterizer = Rasterizer { samples, triangles, planes: &mut self.planes.parallel, cutout };
                dispatch(BeamTraversal::new(part, number, projection, rasterizer, stack, clip), self.isa);
            }
            Projection::Perspective(_) => {
                let rasterizer = Rasterizer { samples, triangles, planes: &mut self.planes.perspective, cutout };
                dispatch(BeamTraversal::new(part, number, projection, rasterizer, stack, clip), self.isa);
            }
        }
        Ok(())
    }
}

/// Returns the least depth key and the pixel groups of a local box, or `None` if it does not overlap the sub-tile. Computes in float64.
fn hit_box(result: &VisBuf, b: &Box3) -> Option<(i32, GroupBox)> {
    match &result.view {
        Projection::Parallel(view) => hit_parallel(view, result.corner_px, b),
        Projection::Perspective(view) => hit_perspective(view, result.corner_px, b),
    }
}

fn hit_parallel(view: &ParallelProjection, corner_px: [u64; 2], b: &Box3) -> Option<(i32, GroupBox)> {
    let (axes, [width, height]) = (&view.axes, view.pixel_m);
    let (center, half) = (b.center(), b.half_extents());

    // The box's centre and half extents in the view, widened for snapping and rounding.
    let half_extent = |axis: [f64; 3]| (0..3).map(|k| axis[k].abs() * half[k]).sum::<f64>() * (1.0 + 1e-12) + 1e-6;
    let [u, v, d] = axes.uvd_from_local(center);
    let (eu, ev, ed) = (half_extent(axes.right) / width + 1.0 / 64.0, half_extent(axes.up) / height + 1.0 / 64.0, half_extent(axes.forward));
    let x = (u - view.u0_m) / width - corner_px[0] as f64;
    let y = (view.v0_m - v) / height - corner_px[1] as f64;

    // Overlap with the sub-tile.
    let near = (d - ed - view.d0_m) * DEPTH_UNITS_PER_M - 2.0;
    hit_pixels([x - eu, x + eu], [y - ev, y + ev], near)
}

fn hit_perspective(view: &PerspectiveProjection, corner_px: [u64; 2], b: &Box3) -> Option<(i32, GroupBox)> {
    // Bounds of affine coordinates over the box, widened for rounding.
    let (center, half) = (b.center(), b.half_extents());
    let interval = |[a0, a1, a2, constant]: [f64; 4]| {
        let middle = a0 * center[0] + a1 * center[1] + a2 * center[2] + constant;
        let reach = (a0.abs() * half[0] + a1.abs() * half[1] + a2.abs() * half[2]) * (1.0 + 1e-12) + 1e-6;
        [middle - reach, middle + reach]
    };
    let [nearest, last] = interval(view.ahead());
    if last < view.near_m {
        return None;
    }

    // Over the visible depths, tangents relative to the sub-tile's centre are least and greatest at one of both ends.
    let (first, side) = (nearest.max(view.near_m), SUBTILE_PX as f64);
    let middle = [view.left + (corner_px[0] as f64 + side / 2.0) * view.pixel[0], view.top - (corner_px[1] as f64 + side / 2.0) * view.pixel[1]];
    let pixels = |[lo, hi]: [f64; 2], pixel: f64| {
        let (lo, hi) = ((lo / first).min(lo / last), (hi / first).max(hi / last));
        [side / 2.0 + lo / pixel - 1.0 / 64.0, side / 2.0 + hi / pixel + 1.0 / 64.0]
    };
    let x = pixels(interval(view.beside(middle[0])), view.pixel[0]);
    let [down, up] = pixels(interval(view.above(middle[1])), view.pixel[1]);
    hit_pixels(x, [side - up, side - down], first * DEPTH_UNITS_PER_M - 2.0)
}

/// `near`: the least depth in units.
fn hit_pixels(x: [f64; 2], y: [f64; 2], near: f64) -> Option<(i32, GroupBox)> {
    let side = SUBTILE_PX as f64;
    let overlaps = x[1] >= 0.0 && x[0] <= side && y[1] >= 0.0 && y[0] <= side;
    let groups = GroupBox::new([x[0] as f32, y[0] as f32, x[1] as f32, y[1] as f32]);
    overlaps.then(|| (least_depth_key((near as f32).next_down()), groups))
}
