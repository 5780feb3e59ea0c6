//! The way of a bundle through the trees of all parts, nearest boxes first.

use map3d_base::{DEPTH_UNITS_PER_M, Vec3, ViewAxes, vec3};
use map3d_scene::instances::place;
use map3d_scene::records::{EMPTY, LEAF_BIT};
use map3d_scene::{Leaf, MaterialRecord, Node};

use super::patch::{Openness, Patch};
use super::rays::{Aim, RayLanes, Reach};
use super::view::{PartView, children};
use super::{NearPart, Shadow};
use crate::beam::boxes::BoxMap;
use crate::cutout::{Cutout, CutoutSample};
use crate::lanes::FloatLanes;
use crate::surface::{Placed, Surface};

/// A node or leaf still to be visited, and where its box begins along the rays.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    child: u32,
    near: f32,
}

/// A triangle that was the nearest of some ray.
#[derive(Clone, Copy)]
pub(super) struct Met {
    pub part: u32,
    pub leaf: u32,
    pub lane: u8,
}

pub(super) struct Descent<'a> {
    pub parts: &'a [NearPart],
    /// The boxes of all parts.
    pub crowd: (&'a BoxMap, &'a [Node]),
    pub center: Vec3,
    pub axes: &'a ViewAxes,
    pub width_m: f64,
    pub views: &'a [PartView],
    pub stack: &'a mut Vec<Entry>,
    pub met: &'a mut Vec<Met>,
    pub cutout: &'a dyn Cutout,
    pub rays: &'a mut RayLanes,
    pub patch: &'a Patch,
    pub aim: &'a Aim,
    /// Where the cosines of rays are added.
    pub openness: Option<&'a mut Openness>,
    pub shadow: &'a mut Shadow,
}

impl<'a> Descent<'a> {
    /// `ANY`: the first hit ends a ray; else the nearest triangle of each ray is found.
    #[inline(always)]
    pub fn run<L: FloatLanes, const ANY: bool>(mut self) {
        self.rays.send::<L::Sixteen>(self.patch, self.aim);
        self.shadow.sent = self.rays.alive;
        if self.shadow.sent != 0 {
            self.all_parts::<L, ANY>();
        }
        self.shadow.hit = self.shadow.sent & !self.rays.alive;
        if let Some(openness) = self.openness.take() {
            self.rays.add_open::<L::Sixteen>(self.shadow.sent, self.aim.far_m, openness);
        }
    }

