//! The rays of a packet as lanes, and the intersection of a triangle with all of them.

use super::origins::{AmbientOcclusion, GROUP, GROUPS, PACKET_SIZE, PacketOrigins, PerRay};
use crate::lanes::Floats;

const NO_HIT: u32 = u32::MAX;

/// The rays of one direction in ray space: metres right, up and along the direction. A finished ray has NaN coordinates, so that it hits no triangle and
/// does not count in bounds.
#[derive(Clone)]
#[repr(C, align(64))]
pub(crate) struct RayLanes {
    right: PerRay,
    up: PerRay,
    /// A ray hits triangles beyond `near`, up to `far`.
    near: PerRay,
    far: PerRay,
    /// Cosine between direction and normal.
    cosine: PerRay,
    group_bounds: GroupBounds,
    /// The triangle that each ray has hit last, by the caller's number.
    hit: [u32; PACKET_SIZE],
    /// Bit k is set while ray k is active.
    pub active: u64,
}

/// Bounds of the rays that were sent, by group, across the direction.
#[derive(Clone, Copy)]
struct GroupBounds {
    right_lo: [f32; GROUPS],
    right_hi: [f32; GROUPS],
    up_lo: [f32; GROUPS],
    up_hi: [f32; GROUPS],
}

impl GroupBounds {
    const NONE: Self = Self { right_lo: [f32::NAN; GROUPS], right_hi: [f32::NAN; GROUPS], up_lo: [f32::NAN; GROUPS], up_hi: [f32::NAN; GROUPS] };
}

/// The box around the active rays: right, up, along.
#[derive(Clone, Copy, Debug)]
pub(super) struct RayBounds {
    pub lo: [f32; 3],
    pub hi: [f32; 3],
}

/// The rays to send from the origins of a packet.
#[derive(Clone, Copy, Debug)]
pub(super) struct PacketQuery {
    /// Unit vectors right, up, along.
    pub axes: [[f32; 3]; 3],
    pub near_m: f32,
    pub far_m: f32,
    /// Sends rays only from points whose surfaces face the direction.
    pub only_facing: bool,
}

/// The rays of a group that hit a triangle, and the distances of all lanes along the direction.
struct GroupHits<F> {
    mask: u32,
    along: F,
}

impl RayLanes {
    pub fn new() -> Self {
        let none = [[f32::NAN; GROUP]; GROUPS];
        Self { right: none, up: none, near: none, far: none, cosine: none, group_bounds: GroupBounds::NONE, hit: [NO_HIT; PACKET_SIZE], active: 0 }
    }

    /// Starts the rays of a query.
    #[inline(always)]
    pub fn send<F: Floats<GROUP>>(&mut self, origins: &PacketOrigins, query: &PacketQuery) {
        self.hit = [NO_HIT; PACKET_SIZE];
        self.active = origins.mask;
        self.group_bounds = GroupBounds::NONE;
        for g in 0..GROUPS {
            let exists = (origins.mask >> (g * GROUP)) as u32 & 0xFFFF;
            if exists == 0 {
                continue;
            }

            // Transform origins and normals to ray space.
            let load = |v: &[PerRay; 3]| [F::load(&v[0][g]), F::load(&v[1][g]), F::load(&v[2][g])];
            let (position, normal) = (load(&origins.position), load(&origins.normal));
            let along = dot(query.axes[2], position);
            let cosine = dot(query.axes[2], normal);
            dot(query.axes[0], position).store(&mut self.right[g]);
            dot(query.axes[1], position).store(&mut self.up[g]);
            along.add(F::splat(query.near_m)).store(&mut self.near[g]);
            along.add(F::splat(query.far_m)).store(&mut self.far[g]);
            cosine.store(&mut self.cosine[g]);

            // Finish the lanes without a ray.
            let sent = if query.only_facing { exists & cosine.greater(F::splat(0.0)) } else { exists };
            self.finish::<F>(g, !sent);

            // Bound the others.
            if sent != 0 {
                let (right, up) = (F::load(&self.right[g]), F::load(&self.up[g]));
                let (least, greatest) = (F::splat(f32::INFINITY), F::splat(f32::NEG_INFINITY));
                self.group_bounds.right_lo[g] = right.min(least).least();
                self.group_bounds.right_hi[g] = right.max(greatest).greatest();
                self.group_bounds.up_lo[g] = up.min(least).least();
                self.group_bounds.up_hi[g] = up.max(greatest).greatest();
            }
        }
    }

