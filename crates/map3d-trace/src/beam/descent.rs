//! One part's tree, front to back: nodes that are outside or hidden are skipped, triangles of leaves drawn.

use std::cell::Cell;

use map3d_base::{DEPTH_UNITS_PER_M, Isa};
use map3d_scene::records::{EMPTY, LEAF_BIT};
use map3d_scene::{Chunk, InstanceRecord, Leaf, Node};

use super::boxes::{BoxMap, least_key};
use super::buffer::{GROUPS_PER_ROW, KeyPlane, Track};
use super::canvas::{Candidate, Canvas};
use super::corners::Corners;
use super::exact::Exact;
use super::project::Projection;
use super::shape::{Depth, Keys, PixelBox, bias, edges, is_near, key_plane, whole_steps};
use crate::cutout::Sheet;
use crate::lanes::Lanes;
use crate::surface::{Placed, Surface};
use crate::visbuf::NOTHING;

/// A node or leaf still to be visited.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    child: u32,
    /// The least key in it.
    key: i32,
    /// First column, first row, last column, last row of the groups it meets.
    groups: [u8; 4],
}

/// Groups that a box of pixels meets: x0, y0, x1, y1.
#[inline(always)]
pub(crate) fn groups(pixels: [f32; 4]) -> [u8; 4] {
    const LAST: f32 = (GROUPS_PER_ROW * 8 - 1) as f32;
    let mut out = [0; 4];
    for k in 0..4 {
        out[k] = pixels[k].clamp(0.0, LAST) as u8 >> 3;
    }
    out
}

pub(crate) struct Descent<'a> {
    chunk: &'a Chunk,
    instance: Option<&'a InstanceRecord>,
    projection: Projection<'a>,
    /// Index into the sub-tile's parts, and number in the scene.
    part: (u32, u32),
    canvas: Canvas<'a>,
    stack: &'a mut Vec<Entry>,
    map: BoxMap,
    /// Depth units in a pixel's side.
    pixel_units: f64,
}

impl<'a> Descent<'a> {
    pub fn new(
        chunk: &'a Chunk,
        instance: Option<&'a InstanceRecord>,
        projection: Projection<'a>,
        part: (u32, u32),
        canvas: Canvas<'a>,
        stack: &'a mut Vec<Entry>,
    ) -> Self {
        let map = BoxMap::new(&projection, chunk.origin(), &chunk.bounds(), instance.map(|i| &i.transform));
        let pixel_units = projection.frame.pixel_m(projection.frame.zmax) * DEPTH_UNITS_PER_M;
        Self { chunk, instance, projection, part, canvas, stack, map, pixel_units }
    }

    /// Runs with the lanes of an instruction set that this machine has.
    pub fn run(self, isa: Isa) {
        super::dispatch::run(self, isa);
    }

    #[inline(always)]
    pub fn run_with<L: Lanes>(mut self) {
        let (nodes, leaves) = (self.chunk.nodes(), self.chunk.leaves());
        self.stack.clear();
        self.stack.push(Entry { child: 0, key: i32::MIN, groups: [0, 0, 7, 7] });
        while let Some(entry) = self.stack.pop() {
            if !self.canvas.samples.can_win::<L>(entry.key, entry.groups) {
                continue;
            }
            if entry.child & LEAF_BIT == 0 {
                self.push_children::<L>(&nodes[entry.child as usize]);
            } else {
                let number = entry.child & !LEAF_BIT;
                self.leaf::<L>(number, &leaves[number as usize]);
            }
        }
    }

    /// Pushes the children that meet the sub-tile, the nearest on top.
    #[inline(always)]
    fn push_children<L: Lanes>(&mut self, node: &Node) {
        let boxes = self.map.children::<L>(node);
        let first = self.stack.len();
        let mut mask = boxes.mask;
        while mask != 0 {
            let k = mask.trailing_zeros() as usize & 7;
            mask &= mask - 1;
            if node.child[k] == EMPTY {
                continue;
            }
            let entry = Entry {
                child: node.child[k],
                key: least_key(boxes.near[k]),
                groups: groups([boxes.x[0][k], boxes.y[0][k], boxes.x[1][k], boxes.y[1][k]]),
            };
            let mut at = self.stack.len();
            self.stack.push(entry);
            while at > first && self.stack[at - 1].key < entry.key {
                self.stack[at] = self.stack[at - 1];
                at -= 1;
            }
            self.stack[at] = entry;
        }
    }

