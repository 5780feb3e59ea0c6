//! The data tile: normal, id and depth of a tile in one lossless stream (spec/data-tile.md).

mod decode;
mod encode;
mod label;
mod residuals;
mod segments;

pub use decode::{DataTile, decode_data_tile};
pub use encode::DataTileEncoder;

/// Greatest width and height.
pub const MAX_DATA_TILE_PX: u32 = 1_024;

const MAGIC: &[u8; 3] = b"M3D";
const VERSION: u8 = 1;
const HEADER_BYTES: usize = 24;
const MAX_BODY_BYTES_PER_PX: usize = 31;

/// Starts and slopes are in units of 2^-14 of a depth's.
const FRACTION_BITS: u32 = 14;
const MAX_START: i64 = 1 << (32 + FRACTION_BITS);

/// Bits of a code beside the source.
const WITH_LENGTH: u8 = 4;
const WITH_RESIDUALS: u8 = 8;
/// Where the label of a run comes from: the run above its first pixel, the run after that one, or nowhere.
const ABOVE: u8 = 0;
const AFTER_ABOVE: u8 = 1;
const NEW: u8 = 2;

/// Shapes: where the slopes of a label come from.
const NO_DEPTHS: u8 = 0;
const ZERO_SLOPES: u8 = 1;
const OWN_SLOPES: u8 = 2;
const SHARED_SLOPES: u8 = 3;
/// Bit of a shape.
const ROUGH: u8 = 4;

/// Slopes of a plane to the right and down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Slopes {
    right: i32,
    down: i32,
}

/// Returns a number whose lowest bit is the sign.
fn fold(n: u32) -> u32 {
    (n << 1) ^ ((n as i32) >> 31) as u32
}

fn unfold(n: u32) -> u32 {
    (n >> 1) ^ (n & 1).wrapping_neg()
}

fn fold_long(n: i64) -> u64 {
    ((n << 1) ^ (n >> 63)) as u64
}

fn unfold_long(n: u64) -> i64 {
    (n >> 1) as i64 ^ -((n & 1) as i64)
}
