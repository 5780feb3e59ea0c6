//! Mip levels: a texel is the area-weighted mean, in linear light and premultiplied by alpha, of the level before (spec/scene.md, Texture).

use map3d_image::Raster;
use map3d_image::srgb::{BYTE, LINEAR16};

/// Linear light premultiplied by alpha, 16 bits per channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LinearRaster {
    pub width: u32,
    pub height: u32,
    pub pixels: Vec<[u16; 4]>,
}

/// Returns the number of levels of an image, down to 1 × 1.
pub fn level_count(width: u32, height: u32) -> u32 {
    width.max(height).max(1).ilog2() + 1
}

pub fn level_size(width: u32, height: u32, level: u32) -> (u32, u32) {
    ((width >> level).max(1), (height >> level).max(1))
}

/// Computes level 1 from level 0.
pub fn first_mip(image: &Raster) -> LinearRaster {
    let table: &[u16; 256] = &LINEAR16;
    shrink(image.width, image.height, |y, row| {
        for (to, from) in row.iter_mut().zip(image.row(y)) {
            *to = premultiplied_by(table, *from);
        }
    })
}

/// Computes the next level.
pub fn next_mip(image: &LinearRaster) -> LinearRaster {
    let w = image.width as usize;
    shrink(image.width, image.height, |y, row| row.copy_from_slice(&image.pixels[y as usize * w..][..w]))
}

/// Returns linear light premultiplied by alpha of an sRGB pixel with straight alpha.
pub fn premultiplied(p: [u8; 4]) -> [u16; 4] {
    premultiplied_by(&LINEAR16, p)
}

#[inline(always)]
fn premultiplied_by(table: &[u16; 256], p: [u8; 4]) -> [u16; 4] {
    let (r, g, b) = (table[p[0] as usize], table[p[1] as usize], table[p[2] as usize]);
    if p[3] == 255 {
        return [r, g, b, 65_535];
    }
    let a = u32::from(p[3]);
    let times = |c: u16| ((u32::from(c) * a + 127) / 255) as u16;
    [times(r), times(g), times(b), (a * 257) as u16]
}

impl LinearRaster {
    /// Converts to sRGB bytes with straight alpha; black where alpha is 0.
    pub fn to_raster(&self) -> Raster {
        let byte = |c: u16, a: u16| {
            let straight = if a == 65_535 { u32::from(c) } else { (u32::from(c) * 65_535 + u32::from(a) / 2) / u32::from(a) };
            BYTE[straight.min(65_535) as usize]
        };
        let pixel = |p: &[u16; 4]| match p[3] {
            0 => [0; 4],
            a => [byte(p[0], a), byte(p[1], a), byte(p[2], a), ((u32::from(a) + 128) / 257) as u8],
        };
        Raster::new(self.width, self.height, self.pixels.iter().map(pixel).collect())
    }
}

/// Halves an image; `load` writes its rows into a buffer.
fn shrink(width: u32, height: u32, mut load: impl FnMut(u32, &mut [[u16; 4]])) -> LinearRaster {
    let (nw, nh) = level_size(width, height, 1);
    if width == 2 * nw && height == 2 * nh {
        return halve(nw, nh, load);
    }
    let mut pixels = Vec::with_capacity(nw as usize * nh as usize);
    let mut row = vec![[0u16; 4]; width as usize];
    let columns: Vec<Vec<Share>> = (0..nw).map(|x| covered(x, width, nw)).collect();
    let area = u64::from(width) * u64::from(height);
    for y in 0..nh {
        let mut sums = vec![[0u64; 4]; nw as usize];
        for line in covered(y, height, nh) {
            load(line.texel as u32, &mut row);
            for (sum, shares) in sums.iter_mut().zip(&columns) {
                for column in shares {
                    (0..4).for_each(|c| sum[c] += u64::from(row[column.texel][c]) * column.part * line.part);
                }
            }
        }
        pixels.extend(sums.iter().map(|s| s.map(|c| ((c + area / 2) / area) as u16)));
    }
    LinearRaster { width: nw, height: nh, pixels }
}

/// A texel and the part of it, in units of 1/m, that a texel of the next level covers.
#[derive(Clone, Copy)]
struct Share {
    texel: usize,
    part: u64,
}

/// Returns the texels of a row of `n` that texel `i` of a row of `m` covers; their parts together are n.
fn covered(i: u32, n: u32, m: u32) -> Vec<Share> {
    let (i, n, m) = (u64::from(i), u64::from(n), u64::from(m));
    let (from, to) = (i * n, (i + 1) * n);
    (from / m..to.div_ceil(m)).map(|k| Share { texel: k as usize, part: to.min((k + 1) * m) - from.max(k * m) }).collect()
}

fn halve(nw: u32, nh: u32, mut load: impl FnMut(u32, &mut [[u16; 4]])) -> LinearRaster {
    let mut pixels = Vec::with_capacity(nw as usize * nh as usize);
    let mut rows = [vec![[0u16; 4]; nw as usize * 2], vec![[0u16; 4]; nw as usize * 2]];
    for y in 0..nh {
        load(2 * y, &mut rows[0]);
        load(2 * y + 1, &mut rows[1]);
        let pairs = rows[0].as_chunks::<2>().0.iter().zip(rows[1].as_chunks::<2>().0);
        pixels.extend(pairs.map(|(top, bottom)| quarter(top, bottom)));
    }
    LinearRaster { width: nw, height: nh, pixels }
}

/// Returns the mean of four texels.
#[inline(always)]
fn quarter(top: &[[u16; 4]; 2], bottom: &[[u16; 4]; 2]) -> [u16; 4] {
    let mut out = [0; 4];
    for (c, mean) in out.iter_mut().enumerate() {
        let sum = u32::from(top[0][c]) + u32::from(top[1][c]) + u32::from(bottom[0][c]) + u32::from(bottom[1][c]);
        *mean = ((sum + 2) >> 2) as u16;
    }
    out
}
