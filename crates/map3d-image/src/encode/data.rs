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

/// Returns R, G, B, A of each value; R is the least significant byte.
pub fn bytes_from_u32(values: &[u32]) -> &[u8] {
    bytemuck::cast_slice(values)
}

/// Returns grey and alpha of each value; grey is the less significant byte.
pub fn bytes_from_u16(values: &[u16]) -> &[u8] {
    bytemuck::cast_slice(values)
}
