//! The traversal of one part's BVH by a beam, front to back: nodes that are outside or hidden are skipped, the triangles of leaves are rasterised.

use std::cell::Cell;

use map3d_base::{DEPTH_UNITS_PER_M, Projection, Vec3};
use map3d_scene::records::{EMPTY, LEAF_BIT};
use map3d_scene::{Leaf, Node};

use super::child_boxes::{ChildBoxes, SubtileBoxes};
use super::clip::PartClip;
use super::edges::{is_near, triangle_edges};
use super::exact::ExactTriangle;
use super::key_plane::{DepthKeyPlane, KeyPlane, KeySetup, TriangleDepth};
use super::perspective_plane::PerspectiveKeyPlane;
use super::pixels::{PixelBox, SnappedCorners};
use super::rasterizer::{Candidate, Rasterizer};
use super::sample_buffer::{GroupBox, NOTHING, VisibleTriangle};
use super::vertices::{ProjectedLeaf, project_corners};
use crate::cutout::{CutoutMap, CutoutTriangle};
use crate::depth_key::{TieBreak, UNBIASED_RANK, edge_on_bias};
use crate::lanes::{Kernel, Lanes};
use crate::part::LoadedPart;
use crate::perspective::{homogeneous, inverse_depth, plane_distance};
use crate::projection::{DepthRange, SubtileProjection, each_corner};

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
pub(super) struct LeafTriangle {
    leaf: u32,
    lane: usize,
    /// Index into `Chunk::triangles`.
    triangle: u32,
}

/// A triangle, or what the view's planes leave of it.
#[derive(Clone, Copy)]
pub(super) struct Piece {
    position: LeafTriangle,
    /// Corners in pixels and depth units, not snapped.
    pixel: [[f64; 3]; 3],
    snapped: SnappedCorners,
    /// Set if the corners are not those of the triangle.
    is_cut: bool,
}

/// Sets up a triangle's depth keys and draws it.
pub(crate) trait DrawTriangle: KeyPlane {
    fn draw<L: Lanes>(traversal: &mut BeamTraversal<Self>, piece: &Piece, pixels: &PixelBox);
}

pub(crate) struct BeamTraversal<'a, P> {
    part: &'a LoadedPart,
    /// Index into `VisBuf::parts`.
    part_index: u32,
    projection: SubtileProjection<'a>,
    rasterizer: Rasterizer<'a, P>,
    stack: &'a mut Vec<BeamEntry>,
    /// `None`: all of the part is drawn as it is.
    clip: Option<&'a PartClip>,
    /// Pieces of a leaf's triangles that planes have cut.
    pieces: Vec<Piece>,
    boxes: SubtileBoxes,
    /// Depth units in a pixel's width and height, in parallel projection.
    pixel_units: [f64; 2],
    /// Least depth in units that is drawn in perspective.
    near: f64,
}

impl<P: DrawTriangle> Kernel for BeamTraversal<'_, P> {
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

impl<'a, P: DrawTriangle> BeamTraversal<'a, P> {
    /// `part_index`: index into `VisBuf::parts`.
    pub fn new(
        part: &'a LoadedPart,
        part_index: u32,
        projection: SubtileProjection<'a>,
        rasterizer: Rasterizer<'a, P>,
        stack: &'a mut Vec<BeamEntry>,
        clip: Option<&'a PartClip>,
    ) -> Self {
        let boxes = SubtileBoxes::new(&projection, part);
        let (pixel_units, near) = match projection.view {
            Projection::Parallel(view) => (view.pixel_m.map(|side| side * DEPTH_UNITS_PER_M), 0.0),
            Projection::Perspective(view) => ([0.0; 2], view.near_m * DEPTH_UNITS_PER_M),
        };
        Self { part, part_index, projection, rasterizer, stack, clip, pieces: Vec::new(), boxes, pixel_units, near }
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
        if let Some(clip) = self.clip {
            mask = self.cut_leaf(clip, number, leaf, &projected, mask);
        }
        loop {
            let piece = if mask != 0 {
                let lane = mask.trailing_zeros() as usize & 7;
                mask &= mask - 1;
                let position = LeafTriangle { leaf: number, lane, triangle: leaf.triangle[lane] };
                Piece { position, pixel: projected.corners(lane), snapped: projected.snapped_corners(lane), is_cut: false }
            } else if let Some(piece) = self.pieces.pop() {
                piece
            } else {
                return;
            };
            if let Some(pixels) = PixelBox::of(&piece.snapped) {
                P::draw::<L>(self, &piece, &pixels);
            }
        }
    }

