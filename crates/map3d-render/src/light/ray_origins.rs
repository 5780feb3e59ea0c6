//! The ray origins of a sub-tile, grouped in packets.

use map3d_base::{Box3, Vec3};
use map3d_trace::{PACKET_SIZE, PacketOrigins, SUBTILE_PX, SceneRegion};

use super::subtile::SurfacePoint;
use super::unprojection::PointRow;

/// Sides of a packet of whole pixels, and of a bucket of other points.
const PACKET_PX: usize = 8;
pub(super) const BUCKET_PX: usize = 16;
/// Packets of whole pixels in a sub-tile.
const PIXEL_PACKETS: usize = (SUBTILE_PX / PACKET_PX) * (SUBTILE_PX / PACKET_PX);
const NO_BUCKET: usize = usize::MAX;

/// Each whole pixel has a fixed index. Other points are appended to packets bucket by bucket, in the order in which they are pushed. An origin's index is
/// its packet times `PACKET_SIZE` plus its number there.
pub(super) struct RayOrigins {
    /// Local bounds of all points, without the lift.
    pub bounds: Box3,
    /// A lattice point near the first point.
    pub center: Vec3,
    lift_m: f64,
    /// Packets of whole pixels, then the others; kept from sub-tile to sub-tile.
    packets: Vec<PacketOrigins>,
    used: usize,
    /// Bucket of the last packet.
    bucket: usize,
}

impl Default for RayOrigins {
    fn default() -> Self {
        let packets = vec![PacketOrigins::default(); PIXEL_PACKETS];
        Self { bounds: Box3::EMPTY, center: [0.0; 3], lift_m: 0.0, packets, used: PIXEL_PACKETS, bucket: NO_BUCKET }
    }
}

impl RayOrigins {
    /// Removes all points. The next ones are lifted above their surfaces along the normal; `first` is the first of them, local.
    pub fn restart(&mut self, lift_m: f64, first: Option<Vec3>) {
        self.packets[..self.used].iter_mut().for_each(PacketOrigins::clear);
        (self.used, self.bucket) = (PIXEL_PACKETS, NO_BUCKET);
        (self.bounds, self.center, self.lift_m) = (Box3::EMPTY, first.map_or([0.0; 3], SceneRegion::snap_center), lift_m);
    }

    pub fn is_empty(&self) -> bool {
        self.bounds.is_empty()
    }

    /// Returns the packets, of which some are empty.
    pub fn packets(&self) -> &[PacketOrigins] {
        &self.packets[..self.used]
    }

    /// Sets `count` whole pixels of a row that starts at (i, j). Positions are local; `normal` is geometric.
    pub fn set_row(&mut self, [i, j]: [usize; 2], count: usize, positions: &PointRow, normal: Vec3) {
        let p = [&positions[0][..count], &positions[1][..count], &positions[2][..count]];
        for axis in 0..3 {
            let (lo, hi) = (&mut self.bounds.lo[axis], &mut self.bounds.hi[axis]);
            for v in p[axis] {
                *lo = if *v < *lo { *v } else { *lo };
                *hi = if *v > *hi { *v } else { *hi };
            }
        }
        let lift = normal.map(|n| n * self.lift_m);
        for k in 0..count {
            let index = pixel_index([i + k, j]);
            let position = [p[0][k] - self.center[0] + lift[0], p[1][k] - self.center[1] + lift[1], p[2][k] - self.center[2] + lift[2]];
            self.packets[index / PACKET_SIZE].set(index % PACKET_SIZE, position, normal);
        }
    }

    /// Appends a point and returns its index.
    pub fn push(&mut self, bucket: usize, point: &SurfacePoint) -> u32 {
        let SurfacePoint { position: at, normal } = *point;
        let mut p = [0.0; 3];
        for k in 0..3 {
            self.bounds.lo[k] = if at[k] < self.bounds.lo[k] { at[k] } else { self.bounds.lo[k] };
            self.bounds.hi[k] = if at[k] > self.bounds.hi[k] { at[k] } else { self.bounds.hi[k] };
            p[k] = at[k] - self.center[k] + normal[k] * self.lift_m;
        }
        let count = self.packets[self.used - 1].mask().count_ones() as usize;
        let k = if bucket == self.bucket && count < PACKET_SIZE { count } else { self.start_packet(bucket) };
        self.packets[self.used - 1].set(k, p, normal);
        ((self.used - 1) * PACKET_SIZE + k) as u32
    }

