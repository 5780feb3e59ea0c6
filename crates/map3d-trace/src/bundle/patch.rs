//! Points of surfaces that lie close together, from which bundles start.

use map3d_base::Vec3;

/// Rays of a bundle at most.
pub const RAYS: usize = 64;
/// Lanes that are worked on at once.
pub(crate) const GROUP: usize = 16;
pub(crate) const GROUPS: usize = RAYS / GROUP;

/// A number a ray.
pub(super) type Lanes = [[f32; GROUP]; GROUPS];

/// Up to 64 points with the normals of their surfaces. Each 16 numbers in order should be a compact part of the patch.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct Patch {
    /// Metres from the surroundings' center, x, y, z.
    pub(super) at: [Lanes; 3],
    pub(super) normal: [Lanes; 3],
    pub(super) there: u64,
}

impl Default for Patch {
    fn default() -> Self {
        Self { at: [[[0.0; GROUP]; GROUPS]; 3], normal: [[[0.0; GROUP]; GROUPS]; 3], there: 0 }
    }
}

impl Patch {
    /// Without points again.
    pub fn clear(&mut self) {
        self.there = 0;
    }

    pub fn is_empty(&self) -> bool {
        self.there == 0
    }

    /// Bit k: point k is there.
    pub fn there(&self) -> u64 {
        self.there
    }

    /// Point k (below `RAYS`), in metres from the center of the `Surroundings` that it is used with, and its unit normal.
    #[inline]
    pub fn put(&mut self, k: usize, at: Vec3, normal: Vec3) {
        let (g, lane) = (k / GROUP, k % GROUP);
        for axis in 0..3 {
            self.at[axis][g][lane] = at[axis] as f32;
            self.normal[axis][g][lane] = normal[axis] as f32;
        }
        self.there |= 1 << k;
    }
}

/// Sums of cosines over directions, of each point of a patch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Openness {
    pub(super) open: Lanes,
    pub(super) all: Lanes,
}

impl Openness {
    /// The mean over all rays, weighed by their cosines; 1 where no ray was sent.
    pub fn share(&self, k: usize) -> f32 {
        let (open, all) = (self.open[k / GROUP][k % GROUP], self.all[k / GROUP][k % GROUP]);
        if all > 0.0 { open / all } else { 1.0 }
    }
}