    #[inline(always)]
    fn all_parts<L: FloatLanes, const ANY: bool>(&mut self) {
        let mut reach = self.rays.reach::<L::Sixteen>();
        let (map, nodes) = self.crowd;
        for node in nodes {
            let (mut mask, near) = children::<L::Eight>(map, node, &reach);
            while mask != 0 {
                let k = mask.trailing_zeros() as usize & 7;
                mask &= mask - 1;
                if node.child[k] != EMPTY && near[k] <= reach.hi[2] {
                    self.part::<L, ANY>(node.child[k], &mut reach);
                    if self.rays.alive == 0 {
                        return;
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn part<L: FloatLanes, const ANY: bool>(&mut self, number: u32, reach: &mut Reach) {
        let part = &self.parts[number as usize];
        let view = &self.views[number as usize];
        let (nodes, leaves) = (part.chunk.nodes(), part.chunk.leaves());
        self.stack.clear();
        self.stack.push(Entry { child: 0, near: f32::NEG_INFINITY });
        while let Some(entry) = self.stack.pop() {
            if entry.near > reach.hi[2] {
                continue;
            }
            if entry.child & LEAF_BIT != 0 {
                let leaf = entry.child & !LEAF_BIT;
                if self.leaf::<L, ANY>(number, view, leaf, &leaves[leaf as usize], reach) {
                    if self.rays.alive == 0 {
                        return;
                    }
                    *reach = self.rays.reach::<L::Sixteen>();
                }
                continue;
            }
            let node = &nodes[entry.child as usize];
            let (mut mask, near) = children::<L::Eight>(&view.boxes, node, reach);
            let first = self.stack.len();
            while mask != 0 {
                let k = mask.trailing_zeros() as usize & 7;
                mask &= mask - 1;
                if node.child[k] != EMPTY {
                    self.insert(first, Entry { child: node.child[k], near: near[k] });
                }
            }
        }
    }

    /// Keeps the entries from `first` on in order, the nearest on top.
    #[inline(always)]
    fn insert(&mut self, first: usize, entry: Entry) {
        let mut at = self.stack.len();
        self.stack.push(entry);
        while at > first && self.stack[at - 1].near < entry.near {
            self.stack[at] = self.stack[at - 1];
            at -= 1;
        }
        self.stack[at] = entry;
    }

    /// Whether any ray meets a triangle of the leaf.
    #[inline(always)]
    fn leaf<L: FloatLanes, const ANY: bool>(&mut self, number: u32, view: &PartView, leaf_number: u32, leaf: &Leaf, reach: &Reach) -> bool {
        let corners = view.corners::<L::Eight>(leaf);
        let mut mask = corners.meeting::<L::Eight>(reach);
        let mut any = false;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & 7;
            mask &= mask - 1;
            let Some(triangle) = corners.triangle(lane) else { continue };
            let only = match self.sheet(number, leaf.triangle[lane]) {
                None => u64::MAX,
                Some(material) => {
                    let meeting = self.rays.meeting::<L::Sixteen>(&triangle);
                    if meeting == 0 {
                        continue;
                    }
                    self.uncut(number, leaf_number, lane, meeting, material)
                }
            };
            if self.rays.meet::<L::Sixteen, ANY>(&triangle, self.met.len() as u32, only) {
                any = true;
                if !ANY {
                    self.met.push(Met { part: number, leaf: leaf_number, lane: lane as u8 });
                }
            }
        }
        any
    }

    /// The material of a triangle that may be cut out.
    #[inline(always)]
    fn sheet(&self, number: u32, triangle: u32) -> Option<&'a MaterialRecord> {
        let parts: &'a [NearPart] = self.parts;
        let chunk = &parts[number as usize].chunk;
        if !chunk.has_cutouts() {
            return None;
        }
        let material = &chunk.materials()[chunk.triangles()[triangle as usize].material as usize];
        material.is_cutout().then_some(material)
    }

    /// Those of the rays that meet a triangle for which it is not cut out, a bit each.
    #[cold]
    #[inline(never)]
    fn uncut(&self, number: u32, leaf: u32, lane: usize, mut meeting: u64, material: &MaterialRecord) -> u64 {
        let part = &self.parts[number as usize];
        let record = part.chunk.leaves()[leaf as usize].triangle[lane];
        let local = local_corners(part, leaf, lane);
        let pixel = local.map(|p| {
            let [x, y, d] = self.axes.uvd_from_local(vec3::sub(p, self.center));
            [x / self.width_m, -y / self.width_m, d * DEPTH_UNITS_PER_M]
        });
        let instance = part.instance.as_ref().map(|(k, record)| (*k, record));
        let [u, v] = Surface::new(0, &part.chunk, record, instance, &Placed { local, pixel, axes: self.axes }).uv;
        let stencil = self.cutout.stencil(material, &[u, v]);
        let mut there = 0;
        while meeting != 0 {
            let ray = meeting.trailing_zeros();
            meeting &= meeting - 1;
            let [right, up] = self.rays.across(ray as usize);
            let (x, y) = (right / self.width_m as f32, -up / self.width_m as f32);
            let uv = [u.at(x, y), v.at(x, y)];
            let covers = match &stencil {
                Some(stencil) => stencil.covers(uv),
                None => self.cutout.covers(material, &CutoutSample { uv, footprint: [[u.dx, v.dx], [u.dy, v.dy]] }),
            };
            there |= u64::from(covers) << ray;
        }
        there
    }
}

/// Corners of a leaf's triangle where its part lies.
pub(super) fn local_corners(part: &NearPart, leaf: u32, lane: usize) -> [Vec3; 3] {
    let (leaf, origin) = (&part.chunk.leaves()[leaf as usize], part.chunk.origin());
    [0, 3, 6].map(|c| {
        let p = [0, 1, 2].map(|k| origin[k] + f64::from(leaf.corners[c + k][lane]));
        part.instance.as_ref().map_or(p, |(_, record)| place(&record.transform, p))
    })
}
