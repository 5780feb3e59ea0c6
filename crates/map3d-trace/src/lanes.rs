//! Sixteen int32 lanes: the 16 samples of a pixel, or 16 pixels of a row. All arithmetic is on integers, so every implementation gives equal bits.

mod plain;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(crate) use plain::Plain;
#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Avx2, Avx512};

/// Masks have bit k for lane k.
pub(crate) trait Lanes: Copy {
    fn splat(value: i32) -> Self;
    fn load(from: &[i32; 16]) -> Self;
    fn store(self, to: &mut [i32; 16]);
    /// Wraps around.
    fn add(self, other: Self) -> Self;
    /// The low 32 bits.
    fn mul(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn or(self, other: Self) -> Self;
    /// Arithmetic shift; `bits` < 32.
    fn shift_right(self, bits: u32) -> Self;
    /// Lanes below zero.
    fn negative(self) -> u32;
    fn less(self, other: Self) -> u32;
    fn equal(self, other: Self) -> u32;
    /// Stores the lanes of the mask.
    fn put(self, mask: u32, to: &mut [i32; 16]);
    fn greatest(self) -> i32;
    /// Eight boxes against the square from 0 to `side`, both ends included: bit k is set when box k meets it. NaN never does.
    fn meets_square(x: &[[f32; 8]; 2], y: &[[f32; 8]; 2], side: f32) -> u32;
}