    /// Starts a packet and returns the number of its first point.
    fn start_packet(&mut self, bucket: usize) -> usize {
        if self.used == self.packets.len() {
            self.packets.push(PacketOrigins::default());
        }
        (self.used, self.bucket) = (self.used + 1, bucket);
        0
    }
}

/// Returns the origin index of whole pixel (i, j).
#[inline(always)]
pub(super) fn pixel_index(pixel: [usize; 2]) -> usize {
    bucket_index(pixel, PACKET_PX)
}

/// Returns the whole pixel of an origin index.
pub(super) fn pixel_of_index(index: usize) -> [usize; 2] {
    bucket_cell(index, PACKET_PX, SUBTILE_PX)
}

/// Returns the index of a pixel of a sub-tile in the order of buckets of `side` × `side` pixels, and within a bucket of squares of 4 × 4.
#[inline(always)]
pub(super) fn bucket_index([i, j]: [usize; 2], side: usize) -> usize {
    let bucket = j / side * (SUBTILE_PX / side) + i / side;
    let square = j % side / 4 * (side / 4) + i % side / 4;
    (bucket * (side * side / 16) + square) * 16 + j % 4 * 4 + i % 4
}

/// Returns the cell of a bucket index in a grid that is `row` cells wide.
#[inline(always)]
pub(super) fn bucket_cell(index: usize, side: usize, row: usize) -> [usize; 2] {
    let (bucket, square) = (index / (side * side), index / 16 % (side * side / 16));
    let (i, j) = (square % (side / 4) * 4 + index % 4, square / (side / 4) * 4 + index / 4 % 4);
    [bucket % (row / side) * side + i, bucket / (row / side) * side + j]
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: Vec3 = [0.0, 0.0, 1.0];

    #[test]
    fn whole_pixels_have_fixed_indices() {
        let mut origins = RayOrigins::default();
        origins.restart(0.5, Some([3.0, 4.0, 100.0]));
        let row: PointRow = [std::array::from_fn(|k| k as f64), [7.0; SUBTILE_PX], [100.0; SUBTILE_PX]];
        origins.set_row([0, 7], 10, &row, UP);
        let masks: Vec<u64> = origins.packets().iter().map(PacketOrigins::mask).filter(|mask| *mask != 0).collect();
        assert_eq!(masks, [0xF000_F000_0000_0000, 0x3000_0000_0000]);
        assert_eq!((origins.bounds.lo, origins.bounds.hi), ([0.0, 7.0, 100.0], [9.0, 7.0, 100.0]));
        origins.restart(0.0, None);
        assert!(origins.packets().iter().all(PacketOrigins::is_empty) && origins.is_empty());
    }

    #[test]
    fn other_points_share_packets_within_a_bucket() {
        let mut origins = RayOrigins::default();
        origins.restart(0.0, None);
        let point = |x: f64| SurfacePoint { position: [x, 0.0, 0.0], normal: UP };
        let indices: Vec<u32> = (0..150).map(|k| origins.push(k / 100, &point(k as f64))).collect();
        let packet_of = |k: usize| indices[k] as usize / PACKET_SIZE - PIXEL_PACKETS;
        assert_eq!([0, 63, 64, 99, 100, 149].map(packet_of), [0, 0, 1, 1, 2, 2]);
        assert_eq!(origins.packets()[PIXEL_PACKETS..].iter().map(|p| p.mask().count_ones()).collect::<Vec<_>>(), [64, 36, 50]);
        assert!(indices.windows(2).all(|two| two[0] < two[1]));
        origins.restart(0.0, None);
        assert_eq!((origins.packets().len(), origins.push(1, &point(0.0)) as usize), (PIXEL_PACKETS, PIXEL_PACKETS * PACKET_SIZE));
        assert_eq!(origins.packets()[PIXEL_PACKETS].mask(), 1);
    }

    #[test]
    fn sixteen_indices_are_four_by_four_pixels() {
        assert_eq!(pixel_index([9, 2]), 64 + 2 * 4 + 1);
        assert_eq!(pixel_index([13, 6]), 64 + 3 * 16 + 2 * 4 + 1);
        assert_eq!(bucket_index([63, 63], 16), 15 * 256 + 255);
        for side in [8, 16] {
            assert!((0..SUBTILE_PX * SUBTILE_PX).all(|index| bucket_index(bucket_cell(index, side, SUBTILE_PX), side) == index));
        }
        assert_eq!(bucket_cell(15 * 64 + 63, 8, 32), [31, 31]);
        assert_eq!(bucket_cell(5 * 64 + 16, 8, 32), [12, 8]);
    }
}
