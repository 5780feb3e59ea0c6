//! The sample buffer of a sub-tile. A pixel whose 16 samples meet one surface holds only that surface's slot and bounds of its keys; only pixels on
//! edges hold 16 keys and slots. A key is depth − bias in units of 2^-10 m from D0, less 2^31: the least wins.

use crate::lanes::Lanes;
use crate::visbuf::{NOTHING, SUBTILE_PX};

pub(crate) const PIXELS: usize = SUBTILE_PX * SUBTILE_PX;
/// Pixels come in blocks of 16 along a row.
pub(crate) const BLOCKS_PER_ROW: usize = SUBTILE_PX / 16;
/// `SampleBuffer::slot` of a pixel whose samples meet several surfaces.
pub const MIXED: u32 = u32::MAX - 1;
/// The key of a sample that meets nothing.
pub(crate) const FAR: i32 = i32::MAX;
/// Groups of 8 × 8 pixels share a bound of their keys.
pub(crate) const GROUPS_PER_ROW: usize = SUBTILE_PX / 8;

/// The affine key of a surface in fixed point, evaluated at pixel centres of its box: `clamp((z0 + gx·(i − x0) + gy·(j − y0) + offset) >> shift) + base`.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(crate) struct KeyPlane {
    /// From the pixel's centre to each sample.
    pub offsets: [i32; 16],
    pub z0: i32,
    pub gx: i32,
    pub gy: i32,
    pub x0: i32,
    pub y0: i32,
    pub shift: u32,
    pub lo: i32,
    pub hi: i32,
    pub base: i32,
    /// Bounds of `offsets`.
    pub offset_lo: i32,
    pub offset_hi: i32,
}

impl KeyPlane {
    /// Fixed-point value at the centre of pixel (i, j).
    #[inline(always)]
    pub fn center(&self, i: i32, j: i32) -> i32 {
        let across = self.gx.wrapping_mul(i - self.x0);
        self.z0.wrapping_add(across).wrapping_add(self.gy.wrapping_mul(j - self.y0))
    }

    /// A key fits int32 though `base` alone may not, where the plane runs out of the depths before the triangle ends: so the sum wraps.
    #[inline(always)]
    pub fn key(&self, fixed: i32) -> i32 {
        (fixed >> self.shift).max(self.lo).min(self.hi).wrapping_add(self.base)
    }

    /// Keys of fixed-point values.
    #[inline(always)]
    pub fn keys<L: Lanes>(&self, fixed: L) -> L {
        fixed.shift_right(self.shift).max(L::splat(self.lo)).min(L::splat(self.hi)).add(L::splat(self.base))
    }

    /// Keys of the 16 samples of pixel (i, j).
    #[inline(always)]
    pub fn sample_keys<L: Lanes>(&self, i: i32, j: i32) -> L {
        self.keys(L::splat(self.center(i, j)).add(L::load(&self.offsets)))
    }

    /// Bounds of the keys of pixel (i, j).
    #[inline(always)]
    pub fn key_bounds(&self, i: i32, j: i32) -> (i32, i32) {
        let center = self.center(i, j);
        (self.key(center.wrapping_add(self.offset_lo)), self.key(center.wrapping_add(self.offset_hi)))
    }
}

/// What is kept of a surface that won a sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Track {
    /// Of surfaces that a whole pixel can show.
    pub plane: KeyPlane,
    /// Index into `VisBuf::parts`.
    pub part: u32,
    /// Number in the scene, for ties.
    pub part_number: u32,
    /// Number in the chunk.
    pub triangle: u32,
    pub leaf: u32,
    pub lane: u8,
    pub rank: u8,
    pub object_id: u32,
    /// Number in the asset.
    pub source: u32,
}

impl Track {
    /// Less wins a tie of keys: the higher rank, the smaller object id, the smaller triangle number; then what makes the order total.
    pub fn tie_order(&self) -> (u8, u32, u32, u32, u32) {
        (u8::MAX - self.rank, self.object_id, self.source, self.part_number, self.triangle)
    }
}

/// Row-major arrays over the pixels of a sub-tile; `near` and `far` in blocks of 16 pixels.
pub(crate) struct SampleBuffer {
    /// Slot, `MIXED` or `NOTHING`.
    pub slot: Vec<[u32; 16]>,
    /// No sample's key is less.
    pub near: Vec<[i32; 16]>,
    /// No sample's key is greater.
    pub far: Vec<[i32; 16]>,
    /// Of `MIXED` pixels.
    pub keys: Vec<[i32; 16]>,
    pub slots: Vec<[u32; 16]>,
    /// No key of the group is greater.
    pub group_far: [i32; 64],
    /// Groups whose `group_far` can be lowered.
    pub dirty: u64,
    /// Per group: `MIXED` pixels whose `far` can be lowered.
    pub stale: [u64; 64],
}

impl SampleBuffer {
    pub fn new() -> Self {
        Self {
            slot: vec![[NOTHING; 16]; PIXELS / 16],
            near: vec![[FAR; 16]; PIXELS / 16],
            far: vec![[FAR; 16]; PIXELS / 16],
            keys: vec![[FAR; 16]; PIXELS],
            slots: vec![[NOTHING; 16]; PIXELS],
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

    /// Something of a pixel changed, so its group's bound may sink.
    #[inline(always)]
    pub fn touch(&mut self, p: usize) {
        self.dirty |= 1 << group_of(p);
    }

    /// Whether a key of at least `near` can still win a sample in the groups of the box (first column, first row, last column, last row).
    #[inline(always)]
    pub fn can_win<L: Lanes>(&mut self, near: i32, groups: [u8; 4]) -> bool {
        let [x0, y0, x1, y1] = groups;
        for row in usize::from(y0)..=usize::from(y1) {
            for column in usize::from(x0)..=usize::from(x1) {
                let group = (row * GROUPS_PER_ROW + column) & 63;
                if near > self.group_far[group] {
                    continue;
                }
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
        let mut stale = std::mem::take(&mut self.stale[group]);
        while stale != 0 {
            let bit = stale.trailing_zeros() as usize;
            stale &= stale - 1;
            let p = (corner + (bit >> 3) * SUBTILE_PX + (bit & 7)) & (PIXELS - 1);
            if self.slot_of(p) == MIXED {
                self.far[p >> 4][p & 15] = L::load(&self.keys[p]).greatest();
            }
        }
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

/// The group of a pixel.
#[inline(always)]
pub(crate) fn group_of(p: usize) -> usize {
    (p / SUBTILE_PX / 8 * GROUPS_PER_ROW + p % SUBTILE_PX / 8) & 63
}

/// The pixel's bit in its group's `stale`.
#[inline(always)]
pub(crate) fn bit_in_group(p: usize) -> u64 {
    1 << ((p / SUBTILE_PX % 8) * 8 + p % 8)
}
