//! The rays of a bundle as lanes, and the test of a triangle against all of them.

use super::patch::{GROUP, GROUPS, Lanes, Openness, Patch, RAYS};
use crate::lanes::Floats;

const NO_TRIANGLE: u32 = u32::MAX;

/// Rays of one direction, in metres across them (right, up) and along them. A ray that is done has NaN for coordinates, so that it meets nothing and
/// counts for no box.
#[derive(Clone)]
#[repr(C, align(64))]
pub(crate) struct RayLanes {
    right: Lanes,
    up: Lanes,
    /// A ray meets what lies beyond `near`, up to `far`.
    near: Lanes,
    far: Lanes,
    /// Cosine between direction and normal.
    cosine: Lanes,
    /// Least right, greatest right, least up, greatest up of the rays that were sent of each group.
    spans: [[f32; GROUPS]; 4],
    pub found: [u32; RAYS],
    /// Bit k: the k-th ray is not done.
    pub alive: u64,
}

/// A box around rays that are not done: right, up, along.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    pub lo: [f32; 3],
    pub hi: [f32; 3],
}

/// Rays to send from a patch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Aim {
    /// Unit vectors right, up, along.
    pub rows: [[f32; 3]; 3],
    pub near_m: f32,
    pub far_m: f32,
    /// Only from points whose surfaces face the direction.
    pub facing: bool,
}

impl RayLanes {
    pub fn new() -> Self {
        let none = [[f32::NAN; GROUP]; GROUPS];
        Self { right: none, up: none, near: none, far: none, cosine: none, spans: [[f32::NAN; GROUPS]; 4], found: [NO_TRIANGLE; RAYS], alive: 0 }
    }

    /// Sends rays from a patch; those are alive that there are.
    #[inline(always)]
    pub fn send<F: Floats<GROUP>>(&mut self, patch: &Patch, aim: &Aim) {
        self.found = [NO_TRIANGLE; RAYS];
        self.alive = patch.there;
        self.spans = [[f32::NAN; GROUPS]; 4];
        for g in 0..GROUPS {
            if (patch.there >> (g * GROUP)) as u16 == 0 {
                continue;
            }
            let at = [F::load(&patch.at[0][g]), F::load(&patch.at[1][g]), F::load(&patch.at[2][g])];
            let normal = [F::load(&patch.normal[0][g]), F::load(&patch.normal[1][g]), F::load(&patch.normal[2][g])];
            let along = dot(aim.rows[2], at);
            let cosine = dot(aim.rows[2], normal);
            dot(aim.rows[0], at).store(&mut self.right[g]);
            dot(aim.rows[1], at).store(&mut self.up[g]);
            along.add(F::splat(aim.near_m)).store(&mut self.near[g]);
            along.add(F::splat(aim.far_m)).store(&mut self.far[g]);
            cosine.store(&mut self.cosine[g]);
            let there = (patch.there >> (g * GROUP)) as u32 & 0xFFFF;
            let sent = if aim.facing { there & cosine.greater(F::splat(0.0)) } else { there };
            self.end::<F>(g, !sent);
            if sent != 0 {
                let (right, up) = (F::load(&self.right[g]), F::load(&self.up[g]));
                let (least, greatest) = (F::splat(f32::INFINITY), F::splat(f32::NEG_INFINITY));
                self.spans[0][g] = right.min(least).least();
                self.spans[1][g] = right.max(greatest).greatest();
                self.spans[2][g] = up.min(least).least();
                self.spans[3][g] = up.max(greatest).greatest();
            }
        }
    }

    /// Bit g: the box of a triangle meets rays of group g.
    #[inline(always)]
    fn groups_near(&self, t: &Triangle) -> u32 {
        let [r0, r1, u0, u1] = &self.spans;
        let mut near = [0u32; GROUPS];
        for g in 0..GROUPS {
            near[g] = u32::from((t.box_right[1] >= r0[g]) & (t.box_right[0] <= r1[g]) & (t.box_up[1] >= u0[g]) & (t.box_up[0] <= u1[g])) << g;
        }
        near[0] | near[1] | near[2] | near[3]
    }

