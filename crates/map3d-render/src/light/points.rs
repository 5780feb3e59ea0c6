//! The points of a sub-tile that rays start from, in patches.

use map3d_base::{Box3, Vec3};
use map3d_trace::{Patch, RAYS, SUBTILE_PX, Surroundings};

use super::place::Row;

/// Sides of a patch of whole pixels, and of a bucket of points that have no pixel for themselves.
const SQUARE_PX: usize = 8;
pub(super) const BUCKET_PX: usize = 16;
const SQUARES: usize = (SUBTILE_PX / SQUARE_PX) * (SUBTILE_PX / SQUARE_PX);
const NO_BUCKET: usize = usize::MAX;

/// Points of whole pixels have places of their own. What else there is comes to patches in the order in which it is added, bucket by bucket.
pub(super) struct Points {
    /// Local, around all.
    pub bounds: Box3,
    /// A lattice point near the first.
    pub center: Vec3,
    lift_m: f64,
    /// Those of whole pixels, then others; kept from sub-tile to sub-tile.
    patches: Vec<Patch>,
    used: usize,
    bucket: usize,
}

impl Default for Points {
    fn default() -> Self {
        Self { bounds: Box3::EMPTY, center: [0.0; 3], lift_m: 0.0, patches: vec![Patch::default(); SQUARES], used: SQUARES, bucket: NO_BUCKET }
    }
}

impl Points {
    /// Without points again; the next will be raised above their surfaces. `first`: that of them which comes first,
    /// local.
    pub fn restart(&mut self, lift_m: f64, first: Option<Vec3>) {
        self.patches[..self.used].iter_mut().for_each(Patch::clear);
        (self.used, self.bucket) = (SQUARES, NO_BUCKET);
        (self.bounds, self.center, self.lift_m) = (Box3::EMPTY, first.map_or([0.0; 3], Surroundings::center_near), lift_m);
    }

    pub fn is_empty(&self) -> bool {
        self.bounds.is_empty()
    }

    /// Some are empty.
    pub fn patches(&self) -> &[Patch] {
        &self.patches[..self.used]
    }

    /// The points of whole pixels of a row, the first of which is (i, j), in order; `at`: local; `normal`: geometric.
    pub fn put_row(&mut self, [i, j]: [usize; 2], count: usize, at: &Row, normal: Vec3) {
        let at = [&at[0][..count], &at[1][..count], &at[2][..count]];
        for axis in 0..3 {
            let (lo, hi) = (&mut self.bounds.lo[axis], &mut self.bounds.hi[axis]);
            for p in at[axis] {
                *lo = if *p < *lo { *p } else { *lo };
                *hi = if *p > *hi { *p } else { *hi };
            }
        }
        let up = normal.map(|n| n * self.lift_m);
        for k in 0..count {
            let place = place_of([i + k, j]);
            let p = [at[0][k] - self.center[0] + up[0], at[1][k] - self.center[1] + up[1], at[2][k] - self.center[2] + up[2]];
            self.patches[place / RAYS].put(place % RAYS, p, normal);
        }
    }

    /// Another point; its place is told.
    pub fn add(&mut self, bucket: usize, at: Vec3, normal: Vec3) -> u32 {
        let mut p = [0.0; 3];
        for k in 0..3 {
            self.bounds.lo[k] = if at[k] < self.bounds.lo[k] { at[k] } else { self.bounds.lo[k] };
            self.bounds.hi[k] = if at[k] > self.bounds.hi[k] { at[k] } else { self.bounds.hi[k] };
            p[k] = at[k] - self.center[k] + normal[k] * self.lift_m;
        }
        let count = self.patches[self.used - 1].there().count_ones() as usize;
        let k = if bucket == self.bucket && count < RAYS { count } else { self.next_patch(bucket) };
        self.patches[self.used - 1].put(k, p, normal);
        ((self.used - 1) * RAYS + k) as u32
    }

    fn next_patch(&mut self, bucket: usize) -> usize {
        if self.used == self.patches.len() {
            self.patches.push(Patch::default());
        }
        (self.used, self.bucket) = (self.used + 1, bucket);
        0
    }
}

