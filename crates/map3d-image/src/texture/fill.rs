//! Unused texels take the colour of the nearest used one: an exact Euclidean distance transform, rows after columns
//! (after Meijster, Roerdink & Hesselink 2000). Ties: the upper, then the left texel.

use std::ops::Range;

use crate::raster::Raster;
use crate::texture::mask::UsageMask;

/// Vertical distance where a column has no used texel.
const FAR: i32 = 1 << 20;

/// Fills in place. An empty or full mask changes nothing. The work grows with the unused area.
pub fn fill_unused(image: &mut Raster, mask: &UsageMask) {
    assert_eq!((image.width, image.height), (mask.width(), mask.height()), "mask and image differ in size");
    if mask.is_full() || mask.used() == 0 {
        return;
    }
    let w = image.width as usize;
    let gaps: Vec<Vec<Range<usize>>> = (0..mask.height()).map(|y| mask.gaps(y)).collect();
    let vertical = vertical_offsets(w, &gaps);
    let mut sources = Envelope::default();
    let mut run = Vec::new();
    // Every source is a used texel, and those are never written.
    for (y, row) in gaps.iter().enumerate() {
        let offsets = &vertical[y * w..][..w];
        for gap in row {
            sources.build(offsets, gap.start.saturating_sub(1), (gap.end + 1).min(w));
            run.clear();
            run.extend(gap.clone().map(|x| {
                let from = sources.nearest(x as i32);
                image.pixels[(y as i32 + offsets[from]) as usize * w + from]
            }));
            image.pixels[y * w..][gap.clone()].copy_from_slice(&run);
        }
    }
}

/// For each texel the signed rows to the nearest used one in its column: 0 when it is used itself.
fn vertical_offsets(w: usize, gaps: &[Vec<Range<usize>>]) -> Vec<i32> {
    let mut offsets = vec![0; w * gaps.len()];
    for (y, row) in gaps.iter().enumerate() {
        let (before, own) = offsets.split_at_mut(y * w);
        for gap in row {
            match y {
                0 => own[gap.clone()].fill(FAR),
                _ => {
                    let above = &before[(y - 1) * w..][gap.clone()];
                    own[gap.clone()].iter_mut().zip(above).for_each(|(o, a)| *o = if *a == FAR { FAR } else { a - 1 });
                }
            }
        }
    }
    for (y, row) in gaps.iter().enumerate().rev().skip(1) {
        let (upper, lower) = offsets.split_at_mut((y + 1) * w);
        for gap in row {
            let below = &lower[gap.clone()];
            for (own, below) in upper[y * w..][gap.clone()].iter_mut().zip(below) {
                if *below != FAR && *below >= 0 && below + 1 < own.abs() {
                    *own = below + 1;
                }
            }
        }
    }
    offsets
}

/// Lower envelope of the parabolas (x − i)² + offset(i)² over part of a row.
#[derive(Default)]
struct Envelope {
    /// (column, first x at which it is the nearest)
    parts: Vec<(usize, i32)>,
    at: usize,
}

impl Envelope {
    fn build(&mut self, offsets: &[i32], from: usize, end: usize) {
        self.parts.clear();
        self.at = 0;
        for i in from..end {
            if offsets[i] == FAR {
                continue;
            }
            let square = i64::from(offsets[i]).pow(2);
            let mut start = i32::MIN;
            while let Some(&(top, top_start)) = self.parts.last() {
                start = overtakes(top, i64::from(offsets[top]).pow(2), i, square);
                if start > top_start {
                    break;
                }
                self.parts.pop();
                start = i32::MIN;
            }
            self.parts.push((i, start));
        }
    }

    /// The nearest column to x; x must not decrease between calls.
    fn nearest(&mut self, x: i32) -> usize {
        while self.parts.get(self.at + 1).is_some_and(|(_, start)| *start <= x) {
            self.at += 1;
        }
        self.parts[self.at].0
    }
}

/// The first x at which column b is strictly nearer than column a < b.
fn overtakes(a: usize, a_square: i64, b: usize, b_square: i64) -> i32 {
    let (ai, bi) = (a as i64, b as i64);
    let numerator = bi * bi - ai * ai + b_square - a_square;
    (numerator.div_euclid(2 * (bi - ai)) + 1) as i32
}
