//! The parts of a scene region in ray space: metres right, up and along the direction of a ray packet.

use map3d_base::{Box3, Vec3, ViewAxes};
use map3d_scene::lattice::EXACT_REACH_M;
use map3d_scene::records::EMPTY;
use map3d_scene::{Leaf, Node};

use super::rays::{RayBounds, RaySpaceTriangle};
use crate::boxes::{AffineCoordinate, BoxProjection};
use crate::lanes::Floats;
use crate::part::LoadedPart;

/// Margin around boxes in metres, in addition to that for rounding.
const MARGIN_M: f64 = 1e-4;

/// A part in ray space.
pub(crate) struct RaySpacePart {
    pub boxes: BoxProjection,
    /// Offset from the chunk's positions to those relative to the center; zeros for an instance.
    shift: [f64; 3],
    /// The sums of shift and positions are exact in float32.
    is_exact: bool,
    rows: [RaySpaceRow; 3],
}

/// A coordinate in ray space, affine over shifted positions.
#[derive(Clone, Copy)]
struct RaySpaceRow {
    coefficients: [f32; 3],
    constant: f32,
}

impl RaySpaceRow {
    #[inline(always)]
    fn evaluate<F: Floats<8>>(&self, p: [F; 3]) -> F {
        let m = self.coefficients;
        F::splat(m[0]).mul(p[0]).add(F::splat(m[1]).mul(p[1])).add(F::splat(m[2]).mul(p[2])).add(F::splat(self.constant))
    }
}

impl RaySpacePart {
    /// `center`: the lattice point from which the rays' positions count.
    pub fn new(part: &LoadedPart, center: Vec3, axes: &ViewAxes) -> Self {
        let (origin, bounds, transform) = (part.chunk.origin(), part.chunk.bounds(), part.transform());
        let axes = [axes.right, axes.up, axes.forward];
        let boxes = axes.map(|m| AffineCoordinate { coefficients: m, constant: (0..3).map(|k| -m[k] * center[k]).sum(), margin: MARGIN_M });
        let boxes = BoxProjection::new(boxes, origin, &bounds, transform);
        match transform {
            // Positions of a chunk are shifted exactly, so that equal corners of different chunks stay equal.
            None => {
                let shift = [0, 1, 2].map(|k| origin[k] - center[k]);
                let is_near = |k: usize| [shift[k], bounds.lo[k] - center[k], bounds.hi[k] - center[k]].iter().all(|v| v.abs() <= EXACT_REACH_M);
                let rows = axes.map(|m| RaySpaceRow { coefficients: m.map(|v| v as f32), constant: 0.0 });
                Self { boxes, shift, is_exact: (0..3).all(is_near), rows }
            }
            // The placement of an instance is part of the rows.
            Some(t) => {
                let column = |m: Vec3, k: usize| m[0] * t[k] + m[1] * t[k + 4] + m[2] * t[k + 8];
                let row = |m: Vec3| {
                    let rotated = [column(m, 0), column(m, 1), column(m, 2)];
                    let moved = [0, 1, 2].map(|k| t[4 * k + 3] - center[k]);
                    let constant: f64 = (0..3).map(|k| m[k] * moved[k] + rotated[k] * origin[k]).sum();
                    RaySpaceRow { coefficients: rotated.map(|v| v as f32), constant: constant as f32 }
                };
                Self { boxes, shift: [0.0; 3], is_exact: true, rows: axes.map(row) }
            }
        }
    }

    /// Transforms the corners of a leaf's triangles.
    #[inline(always)]
    pub fn transform_leaf<F: Floats<8>>(&self, leaf: &Leaf) -> RaySpaceLeaf {
        let mut out = RaySpaceLeaf([[[0.0; 8]; 3]; 3]);
        for corner in 0..3 {
            let c = &leaf.corners;
            let from = [&c[corner * 3], &c[corner * 3 + 1], &c[corner * 3 + 2]];
            let p = if self.is_exact { self.shift_exactly::<F>(from) } else { self.shift_and_round::<F>(from) };
            for row in 0..3 {
                self.rows[row].evaluate(p).store(&mut out.0[row][corner]);
            }
        }
        out
    }