/// Place of the point of whole pixel (i, j): its patch times `RAYS`, and its number there.
#[inline(always)]
pub(super) fn place_of(pixel: [usize; 2]) -> usize {
    key_of(pixel, SQUARE_PX)
}

/// The pixel of a place.
pub(super) fn pixel_of(place: usize) -> [usize; 2] {
    cell_of(place, SQUARE_PX, SUBTILE_PX)
}

/// The place of a pixel of a sub-tile in the order of buckets of `side` × `side`, and there four by four after each other.
#[inline(always)]
pub(super) fn key_of([i, j]: [usize; 2], side: usize) -> usize {
    let bucket = j / side * (SUBTILE_PX / side) + i / side;
    let square = j % side / 4 * (side / 4) + i % side / 4;
    (bucket * (side * side / 16) + square) * 16 + j % 4 * 4 + i % 4
}

/// The cell of a key, in any grid that is `row` cells wide.
#[inline(always)]
pub(super) fn cell_of(key: usize, side: usize, row: usize) -> [usize; 2] {
    let (bucket, square) = (key / (side * side), key / 16 % (side * side / 16));
    let (i, j) = (square % (side / 4) * 4 + key % 4, square / (side / 4) * 4 + key / 4 % 4);
    [bucket % (row / side) * side + i, bucket / (row / side) * side + j]
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: Vec3 = [0.0, 0.0, 1.0];

    #[test]
    fn whole_pixels_have_places_of_their_own() {
        let mut points = Points::default();
        points.restart(0.5, Some([3.0, 4.0, 100.0]));
        let row: Row = [std::array::from_fn(|k| k as f64), [7.0; SUBTILE_PX], [100.0; SUBTILE_PX]];
        points.put_row([0, 7], 10, &row, UP);
        assert_eq!(
            points.patches().iter().map(|p| p.there()).filter(|there| *there != 0).collect::<Vec<_>>(),
            [0xF000_F000_0000_0000, 0x3000_0000_0000]
        );
        assert_eq!((points.bounds.lo, points.bounds.hi), ([0.0, 7.0, 100.0], [9.0, 7.0, 100.0]));
        points.restart(0.0, None);
        assert!(points.patches().iter().all(Patch::is_empty) && points.is_empty());
    }

    #[test]
    fn others_come_to_patches_of_their_bucket() {
        let mut points = Points::default();
        points.restart(0.0, None);
        let places: Vec<u32> = (0..150).map(|k| points.add(k / 100, [k as f64, 0.0, 0.0], UP)).collect();
        let patch_of = |k: usize| places[k] as usize / RAYS - SQUARES;
        assert_eq!([0, 63, 64, 99, 100, 149].map(patch_of), [0, 0, 1, 1, 2, 2]);
        assert_eq!(points.patches()[SQUARES..].iter().map(|p| p.there().count_ones()).collect::<Vec<_>>(), [64, 36, 50]);
        assert!(places.windows(2).all(|two| two[0] < two[1]));
        points.restart(0.0, None);
        assert_eq!((points.patches().len(), points.add(1, [0.0; 3], UP) as usize), (SQUARES, SQUARES * RAYS));
        assert_eq!(points.patches()[SQUARES].there(), 1);
    }

    #[test]
    fn sixteen_places_are_four_by_four_pixels() {
        assert_eq!(place_of([9, 2]), 64 + 2 * 4 + 1);
        assert_eq!(place_of([13, 6]), 64 + 3 * 16 + 2 * 4 + 1);
        assert_eq!(key_of([63, 63], 16), 15 * 256 + 255);
        for side in [8, 16] {
            assert!((0..SUBTILE_PX * SUBTILE_PX).all(|key| key_of(cell_of(key, side, SUBTILE_PX), side) == key));
        }
        assert_eq!(cell_of(15 * 64 + 63, 8, 32), [31, 31]);
        assert_eq!(cell_of(5 * 64 + 16, 8, 32), [12, 8]);
    }
}
