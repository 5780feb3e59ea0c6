//! Bilinear taps in integers: 15-bit texels, weights of 14 bits, sums of 24 bits; the same on every machine.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{
    __m128i, _mm_add_epi32, _mm_cvtsi64_si128, _mm_cvtsi128_si64, _mm_madd_epi16, _mm_set1_epi32, _mm_setzero_si128, _mm_srai_epi32, _mm_srli_si128,
    _mm_unpacklo_epi16,
};

/// Bits of a tap's position within a texel, and of its place within a texture's level in all.
pub const WEIGHT_BITS: u32 = 7;
/// A tap adds a texel's 15 bits times 2^TAP_BITS.
pub const TAP_BITS: u32 = 9;

const ONE: u32 = 1 << WEIGHT_BITS;
const DROP: i32 = (2 * WEIGHT_BITS - TAP_BITS) as i32;

/// Weights of the four texels (TL, TR, BL, BR) at fractions in 1/128 texel; together 2^14.
#[inline(always)]
fn weights(fx: u32, fy: u32) -> [u32; 4] {
    let (gx, gy) = (ONE - fx, ONE - fy);
    [gx * gy, fx * gy, gx * fy, fx * fy]
}

/// A sum of taps: four channels.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub struct TapSum(__m128i);

#[cfg(target_arch = "x86_64")]
impl TapSum {
    #[inline(always)]
    pub fn new() -> Self {
        // SAFETY: SSE2 is part of x86-64.
        Self(unsafe { _mm_setzero_si128() })
    }

    /// Adds a bilinear tap of four texels (TL, TR, BL, BR).
    #[inline(always)]
    pub fn add(&mut self, texels: [[u16; 4]; 4], fx: u32, fy: u32) {
        let [w00, w01, w10, w11] = weights(fx, fy);
        let [a, b, c, d]: [i64; 4] = bytemuck::cast(texels);
        // SAFETY: SSE2 is part of x86-64; all operands are values.
        unsafe {
            let (above, below) = (_mm_set1_epi32((w00 | w01 << 16) as i32), _mm_set1_epi32((w10 | w11 << 16) as i32));
            let upper = _mm_madd_epi16(_mm_unpacklo_epi16(_mm_cvtsi64_si128(a), _mm_cvtsi64_si128(b)), above);
            let lower = _mm_madd_epi16(_mm_unpacklo_epi16(_mm_cvtsi64_si128(c), _mm_cvtsi64_si128(d)), below);
            self.0 = _mm_add_epi32(self.0, _mm_srai_epi32::<DROP>(_mm_add_epi32(upper, lower)));
        }
    }

    #[inline(always)]
    pub fn channels(self) -> [u32; 4] {
        // SAFETY: SSE2 is part of x86-64.
        let (low, high) = unsafe { (_mm_cvtsi128_si64(self.0), _mm_cvtsi128_si64(_mm_srli_si128::<8>(self.0))) };
        [low as u32, (low >> 32) as u32, high as u32, (high >> 32) as u32]
    }
}

#[cfg(not(target_arch = "x86_64"))]
pub use portable::TapSum;

#[cfg(any(test, not(target_arch = "x86_64")))]
mod portable {
    use super::{DROP, weights};

    /// A sum of taps: four channels.
    #[derive(Clone, Copy)]
    pub struct TapSum([u32; 4]);

    impl TapSum {
        pub fn new() -> Self {
            Self([0; 4])
        }

        /// Adds a bilinear tap of four texels (TL, TR, BL, BR).
        pub fn add(&mut self, texels: [[u16; 4]; 4], fx: u32, fy: u32) {
            let w = weights(fx, fy);
            for (c, sum) in self.0.iter_mut().enumerate() {
                *sum += (0..4).map(|k| u32::from(texels[k][c]) * w[k]).sum::<u32>() >> DROP;
            }
        }

        pub fn channels(self) -> [u32; 4] {
            self.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways_of_adding_are_equal() {
        let mut state = 1u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state >> 8
        };
        let (mut fast, mut plain) = (TapSum::new(), portable::TapSum::new());
        for _ in 0..64 {
            let texels = [(); 4].map(|()| [(); 4].map(|()| (random() % 32_768) as u16));
            let (fx, fy) = (random() % ONE, random() % ONE);
            fast.add(texels, fx, fy);
            plain.add(texels, fx, fy);
        }
        assert_eq!(fast.channels(), plain.channels());
    }

    #[test]
    fn a_full_texel_weighs_one() {
        let mut sum = TapSum::new();
        sum.add([[32_767, 0, 1, 32_767]; 4], 77, 3);
        assert_eq!(sum.channels(), [32_767 << TAP_BITS, 0, 1 << TAP_BITS, 32_767 << TAP_BITS]);
    }
}