    /// Ends rays of a group.
    #[inline(always)]
    fn end<F: Floats<GROUP>>(&mut self, g: usize, mask: u32) {
        let mask = mask & 0xFFFF;
        if mask == 0 {
            return;
        }
        let nan = F::splat(f32::NAN);
        nan.put(mask, &mut self.right[g]);
        nan.put(mask, &mut self.up[g]);
        nan.put(mask, &mut self.near[g]);
        nan.put(mask, &mut self.far[g]);
        self.alive &= !(u64::from(mask) << (g * GROUP));
    }

    #[inline(always)]
    fn is_done(&self, g: usize) -> bool {
        (self.alive >> (g * GROUP)) as u16 == 0
    }

    /// Around the rays that are not done.
    #[inline(always)]
    pub fn reach<F: Floats<GROUP>>(&self) -> Reach {
        let (least, greatest) = (F::splat(f32::INFINITY), F::splat(f32::NEG_INFINITY));
        let (mut lo, mut hi) = ([least; 3], [greatest; 3]);
        for g in 0..GROUPS {
            if self.is_done(g) {
                continue;
            }
            let (right, up) = (F::load(&self.right[g]), F::load(&self.up[g]));
            lo = [right.min(lo[0]), up.min(lo[1]), F::load(&self.near[g]).min(lo[2])];
            hi = [right.max(hi[0]), up.max(hi[1]), F::load(&self.far[g]).max(hi[2])];
        }
        Reach { lo: [lo[0].least(), lo[1].least(), lo[2].least()], hi: [hi[0].greatest(), hi[1].greatest(), hi[2].greatest()] }
    }

    /// Ends (`ANY`) or shortens the rays that meet the triangle, which is given a number; whether any does. `only`: bits of the rays that may.
    #[inline(always)]
    pub fn meet<F: Floats<GROUP>, const ANY: bool>(&mut self, triangle: &Triangle, number: u32, only: u64) -> bool {
        let mut any = false;
        let mut near = self.groups_near(triangle);
        while near != 0 {
            let g = near.trailing_zeros() as usize & (GROUPS - 1);
            near &= near - 1;
            if self.is_done(g) {
                continue;
            }
            let (hits, along) = self.hits::<F>(g, triangle);
            let hits = hits & (only >> (g * GROUP)) as u32;
            if hits == 0 {
                continue;
            }
            any = true;
            if ANY {
                self.end::<F>(g, hits);
            } else {
                along.put(hits, &mut self.far[g]);
                let mut rest = hits;
                while rest != 0 {
                    self.found[g * GROUP + (rest.trailing_zeros() as usize & (GROUP - 1))] = number;
                    rest &= rest - 1;
                }
            }
        }
        any
    }

    /// Bits of the rays that meet the triangle.
    #[inline(always)]
    pub fn meeting<F: Floats<GROUP>>(&self, triangle: &Triangle) -> u64 {
        let mut meeting = 0;
        let mut near = self.groups_near(triangle);
        while near != 0 {
            let g = near.trailing_zeros() as usize & (GROUPS - 1);
            near &= near - 1;
            if !self.is_done(g) {
                meeting |= u64::from(self.hits::<F>(g, triangle).0) << (g * GROUP);
            }
        }
        meeting
    }

