//! The planes that two by two pixels show: what is soft, such as ambient occlusion, is found once for each.

use map3d_base::Vec3;
use map3d_base::vec3::{dot, sub};
use map3d_trace::SUBTILE_PX;

use super::points::cell_of;

const QUADS_PER_ROW: usize = SUBTILE_PX / 2;
const NO_PLANE: u32 = u32::MAX;
/// Points this near to a plane lie in it, in metres.
const NEAR_M: f64 = 1.0 / 64.0;

/// Quads in a row of those whose planes may come together: more of them would see too much, of fewer too few planes face alike.
const BUCKET: usize = 16;
const SIDES: usize = 6;

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

    /// The bucket and number of all, those that lie and face alike after each other: their rays go the same ways, and are sent together or not at all.
    pub fn in_order(&self) -> Vec<(usize, u32)> {
        let mut all = Vec::with_capacity(self.all.len());
        for key in 0..QUADS_PER_ROW * QUADS_PER_ROW {
            let [i, j] = cell_of(key, BUCKET / 2, QUADS_PER_ROW);
            let bucket = j / BUCKET * (QUADS_PER_ROW / BUCKET) + i / BUCKET;
            let mut number = self.first_of_quad[j * QUADS_PER_ROW + i];
            while number != NO_PLANE {
                let plane = &self.all[number as usize];
                all.push((bucket * SIDES + side_of(plane.normal), key, number));
                number = plane.next;
            }
        }
        all.sort_unstable();
        all.into_iter().map(|(side, _, number)| (side / SIDES, number)).collect()
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

/// The axis along which a plane faces: flat ones up or down, others by the direction in which they slope.
fn side_of(normal: Vec3) -> usize {
    let [x, y, z] = normal.map(f64::abs);
    let axis = if z > 0.9 { 2 } else { usize::from(x <= y) };
    axis * 2 + usize::from(normal[axis] < 0.0)
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
        let order = planes.in_order();
        assert_eq!(order, [(0, turned), (0, first), (0, below), (0, neighbour), (0, thin)]);
        let far = planes.add([32, 31], [3.0, 0.0, 1.5], up, 5);
        assert_eq!(planes.in_order().last(), Some(&(1, far)));
        planes.clear();
        assert!(planes.in_order().is_empty());
        assert_eq!(planes.add([4, 6], [1.0, 0.0, 1.5], up, 4), 0);
    }
}
