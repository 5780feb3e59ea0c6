//! Unused texels take the colour of the nearest used one: an exact Euclidean distance transform, rows after columns
//! (after Meijster, Roerdink & Hesselink 2000). Ties: the upper, then the left texel.

use crate::raster::Raster;
use crate::texture::mask::UsageMask;

/// Vertical distance where a column has no used texel.
const FAR: i32 = 1 << 20;

/// Fills in place. An empty or full mask changes nothing.
pub fn fill_unused(image: &mut Raster, mask: &UsageMask) {
    assert_eq!((image.width, image.height), (mask.width(), mask.height()), "mask and image differ in size");
    if mask.is_full() || mask.used() == 0 {
        return;
    }
    let vertical = vertical_offsets(mask);
    let (w, h) = (image.width as usize, image.height as usize);
    let mut sources = Envelope::default();
    let mut row = vec![[0u8; 4]; w];
    // Every source is a used texel, and those are never written.
    for y in 0..h {
        let offsets = &vertical[y * w..][..w];
        let mut x = 0;
        while x < w {
            if offsets[x] == 0 {
                x += 1;
                continue;
            }
            let end = (x..w).find(|i| offsets[*i] == 0).unwrap_or(w);
            sources.build(offsets, x.saturating_sub(1), (end + 1).min(w));
            for (i, pixel) in row.iter_mut().enumerate().take(end).skip(x) {
                let from = sources.nearest(i as i32);
                let from_row = (y as i32 + offsets[from]) as usize;
                *pixel = image.pixels[from_row * w + from];
            }
            image.pixels[y * w + x..y * w + end].copy_from_slice(&row[x..end]);
            x = end;
        }
    }
}

/// For each texel the signed rows to the nearest used one in its column: 0 when it is used itself.
fn vertical_offsets(mask: &UsageMask) -> Vec<i32> {
    let (w, h) = (mask.width() as usize, mask.height() as usize);
    let mut offsets = vec![FAR; w * h];
    for y in 0..h {
        for x in 0..w {
            if mask.get(x as u32, y as u32) {
                offsets[y * w + x] = 0;
            } else if y > 0 && offsets[(y - 1) * w + x] != FAR {
                offsets[y * w + x] = offsets[(y - 1) * w + x] - 1;
            }
        }
    }
    for y in (0..h.saturating_sub(1)).rev() {
        let (upper, lower) = offsets.split_at_mut((y + 1) * w);
        for (own, below) in upper[y * w..].iter_mut().zip(&lower[..w]) {
            if *below != FAR && *below >= 0 && below + 1 < own.abs() {
                *own = below + 1;
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
