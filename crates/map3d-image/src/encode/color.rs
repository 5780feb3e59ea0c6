//! Converts colour to sRGB bytes with straight coverage alpha; pixels with alpha 0 take the colour of the nearest covered pixel.

use crate::fill::fill_unmarked;
use crate::mask::PixelMask;
use crate::raster::Raster;
use crate::srgb::{TO_BYTE, ToByte};

/// Converts linear premultiplied 16-bit colour to sRGB bytes.
pub fn color_from_linear((width, height): (u32, u32), color: &[[u16; 4]]) -> Raster {
    let table: &ToByte = &TO_BYTE;
    let mut pixels = vec![[0; 4]; color.len()];
    let mut covered = 0usize;
    for (to, p) in pixels.iter_mut().zip(color) {
        *to = if p[3] == 65_535 { [table.byte(p[0]), table.byte(p[1]), table.byte(p[2]), 255] } else { straight(table, *p) };
        covered += usize::from(to[3] != 0);
    }
    let mut image = Raster::new(width, height, pixels);
    if covered != 0 && covered != color.len() {
        fill_uncovered(&mut image);
    }
    image
}

/// Converts linear premultiplied 16-bit colour to sRGB bytes with straight alpha; pixels without coverage are 0.
pub fn bytes_from_linear(color: &[[u16; 4]]) -> Vec<[u8; 4]> {
    let table: &ToByte = &TO_BYTE;
    color.iter().map(|p| if p[3] == 65_535 { [table.byte(p[0]), table.byte(p[1]), table.byte(p[2]), 255] } else { straight(table, *p) }).collect()
}

fn straight(table: &ToByte, p: [u16; 4]) -> [u8; 4] {
    let a = u32::from(p[3]);
    let alpha = ((a + 128) / 257) as u8;
    if alpha == 0 {
        return [0; 4];
    }
    let byte = |c: u16| table.byte(((u32::from(c) * 65_535 + a / 2) / a).min(65_535) as u16);
    [byte(p[0]), byte(p[1]), byte(p[2]), alpha]
}

fn fill_uncovered(image: &mut Raster) {
    let mut mask = PixelMask::empty(image.width, image.height);
    for y in 0..image.height {
        for (x, pixel) in image.row(y).iter().enumerate() {
            if pixel[3] != 0 {
                mask.mark(x as u32, y);
            }
        }
    }
    let alpha: Vec<u8> = image.pixels.iter().map(|p| p[3]).collect();
    fill_unmarked(image, &mask, u32::MAX);
    for (pixel, a) in image.pixels.iter_mut().zip(alpha) {
        pixel[3] = a;
    }
}
