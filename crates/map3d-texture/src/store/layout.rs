//! Where the texels of a level lie in memory: in strips of 32 columns. A strip holds its rows one after the other, each with a 33rd texel that repeats the first
//! one of the next strip. A bilinear tap thus never leaves a strip, and the taps of a pixel touch few cache lines, whichever way the texture is turned.

/// Columns of a strip, as a power of two.
pub const STRIP_BITS: u32 = 5;
/// Texels from one row of a strip to the next.
pub const STRIP_PITCH: usize = (1 << STRIP_BITS) + 1;

const COLUMNS: usize = 1 << STRIP_BITS;

/// Layout of a level of some height.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StripLayout {
    /// What the step to the next strip adds to the number of a texel, besides the columns of the strip.
    pub to_next_strip: i32,
}

impl StripLayout {
    pub fn new(height: u32) -> Self {
        Self { to_next_strip: (STRIP_PITCH * height as usize - COLUMNS) as i32 }
    }

    /// Returns the number of texels to store: whole strips.
    pub fn texel_count(width: u32, height: u32) -> usize {
        (width as usize).div_ceil(COLUMNS) * STRIP_PITCH * height as usize
    }

    /// Returns the number of the texel at column `x` of row `y`. Outside the level the result means nothing.
    #[inline(always)]
    pub fn index(self, x: i32, y: i32) -> i32 {
        y.wrapping_mul(STRIP_PITCH as i32).wrapping_add(x).wrapping_add((x >> STRIP_BITS).wrapping_mul(self.to_next_strip))
    }

    /// Stores row `y` of a level: all its columns. The last strip repeats the last texel.
    pub fn write_row(self, y: usize, row: &[[u8; 4]], texels: &mut [[u8; 4]]) {
        for (strip, columns) in row.chunks(COLUMNS).enumerate() {
            let next = row.get((strip + 1) * COLUMNS).or(columns.last()).copied().unwrap_or_default();
            let out = &mut texels[self.index((strip * COLUMNS) as i32, y as i32) as usize..][..STRIP_PITCH];
            out[..columns.len()].copy_from_slice(columns);
            out[columns.len()..].fill(next);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZES: [(u32, u32); 8] = [(1, 1), (31, 3), (32, 5), (33, 4), (64, 2), (65, 7), (100, 1), (1024, 3)];

    /// Returns a texel that occurs once in a level.
    fn texel(x: usize, y: usize) -> [u8; 4] {
        [x as u8, (x >> 8) as u8, y as u8, 1]
    }

    fn strips(width: u32, height: u32) -> Vec<[u8; 4]> {
        let (layout, mut texels) = (StripLayout::new(height), vec![[0; 4]; StripLayout::texel_count(width, height)]);
        for y in 0..height as usize {
            layout.write_row(y, &(0..width as usize).map(|x| texel(x, y)).collect::<Vec<_>>(), &mut texels);
        }
        texels
    }

    #[test]
    fn every_texel_lies_at_its_own_index() {
        for (width, height) in SIZES {
            let (layout, texels) = (StripLayout::new(height), strips(width, height));
            for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                assert_eq!(texels[layout.index(x as i32, y as i32) as usize], texel(x as usize, y as usize), "{width} × {height} ({x}, {y})");
            }
        }
    }

    #[test]
    fn the_right_and_lower_neighbours_of_a_texel_are_one_and_a_pitch_further() {
        for (width, height) in SIZES {
            let (layout, texels) = (StripLayout::new(height), strips(width, height));
            for (x, y) in (0..height as usize - 1).flat_map(|y| (0..width as usize - 1).map(move |x| (x, y))) {
                let at = layout.index(x as i32, y as i32) as usize;
                let found = [texels[at + 1], texels[at + STRIP_PITCH], texels[at + STRIP_PITCH + 1]];
                assert_eq!(found, [texel(x + 1, y), texel(x, y + 1), texel(x + 1, y + 1)], "{width} × {height} ({x}, {y})");
            }
        }
    }

    #[test]
    fn the_last_strip_repeats_the_last_column() {
        for (width, height) in SIZES {
            let texels = strips(width, height);
            let last = texels.chunks_exact(STRIP_PITCH).last().expect("a row");
            let used = (width as usize - 1) % COLUMNS + 1;
            assert!(last[used..].iter().all(|t| *t == texel(width as usize - 1, height as usize - 1)), "{width} × {height}");
        }
    }
}