    /// Finishes rays of a group.
    #[inline(always)]
    fn finish<F: Floats<GROUP>>(&mut self, g: usize, mask: u32) {
        let mask = mask & 0xFFFF;
        if mask == 0 {
            return;
        }
        let nan = F::splat(f32::NAN);
        nan.put(mask, &mut self.right[g]);
        nan.put(mask, &mut self.up[g]);
        nan.put(mask, &mut self.near[g]);
        nan.put(mask, &mut self.far[g]);
        self.active &= !(u64::from(mask) << (g * GROUP));
    }

    #[inline(always)]
    fn is_finished(&self, g: usize) -> bool {
        (self.active >> (g * GROUP)) as u16 == 0
    }

    /// Returns the box around the active rays.
    #[inline(always)]
    pub fn bounds<F: Floats<GROUP>>(&self) -> RayBounds {
        let (least, greatest) = (F::splat(f32::INFINITY), F::splat(f32::NEG_INFINITY));
        let (mut lo, mut hi) = ([least; 3], [greatest; 3]);
        for g in 0..GROUPS {
            if self.is_finished(g) {
                continue;
            }
            let (right, up) = (F::load(&self.right[g]), F::load(&self.up[g]));
            lo = [right.min(lo[0]), up.min(lo[1]), F::load(&self.near[g]).min(lo[2])];
            hi = [right.max(hi[0]), up.max(hi[1]), F::load(&self.far[g]).max(hi[2])];
        }
        RayBounds { lo: [lo[0].least(), lo[1].least(), lo[2].least()], hi: [hi[0].greatest(), hi[1].greatest(), hi[2].greatest()] }
    }

    /// Intersects a triangle with the rays of the mask `allowed` and returns whether any hits it. Any hit (`ANY`) finishes a ray; otherwise the ray is
    /// shortened to the triangle and remembers `number`.
    #[inline(always)]
    pub fn intersect<F: Floats<GROUP>, const ANY: bool>(&mut self, triangle: &RaySpaceTriangle, number: u32, allowed: u64) -> bool {
        let mut any = false;
        let mut groups = self.groups_near(triangle);
        while groups != 0 {
            let g = groups.trailing_zeros() as usize & (GROUPS - 1);
            groups &= groups - 1;
            if self.is_finished(g) {
                continue;
            }
            let GroupHits { mask, along } = self.intersect_group::<F>(g, triangle);
            let hits = mask & (allowed >> (g * GROUP)) as u32;
            if hits == 0 {
                continue;
            }
            any = true;
            if ANY {
                self.finish::<F>(g, hits);
            } else {
                along.put(hits, &mut self.far[g]);
                let mut rest = hits;
                while rest != 0 {
                    self.hit[g * GROUP + (rest.trailing_zeros() as usize & (GROUP - 1))] = number;
                    rest &= rest - 1;
                }
            }
        }
        any
    }

    /// Returns the mask of the rays that hit a triangle, without changing them.
    #[inline(always)]
    pub fn hits<F: Floats<GROUP>>(&self, triangle: &RaySpaceTriangle) -> u64 {
        let mut hits = 0;
        let mut groups = self.groups_near(triangle);
        while groups != 0 {
            let g = groups.trailing_zeros() as usize & (GROUPS - 1);
            groups &= groups - 1;
            if !self.is_finished(g) {
                hits |= u64::from(self.intersect_group::<F>(g, triangle).mask) << (g * GROUP);
            }
        }
        hits
    }

    /// Returns the mask of the groups whose bounds overlap the triangle's box.
    #[inline(always)]
    fn groups_near(&self, t: &RaySpaceTriangle) -> u32 {
        let b = &self.group_bounds;
        let mut near = [0u32; GROUPS];
        for g in 0..GROUPS {
            let right = (t.box_right.max >= b.right_lo[g]) & (t.box_right.min <= b.right_hi[g]);
            near[g] = u32::from(right & (t.box_up.max >= b.up_lo[g]) & (t.box_up.min <= b.up_hi[g])) << g;
        }
        near[0] | near[1] | near[2] | near[3]
    }

