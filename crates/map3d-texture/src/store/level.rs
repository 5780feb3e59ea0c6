//! A level of a texture, ready to sample.

use crate::store::mips::{LinearRaster, first_mip, premultiplied};
use map3d_image::Raster;
use map3d_image::srgb::{ROOT, ROOT_OF_RGB};

/// A level as bytes q = 255·√(linear light), premultiplied by alpha, and alpha likewise: finer than sRGB bytes in shadows and lights, at most a third
/// coarser between, in four bytes per texel. Rows top to bottom.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Level {
    pub width: u32,
    pub height: u32,
    pub texels: Vec<[u8; 4]>,
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
    fn new(width: u32, height: u32, texels: Vec<[u8; 4]>) -> Self {
        let cells = texels.iter().any(|t| t[3] != 255).then(|| alpha_cells(width as usize, &texels));
        Self { width, height, texels, cells }
    }

    pub fn from_raster(raster: Raster) -> Self {
        let table: &[[u32; 256]; 3] = &ROOT_OF_RGB;
        let Raster { width, height, pixels: mut texels } = raster;
        for p in &mut texels {
            let [r, g, b, a] = *p;
            *p = match a {
                255 => (table[0][r as usize] | table[1][g as usize] | table[2][b as usize]).to_le_bytes(),
                _ => premultiplied(*p).map(|c| ROOT[c as usize]),
            };
        }
        Self::new(width, height, texels)
    }

    pub fn from_linear(linear: &LinearRaster) -> Self {
        let table: &[u8; 65_536] = &ROOT;
        let texel = |p: &[u16; 4]| [table[p[0] as usize], table[p[1] as usize], table[p[2] as usize], table[p[3] as usize]];
        Self::new(linear.width, linear.height, linear.pixels.iter().map(texel).collect())
    }

    /// Computes the next level: the root of the mean light of four texels. `None` for odd sides.
    pub fn halved(&self) -> Option<Self> {
        let (w, h) = (self.width as usize, self.height as usize);
        if w % 2 == 1 || h % 2 == 1 {
            return None;
        }
        let mut texels = vec![[0; 4]; w / 2 * (h / 2)];
        let mut sums = vec![[0i32; 4]; w];
        let mut fours = vec![[0i32; 4]; w / 2];
        for (rows, out) in self.texels.chunks_exact(2 * w).zip(texels.chunks_exact_mut(w / 2)) {
            let (upper, lower) = rows.split_at(w);
            for ((sum, a), b) in sums.as_flattened_mut().iter_mut().zip(upper.as_flattened()).zip(lower.as_flattened()) {
                *sum = square(*a) + square(*b);
            }
            for (four, [a, b]) in fours.iter_mut().zip(sums.as_chunks::<2>().0) {
                for c in 0..4 {
                    four[c] = a[c] + b[c];
                }
            }
            out.as_flattened_mut().iter_mut().zip(fours.as_flattened()).for_each(|(q, four)| *q = mean_root(*four));
        }
        Some(Self::new(self.width / 2, self.height / 2, texels))
    }

    /// Computes levels 0 and 1 of an image.
    pub(super) fn first_two(image: Raster) -> (Self, Self) {
        let odd = (image.width % 2 == 1 || image.height % 2 == 1).then(|| Self::from_linear(&first_mip(&image)));
        let level_0 = Self::from_raster(image);
        let level_1 = odd.or_else(|| level_0.halved()).expect("even sides");
        (level_0, level_1)
    }

    /// Returns the cell of a texel, which must have a right and a lower neighbour.
    #[inline(always)]
    pub(crate) fn alpha_cell(&self, texel: usize) -> AlphaCell {
        self.cells.as_ref().map_or(AlphaCell::Opaque, |cells| cells[texel])
    }

    pub(super) fn bytes(&self) -> u64 {
        (self.texels.len() * 4 + self.cells.as_ref().map_or(0, Vec::len)) as u64
    }
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

/// Returns the cells of all texels; `Mixed` in the last row and column.
fn alpha_cells(width: usize, texels: &[[u8; 4]]) -> Vec<AlphaCell> {
    let alone: Vec<AlphaCell> = texels.iter().map(|t| AlphaCell::of_texel(*t)).collect();
    let mut cells = vec![AlphaCell::Mixed; texels.len()];
    for (out, rows) in cells.chunks_exact_mut(width).zip(alone.windows(2 * width).step_by(width)) {
        let (upper, lower) = rows.split_at(width);
        for (x, cell) in out[..width - 1].iter_mut().enumerate() {
            *cell = upper[x].and(upper[x + 1]).and(lower[x].and(lower[x + 1]));
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
    #[test]
    fn the_mean_root_is_rounded_exactly() {
        for sum in 0..=4 * 255 * 255 {
            assert_eq!(super::mean_root(sum), ((f64::from(sum) / 4.0).sqrt() + 0.5) as u8, "{sum}");
        }
    }
}
