//! The visibility rule (spec/pyramid.md §4): among the surfaces that cover a sample, the least depth key (depth − bias) wins; `TieBreak` decides
//! between equal keys.

/// Bias in depth units for each class rank above that of walls and roofs.
pub(crate) const BIAS_UNITS: f64 = 2.0;
/// Class rank of walls, roofs and unclassified surfaces, which have no bias.
pub(crate) const UNBIASED_RANK: f64 = 3.0;
/// Limit of 1/|n·d|.
pub(crate) const STEEPNESS_MAX: f64 = 16.0;
/// The greatest bias of any surface.
pub(crate) const BIAS_MAX: i64 = (5 - 3) * 2 * 16;

/// Returns `round((rank − 3)·b/max(|n·d|, 1/16))`. |n·d| follows from the depth gradient; `pixel_units` are the numbers of depth units in a
/// pixel's width and height.
#[inline(always)]
pub(crate) fn depth_bias(gradient: [f64; 2], rank: u8, pixel_units: [f64; 2]) -> i64 {
    let above = f64::from(rank) - UNBIASED_RANK;
    if above == 0.0 {
        return 0;
    }
    let slope = [gradient[0] / pixel_units[0], gradient[1] / pixel_units[1]];
    let steepness = (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt().min(STEEPNESS_MAX);
    (above * BIAS_UNITS * steepness + 0.5).floor() as i64
}

/// Returns the bias of a triangle seen edge-on, whose gradient is not finite.
pub(crate) fn edge_on_bias(rank: u8) -> i64 {
    depth_bias([f64::INFINITY, 0.0], rank, [1.0; 2])
}

/// Returns a lower bound of the 32-bit depth keys of all surfaces at depth units ≥ `near`. 32-bit keys are depth − bias − 2^31.
#[inline(always)]
pub(crate) fn least_depth_key(near: f32) -> i32 {
    (near as i64 - BIAS_MAX - 2 - (1 << 31)).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
}

/// Orders surfaces with equal depth keys; the least wins: the higher rank, the smaller object id, the smaller triangle number in the asset. The last two
/// fields make the order total.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct TieBreak {
    inverted_rank: u8,
    object_id: u32,
    source: u32,
    part: u32,
    triangle: u32,
}

impl TieBreak {
    /// `source`: number in the asset; `part`: number in the scene; `triangle`: number in the chunk.
    pub fn new(rank: u8, object_id: u32, source: u32, part: u32, triangle: u32) -> Self {
        Self { inverted_rank: u8::MAX - rank, object_id, source, part, triangle }
    }
}
