//! The traversal of one part's BVH by a beam, front to back: nodes that are outside or hidden are skipped, the triangles of leaves are rasterised.

use std::cell::Cell;

use map3d_base::DEPTH_UNITS_PER_M;
use map3d_scene::records::{EMPTY, LEAF_BIT};
use map3d_scene::{Leaf, Node};

use super::child_boxes::{ChildBoxes, subtile_boxes};
use super::edges::{is_near, triangle_edges};
use super::exact::ExactTriangle;
use super::key_plane::{DepthKeyPlane, KeySetup, TriangleDepth};
use super::pixels::{PixelBox, SnappedCorners};
use super::rasterizer::{Candidate, Rasterizer};
use super::sample_buffer::{GroupBox, NOTHING, VisibleTriangle};
use super::vertices::ProjectedLeaf;
use crate::boxes::BoxProjection;
use crate::cutout::CutoutTriangle;
use crate::depth_key::{TieBreak, edge_on_bias};
use crate::lanes::{Kernel, Lanes};
use crate::part::LoadedPart;
use crate::projection::SubtileProjection;
use crate::surface::SurfaceAttributes;

/// A node or leaf on the traversal stack.
#[derive(Clone, Copy)]
pub(crate) struct BeamEntry {
    child: u32,
    /// Lower bound of the depth keys in it.
    least_key: i32,
    groups: GroupBox,
}

/// Position of a triangle in its chunk.
#[derive(Clone, Copy)]
struct LeafTriangle {
    leaf: u32,
    lane: usize,
    /// Index into `Chunk::triangles`.
    triangle: u32,
}

pub(crate) struct BeamTraversal<'a> {
    part: &'a LoadedPart,
    /// Index into `VisBuf::parts`.
    part_index: u32,
    projection: SubtileProjection<'a>,
    rasterizer: Rasterizer<'a>,
    stack: &'a mut Vec<BeamEntry>,
    boxes: BoxProjection,
    /// Depth units in a pixel's side.
    pixel_units: f64,
}

impl Kernel for BeamTraversal<'_> {
    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        let (nodes, leaves) = (self.part.chunk.nodes(), self.part.chunk.leaves());
        self.stack.clear();
        self.stack.push(BeamEntry { child: 0, least_key: i32::MIN, groups: GroupBox::ALL });
        while let Some(entry) = self.stack.pop() {
            // Skip what has been hidden since it was pushed.
            if !self.rasterizer.samples.can_win::<L>(entry.least_key, entry.groups) {
                continue;
            }
            if entry.child & LEAF_BIT == 0 {
                self.push_children::<L>(&nodes[entry.child as usize]);
            } else {
                let number = entry.child & !LEAF_BIT;
                self.draw_leaf::<L>(number, &leaves[number as usize]);
            }
        }
    }
}

impl<'a> BeamTraversal<'a> {
    /// `part_index`: index into `VisBuf::parts`.
    pub fn new(
        part: &'a LoadedPart,
        part_index: u32,
        projection: SubtileProjection<'a>,
        rasterizer: Rasterizer<'a>,
        stack: &'a mut Vec<BeamEntry>,
    ) -> Self {
        let boxes = subtile_boxes(&projection, part);
        let pixel_units = projection.frame.pixel_m(projection.frame.zmax) * DEPTH_UNITS_PER_M;
        Self { part, part_index, projection, rasterizer, stack, boxes, pixel_units }
    }

    /// Pushes the children that overlap the sub-tile, the nearest on top.
    #[inline(always)]
    fn push_children<L: Lanes>(&mut self, node: &Node) {
        let boxes = ChildBoxes::new::<L>(&self.boxes, node);
        let first = self.stack.len();
        let mut mask = boxes.mask;
        while mask != 0 {
            let k = mask.trailing_zeros() as usize & 7;
            mask &= mask - 1;
            if node.child[k] == EMPTY {
                continue;
            }
            let entry = BeamEntry { child: node.child[k], least_key: boxes.least_depth_key(k), groups: boxes.groups(k) };

            // Insertion sort by distance.
            let mut at = self.stack.len();
            self.stack.push(entry);
            while at > first && self.stack[at - 1].least_key < entry.least_key {
                self.stack[at] = self.stack[at - 1];
                at -= 1;
            }
            self.stack[at] = entry;
        }
    }

