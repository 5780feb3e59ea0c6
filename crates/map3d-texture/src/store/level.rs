//! A level of a texture, ready to sample.

use crate::store::layout::{STRIP_PITCH, StripLayout};
use crate::store::mips::{LinearRaster, first_mip, premultiplied};
use map3d_image::Raster;
use map3d_image::srgb::{ROOT, ROOT_OF_RGB};

/// A level as bytes q = 255·√(linear light), premultiplied by alpha, and alpha likewise: finer than sRGB bytes in shadows and lights, at most a third
/// coarser between, in four bytes per texel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Level {
    pub width: u32,
    pub height: u32,
    pub(crate) layout: StripLayout,
    /// In strips.
    pub(crate) texels: Vec<[u8; 4]>,
    /// For each texel with its right and lower neighbours; `None` when every texel is opaque.
    cells: Option<Vec<AlphaCell>>,
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
        Self::of_image(raster, true)
    }

    /// Converts an image. `has_alpha`: a texel that is sampled may not be opaque; otherwise every texel counts as opaque.
    pub(super) fn of_image(mut image: Raster, has_alpha: bool) -> Self {
        let mut out = LevelWriter::new(image.width, image.height);
        for row in image.pixels.chunks_exact_mut(image.width as usize) {
            to_roots(row, has_alpha);
            out.push(row);
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
    pub(super) fn first_mip_of(image: Raster, has_alpha: bool) -> Self {
        match image.width % 2 == 1 || image.height % 2 == 1 {
            true => Self::from_linear(&first_mip(&image)),
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
        self.cells.as_ref().map_or(AlphaCell::Opaque, |cells| cells[self.layout.index(x, y) as usize])
    }

    pub(super) fn bytes(&self) -> u64 {
        (self.texels.len() * 4 + self.cells.as_ref().map_or(0, Vec::len)) as u64
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
        level.cells = is_transparent.then(|| alpha_cells(level.height as usize, &level.texels));
        self.level
    }
}

/// Converts sRGB bytes with straight alpha; without `has_alpha` as if every texel were opaque.
fn to_roots(row: &mut [[u8; 4]], has_alpha: bool) {
    let table: &[[u32; 256]; 3] = &ROOT_OF_RGB;
    let opaque = |[r, g, b, _]: [u8; 4]| (table[0][r as usize] | table[1][g as usize] | table[2][b as usize]).to_le_bytes();
    match has_alpha {
        true => row.iter_mut().for_each(|p| *p = if p[3] == 255 { opaque(*p) } else { premultiplied(*p).map(|c| ROOT[c as usize]) }),
        false => row.iter_mut().for_each(|p| *p = opaque(*p)),
    }
}

/// Computes level 1 of an image with even sides, pair of rows by pair of rows. A texel of level 1 is the root of the mean light of four texels.
fn convert_and_halve(mut image: Raster, has_alpha: bool) -> Level {
    let w = image.width as usize;
    let mut out = LevelWriter::new(image.width / 2, image.height / 2);
    let mut row = vec![[0; 4]; w / 2];
    let mut sums = vec![[0i32; 4]; w];
    let mut fours = vec![[0i32; 4]; w / 2];
    for rows in image.pixels.chunks_exact_mut(2 * w) {
        to_roots(rows, has_alpha);
        let (upper, lower) = rows.split_at(w);
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
        let halved = Level::first_mip_of(image, true);
        for (x, y) in (0..32 * 32).map(|k| (k % 32, k / 32)) {
            let (a, b) = (exact.texel(x, y), halved.texel(x, y));
            assert!((0..4).all(|c| a[c].abs_diff(b[c]) <= 1), "({x}, {y}): {a:?} {b:?}");
        }
    }

    #[test]
    fn the_mean_root_is_rounded_exactly() {
        for sum in 0..=4 * 255 * 255 {
            assert_eq!(mean_root(sum), ((f64::from(sum) / 4.0).sqrt() + 0.5) as u8, "{sum}");
        }
    }
}
