//! Sixteen int32 lanes: the 16 samples of a pixel, or 16 pixels of a row. Integer arithmetic is exact, so all implementations give equal bits.

use super::floats::FloatLanes;

/// Sixteen int32 lanes and the float lanes of the same instruction set. Bit k of a mask belongs to lane k.
pub(crate) trait Lanes: Copy + FloatLanes {
    fn splat(value: i32) -> Self;
    fn load(from: &[i32; 16]) -> Self;
    fn store(self, to: &mut [i32; 16]);
    /// Wraps around.
    fn add(self, other: Self) -> Self;
    /// The low 32 bits of the product.
    fn mul(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    fn or(self, other: Self) -> Self;
    /// Arithmetic shift; `bits` < 32.
    fn shift_right(self, bits: u32) -> Self;
    /// Mask of the lanes below zero.
    fn negative(self) -> u32;
    /// Mask of the lanes where `self` < `other`.
    fn less(self, other: Self) -> u32;
    /// Mask of the equal lanes.
    fn equal(self, other: Self) -> u32;
    /// Stores the lanes that the mask selects.
    fn put(self, mask: u32, to: &mut [i32; 16]);
    fn greatest(self) -> i32;
}
