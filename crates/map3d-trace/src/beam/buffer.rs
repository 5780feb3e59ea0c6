//! The sample buffer of a sub-tile. A pixel whose 16 samples meet one surface holds only that surface's slot and bounds of its keys; only pixels on
//! edges hold 16 keys and slots. A key is depth − bias in units of 2^-10 m from D0, less 2^31: the least wins.

use crate::visbuf::{NOTHING, SUBTILE_PX};

pub(crate) const PIXELS: usize = SUBTILE_PX * SUBTILE_PX;
/// `SampleBuffer::slot` of a pixel whose samples meet several surfaces.
pub(crate) const MIXED: u32 = u32::MAX - 1;
/// The key of a sample that meets nothing.
pub(crate) const FAR: i32 = i32::MAX;
/// Groups of 8 × 8 pixels share a bound of their keys.
pub(crate) const GROUPS_PER_ROW: usize = SUBTILE_PX / 8;

/// The affine key of a surface in fixed point, evaluated at pixel centres of its box: `clamp((z0 + gx·(i − x0) + gy·(j − y0) + offset) >> shift) + base`.
#[derive(Clone, Copy, Debug)]
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
    /// Least and greatest of `offsets`.
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

    #[inline(always)]
    pub fn key(&self, fixed: i32) -> i32 {
        (fixed >> self.shift).max(self.lo).min(self.hi) + self.base
    }
}

/// What is kept of a surface that won a sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Track {
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

/// Row-major arrays over the pixels of a sub-tile.
pub(crate) struct SampleBuffer {
    /// Slot, `MIXED` or `NOTHING`.
    pub slot: Box<[u32; PIXELS]>,
    /// No sample's key is less.
    pub near: Box<[i32; PIXELS]>,
    /// No sample's key is greater.
    pub far: Box<[i32; PIXELS]>,
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
            slot: Box::new([NOTHING; PIXELS]),
            near: Box::new([FAR; PIXELS]),
            far: Box::new([FAR; PIXELS]),
            keys: vec![[FAR; 16]; PIXELS],
            slots: vec![[NOTHING; 16]; PIXELS],
            group_far: [FAR; 64],
            dirty: 0,
            stale: [0; 64],
        }
    }

    pub fn clear(&mut self) {
        self.slot.fill(NOTHING);
        self.near.fill(FAR);
        self.far.fill(FAR);
        self.group_far = [FAR; 64];
        self.dirty = 0;
        self.stale = [0; 64];
    }
}
