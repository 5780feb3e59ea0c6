//! Ray packets: up to 64 parallel rays at once, for shadows, ambient occlusion and second surfaces. A packet traverses a BVH as one box; triangles are
//! intersected with all of its rays, in coordinates along and across them (spec/pyramid.md §10).
//!
//! A `SceneRegion` holds the parts that rays can hit, `RayPackets` traces packets of one direction through it, and `PacketOrigins` are the points from
//! which a packet starts.

mod origins;
mod ray_space;
mod rays;
mod traversal;

use map3d_base::vec3::{cross, dot, normalized};
use map3d_base::{Box3, Error, Isa, RAY_LIFT_M, Result, Vec3, ViewAxes};
use map3d_scene::SceneStore;
use map3d_scene::lattice::{STEPS_PER_M, snap};

use crate::boxes::BoxProjection;
use crate::cutout::Cutout;
use crate::lanes::dispatch;
use crate::part::LoadedPart;
pub use origins::{AmbientOcclusion, PACKET_SIZE, PacketOrigins};
use ray_space::{PartBoxes, RaySpacePart};
use rays::{PacketQuery, RayLanes};
pub use traversal::HitMask;
use traversal::{HitTriangle, PacketEntry, PacketTraversal};

/// The open parts of a region of a scene.
pub struct SceneRegion {
    /// A lattice point; rays and corners are taken relative to it.
    center: Vec3,
    parts: Vec<LoadedPart>,
    boxes: PartBoxes,
}

impl SceneRegion {
    /// Returns the lattice point nearest to a local point.
    pub fn snap_center(p: Vec3) -> Vec3 {
        snap(p).map(|v| v as f64 / STEPS_PER_M)
    }

    /// Opens the parts whose local boxes `overlaps` accepts. `center` is a local lattice point near the rays' origins. Fails for another center, and for a
    /// chunk that cannot be read.
    pub fn open(scene: &SceneStore, center: Vec3, mut overlaps: impl FnMut(&Box3) -> bool) -> Result<Self> {
        if Self::snap_center(center) != center {
            return Err(Error::argument(format!("center {center:?} of a scene region is not a lattice point; use SceneRegion::snap_center")));
        }
        let mut numbers = Vec::new();
        scene.candidate_parts(&mut overlaps, &mut numbers);
        numbers.sort_unstable();
        let all = scene.parts();
        numbers.retain(|k| overlaps(&all[*k as usize].bounds));
        let parts = numbers.iter().map(|k| LoadedPart::load(scene, *k)).collect::<Result<Vec<_>>>()?;
        let boxes = PartBoxes::new(center, numbers.iter().map(|k| &all[*k as usize].bounds));
        Ok(Self { center, parts, boxes })
    }

    /// Opens the parts within `radius_m` of a local box.
    pub fn open_within(scene: &SceneStore, center: Vec3, bounds: &Box3, radius_m: f64) -> Result<Self> {
        let overlaps = |b: &Box3| (0..3).all(|k| b.lo[k] <= bounds.hi[k] + radius_m && b.hi[k] >= bounds.lo[k] - radius_m);
        Self::open(scene, center, overlaps)
    }

    /// Opens the parts that rays of a direction can hit if they start in a local box or within `RAY_LIFT_M` of it.
    pub fn open_ahead(scene: &SceneStore, center: Vec3, bounds: &Box3, direction: Vec3) -> Result<Self> {
        let axes = ray_axes(direction)?;
        let interval = |axis: Vec3, b: &Box3| {
            let (middle, half) = (dot(axis, b.center()), b.half_extents());
            let half = (0..3).map(|k| axis[k].abs() * half[k]).sum::<f64>() + RAY_LIFT_M;
            [middle - half, middle + half]
        };
        let overlaps = |b: &Box3| {
            let [right, up, along] = [axes.right, axes.up, axes.forward].map(|a| (interval(a, b), interval(a, bounds)));
            let intersect = |(a, b): ([f64; 2], [f64; 2])| a[0] <= b[1] && a[1] >= b[0];
            intersect(right) && intersect(up) && along.0[1] >= along.1[0]
        };
        Self::open(scene, center, overlaps)
    }

    /// The local point from which the positions of `PacketOrigins` count.
    pub fn center(&self) -> Vec3 {
        self.center
    }

    /// Returns whether the region has no parts, so that no ray hits anything.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// Prepares packets along a local direction of any length. `width_m` is the width over which cut-outs are filtered. Fails for a zero direction, and for
    /// an instruction set that this machine does not support.
    pub fn packets_along(&self, direction: Vec3, width_m: f64, isa: Isa) -> Result<RayPackets<'_>> {
        let axes = ray_axes(direction)?;
        if !Isa::available().contains(&isa) {
            return Err(Error::argument(format!("this machine does not support the instruction set {isa:?}; use one of {:?}", Isa::available())));
        }
        Ok(RayPackets {
            region: self,
            part_boxes: self.boxes.projection(&axes),
            ray_space_parts: self.parts.iter().map(|p| RaySpacePart::new(p, self.center, &axes)).collect(),
            axes,
            width_m: width_m.max(1e-6),
            isa,
            rays: RayLanes::new(),
            stack: Vec::new(),
            hit_triangles: Vec::new(),
        })
    }
}

