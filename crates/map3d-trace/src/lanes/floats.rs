//! Float32 lanes: eight boxes or triangles, sixteen rays. Only operations that IEEE 754 fixes to the bit, none of them fused, so every implementation
//! gives equal bits.

use super::Plain;
#[cfg(target_arch = "x86_64")]
use super::{Avx2, Avx512, x86_floats};

/// `N` lanes. Masks have bit k for lane k; comparisons with NaN are false.
pub(crate) trait Floats<const N: usize>: Copy {
    fn splat(value: f32) -> Self;
    fn load(from: &[f32; N]) -> Self;
    fn store(self, to: &mut [f32; N]);
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    /// `self` where it is less, else `other`.
    fn min(self, other: Self) -> Self;
    /// `self` where it is greater, else `other`.
    fn max(self, other: Self) -> Self;
    /// Lanes that are at least as great.
    fn at_least(self, other: Self) -> u32;
    fn greater(self, other: Self) -> u32;
    /// Stores the lanes of the mask.
    fn put(self, mask: u32, to: &mut [f32; N]);
    /// The least lane; none may be NaN.
    fn least(self) -> f32;
    /// The greatest lane; none may be NaN.
    fn greatest(self) -> f32;
}

/// Floats that go with the integer lanes of an instruction set.
pub(crate) trait FloatLanes {
    type Eight: Floats<8>;
    type Sixteen: Floats<16>;
}

impl FloatLanes for Plain {
    type Eight = PlainFloats<8>;
    type Sixteen = PlainFloats<16>;
}

#[cfg(target_arch = "x86_64")]
impl FloatLanes for Avx2 {
    type Eight = x86_floats::Eight;
    type Sixteen = x86_floats::TwoEights;
}

#[cfg(target_arch = "x86_64")]
impl FloatLanes for Avx512 {
    type Eight = x86_floats::Eight;
    type Sixteen = x86_floats::Sixteen;
}

/// Lanes as an array, for every machine.
#[derive(Clone, Copy)]
pub(crate) struct PlainFloats<const N: usize>([f32; N]);

impl<const N: usize> PlainFloats<N> {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let mut out = [0.0; N];
        for k in 0..N {
            out[k] = f(self.0[k], other.0[k]);
        }
        Self(out)
    }

    #[inline(always)]
    fn mask(self, other: Self, f: impl Fn(f32, f32) -> bool) -> u32 {
        let mut mask = 0;
        for k in 0..N {
            mask |= u32::from(f(self.0[k], other.0[k])) << k;
        }
        mask
    }
}

impl<const N: usize> Floats<N> for PlainFloats<N> {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; N])
    }

    #[inline(always)]
    fn load(from: &[f32; N]) -> Self {
        Self(*from)
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; N]) {
        *to = self.0;
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> u32 {
        self.mask(other, |a, b| a >= b)
    }

    #[inline(always)]
    fn greater(self, other: Self) -> u32 {
        self.mask(other, |a, b| a > b)
    }

    #[inline(always)]
    fn put(self, mask: u32, to: &mut [f32; N]) {
        for k in 0..N {
            to[k] = if mask >> k & 1 != 0 { self.0[k] } else { to[k] };
        }
    }

    #[inline(always)]
    fn least(self) -> f32 {
        self.0.into_iter().fold(f32::INFINITY, |a, b| if b < a { b } else { a })
    }

    #[inline(always)]
    fn greatest(self) -> f32 {
        self.0.into_iter().fold(f32::NEG_INFINITY, |a, b| if b > a { b } else { a })
    }
}
