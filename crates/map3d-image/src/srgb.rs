//! The sRGB curve (IEC 61966-2-1) as tables: bytes to linear 16-bit light and back to the nearest byte (spec/pyramid.md §5).

use std::sync::LazyLock;

/// `round(65535·f(b/255))` of each sRGB byte.
pub static LINEAR16: LazyLock<[u16; 256]> = LazyLock::new(|| std::array::from_fn(|b| scaled(b, 65_535.0)));

/// `round(255·√(v/65535))` of each 16-bit linear value: the bytes of texels ready to filter.
pub static ROOT: LazyLock<Box<[u8; 65_536]>> = LazyLock::new(|| {
    let byte = |v: usize| ((v as f64 / 65_535.0).sqrt() * 255.0).round() as u8;
    (0..65_536).map(byte).collect::<Vec<u8>>().try_into().expect("65,536 entries")
});

/// `ROOT` of each sRGB byte, at the place of red, green and blue in a little-endian RGBA word; red also sets alpha to 255.
pub static ROOT_OF_RGB: LazyLock<[[u32; 256]; 3]> = LazyLock::new(|| {
    let at = |k: usize, b: usize| u32::from(ROOT[LINEAR16[b] as usize]) << (8 * k) | if k == 0 { 255 << 24 } else { 0 };
    std::array::from_fn(|k| std::array::from_fn(|b| at(k, b)))
});

/// The sRGB byte whose linear value is nearest to a 16-bit linear value; the lower byte of two equally near ones.
pub static BYTE: LazyLock<Box<[u8; 65_536]>> = LazyLock::new(|| {
    let mut table = vec![0; 65_536].into_boxed_slice();
    let mut byte = 0usize;
    for (value, slot) in table.iter_mut().enumerate() {
        while byte < 255 && value.abs_diff(LINEAR16[byte + 1] as usize) < value.abs_diff(LINEAR16[byte] as usize) {
            byte += 1;
        }
        *slot = byte as u8;
    }
    table.try_into().expect("65,536 entries")
});

/// `BYTE` in tables that fit the first-level cache, for whole images.
pub struct ToByte {
    /// The byte of each sixteenth value.
    first: [u8; 4_096],
    /// For each byte the least value of the next byte; 2^16 for the last. Two entries differ by more than 16.
    next: [u32; 256],
}

pub static TO_BYTE: LazyLock<ToByte> = LazyLock::new(|| {
    let mut next = [1 << 16; 256];
    for (value, pair) in BYTE.windows(2).enumerate().filter(|(_, pair)| pair[0] != pair[1]) {
        next[pair[0] as usize] = value as u32 + 1;
    }
    ToByte { first: std::array::from_fn(|k| BYTE[k * 16]), next }
});

impl ToByte {
    #[inline(always)]
    pub fn byte(&self, value: u16) -> u8 {
        let first = self.first[usize::from(value >> 4)];
        first + u8::from(u32::from(value) >= self.next[first as usize])
    }
}

/// Converts from sRGB to linear light, 0..1.
pub fn linear_from_srgb(c: f64) -> f64 {
    if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

fn scaled(byte: usize, unit: f64) -> u16 {
    (linear_from_srgb(byte as f64 / 255.0) * unit).round() as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_survives_the_round_trip_through_linear_light() {
        assert!((0..=255u8).all(|b| BYTE[LINEAR16[b as usize] as usize] == b));
    }

    #[test]
    fn small_tables_give_the_same_bytes() {
        assert!((0..=u16::MAX).all(|v| TO_BYTE.byte(v) == BYTE[v as usize]));
    }

    #[test]
    fn every_linear_value_takes_the_nearest_byte() {
        for value in (0..65_536usize).step_by(7) {
            let distance = |b: usize| value.abs_diff(LINEAR16[b] as usize);
            let best = (0..256).map(distance).min().expect("256 bytes");
            assert_eq!(distance(BYTE[value] as usize), best, "{value}");
        }
    }
}
