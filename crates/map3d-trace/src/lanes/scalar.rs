//! Lanes as arrays, for processors without AVX2.

use super::traits::{FloatLanes, Floats, Lanes};

#[derive(Clone, Copy)]
pub(crate) struct Scalar([i32; 16]);

impl Scalar {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(i32, i32) -> i32) -> Self {
        let mut out = [0; 16];
        for k in 0..16 {
            out[k] = f(self.0[k], other.0[k]);
        }
        Self(out)
    }

    #[inline(always)]
    fn compare(self, other: Self, f: impl Fn(i32, i32) -> bool) -> u32 {
        let mut mask = 0;
        for k in 0..16 {
            mask |= u32::from(f(self.0[k], other.0[k])) << k;
        }
        mask
    }
}

impl Lanes for Scalar {
    #[inline(always)]
    fn splat(value: i32) -> Self {
        Self([value; 16])
    }

    #[inline(always)]
    fn load(from: &[i32; 16]) -> Self {
        Self(*from)
    }

    #[inline(always)]
    fn store(self, to: &mut [i32; 16]) {
        *to = self.0;
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, i32::wrapping_add)
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, i32::wrapping_mul)
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, i32::min)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, i32::max)
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self.zip(other, |a, b| a | b)
    }

    #[inline(always)]
    fn shift_right(self, bits: u32) -> Self {
        self.zip(self, |v, _| v >> (bits & 31))
    }

    #[inline(always)]
    fn negative(self) -> u32 {
        self.compare(self, |a, _| a < 0)
    }

    #[inline(always)]
    fn less(self, other: Self) -> u32 {
        self.compare(other, |a, b| a < b)
    }

    #[inline(always)]
    fn equal(self, other: Self) -> u32 {
        self.compare(other, |a, b| a == b)
    }

    #[inline(always)]
    fn put(self, mask: u32, to: &mut [i32; 16]) {
        for k in 0..16 {
            to[k] = if mask >> k & 1 != 0 { self.0[k] } else { to[k] };
        }
    }

    #[inline(always)]
    fn greatest(self) -> i32 {
        self.0.into_iter().fold(i32::MIN, i32::max)
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, i32::wrapping_sub)
    }

    #[inline(always)]
    fn truncated(values: ScalarFloats<16>) -> Self {
        Self(values.0.map(|v| v as i32))
    }
}

impl FloatLanes for Scalar {
    type Floats8 = ScalarFloats<8>;
    type Floats16 = ScalarFloats<16>;
}

#[derive(Clone, Copy)]
pub(crate) struct ScalarFloats<const N: usize>([f32; N]);

impl<const N: usize> ScalarFloats<N> {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let mut out = [0.0; N];
        for k in 0..N {
            out[k] = f(self.0[k], other.0[k]);
        }
        Self(out)
    }

    #[inline(always)]
    fn compare(self, other: Self, f: impl Fn(f32, f32) -> bool) -> u32 {
        let mut mask = 0;
        for k in 0..N {
            mask |= u32::from(f(self.0[k], other.0[k])) << k;
        }
        mask
    }
}

impl<const N: usize> Floats<N> for ScalarFloats<N> {
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
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
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
        self.compare(other, |a, b| a >= b)
    }

    #[inline(always)]
    fn greater(self, other: Self) -> u32 {
        self.compare(other, |a, b| a > b)
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
