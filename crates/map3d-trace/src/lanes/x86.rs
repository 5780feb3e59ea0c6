//! Integer lanes in vector registers. One of the two files of this crate with `unsafe` intrinsics; the other is `x86_floats`.
//!
//! SAFETY, for all blocks here: the intrinsics need AVX2 (`Avx2`) or AVX-512 F and VL (`Avx512`). Only `dispatch` names these types, after the processor
//! has reported the instruction set. Loads and stores go through references to arrays of exactly the bytes that they touch and demand no alignment.
#![allow(clippy::undocumented_unsafe_blocks)]

use std::arch::x86_64::*;

use super::traits::Lanes;
use super::x86_floats::{F32x16, TwoF32x8};

/// See `lanes::equal_lanes`. All x86-64 processors have SSE2.
#[inline(always)]
pub(super) fn equal_lanes(lanes: &[u32; 16], value: u32) -> u32 {
    let quarter = |k: usize| unsafe { _mm_cmpeq_epi32(_mm_loadu_si128(lanes[4 * k..].as_ptr().cast()), _mm_set1_epi32(value as i32)) };
    let (a, b, c, d) = (quarter(0), quarter(1), quarter(2), quarter(3));
    unsafe { _mm_movemask_epi8(_mm_packs_epi16(_mm_packs_epi32(a, b), _mm_packs_epi32(c, d))) as u32 }
}

/// One 512-bit register.
#[derive(Clone, Copy)]
pub(crate) struct Avx512(__m512i);

impl Lanes for Avx512 {
    #[inline(always)]
    fn splat(value: i32) -> Self {
        Self(unsafe { _mm512_set1_epi32(value) })
    }

    #[inline(always)]
    fn load(from: &[i32; 16]) -> Self {
        Self(unsafe { _mm512_loadu_si512(from.as_ptr().cast()) })
    }

    #[inline(always)]
    fn store(self, to: &mut [i32; 16]) {
        unsafe { _mm512_storeu_si512(to.as_mut_ptr().cast(), self.0) }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(unsafe { _mm512_add_epi32(self.0, other.0) })
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(unsafe { _mm512_mullo_epi32(self.0, other.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm512_min_epi32(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm512_max_epi32(self.0, other.0) })
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(unsafe { _mm512_or_si512(self.0, other.0) })
    }

    #[inline(always)]
    fn shift_right(self, bits: u32) -> Self {
        Self(unsafe { _mm512_sra_epi32(self.0, _mm_cvtsi32_si128(bits as i32)) })
    }

    #[inline(always)]
    fn negative(self) -> u32 {
        u32::from(unsafe { _mm512_movepi32_mask(self.0) })
    }

    #[inline(always)]
    fn less(self, other: Self) -> u32 {
        u32::from(unsafe { _mm512_cmplt_epi32_mask(self.0, other.0) })
    }

    #[inline(always)]
    fn equal(self, other: Self) -> u32 {
        u32::from(unsafe { _mm512_cmpeq_epi32_mask(self.0, other.0) })
    }

    #[inline(always)]
    fn put(self, mask: u32, to: &mut [i32; 16]) {
        unsafe { _mm512_mask_storeu_epi32(to.as_mut_ptr(), mask as u16, self.0) }
    }

    #[inline(always)]
    fn greatest(self) -> i32 {
        unsafe { _mm512_reduce_max_epi32(self.0) }
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(unsafe { _mm512_sub_epi32(self.0, other.0) })
    }

    #[inline(always)]
    fn truncated(values: F32x16) -> Self {
        Self(unsafe { _mm512_cvttps_epi32(values.0) })
    }
}

/// Two 256-bit registers.
#[derive(Clone, Copy)]
pub(crate) struct Avx2(__m256i, __m256i);

impl Lanes for Avx2 {
    #[inline(always)]
    fn splat(value: i32) -> Self {
        let half = unsafe { _mm256_set1_epi32(value) };
        Self(half, half)
    }

    #[inline(always)]
    fn load(from: &[i32; 16]) -> Self {
        let (low, high) = from.split_at(8);
        unsafe { Self(_mm256_loadu_si256(low.as_ptr().cast()), _mm256_loadu_si256(high.as_ptr().cast())) }
    }

    #[inline(always)]
    fn store(self, to: &mut [i32; 16]) {
        let (low, high) = to.split_at_mut(8);
        unsafe {
            _mm256_storeu_si256(low.as_mut_ptr().cast(), self.0);
            _mm256_storeu_si256(high.as_mut_ptr().cast(), self.1);
        }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        unsafe { Self(_mm256_add_epi32(self.0, other.0), _mm256_add_epi32(self.1, other.1)) }
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        unsafe { Self(_mm256_mullo_epi32(self.0, other.0), _mm256_mullo_epi32(self.1, other.1)) }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        unsafe { Self(_mm256_min_epi32(self.0, other.0), _mm256_min_epi32(self.1, other.1)) }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        unsafe { Self(_mm256_max_epi32(self.0, other.0), _mm256_max_epi32(self.1, other.1)) }
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        unsafe { Self(_mm256_or_si256(self.0, other.0), _mm256_or_si256(self.1, other.1)) }
    }

    #[inline(always)]
    fn shift_right(self, bits: u32) -> Self {
        unsafe {
            let bits = _mm_cvtsi32_si128(bits as i32);
            Self(_mm256_sra_epi32(self.0, bits), _mm256_sra_epi32(self.1, bits))
        }
    }

    #[inline(always)]
    fn negative(self) -> u32 {
        unsafe {
            let low = _mm256_movemask_ps(_mm256_castsi256_ps(self.0)) as u32;
            low | (_mm256_movemask_ps(_mm256_castsi256_ps(self.1)) as u32) << 8
        }
    }

    #[inline(always)]
    fn less(self, other: Self) -> u32 {
        unsafe { Self(_mm256_cmpgt_epi32(other.0, self.0), _mm256_cmpgt_epi32(other.1, self.1)) }.negative()
    }

    #[inline(always)]
    fn equal(self, other: Self) -> u32 {
        unsafe { Self(_mm256_cmpeq_epi32(self.0, other.0), _mm256_cmpeq_epi32(self.1, other.1)) }.negative()
    }

    #[inline(always)]
    fn put(self, mask: u32, to: &mut [i32; 16]) {
        let (low, high) = to.split_at_mut(8);
        unsafe {
            let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let low_mask = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(mask as i32), bits), bits);
            let high_mask = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32((mask >> 8) as i32), bits), bits);
            _mm256_maskstore_epi32(low.as_mut_ptr(), low_mask, self.0);
            _mm256_maskstore_epi32(high.as_mut_ptr(), high_mask, self.1);
        }
    }

    #[inline(always)]
    fn greatest(self) -> i32 {
        let mut lanes = [0; 16];
        self.store(&mut lanes);
        lanes.into_iter().fold(i32::MIN, i32::max)
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        unsafe { Self(_mm256_sub_epi32(self.0, other.0), _mm256_sub_epi32(self.1, other.1)) }
    }

    #[inline(always)]
    fn truncated(values: TwoF32x8) -> Self {
        unsafe { Self(_mm256_cvttps_epi32(values.0.0), _mm256_cvttps_epi32(values.1.0)) }
    }
}
