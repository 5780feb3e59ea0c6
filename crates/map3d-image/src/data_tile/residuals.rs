//! Residuals: four bits each, with further bytes for the large ones.

use super::{fold, unfold};

/// Four bits that a byte follows, and a byte that four bytes follow.
const MORE_THAN_FOUR_BITS: u32 = 15;
const MORE_THAN_A_BYTE: u32 = 255;

/// Collects residuals.
#[derive(Default)]
pub struct ResidualWriter {
    fours: Vec<u8>,
    rest: Vec<u8>,
}

impl ResidualWriter {
    pub fn clear(&mut self) {
        self.fours.clear();
        self.rest.clear();
    }

    pub fn count(&self) -> usize {
        self.fours.len()
    }

    /// Drops all residuals but the first `count`. The dropped ones are 0.
    pub fn drop_zeros(&mut self, count: usize) {
        self.fours.truncate(count);
    }

    #[inline(always)]
    pub fn push(&mut self, residual: u32) {
        let folded = fold(residual);
        self.fours.push(folded.min(MORE_THAN_FOUR_BITS) as u8);
        if folded >= MORE_THAN_FOUR_BITS {
            self.push_rest(folded - MORE_THAN_FOUR_BITS);
        }
    }

    #[inline(never)]
    fn push_rest(&mut self, rest: u32) {
        self.rest.push(rest.min(MORE_THAN_A_BYTE) as u8);
        if rest >= MORE_THAN_A_BYTE {
            self.rest.extend_from_slice(&(rest - MORE_THAN_A_BYTE).to_le_bytes());
        }
    }

    /// Appends the two columns.
    pub fn write(&self, body: &mut Vec<u8>) {
        let (pairs, last) = self.fours.as_chunks::<2>();
        body.extend(pairs.iter().map(|[low, high]| low | high << 4));
        body.extend_from_slice(last);
        body.extend_from_slice(&self.rest);
    }
}

/// Reads residuals one after another.
pub struct ResidualReader<'a> {
    fours: &'a [u8],
    rest: &'a [u8],
    next: usize,
    count: usize,
}

impl<'a> ResidualReader<'a> {
    /// `columns`: both columns; `None` if they are too short.
    pub fn new(columns: &'a [u8], count: usize) -> Option<Self> {
        let (fours, rest) = columns.split_at_checked(count.div_ceil(2))?;
        let is_padded = count.is_multiple_of(2) || fours.last().is_some_and(|byte| byte >> 4 == 0);
        is_padded.then_some(Self { fours, rest, next: 0, count })
    }

    /// Returns `None` after the last one, or when its bytes are missing.
    pub fn read(&mut self) -> Option<u32> {
        if self.next == self.count {
            return None;
        }
        let four = u32::from(self.fours[self.next / 2] >> (4 * (self.next % 2)) & 15);
        self.next += 1;
        if four < MORE_THAN_FOUR_BITS {
            return Some(unfold(four));
        }
        let (byte, rest) = self.rest.split_first()?;
        self.rest = rest;
        if u32::from(*byte) < MORE_THAN_A_BYTE {
            return Some(unfold(four + u32::from(*byte)));
        }
        let (long, rest) = self.rest.split_first_chunk::<4>()?;
        self.rest = rest;
        Some(unfold((MORE_THAN_FOUR_BITS + MORE_THAN_A_BYTE).wrapping_add(u32::from_le_bytes(*long))))
    }

    /// Whether all residuals and bytes were read.
    pub fn is_done(&self) -> bool {
        self.next == self.count && self.rest.is_empty()
    }
}
