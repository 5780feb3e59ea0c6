//! Pixels, samples and the snapping lattice of a sub-tile.

use map3d_base::samples::SAMPLES;

/// Side of a sub-tile in pixels. At this size the sample buffer stays in the second-level cache.
pub const SUBTILE_PX: usize = 64;
/// Steps of the snapping lattice per pixel; a pixel's number is its steps >> 8.
pub(crate) const STEPS_PER_PX: i32 = 256;

/// x and y of a triangle's snapped corners in lattice steps from the sub-tile's corner.
pub(crate) type SnappedCorners = [[i64; 2]; 3];

const fn sample_lanes(axis: usize) -> [i32; 16] {
    let mut out = [0; 16];
    let mut k = 0;
    while k < 16 {
        out[k] = if axis == 0 { SAMPLES[k].0 as i32 } else { SAMPLES[k].1 as i32 };
        k += 1;
    }
    out
}

/// Sample positions in 1/16 pixel from a pixel's top left corner.
pub(crate) const SAMPLE_X: [i32; 16] = sample_lanes(0);
pub(crate) const SAMPLE_Y: [i32; 16] = sample_lanes(1);

/// Returns the position of sample k of pixel (i, j) in lattice steps.
#[inline(always)]
pub(crate) fn sample_position(i: i32, j: i32, k: usize) -> [i64; 2] {
    let (x, y) = SAMPLES[k];
    [i64::from(i) * 256 + i64::from(x) * 16, i64::from(j) * 256 + i64::from(y) * 16]
}

/// A rectangle of pixels of a sub-tile, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PixelBox {
    pub x0: i32,
    pub y0: i32,
    pub x1: i32,
    pub y1: i32,
}

impl PixelBox {
    /// Returns the pixels with a sample inside the box of the snapped corners, or `None` if the sub-tile has none.
    #[inline(always)]
    pub fn of(s: &SnappedCorners) -> Option<Self> {
        let lo = |k: usize| s[0][k].min(s[1][k]).min(s[2][k]);
        let hi = |k: usize| s[0][k].max(s[1][k]).max(s[2][k]);
        let first = |k: usize| ((lo(k) + 15) >> 8).max(0);
        let last = |k: usize| (hi(k) >> 8).min(SUBTILE_PX as i64 - 1);
        let (x0, y0, x1, y1) = (first(0), first(1), last(0), last(1));
        (x0 <= x1 && y0 <= y1).then_some(Self { x0: x0 as i32, y0: y0 as i32, x1: x1 as i32, y1: y1 as i32 })
    }

    #[inline(always)]
    pub fn width(&self) -> i32 {
        self.x1 - self.x0 + 1
    }

    #[inline(always)]
    pub fn height(&self) -> i32 {
        self.y1 - self.y0 + 1
    }

    /// Returns the mask of the 16 pixels from column i on whose columns are in the box.
    #[inline(always)]
    pub fn columns_of_span(&self, i: i32) -> u32 {
        let first = (self.x0 - i).max(0) as u32;
        let last = (self.x1 - i).min(15) as u32;
        (0xFFFF << first) & (0xFFFF >> (15 - last))
    }
}
