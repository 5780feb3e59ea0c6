//! SIMD lanes: one trait for integers and one for floats, an implementation for each instruction set, and the dispatch between them.

mod dispatch;
mod scalar;
mod traits;
#[cfg(target_arch = "x86_64")]
mod x86;
#[cfg(target_arch = "x86_64")]
mod x86_floats;

pub(crate) use dispatch::{Kernel, dispatch};
pub(crate) use scalar::Scalar;
#[cfg(test)]
pub(crate) use traits::FloatLanes;
pub(crate) use traits::{Floats, Lanes};

/// Returns the mask of the lanes that equal a value, for code outside of a `Kernel`.
#[inline(always)]
pub(crate) fn equal_lanes(lanes: &[u32; 16], value: u32) -> u32 {
    #[cfg(target_arch = "x86_64")]
    return x86::equal_lanes(lanes, value);
    #[cfg(not(target_arch = "x86_64"))]
    (0..16).fold(0, |mask, k| mask | u32::from(lanes[k] == value) << k)
}

#[cfg(test)]
mod tests {
    use super::equal_lanes;

    #[test]
    fn equal_lanes_finds_every_equal_lane() {
        for value in [0, 1, 7, 1 << 15, 1 << 31, u32::MAX] {
            for mask in (0..0xFFFFu32).step_by(37) {
                let lanes = std::array::from_fn(|k| if mask >> k & 1 == 1 { value } else { value ^ (1 << (k * 2)) });
                assert_eq!(equal_lanes(&lanes, value), mask);
            }
        }
    }
}