    /// Which rays of a group meet a triangle, and where. On an edge counts as inside, whichever way round: corners are the same bits in all triangles
    /// that share them, and an edge's function changes no more than its sign when it is run the other way.
    #[inline(always)]
    fn hits<F: Floats<GROUP>>(&self, g: usize, t: &Triangle) -> (u32, F) {
        let (px, py) = (F::load(&self.right[g]), F::load(&self.up[g]));
        let corner = |k: usize| (F::splat(t.right[k]).sub(px), F::splat(t.up[k]).sub(py));
        let ((x0, y0), (x1, y1), (x2, y2)) = (corner(0), corner(1), corner(2));
        let (a, b, c) = (turn(x0, y0, x1, y1), turn(x1, y1, x2, y2), turn(x2, y2, x0, y0));
        let zero = F::splat(0.0);
        let left = a.at_least(zero) & b.at_least(zero) & c.at_least(zero);
        let inside = left | (zero.at_least(a) & zero.at_least(b) & zero.at_least(c));
        let along = F::splat(t.along[0]).sub(x0.mul(F::splat(t.slope[0]))).sub(y0.mul(F::splat(t.slope[1])));
        let along = along.max(F::splat(t.least)).min(F::splat(t.greatest));
        let within = along.greater(F::load(&self.near[g])) & F::load(&self.far[g]).at_least(along);
        let mut hits = inside & within;
        if hits != 0 {
            // Of a triangle seen nearly edge-on, rounding can let all edges have a point beside it: whether that is asked for depends on its company.
            hits &= F::splat(t.box_right[1]).at_least(px) & px.at_least(F::splat(t.box_right[0]));
            hits &= F::splat(t.box_up[1]).at_least(py) & py.at_least(F::splat(t.box_up[0]));
        }
        (hits, along)
    }

    /// Adds what rays from `near` on that came up to `far` say of the openness of their points (see `Bundles::add_open`).
    #[inline(always)]
    pub fn add_open<F: Floats<GROUP>>(&self, rays: u64, far_m: f32, openness: &mut Openness) {
        for g in 0..GROUPS {
            let mask = (rays >> (g * GROUP)) as u32 & 0xFFFF;
            if mask != 0 {
                let cosine = F::load(&self.cosine[g]);
                let share = F::load(&self.far[g]).sub(F::load(&self.near[g])).mul(F::splat(1.0 / far_m)).min(F::splat(1.0));
                F::load(&openness.all[g]).add(cosine).put(mask, &mut openness.all[g]);
                F::load(&openness.open[g]).add(cosine.mul(share.mul(share))).put(mask, &mut openness.open[g]);
            }
        }
    }

    /// Right and up of a ray.
    pub fn across(&self, ray: usize) -> [f32; 2] {
        [self.right[ray / GROUP][ray % GROUP], self.up[ray / GROUP][ray % GROUP]]
    }

    pub fn found(&self, ray: usize) -> Option<u32> {
        (self.found[ray] != NO_TRIANGLE).then_some(self.found[ray])
    }
}

#[inline(always)]
fn dot<F: Floats<GROUP>>(row: [f32; 3], p: [F; 3]) -> F {
    F::splat(row[0]).mul(p[0]).add(F::splat(row[1]).mul(p[1])).add(F::splat(row[2]).mul(p[2]))
}

#[inline(always)]
fn turn<F: Floats<GROUP>>(ax: F, ay: F, bx: F, by: F) -> F {
    ax.mul(by).sub(ay.mul(bx))
}

/// A triangle in the coordinates of the rays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    right: [f32; 3],
    up: [f32; 3],
    along: [f32; 3],
    /// Change of `along` a metre to the right and up.
    slope: [f32; 2],
    least: f32,
    greatest: f32,
    /// Least and greatest.
    box_right: [f32; 2],
    box_up: [f32; 2],
}

#[inline(always)]
fn range(v: [f32; 3]) -> [f32; 2] {
    let (low, high) = if v[0] < v[1] { (v[0], v[1]) } else { (v[1], v[0]) };
    [if v[2] < low { v[2] } else { low }, if v[2] > high { v[2] } else { high }]
}

impl Triangle {
    /// `None`: seen edge-on, which no ray meets.
    #[inline(always)]
    pub fn new(right: [f32; 3], up: [f32; 3], along: [f32; 3]) -> Option<Self> {
        let (ax, ay, az) = (right[1] - right[0], up[1] - up[0], along[1] - along[0]);
        let (bx, by, bz) = (right[2] - right[0], up[2] - up[0], along[2] - along[0]);
        let inverse = 1.0 / (ax * by - ay * bx);
        let slope = [(az * by - ay * bz) * inverse, (ax * bz - az * bx) * inverse];
        let [least, greatest] = range(along);
        let (box_right, box_up) = (range(right), range(up));
        (slope[0].is_finite() & slope[1].is_finite()).then_some(Self { right, up, along, slope, least, greatest, box_right, box_up })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{FloatLanes, Plain};
    use map3d_base::Vec3;

    type F = <Plain as FloatLanes>::Sixteen;

    fn triangle(along: [f32; 3]) -> Triangle {
        Triangle::new([0.0, 4.0, 0.0], [0.0, 0.0, 4.0], along).expect("a triangle")
    }

    /// Along z, right x, up y.
    fn rays(starts: &[Vec3], near_m: f32, far_m: f32) -> RayLanes {
        let mut patch = Patch::default();
        starts.iter().enumerate().for_each(|(k, p)| patch.put(k, *p, [0.0, 0.0, 1.0]));
        let mut out = RayLanes::new();
        out.send::<F>(&patch, &Aim { rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], near_m, far_m, facing: true });
        out
    }

