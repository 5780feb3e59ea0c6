//! Bilinear taps in integers, the same on every machine: texels are bytes q that stand for linear light q², weights have 14 bits, sums 24.

/// Bits of a tap's position within a texel.
pub const WEIGHT_BITS: u32 = 7;
/// Fraction bits of the taps' places.
pub const PLACE_BITS: u32 = 16;
/// A tap adds a texel's 15 bits times 2^TAP_BITS.
pub const TAP_BITS: u32 = 9;
/// Linear light of a full texel in a sum: 255² in 15 bits.
pub const FULL: u32 = 255 * 255 / 2;
/// Taps between two calls of `settle`, at most: so many full ones fit 32 bits.
pub const BATCH: usize = 8;

const ONE: u32 = 1 << WEIGHT_BITS;
const DROP: u32 = 2 * WEIGHT_BITS - TAP_BITS;

/// Weights of a tap's left and right texels, together 2^14; the upper texel's in the lower 16 bits.
pub type Weights = [i32; 2];

/// At fractions in 1/128 texel.
#[inline(always)]
pub fn weights(fx: u32, fy: u32) -> Weights {
    let (gx, gy) = (ONE - fx, ONE - fy);
    [((gx * gy) | ((gx * fy) << 16)) as i32, ((fx * gy) | ((fx * fy) << 16)) as i32]
}

/// Two texels side by side.
pub type Pair = [[u8; 4]; 2];

/// Texels and weights of a batch of taps.
#[derive(Clone, Copy)]
pub struct Placed {
    /// Numbers of the upper left texels.
    pub at: [i32; BATCH],
    pub weights: [Weights; BATCH],
    pub count: usize,
}

impl Placed {
    pub const NONE: Self = Self { at: [0; BATCH], weights: [[0; 2]; BATCH], count: 0 };
}

/// A sum of taps: four channels.
pub trait TapSum: Copy {
    fn new() -> Self;
    /// Adds a bilinear tap of an upper and a lower pair, with weights as of `weights`.
    fn add(&mut self, upper: Pair, lower: Pair, weights: Weights);
    /// To be called after every `BATCH` taps, and at the end.
    fn settle(&mut self);
    fn channels(self) -> [u32; 4];
    /// Finds texels and weights of taps at offsets (right, down) from a place, in a level that is `width` texels wide.
    fn place(right: &[i32; BATCH], down: &[i32; BATCH], center: [i32; 2], width: i32, out: &mut Placed);
}

/// Linear light of a texel's byte in 15 bits.
#[inline(always)]
fn linear(q: u8) -> u32 {
    (u32::from(q) * u32::from(q)) >> 1
}

/// One channel of a single bilinear tap, as a sum has it.
#[inline(always)]
pub fn single(upper: Pair, lower: Pair, channel: usize, weights: Weights) -> u32 {
    let w = |k: usize| weights[k / 2] as u32 >> (16 * (k % 2)) & 0xFFFF;
    let left = linear(upper[0][channel]) * w(0) + linear(lower[0][channel]) * w(1);
    let right = linear(upper[1][channel]) * w(2) + linear(lower[1][channel]) * w(3);
    (left >> DROP) + (right >> DROP)
}

/// On any machine.
#[derive(Clone, Copy)]
pub struct PlainSum {
    left: [u32; 4],
    right: [u32; 4],
    total: [u32; 4],
}

impl TapSum for PlainSum {
    #[inline(always)]
    fn new() -> Self {
        Self { left: [0; 4], right: [0; 4], total: [0; 4] }
    }

    #[inline(always)]
    fn add(&mut self, upper: Pair, lower: Pair, weights: Weights) {
        for c in 0..4 {
            let w = |k: usize| weights[k / 2] as u32 >> (16 * (k % 2)) & 0xFFFF;
            self.left[c] = self.left[c].wrapping_add(linear(upper[0][c]) * w(0) + linear(lower[0][c]) * w(1));
            self.right[c] = self.right[c].wrapping_add(linear(upper[1][c]) * w(2) + linear(lower[1][c]) * w(3));
        }
    }

