//! Beams against brute force: of every sample of every pixel, the winner.

use map3d_base::Frame;
use map3d_scene::SceneStore;
use map3d_trace::{BeamTracer, Cutout, Pixel, SUBTILE_PX, VisBuf};

use super::{Eye, Known, Place};

/// Whether a cut-out is there at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    There,
    Gone,
    /// Nearer to the edge of a hole than rounding allows to tell.
    Unsure,
}

/// Counts of samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// That meet something.
    pub met: u64,
    /// Whose winner is too close to call.
    pub close: u64,
    /// Of these, where a cut-out may or may not be there.
    pub unsure: u64,
    /// Where a cut-out wins.
    pub cut: u64,
    /// Where one would win but for its hole.
    pub holes: u64,
}

/// One view of a scene, traced with `cutout`, which brute force knows as `presence`.
pub struct Contest<'a> {
    pub store: &'a SceneStore,
    pub frame: &'a Frame,
    pub cutout: &'a dyn Cutout,
    pub presence: &'a dyn Fn(&Known, &Place) -> Presence,
}

/// A triangle that covers a sample.
#[derive(Clone, Copy, Debug)]
struct Rival {
    key: i64,
    order: (u8, u32, u32),
    depth: f64,
    presence: Presence,
    is_cutout: bool,
}

impl Contest<'_> {
    /// Compares the sub-tiles of a frame; every second one, as on a chessboard, to save time.
    pub fn run(&self) -> Tally {
        let (eye, mut tally) = (Eye::new(self.frame), Tally::default());
        let all = eye.know(self.store);
        let mut tracer = BeamTracer::new(self.store, self.frame).expect("tracer");
        for top in (0..256).step_by(SUBTILE_PX) {
            for left in (top % 128..256).step_by(2 * SUBTILE_PX) {
                let result = tracer.trace(left as u64, top as u64, self.cutout).expect("trace");
                let here: Vec<&Known> = all.iter().filter(|t| t.meets([left, top], SUBTILE_PX)).collect();
                for p in 0..SUBTILE_PX * SUBTILE_PX {
                    let (i, j) = (p % SUBTILE_PX, p / SUBTILE_PX);
                    let near: Vec<&Known> = here.iter().filter(|t| t.meets([left + i, top + j], 1)).copied().collect();
                    (0..16).for_each(|k| self.sample(&eye, &near, result, ([left + i, top + j], [i, j], k), &mut tally));
                }
            }
        }
        tally
    }

    /// The triangles that cover a lattice point, the winner first if it is there.
    fn rivals(&self, eye: &Eye, near: &[&Known], at: [i128; 2]) -> Vec<Rival> {
        let rival = |t: &&Known| {
            let depth = eye.depth(t, at);
            let is_cutout = t.material.is_cutout();
            let presence = match eye.place(t, at) {
                _ if !is_cutout => Presence::There,
                Some(place) => (self.presence)(t, &place),
                None => Presence::Unsure,
            };
            Rival { key: t.key(depth), order: t.order(), depth, presence, is_cutout }
        };
        let mut out: Vec<Rival> = near.iter().filter(|t| t.covers(at)).map(rival).collect();
        out.sort_by_key(|r| (r.key, r.order));
        out
    }

    /// Sample k of a pixel given in the square and in its sub-tile.
    fn sample(&self, eye: &Eye, near: &[&Known], result: &VisBuf, (pixel, [i, j], k): ([usize; 2], [usize; 2], usize), tally: &mut Tally) {
        let found = self.rivals(eye, near, Eye::sample(pixel, k));
        // Rounding may differ by a unit at the centre and one more elsewhere, the bias by one.
        let room = if k == 0 { 2 } else { 3 };
        let best = found.iter().find(|r| r.presence == Presence::There);
        let may_win = |r: &&Rival| r.presence != Presence::Gone && best.is_none_or(|b| r.key <= b.key + room);
        let able: Vec<&Rival> = found.iter().filter(may_win).collect();
        tally.count(&found, best, &able);
        let place = || format!("sample {k} of pixel {pixel:?} seen from {} / {}", self.frame.look_at_deg, self.frame.pitch_deg);
        let Some(slot) = slot_of(result, [i, j], k) else {
            assert!(best.is_none(), "{}: nothing, expected one of {able:?}", place());
            return;
        };
        let surface = result.surface(slot);
        let source = result.chunk(surface.chunk).triangles()[surface.triangle as usize].source;
        let got = (255 - surface.rank, surface.object_id, source);
        let winner = able.iter().find(|r| r.order == got);
        let winner = winner.unwrap_or_else(|| panic!("{}: {got:?} won, of {found:?} only {able:?} may", place()));
        if k == 0 {
            let depth = result.center_depth(i, j);
            assert!((f64::from(depth) - winner.depth).abs() <= 1.0, "{}: depth {depth}, expected {winner:?}", place());
        }
    }
}

impl Tally {
    fn count(&mut self, found: &[Rival], best: Option<&Rival>, able: &[&Rival]) {
        self.met += u64::from(!able.is_empty());
        let unsure = able.iter().any(|r| r.presence == Presence::Unsure);
        self.close += u64::from(able.len() > 1 || unsure);
        self.unsure += u64::from(unsure);
        self.cut += u64::from(best.is_some_and(|b| b.is_cutout));
        self.holes += u64::from(found.first().is_some_and(|r| r.presence == Presence::Gone));
    }
}

fn slot_of(result: &VisBuf, [i, j]: [usize; 2], k: usize) -> Option<u32> {
    match result.pixel(i, j) {
        Pixel::Nothing => None,
        Pixel::One(slot) => Some(slot),
        Pixel::Mixed(slots) => (slots[k] != u32::MAX).then_some(slots[k]),
    }
}
