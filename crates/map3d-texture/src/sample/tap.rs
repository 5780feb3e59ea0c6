//! Bilinear taps in integers, equal on every machine: a texel's byte q is the square root of its linear light q², weights have 14 bits, sums 24.

use bytemuck::{Pod, Zeroable};

use crate::store::{STRIP_PITCH, StripLayout};

/// Bits of a tap's position within a texel.
pub const WEIGHT_BITS: u32 = 7;
/// A whole texel in weights.
pub const WEIGHT_ONE: u32 = 1 << WEIGHT_BITS;
/// Fraction bits of the positions of taps.
pub const TAP_POSITION_BITS: u32 = 16;
/// A tap adds a texel's 15 bits times 2^TAP_BITS.
pub const TAP_BITS: u32 = 9;
/// Linear light of a full texel in a sum: 255² in 15 bits.
pub const FULL: u32 = 255 * 255 / 2;
/// Most taps between two calls of `flush`: the sum of this many full ones fits 32 bits.
pub const BATCH: usize = 8;

const DROP: u32 = 2 * WEIGHT_BITS - TAP_BITS;

/// Weights of a tap's texels, together 2^14; the upper texel's weight is in the lower 16 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct BilinearWeights {
    left: i32,
    right: i32,
}

impl BilinearWeights {
    #[inline(always)]
    fn upper_left(self) -> u32 {
        self.left as u32 & 0xFFFF
    }

    #[inline(always)]
    fn lower_left(self) -> u32 {
        self.left as u32 >> 16
    }

    #[inline(always)]
    fn upper_right(self) -> u32 {
        self.right as u32 & 0xFFFF
    }

    #[inline(always)]
    fn lower_right(self) -> u32 {
        self.right as u32 >> 16
    }
}

/// Returns the weights at fractions in 1/128 texel.
#[inline(always)]
pub fn bilinear_weights(fx: u32, fy: u32) -> BilinearWeights {
    let (gx, gy) = (WEIGHT_ONE - fx, WEIGHT_ONE - fy);
    BilinearWeights { left: ((gx * gy) | ((gx * fy) << 16)) as i32, right: ((fx * gy) | ((fx * fy) << 16)) as i32 }
}

/// The four texels of a bilinear tap, each pair from left to right.
#[derive(Clone, Copy)]
pub struct TexelQuad {
    pub upper: [[u8; 4]; 2],
    pub lower: [[u8; 4]; 2],
}

impl TexelQuad {
    pub const ZERO: Self = Self { upper: [[0; 4]; 2], lower: [[0; 4]; 2] };

    /// Returns a texel of a level with its right and lower neighbours. Panics if the level does not have them.
    #[inline(always)]
    pub fn at(texels: &[[u8; 4]], texel: usize) -> Self {
        let rows = &texels[texel..][..QUAD_REACH];
        Self { upper: [rows[0], rows[1]], lower: [rows[STRIP_PITCH], rows[STRIP_PITCH + 1]] }
    }
}

/// Texels from the upper left one of a tap to its lower right one, both included.
const QUAD_REACH: usize = STRIP_PITCH + 2;

/// Texels and weights of a batch of taps. Aligned, so that no register is stored or loaded across two cache lines.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct ResolvedTaps {
    /// Numbers of the upper left texels; those beyond `count` lie in the level, too.
    pub texel: [i32; BATCH],
    pub weights: [BilinearWeights; BATCH],
    pub count: usize,
}

impl ResolvedTaps {
    pub const NONE: Self = Self { texel: [0; BATCH], weights: [BilinearWeights { left: 0, right: 0 }; BATCH], count: 0 };
}

/// Sums bilinear taps in four channels.
pub trait TapAccumulator: Copy {
    fn new() -> Self;
    /// Adds resolved taps. `texels`: those of the level, in its layout. Panics if a tap lies outside.
    fn add_batch(&mut self, texels: &[[u8; 4]], taps: &ResolvedTaps);
    /// Adds the batch to the total; call it after every `BATCH` taps and at the end.
    fn flush(&mut self);
    fn channels(self) -> [u32; 4];
    /// Finds texels and weights of taps at offsets (right, down) from a centre, in a level with a layout.
    fn resolve(right: &[i32; BATCH], down: &[i32; BATCH], center: [i32; 2], layout: StripLayout, out: &mut ResolvedTaps);
}

