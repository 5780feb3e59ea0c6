//! Colour to sRGB bytes with straight coverage alpha; under alpha 0 the colour of the nearest covered pixel.

use crate::raster::Raster;
use crate::srgb::BYTE;
use crate::texture::{UsageMask, fill_unused};

/// Linear premultiplied 16-bit colour to sRGB bytes.
pub fn color_from_linear((width, height): (u32, u32), color: &[[u16; 4]]) -> Raster {
    let table: &[u8; 65_536] = &BYTE;
    let mut covered = 0usize;
    let pixels = color.iter().map(|p| {
        let pixel = match p[3] {
            65_535 => [table[p[0] as usize], table[p[1] as usize], table[p[2] as usize], 255],
            a => straight(table, *p, a),
        };
        covered += usize::from(pixel[3] != 0);
        pixel
    });
    let mut image = Raster::new(width, height, pixels.collect());
    if covered != 0 && covered != color.len() {
        fill_uncovered(&mut image);
    }
    image
}

fn straight(table: &[u8; 65_536], p: [u16; 4], a: u16) -> [u8; 4] {
    let alpha = ((u32::from(a) + 128) / 257) as u8;
    if alpha == 0 {
        return [0; 4];
    }
    let byte = |c: u16| table[((u32::from(c) * 65_535 + u32::from(a) / 2) / u32::from(a)).min(65_535) as usize];
    [byte(p[0]), byte(p[1]), byte(p[2]), alpha]
}

fn fill_uncovered(image: &mut Raster) {
    let mut mask = UsageMask::empty(image.width, image.height);
    for y in 0..image.height {
        for (x, pixel) in image.row(y).iter().enumerate() {
            if pixel[3] != 0 {
                mask.mark(x as u32, y);
            }
        }
    }
    let alpha: Vec<u8> = image.pixels.iter().map(|p| p[3]).collect();
    fill_unused(image, &mask);
    for (pixel, a) in image.pixels.iter_mut().zip(alpha) {
        pixel[3] = a;
    }
}

/// Without alpha, for formats that have none.
pub fn opaque(image: &Raster) -> Vec<[u8; 3]> {
    image.pixels.iter().map(|p| [p[0], p[1], p[2]]).collect()
}
