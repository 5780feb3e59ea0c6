//! A level of a texture, ready to sample.

use crate::store::layout::{STRIP_PITCH, StripLayout};
use crate::store::mips::{LinearRaster, first_mip};
use crate::store::roots::to_roots;
use map3d_image::Raster;
use map3d_image::srgb::ROOT;

/// A level as bytes q = 255·√(linear light), premultiplied by alpha, and alpha likewise: finer than sRGB bytes in shadows and lights, at most a third
/// coarser between, in four bytes per texel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Level {
    pub width: u32,
    pub height: u32,
    pub(crate) layout: StripLayout,
    /// In strips.
    pub(crate) texels: Vec<[u8; 4]>,
    /// `None` when every texel is opaque.
    cells: Option<AlphaCells>,
}

/// The alpha of all bilinear taps between four texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AlphaCell {
    /// Less than a half.
    Transparent,
    Mixed,
    /// More than a half.
    Opaque,
}

impl Level {
    pub fn from_raster(raster: Raster) -> Self {
        Self::of_image(&raster, true)
    }

    /// Converts an image. `has_alpha`: a texel that is sampled may not be opaque; otherwise every texel counts as opaque.
    pub(super) fn of_image(image: &Raster, has_alpha: bool) -> Self {
        let mut out = LevelWriter::new(image.width, image.height);
        let mut row = vec![[0; 4]; image.width as usize];
        for pixels in image.pixels.chunks_exact(row.len()) {
            to_roots(pixels, &mut row, has_alpha);
            out.push(&row);
        }
        out.finish(has_alpha)
    }

    pub fn from_linear(linear: &LinearRaster) -> Self {
        let table: &[u8; 65_536] = &ROOT;
        let texel = |p: &[u16; 4]| [table[p[0] as usize], table[p[1] as usize], table[p[2] as usize], table[p[3] as usize]];
        let mut out = LevelWriter::new(linear.width, linear.height);
        let mut row = Vec::with_capacity(linear.width as usize);
        for pixels in linear.pixels.chunks_exact(linear.width as usize) {
            row.clear();
            row.extend(pixels.iter().map(texel));
            out.push(&row);
        }
        out.finish(true)
    }

    /// Computes level 1 of an image. `has_alpha`: a texel may not be opaque.
    pub(super) fn first_mip_of(image: &Raster, has_alpha: bool) -> Self {
        match image.width % 2 == 1 || image.height % 2 == 1 {
            true => Self::from_linear(&first_mip(image)),
            false => convert_and_halve(image, has_alpha),
        }
    }

    /// Returns the texel at column `x` of row `y`, from the upper left corner.
    #[inline(always)]
    pub fn texel(&self, x: u32, y: u32) -> [u8; 4] {
        self.texels[self.layout.index(x as i32, y as i32) as usize]
    }

    /// Returns the cell of a texel (column, row), which must have a right and a lower neighbour.
    #[inline(always)]
    pub(crate) fn alpha_cell(&self, x: i32, y: i32) -> AlphaCell {
        self.cells.as_ref().map_or(AlphaCell::Opaque, |cells| cells.of_texels[self.layout.index(x, y) as usize])
    }

    /// Returns what the cells in a rectangle (first and last column and row, inside the level) have in common; `Mixed` also for large rectangles.
    #[inline(always)]
    pub(crate) fn common_alpha_cell(&self, [x0, x1]: [i32; 2], [y0, y1]: [i32; 2]) -> AlphaCell {
        self.cells.as_ref().map_or(AlphaCell::Opaque, |cells| cells.common([x0, x1].map(|x| x as usize), [y0, y1].map(|y| y as usize)))
    }

    pub(super) fn bytes(&self) -> u64 {
        (self.texels.len() * 4 + self.cells.as_ref().map_or(0, |cells| cells.of_texels.len() + cells.of_blocks.len())) as u64
    }
}

/// Takes a level row by row, from the top.
pub(super) struct LevelWriter {
    level: Level,
    rows: usize,
}

impl LevelWriter {
    pub(super) fn new(width: u32, height: u32) -> Self {
        let texels = vec![[0; 4]; StripLayout::texel_count(width, height)];
        Self { level: Level { width, height, layout: StripLayout::new(height), texels, cells: None }, rows: 0 }
    }

