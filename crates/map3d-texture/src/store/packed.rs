//! Levels as they are stored: ready to sample, without loss. Each texel is the difference to the one above it, red and blue as their differences to green,
//! alpha only where the texture has some; all of it one Zstandard frame (spec/scene.md, Texture).

use std::cell::RefCell;

use crate::store::level::{Level, LevelWriter};

/// Higher levels of Zstandard make these differences hardly smaller.
const ZSTD_LEVEL: i32 = 1;

thread_local! {
    /// What unpacking needs, kept for the next level: a context of Zstandard and the differences.
    static UNPACKER: RefCell<Unpacker> = RefCell::default();
}

#[derive(Default)]
struct Unpacker {
    zstd: Option<zstd::bulk::Decompressor<'static>>,
    bytes: Vec<u8>,
}

/// Differences are kept for the next level up to this size; larger ones are freed.
const KEPT_BYTES: usize = 4 << 20;

pub(super) fn pack(level: &Level, has_alpha: bool) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(packed_length(level.width, level.height, has_alpha));
    for y in 0..level.height {
        for x in 0..level.width {
            let texel = level.texel(x, y);
            let above = if y == 0 { [0; 4] } else { level.texel(x, y - 1) };
            let [r, g, b, a] = std::array::from_fn(|c| texel[c].wrapping_sub(above[c]));
            bytes.extend([r.wrapping_sub(g), g, b.wrapping_sub(g)]);
            if has_alpha {
                bytes.push(a);
            }
        }
    }
    zstd::bulk::compress(&bytes, ZSTD_LEVEL).expect("memory to memory")
}

/// `has_alpha`: as when it was packed. The error says what is wrong with the frame.
pub(super) fn unpack(frame: &[u8], width: u32, height: u32, has_alpha: bool) -> std::result::Result<Level, String> {
    UNPACKER.with_borrow_mut(|unpacker| {
        let expected = packed_length(width, height, has_alpha);
        unpacker.read(frame, expected)?;
        let level = match has_alpha {
            true => add_up::<4>(&unpacker.bytes[..expected], width, height),
            false => add_up::<3>(&unpacker.bytes[..expected], width, height),
        };
        if unpacker.bytes.len() > KEPT_BYTES {
            unpacker.bytes = Vec::new();
        }
        Ok(level)
    })
}

impl Unpacker {
    /// Fills the first `expected` of the bytes.
    fn read(&mut self, frame: &[u8], expected: usize) -> std::result::Result<(), String> {
        if self.zstd.is_none() {
            self.zstd = Some(zstd::bulk::Decompressor::new().map_err(|e| e.to_string())?);
        }
        if self.bytes.len() < expected {
            self.bytes.resize(expected, 0);
        }
        let zstd = self.zstd.as_mut().expect("made above");
        match zstd.decompress_to_buffer(frame, &mut self.bytes[..expected]) {
            Ok(length) if length == expected => Ok(()),
            Ok(length) => Err(format!("{length} bytes, expected {expected}")),
            Err(cause) => Err(format!("{cause}, expected {expected} bytes")),
        }
    }
}

fn packed_length(width: u32, height: u32, has_alpha: bool) -> usize {
    width as usize * height as usize * if has_alpha { 4 } else { 3 }
}

/// `N`: bytes of a texel.
fn add_up<const N: usize>(bytes: &[u8], width: u32, height: u32) -> Level {
    let mut out = LevelWriter::new(width, height);
    let mut row: Vec<[u8; 4]> = vec![[0, 0, 0, if N == 4 { 0 } else { 255 }]; width as usize];
    for differences in bytes.chunks_exact(N * width as usize) {
        for (texel, d) in row.iter_mut().zip(differences.as_chunks::<N>().0) {
            let [r, g, b, a] = *texel;
            let alpha = if N == 4 { a.wrapping_add(d[N - 1]) } else { 255 };
            *texel = [r.wrapping_add(d[0]).wrapping_add(d[1]), g.wrapping_add(d[1]), b.wrapping_add(d[2]).wrapping_add(d[1]), alpha];
        }
        out.push(&row);
    }
    out.finish(N == 4)
}

#[cfg(test)]
mod tests {
    use super::*;
    use map3d_image::Raster;

    fn level(width: u32, height: u32, has_alpha: bool) -> Level {
        let texel = |k: u32| {
            let [r, g, b, a] = (k.wrapping_mul(0x9E37_79B1) ^ k >> 3).to_le_bytes();
            [r, g, b, if has_alpha { a } else { 255 }]
        };
        Level::of_image(&Raster::new(width, height, (0..width * height).map(texel).collect()), has_alpha)
    }

    #[test]
    fn an_unpacked_level_is_the_packed_one() {
        for (width, height) in [(1, 1), (1, 9), (33, 5), (64, 64), (100, 31)] {
            for has_alpha in [false, true] {
                let level = level(width, height, has_alpha);
                let unpacked = unpack(&pack(&level, has_alpha), width, height, has_alpha);
                assert_eq!(unpacked.as_ref(), Ok(&level), "{width} × {height}, alpha: {has_alpha}");
            }
        }
    }

    #[test]
    fn a_frame_of_another_size_or_a_damaged_one_is_refused() {
        let frame = pack(&level(40, 30, false), false);
        for (width, height, has_alpha) in [(40, 29, false), (40, 31, false), (40, 30, true), (4000, 3000, false)] {
            assert!(unpack(&frame, width, height, has_alpha).is_err(), "{width} × {height}, alpha: {has_alpha}");
        }
        for cut in [0, 3, frame.len() / 2, frame.len() - 1] {
            assert!(unpack(&frame[..cut], 40, 30, false).is_err(), "cut at {cut}");
        }
        assert!(unpack(&frame, 40, 30, false).is_ok(), "after an error the next level unpacks");
    }

    #[test]
    fn what_changes_little_from_row_to_row_becomes_small() {
        let rows = (0..256 * 256u32).map(|k| [(k % 256) as u8, (k % 199) as u8, 40, 255]).map(|[r, _, b, a]| [r, r / 2, b, a]).collect();
        let level = Level::of_image(&Raster::new(256, 256, rows), false);
        assert!(pack(&level, false).len() < 256 * 256 / 50);
    }
}