    /// Adds the pieces of the triangles that planes cut, and returns those of the lanes in `mask` that are drawn as they are.
    #[cold]
    #[inline(never)]
    fn cut_leaf(&mut self, clip: &PartClip, number: u32, leaf: &Leaf, projected: &ProjectedLeaf, mask: u32) -> u32 {
        let near = projected.near_lanes(self.near);
        let mut whole = 0;
        for lane in (0..8).filter(|lane| (mask | near) >> lane & 1 != 0 && leaf.triangle[*lane] != EMPTY) {
            let record = &self.part.chunk.triangles()[leaf.triangle[lane] as usize];
            if !clip.selects(self.part.object_id(record)) {
                continue;
            }
            let local = self.part.triangle_corners(leaf, lane);
            if clip.contains(&local) {
                whole |= 1 << lane;
                continue;
            }
            let position = LeafTriangle { leaf: number, lane, triangle: leaf.triangle[lane] };
            let polygon = clip.cut(&local);
            let corners = polygon.corners();
            for k in 2..corners.len() {
                let (pixel, snapped) = project_corners([corners[0], corners[k - 1], corners[k]], &self.projection);
                self.pieces.push(Piece { position, pixel, snapped, is_cut: true });
            }
        }
        whole & !near
    }

    #[inline(always)]
    fn rank(&self, position: LeafTriangle) -> u8 {
        self.part.chunk.triangles()[position.triangle as usize].rank
    }

    /// Returns the local corners of a piece's triangle.
    fn triangle_corners(&self, piece: &Piece) -> [Vec3; 3] {
        self.part.triangle_corners(&self.part.chunk.leaves()[piece.position.leaf as usize], piece.position.lane)
    }

    #[inline(always)]
    fn candidate(&self, position: LeafTriangle, rank: u8, plane: P, has_plane: bool) -> Candidate<'a, P> {
        let part = self.part;
        let record = &part.chunk.triangles()[position.triangle as usize];
        let triangle = VisibleTriangle {
            part: self.part_index,
            triangle: position.triangle,
            leaf: position.leaf,
            lane: position.lane as u8,
            tie_break: TieBreak::new(rank, part.object_id(record), record.source, part.number, position.triangle),
        };
        let cutout = if part.chunk.has_cutouts() { self.cutout_triangle(position) } else { None };
        Candidate { triangle, plane, has_plane, slot: Cell::new(NOTHING), cutout }
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
        Some(CutoutTriangle::new(material, CutoutMap::new(part, position.triangle, &self.projection, local)))
    }
}

impl DrawTriangle for DepthKeyPlane {
    #[inline(always)]
    fn draw<L: Lanes>(traversal: &mut BeamTraversal<Self>, piece: &Piece, pixels: &PixelBox) {
        // Set up the depth keys; a triangle seen edge-on or with distant corners takes the exact path.
        let Piece { position, pixel, snapped, .. } = piece;
        let rank = traversal.rank(*position);
        let depth = TriangleDepth::new(pixel, rank, traversal.pixel_units);
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
                let candidate = traversal.candidate(*position, rank, plane, true);
                traversal.rasterizer.draw(&candidate, pixels, edges);
            }
            _ => {
                let candidate = traversal.candidate(*position, rank, Self::default(), false);
                let bias = depth.map_or_else(|| edge_on_bias(rank), |d| d.bias);
                traversal.rasterizer.draw_exact::<L>(&candidate, pixels, &ExactTriangle { snapped, pixel, bias }, edges.as_ref());
            }
        }
    }
}

impl DrawTriangle for PerspectiveKeyPlane {
    #[inline(always)]
    fn draw<L: Lanes>(traversal: &mut BeamTraversal<Self>, piece: &Piece, pixels: &PixelBox) {
        let Projection::Perspective(view) = traversal.projection.view else { return };
        let Some(edges) = triangle_edges::<L>(&piece.snapped) else { return };

        // The plane of a cut triangle is that of the whole one.
        let homogeneous = match piece.is_cut {
            false => each_corner(&piece.pixel, |[x, y, z]| [x * z, y * z, z]),
            true => each_corner(&traversal.triangle_corners(piece), |p| homogeneous(view, traversal.projection.corner_px, p)),
        };
        let inverse = inverse_depth(&homogeneous);
        let range = DepthRange::of(&piece.pixel);
        let rank = traversal.rank(piece.position);
        // Only a bias needs the distance.
        let needs_distance = f64::from(rank) != UNBIASED_RANK;
        let distance = inverse.filter(|_| needs_distance).map_or(0.0, |w| plane_distance(view, traversal.projection.corner_px, &w));
        let plane = Self::new(inverse, &range, distance, rank, pixels);
        let candidate = traversal.candidate(piece.position, rank, plane, true);
        traversal.rasterizer.draw(&candidate, pixels, &edges);
    }
}
