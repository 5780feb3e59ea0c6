//! Float lanes in vector registers. One of the two files of this crate with `unsafe` intrinsics; the other is `x86`.
//!
//! SAFETY, for all blocks here: the intrinsics need AVX2 (`F32x8`, `TwoF32x8`) or AVX-512 F (`F32x16`). Only `FloatLanes` of `Avx2` and `Avx512` names
//! these types, and only `dispatch` names those two, after the processor has reported the instruction set. Loads and stores go through references to
//! arrays of exactly the bytes that they touch and demand no alignment.
#![allow(clippy::undocumented_unsafe_blocks)]

use std::arch::x86_64::*;

use super::traits::{FloatLanes, Floats};
use super::x86::{Avx2, Avx512};

impl FloatLanes for Avx2 {
    type Floats8 = F32x8;
    type Floats16 = TwoF32x8;
}

impl FloatLanes for Avx512 {
    type Floats8 = F32x8;
    type Floats16 = F32x16;
}

/// One 256-bit register.
#[derive(Clone, Copy)]
pub(crate) struct F32x8(pub(super) __m256);

impl Floats<8> for F32x8 {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(unsafe { _mm256_set1_ps(value) })
    }

    #[inline(always)]
    fn load(from: &[f32; 8]) -> Self {
        Self(unsafe { _mm256_loadu_ps(from.as_ptr()) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(unsafe { _mm256_add_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(unsafe { _mm256_sub_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(unsafe { _mm256_mul_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(unsafe { _mm256_div_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm256_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> u32 {
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GE_OQ>(self.0, other.0)) as u32 }
    }

    #[inline(always)]
    fn greater(self, other: Self) -> u32 {
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(self.0, other.0)) as u32 }
    }

    #[inline(always)]
    fn put(self, mask: u32, to: &mut [f32; 8]) {
        unsafe {
            let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let lanes = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(mask as i32), bits), bits);
            _mm256_maskstore_ps(to.as_mut_ptr(), lanes, self.0);
        }
    }

    #[inline(always)]
    fn least(self) -> f32 {
        unsafe {
            let four = _mm_min_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let two = _mm_min_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_min_ss(two, _mm_shuffle_ps::<1>(two, two)))
        }
    }

    #[inline(always)]
    fn greatest(self) -> f32 {
        unsafe {
            let four = _mm_max_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let two = _mm_max_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_max_ss(two, _mm_shuffle_ps::<1>(two, two)))
        }
    }
}

/// Two 256-bit registers.
#[derive(Clone, Copy)]
pub(crate) struct TwoF32x8(pub(super) F32x8, pub(super) F32x8);

#[inline(always)]
fn halves(from: &[f32; 16]) -> (&[f32; 8], &[f32; 8]) {
    let (low, high) = from.split_at(8);
    (low.try_into().expect("half of 16"), high.try_into().expect("half of 16"))
}

#[inline(always)]
fn halves_mut(to: &mut [f32; 16]) -> (&mut [f32; 8], &mut [f32; 8]) {
    let (low, high) = to.split_at_mut(8);
    (low.try_into().expect("half of 16"), high.try_into().expect("half of 16"))
}

impl Floats<16> for TwoF32x8 {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(F32x8::splat(value), F32x8::splat(value))
    }

    #[inline(always)]
    fn load(from: &[f32; 16]) -> Self {
        let (low, high) = halves(from);
        Self(F32x8::load(low), F32x8::load(high))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 16]) {
        let (low, high) = halves_mut(to);
        self.0.store(low);
        self.1.store(high);
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0.add(other.0), self.1.add(other.1))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0.sub(other.0), self.1.sub(other.1))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0.mul(other.0), self.1.mul(other.1))
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(self.0.div(other.0), self.1.div(other.1))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(self.0.min(other.0), self.1.min(other.1))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0), self.1.max(other.1))
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> u32 {
        self.0.at_least(other.0) | self.1.at_least(other.1) << 8
    }

    #[inline(always)]
    fn greater(self, other: Self) -> u32 {
        self.0.greater(other.0) | self.1.greater(other.1) << 8
    }

    #[inline(always)]
    fn put(self, mask: u32, to: &mut [f32; 16]) {
        let (low, high) = halves_mut(to);
        self.0.put(mask, low);
        self.1.put(mask >> 8, high);
    }

    #[inline(always)]
    fn least(self) -> f32 {
        self.0.min(self.1).least()
    }

    #[inline(always)]
    fn greatest(self) -> f32 {
        self.0.max(self.1).greatest()
    }
}

/// One 512-bit register.
#[derive(Clone, Copy)]
pub(crate) struct F32x16(pub(super) __m512);

impl Floats<16> for F32x16 {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(unsafe { _mm512_set1_ps(value) })
    }

    #[inline(always)]
    fn load(from: &[f32; 16]) -> Self {
        Self(unsafe { _mm512_loadu_ps(from.as_ptr()) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 16]) {
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(unsafe { _mm512_add_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(unsafe { _mm512_sub_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(unsafe { _mm512_mul_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(unsafe { _mm512_div_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm512_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> u32 {
        u32::from(unsafe { _mm512_cmp_ps_mask::<_CMP_GE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn greater(self, other: Self) -> u32 {
        u32::from(unsafe { _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn put(self, mask: u32, to: &mut [f32; 16]) {
        unsafe { _mm512_mask_storeu_ps(to.as_mut_ptr(), mask as u16, self.0) }
    }

    #[inline(always)]
    fn least(self) -> f32 {
        unsafe { _mm512_reduce_min_ps(self.0) }
    }

    #[inline(always)]
    fn greatest(self) -> f32 {
        unsafe { _mm512_reduce_max_ps(self.0) }
    }
}