    /// Intersects a triangle with the rays of a group. A point on an edge counts as inside for both windings: all triangles that share a corner have it with
    /// the same bits, and reversing an edge changes only the sign of its edge function. So no ray slips through a shared edge.
    #[inline(always)]
    fn intersect_group<F: Floats<GROUP>>(&self, g: usize, t: &RaySpaceTriangle) -> GroupHits<F> {
        // Edge functions, with the rays at the origin.
        let (px, py) = (F::load(&self.right[g]), F::load(&self.up[g]));
        let corner = |k: usize| (F::splat(t.right[k]).sub(px), F::splat(t.up[k]).sub(py));
        let ((x0, y0), (x1, y1), (x2, y2)) = (corner(0), corner(1), corner(2));
        let (a, b, c) = (cross(x0, y0, x1, y1), cross(x1, y1, x2, y2), cross(x2, y2, x0, y0));

        // Inside for either winding.
        let zero = F::splat(0.0);
        let left = a.at_least(zero) & b.at_least(zero) & c.at_least(zero);
        let inside = left | (zero.at_least(a) & zero.at_least(b) & zero.at_least(c));

        // Distance along the rays on the triangle's plane, clamped to the triangle's range.
        let along = F::splat(t.along[0]).sub(x0.mul(F::splat(t.slope[0]))).sub(y0.mul(F::splat(t.slope[1])));
        let along = along.max(F::splat(t.box_along.min)).min(F::splat(t.box_along.max));
        let within = along.greater(F::load(&self.near[g])) & F::load(&self.far[g]).at_least(along);

        // For a triangle seen nearly edge-on, rounding can put a point outside of its box inside all edges. Such hits would depend on the other rays of the
        // packet, so reject them.
        let mut mask = inside & within;
        if mask != 0 {
            mask &= F::splat(t.box_right.max).at_least(px) & px.at_least(F::splat(t.box_right.min));
            mask &= F::splat(t.box_up.max).at_least(py) & py.at_least(F::splat(t.box_up.min));
        }
        GroupHits { mask, along }
    }

    /// Adds the rays of a mask to the ambient occlusion of their points (see `RayPackets::accumulate_ao`).
    #[inline(always)]
    pub fn accumulate_ao<F: Floats<GROUP>>(&self, rays: u64, far_m: f32, ao: &mut AmbientOcclusion) {
        for g in 0..GROUPS {
            let mask = (rays >> (g * GROUP)) as u32 & 0xFFFF;
            if mask != 0 {
                let cosine = F::load(&self.cosine[g]);
                let distance = F::load(&self.far[g]).sub(F::load(&self.near[g])).mul(F::splat(1.0 / far_m)).min(F::splat(1.0));
                F::load(&ao.total[g]).add(cosine).put(mask, &mut ao.total[g]);
                F::load(&ao.visible[g]).add(cosine.mul(distance.mul(distance))).put(mask, &mut ao.visible[g]);
            }
        }
    }

    /// Returns right and up of a ray.
    pub fn position(&self, ray: usize) -> [f32; 2] {
        [self.right[ray / GROUP][ray % GROUP], self.up[ray / GROUP][ray % GROUP]]
    }

    /// Returns the number of the triangle that a ray has hit last.
    pub fn hit(&self, ray: usize) -> Option<u32> {
        (self.hit[ray] != NO_HIT).then_some(self.hit[ray])
    }
}

#[inline(always)]
fn dot<F: Floats<GROUP>>(row: [f32; 3], p: [F; 3]) -> F {
    F::splat(row[0]).mul(p[0]).add(F::splat(row[1]).mul(p[1])).add(F::splat(row[2]).mul(p[2]))
}

#[inline(always)]
fn cross<F: Floats<GROUP>>(ax: F, ay: F, bx: F, by: F) -> F {
    ax.mul(by).sub(ay.mul(bx))
}

#[derive(Clone, Copy, Debug)]
struct MinMax {
    min: f32,
    max: f32,
}

impl MinMax {
    #[inline(always)]
    fn of(v: [f32; 3]) -> Self {
        let (lo, hi) = if v[0] < v[1] { (v[0], v[1]) } else { (v[1], v[0]) };
        Self { min: if v[2] < lo { v[2] } else { lo }, max: if v[2] > hi { v[2] } else { hi } }
    }
}

/// A triangle in ray space.
#[derive(Clone, Copy, Debug)]
pub(super) struct RaySpaceTriangle {
    right: [f32; 3],
    up: [f32; 3],
    along: [f32; 3],
    /// Change of `along` per metre to the right and up.
    slope: [f32; 2],
    box_right: MinMax,
    box_up: MinMax,
    box_along: MinMax,
}

