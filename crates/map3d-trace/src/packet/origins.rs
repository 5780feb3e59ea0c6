//! The points from which a ray packet starts, and the ambient occlusion that its rays accumulate there.

use map3d_base::Vec3;

/// The greatest number of rays in a packet.
pub const PACKET_SIZE: usize = 64;
/// Rays that are processed at once.
pub(super) const GROUP: usize = 16;
pub(super) const GROUPS: usize = PACKET_SIZE / GROUP;

/// One number per ray.
pub(super) type PerRay = [[f32; GROUP]; GROUPS];

/// Up to 64 neighbouring points with the normals of their surfaces. Each 16 consecutive numbers should be a compact part of the packet.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct PacketOrigins {
    /// x, y, z in metres from the scene region's center.
    pub(super) position: [PerRay; 3],
    pub(super) normal: [PerRay; 3],
    pub(super) mask: u64,
}

impl Default for PacketOrigins {
    fn default() -> Self {
        Self { position: [[[0.0; GROUP]; GROUPS]; 3], normal: [[[0.0; GROUP]; GROUPS]; 3], mask: 0 }
    }
}

impl PacketOrigins {
    /// Removes all points.
    pub fn clear(&mut self) {
        self.mask = 0;
    }

    pub fn is_empty(&self) -> bool {
        self.mask == 0
    }

    /// Bit k is set if point k exists.
    pub fn mask(&self) -> u64 {
        self.mask
    }

    /// Sets point k (below `PACKET_SIZE`): its position in metres from the center of the `SceneRegion` that it is traced in, and its unit normal.
    #[inline]
    pub fn set(&mut self, k: usize, position: Vec3, normal: Vec3) {
        let (g, lane) = (k / GROUP, k % GROUP);
        for axis in 0..3 {
            self.position[axis][g][lane] = position[axis] as f32;
            self.normal[axis][g][lane] = normal[axis] as f32;
        }
        self.mask |= 1 << k;
    }
}

/// Accumulates ambient occlusion over directions, for each point of a packet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AmbientOcclusion {
    /// Sums of the rays' cosines, weighted by their visibility.
    pub(super) visible: PerRay,
    /// Sums of the rays' cosines.
    pub(super) total: PerRay,
}

impl AmbientOcclusion {
    /// Returns the cosine-weighted mean visibility over the rays of point k; 1 if no ray was sent.
    pub fn visibility(&self, k: usize) -> f32 {
        let (visible, total) = (self.visible[k / GROUP][k % GROUP], self.total[k / GROUP][k % GROUP]);
        if total > 0.0 { visible / total } else { 1.0 }
    }
}
