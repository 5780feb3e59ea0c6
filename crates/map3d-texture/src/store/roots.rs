//! Converts sRGB bytes to the bytes of texels ready to filter: roots of linear light.

use std::sync::LazyLock;

use crate::store::mips::premultiplied;
use map3d_image::srgb::{ROOT, ROOT_OF_RGB};

/// Converts sRGB bytes with straight alpha; without `has_alpha` as if every texel were opaque.
pub(super) fn to_roots(pixels: &[[u8; 4]], roots: &mut [[u8; 4]], has_alpha: bool) {
    #[cfg(target_arch = "x86_64")]
    if x86::has_vbmi() {
        // SAFETY: the processor has these instructions.
        return unsafe { x86::to_roots_vbmi(pixels, roots, has_alpha) };
    }
    to_roots_scalar(pixels, roots, has_alpha);
}

fn to_roots_scalar(pixels: &[[u8; 4]], roots: &mut [[u8; 4]], has_alpha: bool) {
    let table: &[[u32; 256]; 3] = &ROOT_OF_RGB;
    let opaque = |[r, g, b, _]: [u8; 4]| (table[0][r as usize] | table[1][g as usize] | table[2][b as usize]).to_le_bytes();
    let texels = roots.iter_mut().zip(pixels);
    match has_alpha {
        true => texels.for_each(|(q, p)| *q = if p[3] == 255 { opaque(*p) } else { premultiplied(*p).map(|c| ROOT[c as usize]) }),
        false => texels.for_each(|(q, p)| *q = opaque(*p)),
    }
}

/// The root of each sRGB byte.
static ROOT_OF_BYTE: LazyLock<[u8; 256]> = LazyLock::new(|| std::array::from_fn(|b| ROOT_OF_RGB[2][b].to_le_bytes()[2]));

/// A table of 256 bytes fits four registers.
#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use super::{ROOT_OF_BYTE, to_roots_scalar};

    pub fn has_vbmi() -> bool {
        is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bw") && is_x86_feature_detected!("avx512vbmi")
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
    pub fn to_roots_vbmi(pixels: &[[u8; 4]], roots: &mut [[u8; 4]], has_alpha: bool) {
        let table: &[u8; 256] = &ROOT_OF_BYTE;
        // SAFETY: reads 64 bytes of a quarter of the table.
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| unsafe { _mm512_loadu_epi8(table[64 * k..][..64].as_ptr().cast()) });
        let alpha = _mm512_set1_epi32(0xFF00_0000_u32 as i32);
        let (texels, rest) = pixels.as_chunks::<16>();
        let (out, out_rest) = roots.as_chunks_mut::<16>();
        for (p, q) in texels.iter().zip(out) {
            // SAFETY: reads the 64 bytes of `p`.
            let bytes = unsafe { _mm512_loadu_epi8(p.as_ptr().cast()) };
            if has_alpha && _mm512_cmpeq_epi32_mask(_mm512_and_si512(bytes, alpha), alpha) != 0xFFFF {
                to_roots_scalar(p, q, true);
                continue;
            }
            let (low, high) = (_mm512_permutex2var_epi8(a, bytes, b), _mm512_permutex2var_epi8(c, bytes, d));
            let found = _mm512_mask_blend_epi8(_mm512_movepi8_mask(bytes), low, high);
            // SAFETY: writes the 64 bytes of `q`.
            unsafe { _mm512_storeu_epi8(q.as_mut_ptr().cast(), _mm512_or_si512(found, alpha)) };
        }
        to_roots_scalar(rest, out_rest, has_alpha);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_gives_the_same_root_on_all_instruction_sets() {
        // Rows of any length; few of the texels of the second half are opaque.
        let pixels: Vec<[u8; 4]> = (0..4_099u32)
            .map(|k| {
                let [r, g, b, a] = (k.wrapping_mul(0x9E37_79B1) ^ k).to_le_bytes();
                [k as u8, r ^ g, b, if k < 2_000 { 255 } else { a | 15 << 4 }]
            })
            .collect();
        for has_alpha in [false, true] {
            let (mut plain, mut fast) = (vec![[0; 4]; pixels.len()], vec![[1; 4]; pixels.len()]);
            to_roots_scalar(&pixels, &mut plain, has_alpha);
            to_roots(&pixels, &mut fast, has_alpha);
            assert_eq!(plain, fast, "alpha: {has_alpha}");
        }
    }
}
