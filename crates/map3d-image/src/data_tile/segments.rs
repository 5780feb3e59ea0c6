//! Splits a tile into runs of labels: pixels of one id, one normal and, as far as their depths show, one plane.

use map3d_base::DEPTH_NOTHING;

use super::label::Label;
use super::{ABOVE, AFTER_ABOVE, NEW};

/// Depths of one plane have equal steps from pixel to pixel, but for rounding and for the edges of triangles of one plane.
const STEP_TOLERANCE: u32 = 8;
/// A greater step is an edge (64 m from pixel to pixel).
const STEP_LIMIT: u32 = 65_536;

/// Pixels of one row and one label.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    pub row: u32,
    pub start: u32,
    pub end: u32,
    pub label: u32,
    /// `ABOVE`, `AFTER_ABOVE` or `NEW`.
    pub source: u8,
    /// End of the run above that it continues; its own start for a new label.
    pub expected_end: u32,
    /// Whether a pixel has not the depth that its label predicts.
    pub has_residuals: bool,
}

/// The pixels of a tile: rows from the top; normals as 0xBBGGRR.
#[derive(Clone, Copy)]
pub struct Pixels<'a> {
    pub width: usize,
    pub ids: &'a [u32],
    pub normals: &'a [u32],
    pub depths: &'a [u32],
}

#[derive(Default)]
pub struct Segments {
    pub runs: Vec<Run>,
    pub labels: Vec<Label>,
}

impl Segments {
    pub fn find(&mut self, pixels: Pixels) {
        self.runs.clear();
        self.labels.clear();
        let mut above = 0;
        for row in 0..pixels.ids.len() / pixels.width {
            let first = self.runs.len();
            self.split_row(pixels, row, above);
            above = first;
        }
    }

    /// Appends the runs of a row. `above`: the first run of the row above.
    fn split_row(&mut self, pixels: Pixels, row: usize, mut above: usize) {
        let (last, from) = (self.runs.len(), row * pixels.width);
        let mut start = 0;
        while start < pixels.width {
            let end = find_end(pixels, from, start);
            while above < last && self.runs[above].end as usize <= start {
                above += 1;
            }
            let run = self.continued(pixels, row, (start, end), (above, last)).unwrap_or_else(|| self.begun(pixels, row, (start, end)));
            self.labels[run.label as usize].add(&run, &pixels.depths[from + start..from + end]);
            self.runs.push(run);
            start = end;
        }
    }

    /// Returns the run if its label is that of one of two runs above.
    fn continued(&mut self, pixels: Pixels, row: usize, (start, end): (usize, usize), (above, last): (usize, usize)) -> Option<Run> {
        let from = row * pixels.width;
        for (source, run) in [(ABOVE, above), (AFTER_ABOVE, above + 1)] {
            let run = (run < last).then(|| self.runs[run]).filter(|run| (run.start as usize) < end)?;
            let label = &mut self.labels[run.label as usize];
            let at = start.max(run.start as usize);
            let (depth, depth_above) = (pixels.depths[from + at], pixels.depths[from - pixels.width + at]);
            if label.is_like(pixels.ids[from + start], pixels.normals[from + start], depth) && label.takes_step(depth.wrapping_sub(depth_above)) {
                let [row, start, end] = [row, start, end].map(|n| n as u32);
                return Some(Run { row, start, end, label: run.label, source, expected_end: run.end, has_residuals: false });
            }
        }
        None
    }

    /// Returns a run that begins a label.
    fn begun(&mut self, pixels: Pixels, row: usize, (start, end): (usize, usize)) -> Run {
        let at = row * pixels.width + start;
        let label = self.labels.len() as u32;
        self.labels.push(Label::new(pixels.ids[at], pixels.normals[at], pixels.depths[at], (start as u32, row as u32)));
        let [row, start, end] = [row, start, end].map(|n| n as u32);
        Run { row, start, end, label, source: NEW, expected_end: start, has_residuals: false }
    }
}

/// Finds the end of the run that starts at a pixel of the row that begins at `from`.
fn find_end(pixels: Pixels, from: usize, start: usize) -> usize {
    let rest = from + start..from + pixels.width;
    let (ids, normals, depths) = (&pixels.ids[rest.clone()], &pixels.normals[rest.clone()], &pixels.depths[rest]);
    let (id, normal, first) = (ids[0], normals[0], depths[0]);
    let others = ids.iter().zip(normals).zip(depths).skip(1);
    let is_other = |i: u32, n: u32| (i ^ id) | (n ^ normal) != 0;
    let length = if first == DEPTH_NOTHING {
        others.take_while(|((i, n), depth)| !is_other(**i, **n) && **depth == DEPTH_NOTHING).count()
    } else {
        let (mut before, mut expected) = (first, None);
        let continues = |((i, n), depth): &((&u32, &u32), &u32)| {
            let step = depth.wrapping_sub(before);
            let continues = !is_other(**i, **n) & (**depth != DEPTH_NOTHING) & is_step_like(step, expected);
            (before, expected) = (**depth, Some(step));
            continues
        };
        others.take_while(continues).count()
    };
    start + 1 + length
}

/// Whether a step continues a plane whose last step was `expected`, if it had one.
#[inline(always)]
pub fn is_step_like(step: u32, expected: Option<u32>) -> bool {
    match expected {
        Some(expected) => (step.wrapping_sub(expected) as i32).unsigned_abs() <= STEP_TOLERANCE,
        None => (step as i32).unsigned_abs() <= STEP_LIMIT,
    }
}