/// Returns the linear light of a texel's byte in 15 bits.
#[inline(always)]
fn linear(q: u8) -> u32 {
    (u32::from(q) * u32::from(q)) >> 1
}

/// Weighs one channel of a tap: sums of the left and of the right texels.
#[inline(always)]
fn weighted_columns(texels: TexelQuad, channel: usize, w: BilinearWeights) -> [u32; 2] {
    let (upper, lower) = (texels.upper, texels.lower);
    [
        linear(upper[0][channel]) * w.upper_left() + linear(lower[0][channel]) * w.lower_left(),
        linear(upper[1][channel]) * w.upper_right() + linear(lower[1][channel]) * w.lower_right(),
    ]
}

/// Returns what an accumulator holds in one channel after a single tap.
#[inline(always)]
pub fn sum_single_tap(texels: TexelQuad, channel: usize, weights: BilinearWeights) -> u32 {
    let [left, right] = weighted_columns(texels, channel, weights);
    (left >> DROP) + (right >> DROP)
}

/// Works on any machine.
#[derive(Clone, Copy)]
pub struct ScalarAccumulator {
    /// The batch: sums of left and of right texels, kept apart as the vectors do.
    left: [u32; 4],
    right: [u32; 4],
    total: [u32; 4],
}

impl ScalarAccumulator {
    /// Adds a bilinear tap.
    #[inline(always)]
    pub fn add(&mut self, texels: TexelQuad, weights: BilinearWeights) {
        for c in 0..4 {
            let [left, right] = weighted_columns(texels, c, weights);
            self.left[c] = self.left[c].wrapping_add(left);
            self.right[c] = self.right[c].wrapping_add(right);
        }
    }
}

impl TapAccumulator for ScalarAccumulator {
    #[inline(always)]
    fn new() -> Self {
        Self { left: [0; 4], right: [0; 4], total: [0; 4] }
    }

    #[inline(always)]
    fn add_batch(&mut self, texels: &[[u8; 4]], taps: &ResolvedTaps) {
        for k in 0..taps.count.min(BATCH) {
            self.add(TexelQuad::at(texels, taps.texel[k] as usize), taps.weights[k]);
        }
    }

    #[inline(always)]
    fn flush(&mut self) {
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
    fn resolve(right: &[i32; BATCH], down: &[i32; BATCH], center: [i32; 2], layout: StripLayout, out: &mut ResolvedTaps) {
        for k in 0..BATCH {
            let (x, y) = (center[0].wrapping_add(right[k]), center[1].wrapping_add(down[k]));
            out.texel[k] = layout.index(x >> TAP_POSITION_BITS, y >> TAP_POSITION_BITS);
            let fraction = |c: i32| (c >> (TAP_POSITION_BITS - WEIGHT_BITS)) as u32 & (WEIGHT_ONE - 1);
            out.weights[k] = bilinear_weights(fraction(x), fraction(y));
        }
    }
}

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2Accumulator;

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::*;

    use super::{BATCH, BilinearWeights, DROP, QUAD_REACH, ResolvedTaps, TAP_POSITION_BITS, TapAccumulator, WEIGHT_BITS, WEIGHT_ONE};
    use crate::store::{STRIP_BITS, STRIP_PITCH, StripLayout};

    /// Works in 256-bit registers. SAFETY, for every block here: needs AVX2; only functions of `Sampler` with that target feature name the type, and
    /// they run after a check of the processor. Pointers reach only the locals that are named.
    #[derive(Clone, Copy)]
    pub struct Avx2Accumulator {
        /// Channels 0 to 3 of the batch, for each the sum of the left and of the right texels.
        batch: __m256i,
        total: __m256i,
    }

