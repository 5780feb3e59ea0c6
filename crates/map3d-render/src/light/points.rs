//! The points of a sub-tile that rays start from, gathered into patches.

use map3d_base::{Box3, Vec3};
use map3d_trace::{Patch, RAYS, SUBTILE_PX, Surroundings};

/// What a point stands for; those of a kind that lie together come into a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stand {
    /// The only surface of a pixel.
    Pixel,
    /// One of several surfaces of a pixel.
    Share,
    /// A plane that two by two pixels show; the first is named.
    Quad,
}

impl Stand {
    /// Side of the square of pixels whose points come into a patch.
    fn side_px(self) -> usize {
        if self == Self::Pixel { 8 } else { 16 }
    }
}

pub(super) struct Points {
    /// Column and row of each.
    pub pixels: Vec<[u8; 2]>,
    pub bounds: Box3,
    /// A lattice point near the first.
    pub center: Vec3,
    /// From the center, and normals.
    at: Vec<[Vec3; 2]>,
    /// (bucket, place within it, number) of each, in order once `finish` is called.
    order: Vec<(u16, u16, u32)>,
}

impl Default for Points {
    fn default() -> Self {
        Self { pixels: Vec::new(), bounds: Box3::EMPTY, center: [0.0; 3], at: Vec::new(), order: Vec::new() }
    }
}

impl Points {
    pub fn clear(&mut self) {
        self.pixels.clear();
        self.at.clear();
        self.order.clear();
        self.bounds = Box3::EMPTY;
    }

    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    /// `p`: local; `n`: geometric normal.
    pub fn push(&mut self, pixel: [u8; 2], stand: Stand, p: Vec3, n: Vec3) {
        if self.pixels.is_empty() {
            self.center = Surroundings::center_near(p);
        }
        let mut from_center = [0.0; 3];
        for k in 0..3 {
            self.bounds.lo[k] = if p[k] < self.bounds.lo[k] { p[k] } else { self.bounds.lo[k] };
            self.bounds.hi[k] = if p[k] > self.bounds.hi[k] { p[k] } else { self.bounds.hi[k] };
            from_center[k] = p[k] - self.center[k];
        }
        let (bucket, place) = bucket_of(pixel.map(usize::from), stand);
        self.order.push((bucket, place, self.pixels.len() as u32));
        self.pixels.push(pixel);
        self.at.push([from_center, n]);
    }

    /// To be called when all are there.
    pub fn finish(&mut self) {
        self.order.sort_unstable();
    }

    /// Patches of neighbours, raised above their surfaces, with the number of each of their points.
    pub fn patches(&self, lift_m: f64) -> impl Iterator<Item = (Patch, Vec<u32>)> {
        let buckets = self.order.chunk_by(|a, b| a.0 == b.0);
        buckets.flat_map(|bucket| bucket.chunks(RAYS)).map(move |chunk| {
            let mut patch = Patch::default();
            for (k, (_, _, number)) in chunk.iter().enumerate() {
                let [mut p, n] = self.at[*number as usize];
                for axis in 0..3 {
                    p[axis] += n[axis] * lift_m;
                }
                patch.put(k, p, n);
            }
            (patch, chunk.iter().map(|c| c.2).collect())
        })
    }
}

/// The bucket of a point and its place there, four by four points after each other.
fn bucket_of([i, j]: [usize; 2], stand: Stand) -> (u16, u16) {
    let side = stand.side_px();
    let bucket = j / side * (SUBTILE_PX / side) + i / side;
    let step = if stand == Stand::Quad { 2 } else { 1 };
    let (i, j) = (i % side / step, j % side / step);
    let square = j / 4 * (side / step / 4) + i / 4;
    ((stand as u16) << 8 | bucket as u16, (square * 16 + j % 4 * 4 + i % 4) as u16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_in_one_patch() {
        let mut points = Points::default();
        for k in 0..SUBTILE_PX * SUBTILE_PX {
            let pixel = [k % SUBTILE_PX, k / SUBTILE_PX];
            let p = [pixel[0] as f64, pixel[1] as f64, 100.0];
            let shared = k % 7 == 0;
            let stand = if shared { Stand::Share } else { Stand::Pixel };
            (0..if shared { 3 } else { 1 }).for_each(|_| points.push(pixel.map(|v| v as u8), stand, p, [0.0, 0.0, 1.0]));
        }
        points.finish();
        let mut seen = vec![0; points.len()];
        for (patch, numbers) in points.patches(0.0) {
            assert_eq!(patch.there().count_ones() as usize, numbers.len());
            let near = numbers.iter().map(|n| points.pixels[*n as usize]).all(|p| p[0].abs_diff(points.pixels[numbers[0] as usize][0]) < 16);
            assert!(near);
            numbers.iter().for_each(|n| seen[*n as usize] += 1);
        }
        assert!(seen.iter().all(|n| *n == 1));
        points.clear();
        assert_eq!((points.len(), points.patches(0.0).count(), points.bounds.is_empty()), (0, 0, true));
    }

    #[test]
    fn sixteen_places_are_four_by_four_pixels() {
        assert_eq!(bucket_of([9, 2], Stand::Pixel), (1, 2 * 4 + 1));
        assert_eq!(bucket_of([13, 6], Stand::Pixel), (1, 3 * 16 + 2 * 4 + 1));
        assert_eq!(bucket_of([63, 63], Stand::Share), (0x100 | 15, 255));
        assert_eq!(bucket_of([62, 62], Stand::Quad), (0x200 | 15, 63));
    }
}
