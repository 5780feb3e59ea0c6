//! A bit mask over the pixels of an image.

use std::ops::Range;

/// One bit per pixel, rows top to bottom.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PixelMask {
    width: u32,
    height: u32,
    words: Vec<u64>,
    marked: u64,
}

impl PixelMask {
    pub fn empty(width: u32, height: u32) -> Self {
        let pixels = width as usize * height as usize;
        Self { width, height, words: vec![0; pixels.div_ceil(64)], marked: 0 }
    }

    pub fn width(&self) -> u32 {
        self.width
    }

    pub fn height(&self) -> u32 {
        self.height
    }

    pub fn marked(&self) -> u64 {
        self.marked
    }

    pub fn is_full(&self) -> bool {
        self.marked == u64::from(self.width) * u64::from(self.height)
    }

    pub fn contains(&self, x: u32, y: u32) -> bool {
        let i = y as usize * self.width as usize + x as usize;
        self.words[i / 64] >> (i % 64) & 1 == 1
    }

    /// Returns the runs of unmarked pixels of a row as columns.
    pub fn gaps(&self, y: u32) -> impl Iterator<Item = Range<usize>> {
        let start = u64::from(y) * u64::from(self.width);
        let end = start + u64::from(self.width);
        let mut at = self.run_end(start, true, end);
        std::iter::from_fn(move || {
            let from = at;
            if from >= end {
                return None;
            }
            let stop = self.run_end(from, false, end);
            at = self.run_end(stop, true, end);
            Some((from - start) as usize..(stop - start) as usize)
        })
    }

    /// Marks columns of a row; none when the range is empty.
    pub fn mark_row(&mut self, y: u32, columns: Range<u32>) {
        if columns.start < columns.end {
            let row = u64::from(y) * u64::from(self.width);
            self.set_run(row + u64::from(columns.start), row + u64::from(columns.end));
        }
    }

    pub fn mark(&mut self, x: u32, y: u32) {
        let i = y as usize * self.width as usize + x as usize;
        let bit = 1u64 << (i % 64);
        self.marked += u64::from(self.words[i / 64] & bit == 0);
        self.words[i / 64] |= bit;
    }

    pub fn mark_all(&mut self) {
        self.set_run(0, u64::from(self.width) * u64::from(self.height));
    }

    /// Returns run lengths in row order as LEB128; the first run is of unmarked pixels.
    pub fn to_runs(&self) -> Vec<u8> {
        let mut out = Vec::new();
        let total = u64::from(self.width) * u64::from(self.height);
        let (mut at, mut value) = (0u64, false);
        while at < total {
            let end = self.run_end(at, value, total);
            leb128(&mut out, end - at);
            (at, value) = (end, !value);
        }
        out
    }

    fn run_end(&self, from: u64, value: bool, total: u64) -> u64 {
        let mut at = from;
        while at < total {
            let word = self.words[(at / 64) as usize] ^ if value { u64::MAX } else { 0 };
            let rest = word >> (at % 64);
            if rest != 0 {
                return (at + u64::from(rest.trailing_zeros())).min(total);
            }
            at = (at / 64 + 1) * 64;
        }
        total
    }

    /// Reads the output of `to_runs`; `None` when the runs do not add up to the image.
    pub fn from_runs(width: u32, height: u32, runs: &[u8]) -> Option<Self> {
        let mut mask = Self::empty(width, height);
        let total = u64::from(width) * u64::from(height);
        let (mut at, mut value, mut rest) = (0u64, false, runs);
        while !rest.is_empty() {
            let (n, tail) = read_leb128(rest)?;
            let end = at.checked_add(n).filter(|end| *end <= total)?;
            if value {
                mask.set_run(at, end);
            }
            (at, value, rest) = (end, !value, tail);
        }
        (at == total).then_some(mask)
    }

    fn set_run(&mut self, from: u64, end: u64) {
        let mut at = from;
        while at < end {
            let n = (64 - at % 64).min(end - at);
            let ones = if n == 64 { u64::MAX } else { (1u64 << n) - 1 };
            let word = &mut self.words[(at / 64) as usize];
            self.marked += u64::from((ones << (at % 64) & !*word).count_ones());
            *word |= ones << (at % 64);
            at += n;
        }
    }
}

fn leb128(out: &mut Vec<u8>, mut n: u64) {
    while n >= 128 {
        out.push(n as u8 | 128);
        n >>= 7;
    }
    out.push(n as u8);
}

fn read_leb128(bytes: &[u8]) -> Option<(u64, &[u8])> {
    let mut n = 0u64;
    for (k, byte) in bytes.iter().enumerate().take(9) {
        n |= u64::from(byte & 127) << (7 * k);
        if byte & 128 == 0 {
            return Some((n, &bytes[k + 1..]));
        }
    }
    None
}