/// Returns a direction with axes across it.
fn ray_axes(direction: Vec3) -> Result<ViewAxes> {
    let Some(forward) = normalized(direction) else { return Err(Error::argument("the direction of a ray packet must not be zero")) };
    let right = normalized(cross(forward, [0.0, 0.0, 1.0])).unwrap_or([1.0, 0.0, 0.0]);
    Ok(ViewAxes { right, up: cross(right, forward), forward })
}

/// The closest hits of a packet's rays.
#[derive(Clone, Debug)]
pub struct ClosestHits {
    /// Index into `triangles` for each ray; `None` if it hits nothing.
    pub triangle_of_ray: [Option<u32>; PACKET_SIZE],
    /// Local corners.
    pub triangles: Vec<[Vec3; 3]>,
}

/// Traces ray packets of one direction.
pub struct RayPackets<'a> {
    region: &'a SceneRegion,
    axes: ViewAxes,
    width_m: f64,
    isa: Isa,
    part_boxes: BoxProjection,
    ray_space_parts: Vec<RaySpacePart>,
    rays: RayLanes,
    stack: Vec<PacketEntry>,
    hit_triangles: Vec<HitTriangle>,
}

impl RayPackets<'_> {
    /// Sends a ray from each point whose surface faces the direction and finds those that hit a triangle within `far_m`.
    pub fn any_hit(&mut self, origins: &PacketOrigins, far_m: f64, cutout: &dyn Cutout) -> HitMask {
        let query = self.query(0.0, far_m, true);
        self.trace::<true>(origins, &query, cutout, None)
    }

    /// Sends the same rays as `any_hit` and accumulates their ambient occlusion. A ray's weight is the cosine between its direction and the normal; its
    /// visibility is min(1, t/far_m)² for a closest hit at the distance t.
    pub fn accumulate_ao(&mut self, origins: &PacketOrigins, far_m: f64, cutout: &dyn Cutout, ao: &mut AmbientOcclusion) {
        let query = self.query(0.0, far_m, true);
        self.trace::<false>(origins, &query, cutout, Some(ao));
    }

    /// Sends a ray from each point and finds its closest triangle beyond `near_m`.
    pub fn closest_hits(&mut self, origins: &PacketOrigins, near_m: f64, cutout: &dyn Cutout) -> ClosestHits {
        let query = self.query(near_m, f64::INFINITY, false);
        self.trace::<false>(origins, &query, cutout, None);

        // List each triangle once.
        let mut out = ClosestHits { triangle_of_ray: [None; PACKET_SIZE], triangles: Vec::new() };
        let mut indices = vec![None; self.hit_triangles.len()];
        for (k, triangle_of_ray) in out.triangle_of_ray.iter_mut().enumerate() {
            let Some(hit) = self.rays.hit(k) else { continue };
            *triangle_of_ray = *indices[hit as usize].get_or_insert_with(|| {
                out.triangles.push(self.local_corners(&self.hit_triangles[hit as usize]));
                Some(out.triangles.len() as u32 - 1)
            });
        }
        out
    }

    fn query(&self, near_m: f64, far_m: f64, only_facing: bool) -> PacketQuery {
        let axes = [self.axes.right, self.axes.up, self.axes.forward].map(|r| r.map(|v| v as f32));
        PacketQuery { axes, near_m: near_m as f32, far_m: far_m as f32, only_facing }
    }

    fn trace<const ANY: bool>(
        &mut self,
        origins: &PacketOrigins,
        query: &PacketQuery,
        cutout: &dyn Cutout,
        ao: Option<&mut AmbientOcclusion>,
    ) -> HitMask {
        self.hit_triangles.clear();
        let mut result = HitMask::default();
        let traversal = PacketTraversal::<ANY> {
            parts: &self.region.parts,
            ray_space_parts: &self.ray_space_parts,
            part_nodes: &self.region.boxes.nodes,
            part_boxes: &self.part_boxes,
            center: self.region.center,
            axes: &self.axes,
            width_m: self.width_m,
            cutout,
            origins,
            query,
            rays: &mut self.rays,
            stack: &mut self.stack,
            hit_triangles: &mut self.hit_triangles,
            ao,
            result: &mut result,
        };
        dispatch(traversal, self.isa);
        result
    }

    fn local_corners(&self, hit: &HitTriangle) -> [Vec3; 3] {
        let part = &self.region.parts[hit.part as usize];
        part.triangle_corners(&part.chunk.leaves()[hit.leaf as usize], hit.lane as usize)
    }
}