    pub(super) fn push(&mut self, row: &[[u8; 4]]) {
        self.level.layout.write_row(self.rows, row, &mut self.level.texels);
        self.rows += 1;
    }

    /// `has_alpha`: a texel may not be opaque.
    pub(super) fn finish(mut self, has_alpha: bool) -> Level {
        let level = &mut self.level;
        let is_transparent = has_alpha && level.texels.iter().any(|t| t[3] != 255);
        level.cells = is_transparent.then(|| AlphaCells::new(level));
        self.level
    }
}

/// Computes level 1 of an image with even sides, pair of rows by pair of rows. A texel of level 1 is the root of the mean light of four texels.
fn convert_and_halve(image: &Raster, has_alpha: bool) -> Level {
    let w = image.width as usize;
    let mut out = LevelWriter::new(image.width / 2, image.height / 2);
    let mut roots = vec![[0; 4]; 2 * w];
    let mut row = vec![[0; 4]; w / 2];
    let mut sums = vec![[0i32; 4]; w];
    let mut fours = vec![[0i32; 4]; w / 2];
    for rows in image.pixels.chunks_exact(2 * w) {
        to_roots(rows, &mut roots, has_alpha);
        let (upper, lower) = roots.split_at(w);
        for ((sum, a), b) in sums.as_flattened_mut().iter_mut().zip(upper.as_flattened()).zip(lower.as_flattened()) {
            *sum = square(*a) + square(*b);
        }
        for (four, [a, b]) in fours.iter_mut().zip(sums.as_chunks::<2>().0) {
            for c in 0..4 {
                four[c] = a[c] + b[c];
            }
        }
        row.as_flattened_mut().iter_mut().zip(fours.as_flattened()).for_each(|(q, four)| *q = mean_root(*four));
        out.push(&row);
    }
    out.finish(has_alpha)
}

impl AlphaCell {
    /// Classifies one texel; the thresholds keep clear of a half, so that the rounding of a tap's sum does not matter.
    fn of_texel([.., root]: [u8; 4]) -> Self {
        match root {
            0..=170 => Self::Transparent,
            190.. => Self::Opaque,
            _ => Self::Mixed,
        }
    }

    fn and(self, other: Self) -> Self {
        if self == other { self } else { Self::Mixed }
    }
}

/// The cells of a level with alpha.
#[derive(Clone, Debug, PartialEq, Eq)]
struct AlphaCells {
    /// In strips; for each texel with its right and lower neighbours.
    of_texels: Vec<AlphaCell>,
    /// Row by row; for each block of `BLOCK` × `BLOCK` texels what its cells have in common.
    of_blocks: Vec<AlphaCell>,
    blocks_per_row: usize,
}

/// Binary logarithm of the side of a block.
const BLOCK_BITS: u32 = 2;
const BLOCK: u32 = 1 << BLOCK_BITS;
/// Blocks along a side of the largest rectangle that is looked up.
const MAX_BLOCKS: usize = 4;

impl AlphaCells {
    fn new(level: &Level) -> Self {
        let of_texels = alpha_cells(level.height as usize, &level.texels);
        let (columns, rows) = (level.width.div_ceil(BLOCK), level.height.div_ceil(BLOCK));
        let common = |(column, row): (u32, u32)| {
            let (xs, ys) = (column * BLOCK..level.width.min((column + 1) * BLOCK), row * BLOCK..level.height.min((row + 1) * BLOCK));
            let mut cells = ys.flat_map(|y| xs.clone().map(move |x| level.layout.index(x as i32, y as i32) as usize)).map(|k| of_texels[k]);
            let first = cells.next().unwrap_or(AlphaCell::Mixed);
            cells.fold(first, AlphaCell::and)
        };
        let of_blocks = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row))).map(common).collect();
        Self { of_texels, of_blocks, blocks_per_row: columns as usize }
    }

    #[inline(always)]
    fn common(&self, xs: [usize; 2], ys: [usize; 2]) -> AlphaCell {
        let ([x0, x1], [y0, y1]) = (xs.map(|x| x >> BLOCK_BITS), ys.map(|y| y >> BLOCK_BITS));
        let first = self.of_blocks[y0 * self.blocks_per_row + x0];
        if first == AlphaCell::Mixed || x1 - x0 >= MAX_BLOCKS || y1 - y0 >= MAX_BLOCKS {
            return AlphaCell::Mixed;
        }
        let is_common = (y0..=y1).all(|y| self.of_blocks[y * self.blocks_per_row..][x0..=x1].iter().all(|cell| *cell == first));
        if is_common { first } else { AlphaCell::Mixed }
    }
}

