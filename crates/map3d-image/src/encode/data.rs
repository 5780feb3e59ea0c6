//! Byte layouts of the data layers (spec/pyramid.md §6).

use std::sync::LazyLock;

/// `round((n+1)/2·255)` of each stored component, by its bits.
static NORMAL_BYTE: LazyLock<Box<[u8; 65_536]>> = LazyLock::new(|| {
    let byte = |bits: usize| {
        let n = i64::from(bits as u16 as i16).max(-32_767);
        (((n + 32_767) * 255 + 32_767) / 65_534) as u8
    };
    (0..65_536).map(byte).collect::<Vec<u8>>().try_into().expect("65,536 entries")
});

/// Returns R, G, B of each normal; 0, 0, 0 for none.
pub fn bytes_from_normals(normals: &[[i16; 3]]) -> Vec<u8> {
    let table: &[u8; 65_536] = &NORMAL_BYTE;
    let mut out = vec![0; normals.len() * 3];
    for (to, n) in out.as_chunks_mut::<3>().0.iter_mut().zip(normals) {
        if *n != [0; 3] {
            *to = [table[n[0] as u16 as usize], table[n[1] as u16 as usize], table[n[2] as u16 as usize]];
        }
    }
    out
}

/// Returns 0xBBGGRR of each normal; 0 for none.
pub(super) fn packed_normals(normals: &[[i16; 3]]) -> Vec<u32> {
    let table: &[u8; 65_536] = &NORMAL_BYTE;
    let byte = |n: i16| table[n as u16 as usize];
    let bits = |n: &[i16; 3]| u64::from(n[0] as u16) | u64::from(n[1] as u16) << 16 | u64::from(n[2] as u16) << 32;
    let (mut last, mut packed) = (0, 0);
    let pack = |n: &[i16; 3]| {
        // Neighbours are mostly equal.
        if bits(n) != last {
            last = bits(n);
            packed = if *n == [0; 3] { 0 } else { u32::from_le_bytes([byte(n[0]), byte(n[1]), byte(n[2]), 0]) };
        }
        packed
    };
    normals.iter().map(pack).collect()
}

/// Returns R, G, B, A of each value; R is the least significant byte.
pub fn bytes_from_u32(values: &[u32]) -> &[u8] {
    bytemuck::cast_slice(values)
}

/// Returns channels of pixels of `channels` bytes each, in the given order.
pub(super) fn reordered(pixels: &[u8], channels: usize, order: &[usize]) -> Vec<u8> {
    let mut out = vec![0; pixels.len() / channels * order.len()];
    for (k, from) in order.iter().enumerate() {
        for (to, pixel) in out.chunks_exact_mut(order.len()).zip(pixels.chunks_exact(channels)) {
            to[k] = pixel[*from];
        }
    }
    out
}

/// Returns rows of bits, each padded to whole bytes, the leftmost pixel in the highest bit.
pub(super) fn packed_rows(bits: &[bool], width: usize) -> Vec<u8> {
    let byte = |eight: &[bool]| eight.iter().zip(0..).fold(0, |byte, (bit, k)| byte | u8::from(*bit) << (7 - k));
    bits.chunks_exact(width).flat_map(|row| row.chunks(8).map(byte)).collect()
}
