//! The sRGB curve (IEC 61966-2-1) as tables: bytes to linear 16-bit light and back to the nearest byte (spec/pyramid.md §5).

use std::sync::LazyLock;

/// `round(65535·f(b/255))` of each sRGB byte.
pub static LINEAR16: LazyLock<[u16; 256]> = LazyLock::new(|| std::array::from_fn(|b| scaled(b, 65_535.0)));

/// `round(255·√(v/65535))` of each 16-bit linear value: texels that are filtered.
pub static ROOT: LazyLock<Box<[u8; 65_536]>> = LazyLock::new(|| {
    let byte = |v: usize| ((v as f64 / 65_535.0).sqrt() * 255.0).round() as u8;
    (0..65_536).map(byte).collect::<Vec<u8>>().try_into().expect("65,536 entries")
});

/// The same of each sRGB byte.
pub static ROOT_OF_BYTE: LazyLock<[u8; 256]> = LazyLock::new(|| std::array::from_fn(|b| ROOT[LINEAR16[b] as usize]));

/// The sRGB byte whose linear value is nearest to a 16-bit linear value; the lower byte when two are as near.
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

/// The curve on 0..1: encoded to linear.
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
    fn a_byte_comes_back_from_its_linear_value() {
        assert!((0..=255u8).all(|b| BYTE[LINEAR16[b as usize] as usize] == b));
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
