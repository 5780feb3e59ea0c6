//! Boxes of BVH nodes in the coordinates of a view or a ray packet: eight at a time in float32, with a margin for all rounding, so that traversal never
//! skips a box that it should visit.

use map3d_base::Box3;
use map3d_scene::Node;

use crate::lanes::Floats;

/// Upper bound of the relative error of a sum of four float32 products.
const FLOAT_ERROR: f64 = 1.0 / (1 << 20) as f64;

/// An affine coordinate of local positions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AffineCoordinate {
    pub coefficients: [f64; 3],
    pub constant: f64,
    /// Widens boxes in addition to the margin for rounding, in the unit of the coordinate.
    pub margin: f64,
}

/// Maps boxes in a part's own coordinates, relative to its chunk's origin, to three affine coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoxProjection {
    pub rows: [AffineRow; 3],
}

impl BoxProjection {
    /// `origin` and `bounds` are those of the chunk, `bounds` in the frame of its origin; `transform` places a prototype.
    pub fn new(coordinates: [AffineCoordinate; 3], origin: [f64; 3], bounds: &Box3, transform: Option<&[f64; 12]>) -> Self {
        let extent = [0, 1, 2].map(|k| (bounds.lo[k] - origin[k]).abs().max((bounds.hi[k] - origin[k]).abs()));
        Self { rows: coordinates.map(|c| AffineRow::new(c, origin, extent, transform)) }
    }
}

/// One affine coordinate of positions relative to a chunk's origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AffineRow {
    coefficients: [f32; 3],
    /// The constant, lowered and raised by the margin.
    low: f32,
    high: f32,
    is_negative: [bool; 3],
}

impl AffineRow {
    fn new(coordinate: AffineCoordinate, origin: [f64; 3], extent: [f64; 3], transform: Option<&[f64; 12]>) -> Self {
        // Apply the placement of a prototype.
        let (m, c) = match transform {
            None => (coordinate.coefficients, coordinate.constant),
            Some(t) => {
                let m = coordinate.coefficients;
                let column = |k: usize| m[0] * t[k] + m[1] * t[k + 4] + m[2] * t[k + 8];
                ([column(0), column(1), column(2)], coordinate.constant + column(3))
            }
        };

        // Move the origin to that of the chunk.
        let constant = c + (0..3).map(|k| m[k] * origin[k]).sum::<f64>();

        // Widen by the rounding errors. That of the float64 sum is far below that of float32, even if its terms are huge.
        let size = c.abs() + (0..3).map(|k| m[k].abs() * (origin[k].abs() + extent[k])).sum::<f64>();
        let local = constant.abs() + (0..3).map(|k| m[k].abs() * extent[k]).sum::<f64>();
        let margin = coordinate.margin + local * FLOAT_ERROR + size * 1e-13;
        let coefficients = m.map(|v| v as f32);
        let (low, high) = (((constant - margin) as f32).next_down(), ((constant + margin) as f32).next_up());
        Self { coefficients, low, high, is_negative: coefficients.map(|v| v < 0.0) }
    }

    /// Returns the least coordinate of each child's box.
    #[inline(always)]
    pub fn least<F: Floats<8>>(&self, node: &Node) -> F {
        self.evaluate(node, true, self.low)
    }

    /// Returns the greatest coordinate of each child's box.
    #[inline(always)]
    pub fn greatest<F: Floats<8>>(&self, node: &Node) -> F {
        self.evaluate(node, false, self.high)
    }

    #[inline(always)]
    fn evaluate<F: Floats<8>>(&self, node: &Node, least: bool, constant: f32) -> F {
        let term = |axis: usize| F::splat(self.coefficients[axis]).mul(F::load(self.side(node, axis, least)));
        term(0).add(term(1)).add(term(2)).add(F::splat(constant))
    }

    /// Returns the side of the children's boxes that makes the coordinate least, or greatest, along an axis.
    #[inline(always)]
    fn side<'n>(&self, node: &'n Node, axis: usize, least: bool) -> &'n [f32; 8] {
        let (lower, upper) = (&node.bounds[axis], &node.bounds[axis + 3]);
        if self.is_negative[axis] == least { upper } else { lower }
    }
}