    impl Avx2Accumulator {
        /// Adds a bilinear tap. `upper`, `lower`: its pair of texels, repeated four times.
        #[inline(always)]
        fn add(&mut self, upper: __m256i, lower: __m256i, weights: BilinearWeights) {
            // SAFETY: see the type.
            unsafe {
                // 16-bit numbers: channel by channel the texels TL, BL, TR, BR.
                let rows = _mm256_blend_epi32::<0b1100_1100>(upper, lower);
                let q = _mm256_shuffle_epi8(
                    rows,
                    _mm256_setr_epi8(
                        0, -1, 8, -1, 4, -1, 12, -1, 1, -1, 9, -1, 5, -1, 13, -1, 2, -1, 10, -1, 6, -1, 14, -1, 3, -1, 11, -1, 7, -1, 15, -1,
                    ),
                );
                let linear = _mm256_srli_epi16::<1>(_mm256_mullo_epi16(q, q));
                self.batch = _mm256_add_epi32(self.batch, _mm256_madd_epi16(linear, _mm256_set1_epi64x(bytemuck::cast(weights))));
            }
        }
    }

    impl TapAccumulator for Avx2Accumulator {
        #[inline(always)]
        fn new() -> Self {
            // SAFETY: see the type.
            unsafe { Self { batch: _mm256_setzero_si256(), total: _mm256_setzero_si256() } }
        }

        /// Compares all texels of the batch with the end of the level at once.
        #[inline(always)]
        fn add_batch(&mut self, texels: &[[u8; 4]], taps: &ResolvedTaps) {
            let last = texels.len().checked_sub(QUAD_REACH).map_or(-1, |last| i32::try_from(last).unwrap_or(i32::MAX));
            // SAFETY: see the type.
            let are_inside = unsafe {
                let at = _mm256_loadu_si256(taps.texel.as_ptr().cast());
                let outside = _mm256_or_si256(_mm256_cmpgt_epi32(at, _mm256_set1_epi32(last)), at);
                _mm256_movemask_ps(_mm256_castsi256_ps(outside)) == 0
            };
            assert!(are_inside, "a tap outside the level");
            for k in 0..taps.count.min(BATCH) {
                // SAFETY: see the type. All of `taps.texel` are at least 0 and at most `last`, so both pairs of texels lie in `texels`.
                let [upper, lower] = unsafe {
                    let texel = texels.as_ptr().add(taps.texel[k] as usize);
                    [texel, texel.add(STRIP_PITCH)].map(|pair| _mm256_set1_epi64x(pair.cast::<i64>().read_unaligned()))
                };
                self.add(upper, lower, taps.weights[k]);
            }
        }

        #[inline(always)]
        fn flush(&mut self) {
            // SAFETY: see the type.
            unsafe {
                self.total = _mm256_add_epi32(self.total, _mm256_srli_epi32::<{ DROP as i32 }>(self.batch));
                self.batch = _mm256_setzero_si256();
            }
        }

