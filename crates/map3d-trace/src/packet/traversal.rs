//! The traversal of a ray packet through the BVHs of all parts of a region, nearest boxes first.

use map3d_base::{DEPTH_UNITS_PER_M, Vec3, ViewAxes, vec3};
use map3d_scene::records::{EMPTY, LEAF_BIT};
use map3d_scene::{Leaf, MaterialRecord, Node};

use super::origins::{AmbientOcclusion, PacketOrigins};
use super::ray_space::{ChildHits, RaySpacePart};
use super::rays::{PacketQuery, RayBounds, RayLanes};
use crate::boxes::BoxProjection;
use crate::cutout::{Cutout, CutoutSample};
use crate::lanes::{Kernel, Lanes};
use crate::part::LoadedPart;
use crate::projection::ProjectedTriangle;
use crate::surface::SurfaceAttributes;

/// The rays of a packet that were sent, and those that hit a triangle; bit k is the ray of point k.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HitMask {
    pub sent: u64,
    pub hit: u64,
}

/// A node or leaf on the traversal stack.
#[derive(Clone, Copy)]
pub(super) struct PacketEntry {
    child: u32,
    /// The least distance along the rays of its box.
    near: f32,
}

/// A triangle that was the closest hit of a ray.
#[derive(Clone, Copy)]
pub(super) struct HitTriangle {
    /// Index into the region's parts.
    pub part: u32,
    pub leaf: u32,
    pub lane: u8,
}

/// `ANY`: the first hit finishes a ray. Otherwise the closest triangle of each ray is found.
pub(super) struct PacketTraversal<'a, const ANY: bool> {
    pub parts: &'a [LoadedPart],
    pub ray_space_parts: &'a [RaySpacePart],
    /// The boxes of all parts, eight per node, and their map to ray space.
    pub part_nodes: &'a [Node],
    pub part_boxes: &'a BoxProjection,
    pub center: Vec3,
    pub axes: &'a ViewAxes,
    pub width_m: f64,
    pub cutout: &'a dyn Cutout,
    pub origins: &'a PacketOrigins,
    pub query: &'a PacketQuery,
    pub rays: &'a mut RayLanes,
    pub stack: &'a mut Vec<PacketEntry>,
    pub hit_triangles: &'a mut Vec<HitTriangle>,
    /// Accumulates the rays' ambient occlusion.
    pub ao: Option<&'a mut AmbientOcclusion>,
    /// Receives the result.
    pub result: &'a mut HitMask,
}

impl<const ANY: bool> Kernel for PacketTraversal<'_, ANY> {
    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        self.rays.send::<L::Floats16>(self.origins, self.query);
        self.result.sent = self.rays.active;
        if self.result.sent != 0 {
            self.traverse_region::<L>();
        }
        self.result.hit = self.result.sent & !self.rays.active;
        if let Some(ao) = self.ao.take() {
            self.rays.accumulate_ao::<L::Floats16>(self.result.sent, self.query.far_m, ao);
        }
    }
}

impl<'a, const ANY: bool> PacketTraversal<'a, ANY> {
    /// Traverses all parts whose boxes overlap the rays' bounds.
    #[inline(always)]
    fn traverse_region<L: Lanes>(&mut self) {
        let mut bounds = self.rays.bounds::<L::Floats16>();
        for node in self.part_nodes {
            let ChildHits { mut mask, near } = ChildHits::new::<L::Floats8>(self.part_boxes, node, &bounds);
            while mask != 0 {
                let k = mask.trailing_zeros() as usize & 7;
                mask &= mask - 1;
                if node.child[k] != EMPTY && near[k] <= bounds.hi[2] {
                    self.traverse_part::<L>(node.child[k], &mut bounds);
                    if self.rays.active == 0 {
                        return;
                    }
                }
            }
        }
    }

    /// Traverses the BVH of one part; `bounds` shrink as rays finish or shorten.
    #[inline(always)]
    fn traverse_part<L: Lanes>(&mut self, number: u32, bounds: &mut RayBounds) {
        let part = &self.parts[number as usize];
        let ray_space = &self.ray_space_parts[number as usize];
        let (nodes, leaves) = (part.chunk.nodes(), part.chunk.leaves());
        self.stack.clear();
        self.stack.push(PacketEntry { child: 0, near: f32::NEG_INFINITY });
        while let Some(entry) = self.stack.pop() {
            // Skip what is beyond the ends of all rays.
            if entry.near > bounds.hi[2] {
                continue;
            }

            // Intersect the triangles of a leaf.
            if entry.child & LEAF_BIT != 0 {
                let leaf = entry.child & !LEAF_BIT;
                if self.intersect_leaf::<L>(number, ray_space, leaf, &leaves[leaf as usize], bounds) {
                    if self.rays.active == 0 {
                        return;
                    }
                    *bounds = self.rays.bounds::<L::Floats16>();
                }
                continue;
            }

            // Push the children of a node, the nearest on top.
            let node = &nodes[entry.child as usize];
            let ChildHits { mut mask, near } = ChildHits::new::<L::Floats8>(&ray_space.boxes, node, bounds);
            let first = self.stack.len();
            while mask != 0 {
                let k = mask.trailing_zeros() as usize & 7;
                mask &= mask - 1;
                if node.child[k] != EMPTY {
                    self.insert(first, PacketEntry { child: node.child[k], near: near[k] });
                }
            }
        }
    }