    #[inline(always)]
    fn shift_exactly<F: Floats<8>>(&self, from: [&[f32; 8]; 3]) -> [F; 3] {
        let shifted = |axis: usize| F::load(from[axis]).add(F::splat(self.shift[axis] as f32));
        [shifted(0), shifted(1), shifted(2)]
    }

    #[cold]
    #[inline(never)]
    fn shift_and_round<F: Floats<8>>(&self, from: [&[f32; 8]; 3]) -> [F; 3] {
        [0, 1, 2].map(|axis| F::load(&from[axis].map(|v| (f64::from(v) + self.shift[axis]) as f32)))
    }
}

/// Right, up and along of the three corners of eight triangles; the lanes of unused triangles are NaN.
pub(super) struct RaySpaceLeaf([[[f32; 8]; 3]; 3]);

impl RaySpaceLeaf {
    /// Returns the mask of the lanes whose boxes overlap the rays' bounds.
    #[inline(always)]
    pub fn overlapping_lanes<F: Floats<8>>(&self, bounds: &RayBounds) -> u32 {
        let mut mask = u32::MAX;
        for row in 0..3 {
            let c = &self.0[row];
            let (a, b, c) = (F::load(&c[0]), F::load(&c[1]), F::load(&c[2]));
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            mask &= high.at_least(F::splat(bounds.lo[row])) & F::splat(bounds.hi[row]).at_least(low);
        }
        mask
    }

    /// Returns `None` for a triangle seen edge-on.
    #[inline(always)]
    pub fn triangle(&self, lane: usize) -> Option<RaySpaceTriangle> {
        let row = |k: usize| [self.0[k][0][lane], self.0[k][1][lane], self.0[k][2][lane]];
        RaySpaceTriangle::new(row(0), row(1), row(2))
    }
}

/// The children of a node that rays may hit.
pub(super) struct ChildHits {
    pub mask: u32,
    /// The least distance along the rays of each child's box.
    pub near: [f32; 8],
}

impl ChildHits {
    /// Intersects the boxes of a node's children with the rays' bounds.
    #[inline(always)]
    pub fn new<F: Floats<8>>(boxes: &BoxProjection, node: &Node, bounds: &RayBounds) -> Self {
        let mut out = Self { mask: u32::MAX, near: [0.0; 8] };
        for axis in 0..3 {
            let row = &boxes.rows[axis];
            let (lo, hi) = (row.least::<F>(node), row.greatest::<F>(node));
            out.mask &= hi.at_least(F::splat(bounds.lo[axis])) & F::splat(bounds.hi[axis]).at_least(lo);
            if axis == 2 {
                lo.store(&mut out.near);
            }
        }
        out
    }
}

/// The boxes of a region's parts relative to its center, rounded outwards, eight per node. Child k % 8 of node k / 8 is part k.
pub(crate) struct PartBoxes {
    pub nodes: Vec<Node>,
}

impl PartBoxes {
    pub fn new<'a>(center: Vec3, boxes: impl Iterator<Item = &'a Box3>) -> Self {
        let mut nodes: Vec<Node> = Vec::new();
        for (number, b) in boxes.enumerate() {
            let lane = number % 8;
            if lane == 0 {
                nodes.push(Node { bounds: [[f32::NAN; 8]; 6], child: [EMPTY; 8], padding: [0; 8] });
            }
            let node = nodes.last_mut().expect("pushed");
            for axis in 0..3 {
                node.bounds[axis][lane] = ((b.lo[axis] - center[axis]) as f32).next_down();
                node.bounds[axis + 3][lane] = ((b.hi[axis] - center[axis]) as f32).next_up();
            }
            node.child[lane] = number as u32;
        }
        Self { nodes }
    }

    /// Returns the map of its nodes to ray space.
    pub fn projection(&self, axes: &ViewAxes) -> BoxProjection {
        let mut bounds = Box3::EMPTY;
        for node in &self.nodes {
            for k in (0..8).filter(|k| node.child[*k] != EMPTY) {
                bounds.add_point([0, 1, 2].map(|a| f64::from(node.bounds[a][k])));
                bounds.add_point([3, 4, 5].map(|a| f64::from(node.bounds[a][k])));
            }
        }
        let coordinate = |coefficients| AffineCoordinate { coefficients, constant: 0.0, margin: MARGIN_M };
        BoxProjection::new([axes.right, axes.up, axes.forward].map(coordinate), [0.0; 3], &bounds, None)
    }
}
