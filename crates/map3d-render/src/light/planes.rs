//! The planes that two by two pixels show: what is soft, such as ambient occlusion, is found once for each.

use map3d_base::Vec3;
use map3d_base::vec3::{dot, sub};
use map3d_trace::SUBTILE_PX;

use super::points::{BUCKET_PX, cell_of};

const QUADS_PER_ROW: usize = SUBTILE_PX / 2;
const NO_PLANE: u32 = u32::MAX;
/// Points this near to a plane lie in it, in metres.
const NEAR_M: f64 = 1.0 / 64.0;

pub(super) struct Plane {
    pub normal: Vec3,
    /// Local: the point that stands for most samples, the first of equals. (A mean of several could lie within what stands out between them.)
    pub at: Vec3,
    samples: u8,
    /// The next of the same quad.
    next: u32,
}

pub(super) struct Planes {
    pub all: Vec<Plane>,
    first_of_quad: Vec<u32>,
}

impl Default for Planes {
    fn default() -> Self {
        Self { all: Vec::new(), first_of_quad: vec![NO_PLANE; QUADS_PER_ROW * QUADS_PER_ROW] }
    }
}

impl Planes {
    pub fn clear(&mut self) {
        self.all.clear();
        self.first_of_quad.fill(NO_PLANE);
    }

    /// The numbers of all, by buckets of quads, those of a quad in the order in which they came.
    pub fn by_bucket(&self, mut each: impl FnMut(usize, u32)) {
        const SIDE: usize = BUCKET_PX / 2;
        let mut of_quad = Vec::new();
        for key in 0..QUADS_PER_ROW * QUADS_PER_ROW {
            let [i, j] = cell_of(key, SIDE, QUADS_PER_ROW);
            let mut number = self.first_of_quad[j * QUADS_PER_ROW + i];
            while number != NO_PLANE {
                of_quad.push(number);
                number = self.all[number as usize].next;
            }
            of_quad.drain(..).rev().for_each(|number| each(key / (SIDE * SIDE), number));
        }
    }

    /// The number of the plane that a pixel shows at a local point.
    pub fn add(&mut self, pixel: [usize; 2], at: Vec3, normal: Vec3, samples: u8) -> u32 {
        let place = pixel[1] / 2 * QUADS_PER_ROW + pixel[0] / 2;
        let mut number = self.first_of_quad[place];
        while number != NO_PLANE {
            let plane = &self.all[number as usize];
            if plane.normal == normal && dot(normal, sub(at, plane.at)).abs() < NEAR_M {
                break;
            }
            number = plane.next;
        }
        if number == NO_PLANE {
            number = self.all.len() as u32;
            let next = std::mem::replace(&mut self.first_of_quad[place], number);
            self.all.push(Plane { normal, at, samples, next });
        }
        let plane = &mut self.all[number as usize];
        if samples > plane.samples {
            (plane.at, plane.samples) = (at, samples);
        }
        number
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_quad_come_together_plane_by_plane() {
        let mut planes = Planes::default();
        let up = [0.0, 0.0, 1.0];
        let first = planes.add([4, 6], [1.0, 1.0, 2.0], up, 16);
        assert_eq!(planes.add([5, 7], [2.0, 3.0, 2.001], up, 16), first);
        let below = planes.add([5, 7], [2.0, 3.0, 1.5], up, 16);
        let turned = planes.add([4, 7], [1.0, 1.0, 2.0], [1.0, 0.0, 0.0], 16);
        let neighbour = planes.add([6, 7], [1.0, 1.0, 2.0], up, 16);
        assert_eq!((first, below, turned, neighbour), (0, 1, 2, 3));
        assert_eq!(planes.add([4, 6], [1.0, 0.0, 1.5], up, 4), below);
        let thin = planes.add([8, 8], [1.0, 0.0, 1.5], up, 4);
        assert_eq!(planes.add([9, 8], [3.0, 0.0, 1.5], up, 5), thin);
        assert_eq!((planes.all[1].at, planes.all[thin as usize].at), ([2.0, 3.0, 1.5], [3.0, 0.0, 1.5]));
        let mut order = Vec::new();
        planes.by_bucket(|bucket, number| order.push((bucket, number)));
        assert_eq!(order, [(0, first), (0, below), (0, turned), (0, neighbour), (0, thin)]);
        let far = planes.add([16, 15], [3.0, 0.0, 1.5], up, 5);
        planes.by_bucket(|bucket, number| assert_eq!(bucket, usize::from(number == far)));
        planes.clear();
        planes.by_bucket(|_, _| panic!("a plane"));
        assert_eq!(planes.add([4, 6], [1.0, 0.0, 1.5], up, 4), 0);
    }
}