impl RaySpaceTriangle {
    /// Returns `None` for a triangle seen edge-on, which no ray hits.
    #[inline(always)]
    pub fn new(right: [f32; 3], up: [f32; 3], along: [f32; 3]) -> Option<Self> {
        let (ax, ay, az) = (right[1] - right[0], up[1] - up[0], along[1] - along[0]);
        let (bx, by, bz) = (right[2] - right[0], up[2] - up[0], along[2] - along[0]);
        let inverse = 1.0 / (ax * by - ay * bx);
        let slope = [(az * by - ay * bz) * inverse, (ax * bz - az * bx) * inverse];
        let (box_right, box_up, box_along) = (MinMax::of(right), MinMax::of(up), MinMax::of(along));
        (slope[0].is_finite() & slope[1].is_finite()).then_some(Self { right, up, along, slope, box_right, box_up, box_along })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Scalar;
    use map3d_base::Vec3;

    type F = <Scalar as crate::lanes::FloatLanes>::Floats16;

    fn triangle(along: [f32; 3]) -> RaySpaceTriangle {
        RaySpaceTriangle::new([0.0, 4.0, 0.0], [0.0, 0.0, 4.0], along).expect("a triangle")
    }

    /// Rays along z; right is x, up is y.
    fn rays(starts: &[Vec3], near_m: f32, far_m: f32) -> RayLanes {
        let mut origins = PacketOrigins::default();
        starts.iter().enumerate().for_each(|(k, p)| origins.set(k, *p, [0.0, 0.0, 1.0]));
        let mut out = RayLanes::new();
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        out.send::<F>(&origins, &PacketQuery { axes, near_m, far_m, only_facing: true });
        out
    }

    #[test]
    fn rays_hit_only_triangles_between_near_and_far() {
        let slanted = triangle([10.0, 14.0, 10.0]);
        let mut rays = rays(&[[1.0, 1.0, 0.0], [3.0, 3.0, 0.0], [1.0, 1.0, 11.0], [2.0, 0.5, 0.0]], 0.0, 11.5);
        assert_eq!(rays.hits::<F>(&slanted), 0b0001);
        assert!(rays.intersect::<F, true>(&slanted, 5, u64::MAX));
        assert_eq!(rays.active, 0b1110);
        assert!(!rays.intersect::<F, true>(&slanted, 5, u64::MAX));
    }

    #[test]
    fn closest_hit_shortens_a_ray() {
        let mut rays = rays(&[[1.0, 1.0, 0.0]], 0.0, 100.0);
        assert!(rays.intersect::<F, false>(&triangle([10.0; 3]), 1, u64::MAX));
        assert!(!rays.intersect::<F, false>(&triangle([12.0; 3]), 2, u64::MAX));
        assert!(rays.intersect::<F, false>(&triangle([9.0; 3]), 3, u64::MAX));
        assert_eq!((rays.hit(0), rays.bounds::<F>().hi[2]), (Some(3), 9.0));
    }

    #[test]
    fn triangle_seen_edge_on_is_rejected() {
        assert!(RaySpaceTriangle::new([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], [0.0, 5.0, 1.0]).is_none());
        assert!(RaySpaceTriangle::new([1.0; 3], [2.0; 3], [0.0, 5.0, 1.0]).is_none());
    }

    #[test]
    fn rays_outside_of_a_triangles_box_never_hit_it() {
        let mut seed = 1u32;
        let mut near = move |v: f32| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            v + ((seed >> 29) as f32 - 3.5) * v.abs() * f32::EPSILON
        };
        let mut slivers = 0;
        for k in 0..4_000 {
            let slope = 0.2 + k as f32 * 1e-4;
            let (right, up) = ([1.0, 1.3, 1.9].map(&mut near), [slope, 1.3 * slope, 1.9 * slope].map(&mut near));
            let Some(sliver) = RaySpaceTriangle::new(right, up, [10.0; 3]) else { continue };
            slivers += 1;
            let outside = [0.7, 0.99, 1.91, 2.4].map(|v| [f64::from(near(v)), f64::from(near(v * slope)), 0.0]);
            assert_eq!(rays(&outside, 0.0, 100.0).hits::<F>(&sliver), 0, "{sliver:?} {outside:?}");
            let corners = [0, 1, 2].map(|c| [f64::from(right[c]), f64::from(up[c]), 0.0]);
            assert_eq!(rays(&corners, 0.0, 100.0).hits::<F>(&sliver), 0b111);
        }
        assert!(slivers > 1_000);
    }

    #[test]
    fn bounds_contain_only_active_rays() {
        let mut rays = rays(&[[1.0, -2.0, 3.0], [0.0, 5.0, 4.0], [1.0, 1.0, 0.0]], 0.5, 10.0);
        assert!(rays.intersect::<F, true>(&triangle([8.0; 3]), 0, 0b100));
        let bounds = rays.bounds::<F>();
        assert_eq!((bounds.lo, bounds.hi), ([0.0, -2.0, 3.5], [1.0, 5.0, 14.0]));
        assert_eq!(RayLanes::new().bounds::<F>().hi, [f32::NEG_INFINITY; 3]);
    }
}
