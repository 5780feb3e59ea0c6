//! The operations on lanes. Integer arithmetic is exact; float operations are exactly defined by IEEE 754 and none are fused. So all implementations give
//! equal bits.

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
    /// Wraps around.
    fn sub(self, other: Self) -> Self;
    /// Rounds towards zero. The values must fit int32.
    fn truncated(values: Self::Floats16) -> Self;
}

/// `N` float32 lanes. Bit k of a mask belongs to lane k; comparisons with NaN are false.
pub(crate) trait Floats<const N: usize>: Copy {
    fn splat(value: f32) -> Self;
    fn load(from: &[f32; N]) -> Self;
    fn store(self, to: &mut [f32; N]);
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// `self` where it is less than `other`, else `other`.
    fn min(self, other: Self) -> Self;
    /// `self` where it is greater than `other`, else `other`.
    fn max(self, other: Self) -> Self;
    /// Mask of the lanes where `self` ≥ `other`.
    fn at_least(self, other: Self) -> u32;
    /// Mask of the lanes where `self` > `other`.
    fn greater(self, other: Self) -> u32;
    /// Stores the lanes that the mask selects.
    fn put(self, mask: u32, to: &mut [f32; N]);
    /// The least lane. No lane may be NaN.
    fn least(self) -> f32;
    /// The greatest lane. No lane may be NaN.
    fn greatest(self) -> f32;
}

/// The float lanes of an instruction set.
pub(crate) trait FloatLanes {
    type Floats8: Floats<8>;
    type Floats16: Floats<16>;
}