    #[inline(always)]
    fn leaf<L: Lanes>(&mut self, number: u32, leaf: &Leaf) {
        let transform = self.instance.map(|i| &i.transform);
        let corners = Corners::of(leaf, &self.projection, self.chunk.origin(), transform);
        let mut mask = corners.touching();
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & 7;
            mask &= mask - 1;
            let snapped = whole_steps(&corners.snapped, lane);
            if let Some(b) = PixelBox::of(&snapped) {
                self.triangle::<L>((number, leaf.triangle[lane], lane), &corners, &snapped, &b);
            }
        }
    }

    /// `place`: leaf, triangle in the chunk, lane.
    #[inline(always)]
    fn triangle<L: Lanes>(&mut self, place: (u32, u32, usize), corners: &Corners, snapped: &[[i64; 2]; 3], b: &PixelBox) {
        let pixel = corners.of_lane(place.2);
        let rank = self.chunk.triangles()[place.1 as usize].rank;
        let depth = Depth::of(&pixel, rank, self.pixel_units);
        let is_near = is_near(snapped);
        let plane = match (&depth, is_near) {
            (Some(depth), true) => key_plane::<L>(&pixel, depth, b),
            _ => Keys::Exact,
        };
        if matches!(plane, Keys::Nowhere) {
            return;
        }
        let edges = if is_near { edges::<L>(snapped) } else { None };
        if is_near && edges.is_none() {
            return;
        }
        match (plane, &edges) {
            (Keys::Plane(plane), Some(edges)) => {
                let candidate = self.candidate(place, rank, plane, true);
                self.canvas.draw(&candidate, b, edges);
            }
            _ => {
                let candidate = self.candidate(place, rank, KeyPlane::default(), false);
                let bias = depth.map_or_else(|| edge_on_bias(rank), |d| d.bias);
                self.canvas.draw_exact::<L>(&candidate, b, &Exact { snapped, pixel: &pixel, bias }, edges.as_ref());
            }
        }
    }

    #[inline(always)]
    fn candidate(&self, place: (u32, u32, usize), rank: u8, plane: KeyPlane, is_regular: bool) -> Candidate<'a> {
        let chunk = self.chunk;
        let record = &chunk.triangles()[place.1 as usize];
        let object_id = self.instance.map_or_else(|| chunk.objects()[record.object as usize].id, |i| i.object_id);
        let track = Track {
            plane,
            part: self.part.0,
            part_number: self.part.1,
            triangle: place.1,
            leaf: place.0,
            lane: place.2 as u8,
            rank,
            object_id,
            source: record.source,
        };
        let sheet = if chunk.has_cutouts() { self.sheet(place) } else { None };
        Candidate { track, is_regular, slot: Cell::new(NOTHING), sheet }
    }

    #[cold]
    #[inline(never)]
    fn sheet(&self, place: (u32, u32, usize)) -> Option<Sheet<'a>> {
        let record = &self.chunk.triangles()[place.1 as usize];
        let material = &self.chunk.materials()[record.material as usize];
        if !material.is_cutout() {
            return None;
        }
        let transform = self.instance.map(|i| &i.transform);
        let local = self.projection.local_corners(&self.chunk.leaves()[place.0 as usize], place.2, self.chunk.origin(), transform);
        let placed = Placed { local, pixel: local.map(|p| self.projection.pixel(p)), axes: self.projection.axes };
        let instance = self.instance.map(|i| (self.part.1, i));
        Some(Sheet::new(material, Surface::new(self.part.0, self.chunk, place.1, instance, &placed).uv))
    }
}

/// Bias of a triangle whose gradient is not finite.
fn edge_on_bias(rank: u8) -> i64 {
    bias([f64::INFINITY, 0.0], rank, 1.0)
}