    #[inline(always)]
    fn settle(&mut self) {
        for c in 0..4 {
            self.total[c] += (self.left[c] >> DROP) + (self.right[c] >> DROP);
        }
        (self.left, self.right) = ([0; 4], [0; 4]);
    }

    #[inline(always)]
    fn channels(self) -> [u32; 4] {
        self.total
    }

    #[inline(always)]
    fn place(right: &[i32; BATCH], down: &[i32; BATCH], center: [i32; 2], width: i32, out: &mut Placed) {
        for k in 0..BATCH {
            let (x, y) = (center[0].wrapping_add(right[k]), center[1].wrapping_add(down[k]));
            out.at[k] = (y >> PLACE_BITS).wrapping_mul(width).wrapping_add(x >> PLACE_BITS);
            let fraction = |c: i32| (c >> (PLACE_BITS - WEIGHT_BITS)) as u32 & (ONE - 1);
            out.weights[k] = weights(fraction(x), fraction(y));
        }
    }
}

#[cfg(target_arch = "x86_64")]
pub use wide::WideSum;

#[cfg(target_arch = "x86_64")]
mod wide {
    use std::arch::x86_64::*;

    use super::{BATCH, DROP, ONE, PLACE_BITS, Pair, Placed, TapSum, WEIGHT_BITS, Weights};

    /// In 256-bit registers. SAFETY, for every block here: needs AVX2; the type is named only in `sample::wide`, whose functions run after the
    /// processor was asked. Nothing is read or written through pointers but the locals named.
    #[derive(Clone, Copy)]
    pub struct WideSum {
        /// Channels 0 to 3, each of the left and of the right column.
        part: __m256i,
        total: __m256i,
    }

    impl TapSum for WideSum {
        #[inline(always)]
        fn new() -> Self {
            // SAFETY: see the type.
            unsafe { Self { part: _mm256_setzero_si256(), total: _mm256_setzero_si256() } }
        }

        #[inline(always)]
        fn add(&mut self, upper: Pair, lower: Pair, weights: Weights) {
            // SAFETY: see the type.
            unsafe {
                // Bytes: channel by channel the texels TL, BL, TR, BR.
                let order = _mm_setr_epi8(0, 8, 4, 12, 1, 9, 5, 13, 2, 10, 6, 14, 3, 11, 7, 15);
                let texels = _mm_set_epi64x(bytemuck::cast(lower), bytemuck::cast(upper));
                let q = _mm256_cvtepu8_epi16(_mm_shuffle_epi8(texels, order));
                let linear = _mm256_srli_epi16::<1>(_mm256_mullo_epi16(q, q));
                self.part = _mm256_add_epi32(self.part, _mm256_madd_epi16(linear, _mm256_set1_epi64x(bytemuck::cast(weights))));
            }
        }

        #[inline(always)]
        fn settle(&mut self) {
            // SAFETY: see the type.
            unsafe {
                self.total = _mm256_add_epi32(self.total, _mm256_srli_epi32::<{ DROP as i32 }>(self.part));
                self.part = _mm256_setzero_si256();
            }
        }

        #[inline(always)]
        fn place(right: &[i32; BATCH], down: &[i32; BATCH], center: [i32; 2], width: i32, out: &mut Placed) {
            // SAFETY: see the type; loads and stores go through references to arrays of the bytes they touch.
            unsafe {
                let x = _mm256_add_epi32(_mm256_set1_epi32(center[0]), _mm256_loadu_si256(right.as_ptr().cast()));
                let y = _mm256_add_epi32(_mm256_set1_epi32(center[1]), _mm256_loadu_si256(down.as_ptr().cast()));
                let rows = _mm256_mullo_epi32(_mm256_srai_epi32::<{ PLACE_BITS as i32 }>(y), _mm256_set1_epi32(width));
                let at = _mm256_add_epi32(rows, _mm256_srai_epi32::<{ PLACE_BITS as i32 }>(x));
                _mm256_storeu_si256(out.at.as_mut_ptr().cast(), at);
                let (mask, one) = (_mm256_set1_epi32(ONE as i32 - 1), _mm256_set1_epi32(ONE as i32));
                let fx = _mm256_and_si256(_mm256_srli_epi32::<{ (PLACE_BITS - WEIGHT_BITS) as i32 }>(x), mask);
                let fy = _mm256_and_si256(_mm256_srli_epi32::<{ (PLACE_BITS - WEIGHT_BITS) as i32 }>(y), mask);
                let (gx, gy) = (_mm256_sub_epi32(one, fx), _mm256_sub_epi32(one, fy));
                // 16-bit products: the upper texel's weight below the lower one's.
                let rows = _mm256_or_si256(gy, _mm256_slli_epi32::<16>(fy));
                let left = _mm256_mullo_epi16(_mm256_or_si256(gx, _mm256_slli_epi32::<16>(gx)), rows);
                let right = _mm256_mullo_epi16(_mm256_or_si256(fx, _mm256_slli_epi32::<16>(fx)), rows);
                let (low, high) = (_mm256_unpacklo_epi32(left, right), _mm256_unpackhi_epi32(left, right));
                let (first, second) = out.weights.split_at_mut(BATCH / 2);
                _mm256_storeu_si256(first.as_mut_ptr().cast(), _mm256_permute2x128_si256::<0x20>(low, high));
                _mm256_storeu_si256(second.as_mut_ptr().cast(), _mm256_permute2x128_si256::<0x31>(low, high));
            }
        }