/// Returns the cells of all texels, strip by strip; `Mixed` in the last row and the last column of a strip.
fn alpha_cells(height: usize, texels: &[[u8; 4]]) -> Vec<AlphaCell> {
    let alone: Vec<AlphaCell> = texels.iter().map(|t| AlphaCell::of_texel(*t)).collect();
    let mut cells = vec![AlphaCell::Mixed; texels.len()];
    let strip = STRIP_PITCH * height;
    for (cells, alone) in cells.chunks_exact_mut(strip).zip(alone.chunks_exact(strip)) {
        for (out, rows) in cells.chunks_exact_mut(STRIP_PITCH).zip(alone.windows(2 * STRIP_PITCH).step_by(STRIP_PITCH)) {
            let (upper, lower) = rows.split_at(STRIP_PITCH);
            for (x, cell) in out[..STRIP_PITCH - 1].iter_mut().enumerate() {
                *cell = upper[x].and(upper[x + 1]).and(lower[x].and(lower[x + 1]));
            }
        }
    }
    cells
}

#[inline(always)]
fn square(q: u8) -> i32 {
    i32::from(q) * i32::from(q)
}

/// Returns the root of a quarter of a sum of four squares, halves rounded up.
#[inline(always)]
fn mean_root(sum: i32) -> u8 {
    // Adding 2^23 drops the fraction. A root that is not a half is at least 4.9e-4 away from one, so 2e-4 rounds only halves up.
    let rounded = (sum as f32 * 0.25).sqrt() + 2e-4 + 8_388_608.0;
    rounded.to_bits() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn level_1_is_within_a_step_of_the_mean_light() {
        let pixels = (0..64 * 64u32).map(|k| (k.wrapping_mul(0x9E37_79B1) ^ k >> 7).to_le_bytes()).collect();
        let image = Raster::new(64, 64, pixels);
        let exact = Level::from_linear(&first_mip(&image));
        let halved = Level::first_mip_of(&image, true);
        for (x, y) in (0..32 * 32).map(|k| (k % 32, k / 32)) {
            let (a, b) = (exact.texel(x, y), halved.texel(x, y));
            assert!((0..4).all(|c| a[c].abs_diff(b[c]) <= 1), "({x}, {y}): {a:?} {b:?}");
        }
    }

    #[test]
    fn a_rectangle_has_the_cell_that_all_its_texels_have() {
        // Opaque, transparent and mixed areas of some size.
        let alpha = |x: u32, y: u32| [255, 0, (x * 37 + y * 11) as u8][((x / 13 + y / 17) % 3) as usize];
        let pixels = (0..70 * 90u32).map(|k| [k as u8, 0, 0, alpha(k % 70, k / 70)]).collect();
        let level = Level::of_image(&Raster::new(70, 90, pixels), true);
        let mut found = 0;
        for (x0, y0) in (0..60).flat_map(|x| (0..80).map(move |y| (x, y))) {
            for (w, h) in [(0, 0), (3, 5), (8, 2)] {
                let cells = || (y0..=y0 + h).flat_map(|y| (x0..=x0 + w).map(move |x| (x, y))).map(|(x, y)| level.alpha_cell(x, y));
                let common = level.common_alpha_cell([x0, x0 + w], [y0, y0 + h]);
                assert!(common == AlphaCell::Mixed || cells().all(|cell| cell == common), "{w} × {h} at ({x0}, {y0})");
                found += u32::from(common != AlphaCell::Mixed);
            }
        }
        assert!(found > 1_000, "{found} rectangles");
    }

    #[test]
    fn the_mean_root_is_rounded_exactly() {
        for sum in 0..=4 * 255 * 255 {
            assert_eq!(mean_root(sum), ((f64::from(sum) / 4.0).sqrt() + 0.5) as u8, "{sum}");
        }
    }
}
