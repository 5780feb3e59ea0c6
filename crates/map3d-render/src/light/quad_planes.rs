//! The planes that quads of two by two pixels show. Soft light such as ambient occlusion is computed once for each.

use map3d_base::Vec3;
use map3d_base::vec3::{dot, sub};
use map3d_trace::SUBTILE_PX;

use super::ray_origins::bucket_cell;
use super::subtile::SurfacePoint;

const QUADS_PER_ROW: usize = SUBTILE_PX / 2;
const NO_PLANE: u32 = u32::MAX;
/// Points within this distance of a plane belong to it, in metres.
const TOLERANCE_M: f64 = 1.0 / 64.0;

/// Side of a bucket in quads: the planes of a bucket may share packets. Packets of larger buckets would overlap too many boxes; in smaller ones, too few
/// planes face the same way.
const BUCKET_QUADS: usize = 16;
const FACINGS: usize = 6;

pub(super) struct QuadPlane {
    /// The point with the most samples, the first one of equals. (The mean of several points could be inside an object that protrudes between them.)
    pub point: SurfacePoint,
    samples: u8,
    /// The next plane of the same quad.
    next: u32,
}

pub(super) struct QuadPlanes {
    pub all: Vec<QuadPlane>,
    first_of_quad: Vec<u32>,
}

/// A plane and the bucket whose packets may contain it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BucketEntry {
    pub bucket: usize,
    /// Index into `QuadPlanes::all`.
    pub plane: u32,
}

impl Default for QuadPlanes {
    fn default() -> Self {
        Self { all: Vec::new(), first_of_quad: vec![NO_PLANE; QUADS_PER_ROW * QUADS_PER_ROW] }
    }
}

impl QuadPlanes {
    pub fn clear(&mut self) {
        self.all.clear();
        self.first_of_quad.fill(NO_PLANE);
    }

    /// Adds a point that a pixel shows with a number of samples, and returns the index of its plane.
    pub fn add(&mut self, pixel: [usize; 2], point: &SurfacePoint, samples: u8) -> u32 {
        // Find the plane among those of the quad.
        let quad = pixel[1] / 2 * QUADS_PER_ROW + pixel[0] / 2;
        let mut number = self.first_of_quad[quad];
        while number != NO_PLANE {
            let plane = &self.all[number as usize].point;
            if plane.normal == point.normal && dot(point.normal, sub(point.position, plane.position)).abs() < TOLERANCE_M {
                break;
            }
            number = self.all[number as usize].next;
        }

        // Add a new one.
        if number == NO_PLANE {
            number = self.all.len() as u32;
            let next = std::mem::replace(&mut self.first_of_quad[quad], number);
            self.all.push(QuadPlane { point: *point, samples, next });
        }

        // Keep the point with the most samples.
        let plane = &mut self.all[number as usize];
        if samples > plane.samples {
            (plane.point.position, plane.samples) = (point.position, samples);
        }
        number
    }

    /// Returns all planes by bucket, neighbours that face the same way together: their rays have similar paths, and a packet sends all of them or none.
    pub fn in_order(&self) -> Vec<BucketEntry> {
        let mut all = Vec::with_capacity(self.all.len());
        for index in 0..QUADS_PER_ROW * QUADS_PER_ROW {
            let [i, j] = bucket_cell(index, BUCKET_QUADS / 2, QUADS_PER_ROW);
            let bucket = j / BUCKET_QUADS * (QUADS_PER_ROW / BUCKET_QUADS) + i / BUCKET_QUADS;
            let mut number = self.first_of_quad[j * QUADS_PER_ROW + i];
            while number != NO_PLANE {
                let plane = &self.all[number as usize];
                all.push((bucket * FACINGS + facing(plane.point.normal), index, number));
                number = plane.next;
            }
        }
        all.sort_unstable();
        all.into_iter().map(|(key, _, plane)| BucketEntry { bucket: key / FACINGS, plane }).collect()
    }
}

/// Returns the class of a plane's facing: horizontal planes up or down, others along the axis that is nearest to their slope.
fn facing(normal: Vec3) -> usize {
    let [x, y, z] = normal.map(f64::abs);
    let axis = if z > 0.9 { 2 } else { usize::from(x <= y) };
    axis * 2 + usize::from(normal[axis] < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_quad_are_grouped_by_plane() {
        let mut planes = QuadPlanes::default();
        let add = |planes: &mut QuadPlanes, pixel, position, normal, samples| planes.add(pixel, &SurfacePoint { position, normal }, samples);
        let up = [0.0, 0.0, 1.0];
        let first = add(&mut planes, [4, 6], [1.0, 1.0, 2.0], up, 16);
        assert_eq!(add(&mut planes, [5, 7], [2.0, 3.0, 2.001], up, 16), first);
        let below = add(&mut planes, [5, 7], [2.0, 3.0, 1.5], up, 16);
        let vertical = add(&mut planes, [4, 7], [1.0, 1.0, 2.0], [1.0, 0.0, 0.0], 16);
        let neighbour = add(&mut planes, [6, 7], [1.0, 1.0, 2.0], up, 16);
        assert_eq!((first, below, vertical, neighbour), (0, 1, 2, 3));
        assert_eq!(add(&mut planes, [4, 6], [1.0, 0.0, 1.5], up, 4), below);
        let thin = add(&mut planes, [8, 8], [1.0, 0.0, 1.5], up, 4);
        assert_eq!(add(&mut planes, [9, 8], [3.0, 0.0, 1.5], up, 5), thin);
        let positions = (planes.all[1].point.position, planes.all[thin as usize].point.position);
        assert_eq!(positions, ([2.0, 3.0, 1.5], [3.0, 0.0, 1.5]));
        let order = planes.in_order();
        assert_eq!(order, [vertical, first, below, neighbour, thin].map(|plane| BucketEntry { bucket: 0, plane }));
        let far = add(&mut planes, [32, 31], [3.0, 0.0, 1.5], up, 5);
        assert_eq!(planes.in_order().last(), Some(&BucketEntry { bucket: 1, plane: far }));
        planes.clear();
        assert!(planes.in_order().is_empty());
        assert_eq!(add(&mut planes, [4, 6], [1.0, 0.0, 1.5], up, 4), 0);
    }
}