    #[test]
    fn what_lies_between_near_and_far_is_met() {
        let slanted = triangle([10.0, 14.0, 10.0]);
        let mut rays = rays(&[[1.0, 1.0, 0.0], [3.0, 3.0, 0.0], [1.0, 1.0, 11.0], [2.0, 0.5, 0.0]], 0.0, 11.5);
        assert_eq!(rays.meeting::<F>(&slanted), 0b0001);
        assert!(rays.meet::<F, true>(&slanted, 5, u64::MAX));
        assert_eq!(rays.alive, 0b1110);
        assert!(!rays.meet::<F, true>(&slanted, 5, u64::MAX));
    }

    #[test]
    fn the_nearest_shortens_a_ray() {
        let mut rays = rays(&[[1.0, 1.0, 0.0]], 0.0, 100.0);
        assert!(rays.meet::<F, false>(&triangle([10.0; 3]), 1, u64::MAX));
        assert!(!rays.meet::<F, false>(&triangle([12.0; 3]), 2, u64::MAX));
        assert!(rays.meet::<F, false>(&triangle([9.0; 3]), 3, u64::MAX));
        assert_eq!((rays.found(0), rays.reach::<F>().hi[2]), (Some(3), 9.0));
    }

    #[test]
    fn a_triangle_seen_edge_on_is_not_one() {
        assert!(Triangle::new([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], [0.0, 5.0, 1.0]).is_none());
        assert!(Triangle::new([1.0; 3], [2.0; 3], [0.0, 5.0, 1.0]).is_none());
    }

    #[test]
    fn what_lies_beside_a_triangle_is_never_met() {
        let mut seed = 1u32;
        let mut near = move |v: f32| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            v + ((seed >> 29) as f32 - 3.5) * v.abs() * f32::EPSILON
        };
        let mut slivers = 0;
        for k in 0..4_000 {
            let turn = 0.2 + k as f32 * 1e-4;
            let (right, up) = ([1.0, 1.3, 1.9].map(&mut near), [turn, 1.3 * turn, 1.9 * turn].map(&mut near));
            let Some(sliver) = Triangle::new(right, up, [10.0; 3]) else { continue };
            slivers += 1;
            let beside = [0.7, 0.99, 1.91, 2.4].map(|v| [f64::from(near(v)), f64::from(near(v * turn)), 0.0]);
            assert_eq!(rays(&beside, 0.0, 100.0).meeting::<F>(&sliver), 0, "{sliver:?} {beside:?}");
            let corners = [0, 1, 2].map(|c| [f64::from(right[c]), f64::from(up[c]), 0.0]);
            assert_eq!(rays(&corners, 0.0, 100.0).meeting::<F>(&sliver), 0b111);
        }
        assert!(slivers > 1_000);
    }

    #[test]
    fn reach_is_around_the_rays_that_are_not_done() {
        let mut rays = rays(&[[1.0, -2.0, 3.0], [0.0, 5.0, 4.0], [1.0, 1.0, 0.0]], 0.5, 10.0);
        assert!(rays.meet::<F, true>(&triangle([8.0; 3]), 0, 0b100));
        let reach = rays.reach::<F>();
        assert_eq!((reach.lo, reach.hi), ([0.0, -2.0, 3.5], [1.0, 5.0, 14.0]));
        assert_eq!(RayLanes::new().reach::<F>().hi, [f32::NEG_INFINITY; 3]);
    }
}
