//! Wrap modes as arithmetic on texel numbers.

use map3d_base::asset::Wrap;

/// Returns the texel of a row of `n` that a wrap mode puts at number `i`; `None` outside a texture with a border.
pub(crate) fn wrap_texel(i: i64, n: u32, wrap: Wrap) -> Option<u32> {
    let size = i64::from(n);
    match wrap {
        Wrap::Wrap => Some(i.rem_euclid(size) as u32),
        Wrap::Mirror => {
            let m = i.rem_euclid(2 * size);
            Some(if m < size { m } else { 2 * size - 1 - m } as u32)
        }
        Wrap::Clamp => Some(i.clamp(0, size - 1) as u32),
        Wrap::Border | Wrap::None => (0..size).contains(&i).then_some(i as u32),
    }
}
