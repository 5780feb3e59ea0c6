//! Sixteen int32 lanes: the 16 samples of a pixel, or 16 pixels of a row. All arithmetic is on integers, so every implementation gives equal bits.

mod floats;
mod plain;
#[cfg(target_arch = "x86_64")]
mod x86;
#[cfg(target_arch = "x86_64")]
mod x86_floats;

pub(crate) use floats::{FloatLanes, Floats};
pub(crate) use plain::Plain;
#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Avx2, Avx512};

/// Lanes that equal a value, as a mask; for code that is not compiled for an instruction set of its own.
#[inline(always)]
pub(crate) fn equal_lanes(lanes: &[u32; 16], value: u32) -> u32 {
    #[cfg(target_arch = "x86_64")]
    return x86::equal_lanes(lanes, value);
    #[cfg(not(target_arch = "x86_64"))]
    (0..16).fold(0, |mask, k| mask | u32::from(lanes[k] == value) << k)
}

/// Masks have bit k for lane k.
pub(crate) trait Lanes: Copy + FloatLanes {
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
}

#[cfg(test)]
mod tests {
    use super::equal_lanes;

    #[test]
    fn equal_lanes_are_told_for_any_value() {
        for value in [0, 1, 7, 1 << 15, 1 << 31, u32::MAX] {
            for mask in (0..0xFFFFu32).step_by(37) {
                let lanes = std::array::from_fn(|k| if mask >> k & 1 == 1 { value } else { value ^ (1 << (k * 2)) });
                assert_eq!(equal_lanes(&lanes, value), mask);
            }
        }
    }
}
