//! Compares beams with brute force: the winner of each sample of each pixel.

use map3d_base::Frame;
use map3d_scene::SceneStore;
use map3d_trace::{BeamTracer, Cutout, NOTHING, Pixel, SUBTILE_PX, VisBuf};

use super::{ReferenceTriangle, ReferenceView, TexturePoint};

/// Whether a cut-out covers a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HoleState {
    Covered,
    Hole,
    /// Nearer to the edge of a hole than the rounding error.
    Uncertain,
}

/// Counts of samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct SampleCounts {
    /// Samples with a surface.
    pub covered: u64,
    /// Samples for which rounding may decide the winner.
    pub close: u64,
    /// Close samples at the edge of a hole.
    pub uncertain: u64,
    /// Samples that a cut-out wins.
    pub cutouts: u64,
    /// Samples that a cut-out would win without its hole.
    pub holes: u64,
}

/// One view of a scene, traced with `cutout`; `hole_state` is the same cut-out in float64.
pub struct BeamComparison<'a> {
    pub store: &'a SceneStore,
    pub frame: &'a Frame,
    pub cutout: &'a dyn Cutout,
    pub hole_state: &'a dyn Fn(&ReferenceTriangle, &TexturePoint) -> HoleState,
}

/// A triangle that covers a sample.
#[derive(Clone, Copy, Debug)]
struct CoveringTriangle {
    depth_key: i64,
    tie_break: (u8, u32, u32),
    depth: f64,
    state: HoleState,
    is_cutout: bool,
}

/// A sample of a pixel.
#[derive(Clone, Copy)]
struct SampleId {
    /// The pixel in the square.
    pixel: [usize; 2],
    /// The pixel in its sub-tile.
    in_subtile: [usize; 2],
    /// The sample in the pixel.
    k: usize,
}

impl BeamComparison<'_> {
    /// Compares the sub-tiles of a frame; to save time every second one, as on a chessboard.
    pub fn run(&self) -> SampleCounts {
        let (view, mut counts) = (ReferenceView::new(self.frame), SampleCounts::default());
        let all = view.triangles(self.store);
        let mut tracer = BeamTracer::new(self.store, self.frame).expect("tracer");
        for top in (0..256).step_by(SUBTILE_PX) {
            for left in (top % 128..256).step_by(2 * SUBTILE_PX) {
                let result = tracer.trace(left as u64, top as u64, self.cutout).expect("trace");
                let in_subtile: Vec<&ReferenceTriangle> = all.iter().filter(|t| t.overlaps([left, top], SUBTILE_PX)).collect();
                for p in 0..SUBTILE_PX * SUBTILE_PX {
                    let (i, j) = (p % SUBTILE_PX, p / SUBTILE_PX);
                    let pixel = [left + i, top + j];
                    let in_pixel: Vec<&ReferenceTriangle> = in_subtile.iter().filter(|t| t.overlaps(pixel, 1)).copied().collect();
                    (0..16).for_each(|k| self.compare(&view, &in_pixel, result, SampleId { pixel, in_subtile: [i, j], k }, &mut counts));
                }
            }
        }
        counts
    }

    /// Returns the triangles that cover a lattice point, the winner first unless it has a hole there.
    fn covering(&self, view: &ReferenceView, triangles: &[&ReferenceTriangle], at: [i128; 2]) -> Vec<CoveringTriangle> {
        let covering = |t: &&ReferenceTriangle| {
            let depth = view.depth(t, at);
            let is_cutout = t.material.is_cutout();
            let state = match view.texture_point(t, at) {
                _ if !is_cutout => HoleState::Covered,
                Some(point) => (self.hole_state)(t, &point),
                None => HoleState::Uncertain,
            };
            CoveringTriangle { depth_key: t.depth_key(depth), tie_break: t.tie_break(), depth, state, is_cutout }
        };
        let mut out: Vec<CoveringTriangle> = triangles.iter().filter(|t| t.covers(at)).map(covering).collect();
        out.sort_by_key(|t| (t.depth_key, t.tie_break));
        out
    }

    fn compare(&self, view: &ReferenceView, triangles: &[&ReferenceTriangle], result: &VisBuf, sample: SampleId, counts: &mut SampleCounts) {
        // The triangles that may win by brute force. Rounding may differ by one unit at the centre, by one more at other samples, and the bias by one.
        let SampleId { pixel, in_subtile: [i, j], k } = sample;
        let covering = self.covering(view, triangles, ReferenceView::sample(pixel, k));
        let tolerance = if k == 0 { 2 } else { 3 };
        let best = covering.iter().find(|t| t.state == HoleState::Covered);
        let may_win = |t: &&CoveringTriangle| t.state != HoleState::Hole && best.is_none_or(|b| t.depth_key <= b.depth_key + tolerance);
        let possible: Vec<&CoveringTriangle> = covering.iter().filter(may_win).collect();
        counts.add(&covering, best, &possible);

        // The beam's winner is one of them.
        let name = || format!("sample {k} of pixel {pixel:?} in view {}-{}", self.frame.look_at_deg, self.frame.pitch_deg);
        let Some(slot) = slot_of(result, [i, j], k) else {
            assert!(best.is_none(), "{}: nothing, expected one of {possible:?}", name());
            return;
        };
        let surface = result.surface(slot);
        let source = result.chunk(surface.chunk).triangles()[surface.triangle as usize].source;
        let got = (255 - surface.rank, surface.object_id, source);
        let winner = possible.iter().find(|t| t.tie_break == got);
        let winner = winner.unwrap_or_else(|| panic!("{}: {got:?} won, expected one of {possible:?}; covering: {covering:?}", name()));

        // The depth of the centre is exact to one unit.
        if k == 0 {
            let depth = result.center_depth(i, j);
            assert!((f64::from(depth) - winner.depth).abs() <= 1.0, "{}: depth {depth}, expected {winner:?}", name());
        }
    }
}

impl SampleCounts {
    fn add(&mut self, covering: &[CoveringTriangle], best: Option<&CoveringTriangle>, possible: &[&CoveringTriangle]) {
        self.covered += u64::from(!possible.is_empty());
        let uncertain = possible.iter().any(|t| t.state == HoleState::Uncertain);
        self.close += u64::from(possible.len() > 1 || uncertain);
        self.uncertain += u64::from(uncertain);
        self.cutouts += u64::from(best.is_some_and(|b| b.is_cutout));
        self.holes += u64::from(covering.first().is_some_and(|t| t.state == HoleState::Hole));
    }
}

fn slot_of(result: &VisBuf, [i, j]: [usize; 2], k: usize) -> Option<u32> {
    match result.pixel(i, j) {
        Pixel::Nothing => None,
        Pixel::One(slot) => Some(slot),
        Pixel::Mixed(slots) => (slots[k] != NOTHING).then_some(slots[k]),
    }
}
