//! Gives unmarked pixels the colour of the nearest marked one by an exact Euclidean distance transform, rows after columns
//! (after Meijster, Roerdink & Hesselink 2000). Ties: the upper, then the left texel.

use std::ops::Range;

use crate::mask::PixelMask;
use crate::raster::Raster;

/// Longest side of an image: a distance and the next greater one fit 16 bits.
const MAX_SIDE: u32 = i16::MAX as u32 - 1;

/// Fills in place. An empty or full mask changes nothing. Pixels farther than `reach` from every marked one may keep their colour.
pub fn fill_unmarked(image: &mut Raster, mask: &PixelMask, reach: u32) {
    Filler::default().fill_unmarked(image, mask, reach);
}

/// Fills images one after another and reuses its buffers. One per thread.
#[derive(Default)]
pub struct Filler {
    /// The unmarked runs of all rows, and the end of each row's runs.
    gaps: Vec<Range<usize>>,
    row_ends: Vec<usize>,
    /// For each pixel the distance up to the nearest marked one in its column, at most `far`; 0 for a marked pixel.
    up: Vec<i16>,
    down: Vec<i16>,
    offsets: Vec<i16>,
    envelope: Vec<Parabola>,
}

impl Filler {
    /// See the function of this name.
    pub fn fill_unmarked(&mut self, image: &mut Raster, mask: &PixelMask, reach: u32) {
        assert_eq!((image.width, image.height), (mask.width(), mask.height()), "mask and image differ in size");
        assert!(image.width.max(image.height) <= MAX_SIDE, "{} × {} px", image.width, image.height);
        if mask.is_full() || mask.marked() == 0 {
            return;
        }
        let w = image.width as usize;
        // Represents any greater distance.
        let far = reach.min(MAX_SIDE - 1) as i16 + 1;
        self.find_gaps(mask);
        self.find_up(w, far);
        let Self { gaps, row_ends, up, down, offsets, envelope } = self;
        down.clear();
        down.resize(w, far);
        offsets.clear();
        offsets.resize(w, 0);
        for y in (0..row_ends.len()).rev() {
            let row = row_of(gaps, row_ends, y);
            step_down(down, offsets, &up[y * w..][..w], row, far);
            for gap in row {
                lower_envelope(envelope, offsets, gap.start.saturating_sub(1), (gap.end + 1).min(w), far);
                copy_nearest(image, y, gap, offsets, envelope, far);
            }
        }
    }

    fn find_gaps(&mut self, mask: &PixelMask) {
        self.gaps.clear();
        self.row_ends.clear();
        for y in 0..mask.height() {
            self.gaps.extend(mask.gaps(y));
            self.row_ends.push(self.gaps.len());
        }
    }

    fn find_up(&mut self, w: usize, far: i16) {
        let Self { gaps, row_ends, up, .. } = self;
        up.clear();
        for y in 0..row_ends.len() {
            for gap in row_of(gaps, row_ends, y) {
                up.resize(y * w + gap.start, 0);
                match y {
                    0 => up.resize(gap.end, far),
                    _ => up.extend_from_within((y - 1) * w + gap.start..(y - 1) * w + gap.end),
                }
                up[y * w + gap.start..].iter_mut().for_each(|distance| *distance = (*distance + 1).min(far));
            }
            up.resize((y + 1) * w, 0);
        }
    }
}

/// Returns the unmarked runs of a row.
fn row_of<'a>(gaps: &'a [Range<usize>], row_ends: &[usize], y: usize) -> &'a [Range<usize>] {
    &gaps[if y == 0 { 0 } else { row_ends[y - 1] }..row_ends[y]]
}

/// Updates the distances down from those of the row below; `offsets` receives the offset to the nearer of both, negative upwards. `far` or `-far`:
/// none within reach.
fn step_down(down: &mut [i16], offsets: &mut [i16], up: &[i16], gaps: &[Range<usize>], far: i16) {
    let mut used_from = 0;
    for gap in gaps {
        down[used_from..gap.start].fill(0);
        offsets[used_from..gap.start].fill(0);
        used_from = gap.end;
        let cells = down[gap.clone()].iter_mut().zip(&mut offsets[gap.clone()]).zip(&up[gap.clone()]);
        for ((down, offset), up) in cells {
            *down = (*down + 1).min(far);
            *offset = if *down < *up { *down } else { -up };
        }
    }
    down[used_from..].fill(0);
    offsets[used_from..].fill(0);
}

/// A column whose marked pixel is the nearest from `start` on.
struct Parabola {
    column: i32,
    start: i32,
}

/// Computes the lower envelope of the parabolas (x − i)² + offset(i)² over part of a row.
fn lower_envelope(parabolas: &mut Vec<Parabola>, offsets: &[i16], from: usize, end: usize, far: i16) {
    parabolas.clear();
    for (i, offset) in (from as i32..).zip(&offsets[from..end]) {
        if offset.abs() >= far {
            continue;
        }
        let square = i32::from(*offset).pow(2);
        let mut start = i32::MIN;
        while let Some(top) = parabolas.last() {
            start = overtakes(top.column, i32::from(offsets[top.column as usize]).pow(2), i, square);
            if start > top.start {
                break;
            }
            parabolas.pop();
            start = i32::MIN;
        }
        parabolas.push(Parabola { column: i, start });
    }
}

/// Returns the first x at which column b is strictly nearer than column a < b.
#[inline(always)]
fn overtakes(a: i32, a_square: i32, b: i32, b_square: i32) -> i32 {
    let numerator = b * b - a * a + b_square - a_square;
    // Columns are mostly neighbours.
    if b - a == 1 { (numerator >> 1) + 1 } else { numerator.div_euclid(2 * (b - a)) + 1 }
}

/// Copies colours into a gap. Sources are marked pixels, which are never written.
fn copy_nearest(image: &mut Raster, y: usize, gap: &Range<usize>, offsets: &[i16], parabolas: &[Parabola], far: i16) {
    let (w, far) = (image.width as usize, i32::from(far));
    for (k, parabola) in parabolas.iter().enumerate() {
        let next = parabolas.get(k + 1).map_or(i32::MAX, |p| p.start);
        let from = parabola.start.max(parabola.column - far).max(gap.start as i32) as usize;
        let end = next.min(parabola.column + far).min(gap.end as i32).max(0) as usize;
        if from < end {
            let row = (y as i32 + i32::from(offsets[parabola.column as usize])) as usize;
            let color = image.pixels[row * w + parabola.column as usize];
            match end - from {
                1 => image.pixels[y * w + from] = color,
                _ => image.pixels[y * w..][from..end].fill(color),
            }
        }
    }
}