    /// Inserts an entry into the sorted entries from `first` on, the nearest on top.
    #[inline(always)]
    fn insert(&mut self, first: usize, entry: PacketEntry) {
        let mut at = self.stack.len();
        self.stack.push(entry);
        while at > first && self.stack[at - 1].near < entry.near {
            self.stack[at] = self.stack[at - 1];
            at -= 1;
        }
        self.stack[at] = entry;
    }

    /// Intersects the rays with a leaf's triangles and returns whether any ray hits one.
    #[inline(always)]
    fn intersect_leaf<L: Lanes>(&mut self, number: u32, ray_space: &RaySpacePart, leaf_number: u32, leaf: &Leaf, bounds: &RayBounds) -> bool {
        let corners = ray_space.transform_leaf::<L::Floats8>(leaf);
        let mut mask = corners.overlapping_lanes::<L::Floats8>(bounds);
        let mut any = false;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & 7;
            mask &= mask - 1;
            let Some(triangle) = corners.triangle(lane) else { continue };

            // For a cut-out, keep only the rays that hit it where it is opaque.
            let allowed = match self.cutout_material(number, leaf.triangle[lane]) {
                None => u64::MAX,
                Some(material) => {
                    let hits = self.rays.hits::<L::Floats16>(&triangle);
                    if hits == 0 {
                        continue;
                    }
                    self.covered_rays(number, leaf_number, lane, hits, material)
                }
            };

            // Finish or shorten the rays.
            if self.rays.intersect::<L::Floats16, ANY>(&triangle, self.hit_triangles.len() as u32, allowed) {
                any = true;
                if !ANY {
                    self.hit_triangles.push(HitTriangle { part: number, leaf: leaf_number, lane: lane as u8 });
                }
            }
        }
        any
    }

    /// Returns the material of a triangle if it is a cut-out.
    #[inline(always)]
    fn cutout_material(&self, number: u32, triangle: u32) -> Option<&'a MaterialRecord> {
        let parts: &'a [LoadedPart] = self.parts;
        let chunk = &parts[number as usize].chunk;
        if !chunk.has_cutouts() {
            return None;
        }
        let material = &chunk.materials()[chunk.triangles()[triangle as usize].material as usize];
        material.is_cutout().then_some(material)
    }

    /// Returns those of the rays `hits` that hit a cut-out triangle where it is opaque.
    #[cold]
    #[inline(never)]
    fn covered_rays(&self, number: u32, leaf: u32, lane: usize, mut hits: u64, material: &MaterialRecord) -> u64 {
        // Texture coordinates over the rays' widths.
        let part = &self.parts[number as usize];
        let leaf = &part.chunk.leaves()[leaf as usize];
        let local = part.triangle_corners(leaf, lane);
        let pixel = local.map(|p| {
            let [x, y, d] = self.axes.uvd_from_local(vec3::sub(p, self.center));
            [x / self.width_m, -y / self.width_m, d * DEPTH_UNITS_PER_M]
        });
        let projected = ProjectedTriangle { local, pixel, forward: self.axes.forward };
        let [u, v] = SurfaceAttributes::new(part, 0, leaf.triangle[lane], &projected).uv;

        // The alpha test of each ray.
        let mask = self.cutout.prepare(material, &[u, v]);
        let mut covered = 0;
        while hits != 0 {
            let ray = hits.trailing_zeros();
            hits &= hits - 1;
            let [right, up] = self.rays.position(ray as usize);
            let (x, y) = (right / self.width_m as f32, -up / self.width_m as f32);
            let uv = [u.at(x, y), v.at(x, y)];
            let covers = match &mask {
                Some(mask) => mask.covers(uv),
                None => self.cutout.covers(material, &CutoutSample { uv, footprint: [[u.dx, v.dx], [u.dy, v.dy]] }),
            };
            covered |= u64::from(covers) << ray;
        }
        covered
    }
}