        #[inline(always)]
        fn channels(self) -> [u32; 4] {
            // SAFETY: see the type.
            unsafe {
                let sums = _mm256_add_epi32(self.total, _mm256_srli_epi64::<32>(self.total));
                let (low, high) = (_mm256_castsi256_si128(sums), _mm256_extracti128_si256::<1>(sums));
                let first = [_mm_cvtsi128_si64(low) as u32, _mm_extract_epi64::<1>(low) as u32];
                let second = [_mm_cvtsi128_si64(high) as u32, _mm_extract_epi64::<1>(high) as u32];
                [first[0], first[1], second[0], second[1]]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(state: &mut u32) -> u32 {
        *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *state >> 8
    }

    #[test]
    #[cfg(target_arch = "x86_64")]
    fn both_ways_of_adding_are_equal() {
        #[target_feature(enable = "avx2")]
        fn compare() {
            let mut state = 1;
            let (mut wide, mut plain) = (WideSum::new(), PlainSum::new());
            for k in 0..256 {
                let mut pair = || [(); 2].map(|()| [(); 4].map(|()| if k < 16 { 255 } else { random(&mut state) as u8 }));
                let (upper, lower) = (pair(), pair());
                let w = weights(random(&mut state) % ONE, random(&mut state) % ONE);
                wide.add(upper, lower, w);
                plain.add(upper, lower, w);
                if k % BATCH == BATCH - 1 {
                    wide.settle();
                    plain.settle();
                }
            }
            assert_eq!(wide.channels(), plain.channels());
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: just asked.
            unsafe { compare() }
        }
    }

    #[test]
    #[cfg(target_arch = "x86_64")]
    fn both_ways_of_placing_are_equal() {
        #[target_feature(enable = "avx2")]
        fn compare() {
            let mut state = 7;
            for _ in 0..1000 {
                let mut offsets = || [(); BATCH].map(|()| (random(&mut state) as i32) - (1 << 23));
                let (right, down) = (offsets(), offsets());
                let center = [1 << 28, 1 << 27].map(|c: i32| c + random(&mut state) as i32);
                let (mut wide, mut plain) = (Placed::NONE, Placed::NONE);
                WideSum::place(&right, &down, center, 16_384, &mut wide);
                PlainSum::place(&right, &down, center, 16_384, &mut plain);
                assert_eq!((wide.at, wide.weights), (plain.at, plain.weights));
            }
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: just asked.
            unsafe { compare() }
        }
    }

    #[test]
    fn a_full_texel_weighs_one() {
        let (pair, w) = ([[255, 0, 2, 255]; 2], weights(77, 3));
        let mut sum = PlainSum::new();
        sum.add(pair, pair, w);
        sum.settle();
        for (c, got) in sum.channels().into_iter().enumerate() {
            let exact = linear(pair[0][c]) << TAP_BITS;
            assert!(exact - got <= 1, "channel {c}: {got}, exact {exact}");
            assert_eq!(single(pair, pair, c, w), got);
        }
    }
}