    /// Projects a leaf's triangles at once and draws those that have a sample in the sub-tile.
    #[inline(always)]
    fn draw_leaf<L: Lanes>(&mut self, number: u32, leaf: &Leaf) {
        let projected = ProjectedLeaf::new(leaf, self.part, &self.projection);
        let mut mask = projected.overlapping_lanes();
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & 7;
            mask &= mask - 1;
            let snapped = projected.snapped_corners(lane);
            if let Some(pixels) = PixelBox::of(&snapped) {
                let position = LeafTriangle { leaf: number, lane, triangle: leaf.triangle[lane] };
                self.draw_triangle::<L>(position, &projected.corners(lane), &snapped, &pixels);
            }
        }
    }

    /// `pixel`: corners in pixels, not snapped.
    #[inline(always)]
    fn draw_triangle<L: Lanes>(&mut self, position: LeafTriangle, pixel: &[[f64; 3]; 3], snapped: &SnappedCorners, pixels: &PixelBox) {
        // Set up the depth keys; a triangle seen edge-on or with distant corners takes the exact path.
        let rank = self.part.chunk.triangles()[position.triangle as usize].rank;
        let depth = TriangleDepth::new(pixel, rank, self.pixel_units);
        let is_near = is_near(snapped);
        let keys = match (&depth, is_near) {
            (Some(depth), true) => KeySetup::new::<L>(pixel, depth, pixels),
            _ => KeySetup::Exact,
        };
        if matches!(keys, KeySetup::Outside) {
            return;
        }

        // Set up the edges; a triangle without area covers no sample.
        let edges = if is_near { triangle_edges::<L>(snapped) } else { None };
        if is_near && edges.is_none() {
            return;
        }

        // Draw.
        match (keys, &edges) {
            (KeySetup::Plane(plane), Some(edges)) => {
                let candidate = self.candidate(position, rank, plane, true);
                self.rasterizer.draw(&candidate, pixels, edges);
            }
            _ => {
                let candidate = self.candidate(position, rank, DepthKeyPlane::default(), false);
                let bias = depth.map_or_else(|| edge_on_bias(rank), |d| d.bias);
                self.rasterizer.draw_exact::<L>(&candidate, pixels, &ExactTriangle { snapped, pixel, bias }, edges.as_ref());
            }
        }
    }

    #[inline(always)]
    fn candidate(&self, position: LeafTriangle, rank: u8, plane: DepthKeyPlane, has_plane: bool) -> Candidate<'a> {
        let part = self.part;
        let record = &part.chunk.triangles()[position.triangle as usize];
        let triangle = VisibleTriangle {
            plane,
            part: self.part_index,
            triangle: position.triangle,
            leaf: position.leaf,
            lane: position.lane as u8,
            tie_break: TieBreak::new(rank, part.object_id(record), record.source, part.number, position.triangle),
        };
        let cutout = if part.chunk.has_cutouts() { self.cutout_triangle(position) } else { None };
        Candidate { triangle, has_plane, slot: Cell::new(NOTHING), cutout }
    }

    /// Returns `None` for an opaque triangle.
    #[cold]
    #[inline(never)]
    fn cutout_triangle(&self, position: LeafTriangle) -> Option<CutoutTriangle<'a>> {
        let part = self.part;
        let record = &part.chunk.triangles()[position.triangle as usize];
        let material = &part.chunk.materials()[record.material as usize];
        if !material.is_cutout() {
            return None;
        }
        let local = part.triangle_corners(&part.chunk.leaves()[position.leaf as usize], position.lane);
        let projected = self.projection.project_triangle(local);
        Some(CutoutTriangle::new(material, SurfaceAttributes::new(part, self.part_index, position.triangle, &projected).uv))
    }
}
