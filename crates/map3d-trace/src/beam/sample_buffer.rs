//! The sample buffer of a sub-tile. A pixel whose 16 samples show one surface holds only that surface's slot and bounds of its depth keys; only pixels on
//! edges hold 16 keys and 16 slots. As in a hierarchical depth buffer, groups of pixels share a bound of their keys.

use super::pixels::SUBTILE_PX;
use crate::depth_key::TieBreak;
use crate::lanes::Lanes;

/// The slot of samples that show nothing.
pub const NOTHING: u32 = u32::MAX;
/// The slot of a pixel whose samples show several surfaces.
pub const MIXED: u32 = u32::MAX - 1;
/// The depth key of a sample that shows nothing.
pub(crate) const FAR: i32 = i32::MAX;

pub(crate) const PIXELS: usize = SUBTILE_PX * SUBTILE_PX;
/// Pixels are processed in spans of 16 along a row.
pub(crate) const SPANS_PER_ROW: usize = SUBTILE_PX / 16;
/// Groups of 8 × 8 pixels share a bound of their keys.
const GROUPS_PER_ROW: usize = SUBTILE_PX / 8;

/// A triangle that has won a sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VisibleTriangle {
    /// Index into `VisBuf::parts`.
    pub part: u32,
    /// Index into `Chunk::triangles`.
    pub triangle: u32,
    pub leaf: u32,
    pub lane: u8,
    pub tie_break: TieBreak,
}

/// The groups that a box of pixels overlaps: first column and row, last column and row. (Kept as an array, which the compiler copies as one word.)
#[derive(Clone, Copy, Debug)]
pub(crate) struct GroupBox([u8; 4]);

impl GroupBox {
    pub const ALL: Self = Self([0, 0, GROUPS_PER_ROW as u8 - 1, GROUPS_PER_ROW as u8 - 1]);

    /// `pixels`: least x and y, greatest x and y in pixels from the sub-tile's corner.
    #[inline(always)]
    pub fn new(pixels: [f32; 4]) -> Self {
        const LAST_PX: f32 = (SUBTILE_PX - 1) as f32;
        let mut out = [0; 4];
        for k in 0..4 {
            out[k] = pixels[k].clamp(0.0, LAST_PX) as u8 >> 3;
        }
        Self(out)
    }
}

/// Row-major arrays over the pixels of a sub-tile; `slot`, `near` and `far` in spans of 16 pixels.
pub(crate) struct SampleBuffer {
    /// Slot, `MIXED` or `NOTHING`.
    pub slot: Vec<[u32; 16]>,
    /// Lower bounds of the pixels' depth keys.
    pub near: Vec<[i32; 16]>,
    /// Upper bounds of the pixels' depth keys.
    pub far: Vec<[i32; 16]>,
    /// Depth keys of the samples of `MIXED` pixels.
    pub sample_keys: Vec<[i32; 16]>,
    /// Slots of the samples of `MIXED` pixels.
    pub sample_slots: Vec<[u32; 16]>,
    /// Upper bounds of the groups' depth keys.
    group_far: [i32; 64],
    /// Groups whose `group_far` may be lowered.
    dirty: u64,
    /// For each group, the `MIXED` pixels whose `far` may be lowered.
    stale: [u64; 64],
}

impl SampleBuffer {
    pub fn new() -> Self {
        Self {
            slot: vec![[NOTHING; 16]; PIXELS / 16],
            near: vec![[FAR; 16]; PIXELS / 16],
            far: vec![[FAR; 16]; PIXELS / 16],
            sample_keys: vec![[FAR; 16]; PIXELS],
            sample_slots: vec![[NOTHING; 16]; PIXELS],
            group_far: [FAR; 64],
            dirty: 0,
            stale: [0; 64],
        }
    }

    pub fn clear(&mut self) {
        self.slot.fill([NOTHING; 16]);
        self.near.fill([FAR; 16]);
        self.far.fill([FAR; 16]);
        self.group_far = [FAR; 64];
        self.dirty = 0;
        self.stale = [0; 64];
    }

    #[inline(always)]
    pub fn slot_of(&self, p: usize) -> u32 {
        self.slot[p >> 4][p & 15]
    }

    #[inline(always)]
    pub fn far_of(&self, p: usize) -> i32 {
        self.far[p >> 4][p & 15]
    }

    /// Marks the group of a changed pixel: its bound may be lowered.
    #[inline(always)]
    pub fn mark_dirty(&mut self, p: usize) {
        self.dirty |= 1 << group_of(p);
    }

    /// Marks the groups of changed pixels of a span; bit k of `pixels` is pixel k.
    #[inline(always)]
    pub fn mark_span_dirty(&mut self, span: usize, pixels: u32) {
        let (left, right) = (pixels & 0xFF != 0, pixels >> 8 != 0);
        self.dirty |= (u64::from(left) | u64::from(right) << 1) << group_of(span * 16);
    }

    /// Marks a `MIXED` pixel whose `far` may be lowered.
    #[inline(always)]
    pub fn mark_stale(&mut self, p: usize) {
        self.stale[group_of(p)] |= 1 << ((p / SUBTILE_PX % 8) * 8 + p % 8);
    }

    /// Returns whether a depth key of at least `near` can still win a sample in the groups.
    #[inline(always)]
    pub fn can_win<L: Lanes>(&mut self, near: i32, groups: GroupBox) -> bool {
        let GroupBox([x0, y0, x1, y1]) = groups;
        for row in usize::from(y0)..=usize::from(y1) {
            for column in usize::from(x0)..=usize::from(x1) {
                let group = (row * GROUPS_PER_ROW + column) & 63;
                if near > self.group_far[group] {
                    continue;
                }
                // A stale bound may be too high: compute it and compare again.
                if self.dirty >> group & 1 != 0 {
                    self.refresh::<L>(group);
                    if near > self.group_far[group] {
                        continue;
                    }
                }
                return true;
            }
        }
        false
    }

    /// Recomputes a group's bound from its pixels, and those of its stale pixels from their samples.
    #[inline(always)]
    fn refresh<L: Lanes>(&mut self, group: usize) {
        let corner = group / GROUPS_PER_ROW * 8 * SUBTILE_PX + group % GROUPS_PER_ROW * 8;

        // Bounds of the stale pixels.
        let mut stale = std::mem::take(&mut self.stale[group]);
        while stale != 0 {
            let bit = stale.trailing_zeros() as usize;
            stale &= stale - 1;
            let p = (corner + (bit >> 3) * SUBTILE_PX + (bit & 7)) & (PIXELS - 1);
            if self.slot_of(p) == MIXED {
                self.far[p >> 4][p & 15] = L::load(&self.sample_keys[p]).greatest();
            }
        }

        // Bound of the group.
        let mut far = i32::MIN;
        for row in 0..8 {
            let p = corner + row * SUBTILE_PX;
            for k in 0..8 {
                far = far.max(self.far[(p >> 4) & (PIXELS / 16 - 1)][(p & 8) + k]);
            }
        }
        self.group_far[group] = far;
        self.dirty &= !(1 << group);
    }
}

/// Returns the group of a pixel.
#[inline(always)]
fn group_of(p: usize) -> usize {
    (p / SUBTILE_PX / 8 * GROUPS_PER_ROW + p % SUBTILE_PX / 8) & 63
}