        #[inline(always)]
        fn resolve(right: &[i32; BATCH], down: &[i32; BATCH], center: [i32; 2], layout: StripLayout, out: &mut ResolvedTaps) {
            // SAFETY: see the type; loads and stores go through references to arrays of the bytes they touch.
            unsafe {
                let x = _mm256_add_epi32(_mm256_set1_epi32(center[0]), _mm256_loadu_si256(right.as_ptr().cast()));
                let y = _mm256_add_epi32(_mm256_set1_epi32(center[1]), _mm256_loadu_si256(down.as_ptr().cast()));
                let (column, row) = (_mm256_srai_epi32::<{ TAP_POSITION_BITS as i32 }>(x), _mm256_srai_epi32::<{ TAP_POSITION_BITS as i32 }>(y));
                let in_strip = _mm256_add_epi32(_mm256_mullo_epi32(row, _mm256_set1_epi32(STRIP_PITCH as i32)), column);
                let strip = _mm256_srai_epi32::<{ STRIP_BITS as i32 }>(column);
                let at = _mm256_add_epi32(in_strip, _mm256_mullo_epi32(strip, _mm256_set1_epi32(layout.to_next_strip)));
                _mm256_storeu_si256(out.texel.as_mut_ptr().cast(), at);
                let (mask, one) = (_mm256_set1_epi32(WEIGHT_ONE as i32 - 1), _mm256_set1_epi32(WEIGHT_ONE as i32));
                let fx = _mm256_and_si256(_mm256_srli_epi32::<{ (TAP_POSITION_BITS - WEIGHT_BITS) as i32 }>(x), mask);
                let fy = _mm256_and_si256(_mm256_srli_epi32::<{ (TAP_POSITION_BITS - WEIGHT_BITS) as i32 }>(y), mask);
                let (gx, gy) = (_mm256_sub_epi32(one, fx), _mm256_sub_epi32(one, fy));
                // 16-bit products: the upper texel's weight in the lower half.
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
    fn vector_sums_equal_scalar_sums() {
        #[target_feature(enable = "avx2")]
        fn compare() {
            const TEXELS: usize = 500;
            let mut state = 1;
            let random_texels: Vec<[u8; 4]> = (0..TEXELS).map(|_| [(); 4].map(|()| random(&mut state) as u8)).collect();
            let (mut vector, mut scalar) = (Avx2Accumulator::new(), ScalarAccumulator::new());
            // Two batches of full texels, then some of every number of taps; the last texel of a level is always among them.
            for k in 0..32 + BATCH {
                let texels = if k < 2 { vec![[255; 4]; TEXELS] } else { random_texels.clone() };
                let mut taps = ResolvedTaps { count: if k < 32 { BATCH } else { k - 31 }, ..ResolvedTaps::NONE };
                taps.texel = taps.texel.map(|_| (random(&mut state) as usize % (TEXELS - QUAD_REACH)) as i32);
                taps.texel[0] = (TEXELS - QUAD_REACH) as i32;
                taps.weights = taps.weights.map(|_| bilinear_weights(random(&mut state) % WEIGHT_ONE, random(&mut state) % WEIGHT_ONE));
                vector.add_batch(&texels, &taps);
                scalar.add_batch(&texels, &taps);
                vector.flush();
                scalar.flush();
                assert_eq!(vector.channels(), scalar.channels(), "batch {k}");
            }
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: checked above.
            unsafe { compare() }
        }
    }

    #[test]
    #[cfg(target_arch = "x86_64")]
    fn vector_taps_equal_scalar_taps() {
        #[target_feature(enable = "avx2")]
        fn compare() {
            let mut state = 7;
            for _ in 0..1000 {
                let mut offsets = || [(); BATCH].map(|()| (random(&mut state) as i32) - (1 << 23));
                let (right, down) = (offsets(), offsets());
                let center = [1 << 28, 1 << 27].map(|c: i32| c + random(&mut state) as i32);
                let (mut vector, mut scalar) = (ResolvedTaps::NONE, ResolvedTaps::NONE);
                Avx2Accumulator::resolve(&right, &down, center, StripLayout::new(16_384), &mut vector);
                ScalarAccumulator::resolve(&right, &down, center, StripLayout::new(16_384), &mut scalar);
                assert_eq!((vector.texel, vector.weights), (scalar.texel, scalar.weights));
            }
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: checked above.
            unsafe { compare() }
        }
    }

    #[test]
    #[cfg(target_arch = "x86_64")]
    fn a_batch_outside_the_level_panics() {
        #[target_feature(enable = "avx2")]
        fn add(texels: &[[u8; 4]], texel: i32) {
            let mut taps = ResolvedTaps { count: 1, ..ResolvedTaps::NONE };
            taps.texel[0] = texel;
            Avx2Accumulator::new().add_batch(texels, &taps);
        }
        if is_x86_feature_detected!("avx2") {
            for (length, texel) in [(500, 501 - QUAD_REACH as i32), (500, -1), (500, i32::MIN), (QUAD_REACH - 1, 0), (0, 0)] {
                // SAFETY: checked above.
                let result = std::panic::catch_unwind(|| unsafe { add(&vec![[0; 4]; length], texel) });
                assert!(result.is_err(), "texel {texel} of {length}");
            }
        }
    }

    #[test]
    fn a_full_texel_weighs_one() {
        let pair = [[255, 0, 2, 255]; 2];
        let (texels, w) = (TexelQuad { upper: pair, lower: pair }, bilinear_weights(77, 3));
        let mut sum = ScalarAccumulator::new();
        sum.add(texels, w);
        sum.flush();
        for (c, got) in sum.channels().into_iter().enumerate() {
            let exact = linear(pair[0][c]) << TAP_BITS;
            assert!(exact - got <= 1, "channel {c}: {got}, exact {exact}");
            assert_eq!(sum_single_tap(texels, c, w), got);
        }
    }
}
