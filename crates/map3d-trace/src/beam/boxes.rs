//! Boxes on the way down a tree: eight at a time in float32, with room for every rounding, so that nothing that can be seen is ever left out.

use map3d_base::{Box3, DEPTH_UNITS_PER_M};
use map3d_scene::Node;

use super::project::Projection;
use super::shape::BIAS_MAX;
use crate::lanes::{Floats, Lanes};
use crate::visbuf::SUBTILE_PX;

/// Room for the snapping of corners, in pixels.
const SNAP_ROOM: f64 = 1.0 / 128.0;
/// Relative error of a sum of four float32 products, generously.
const FLOAT_ROOM: f64 = 1.0 / (1 << 20) as f64;

/// One affine row: coefficients, and the constant lowered and raised by the room.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub m: [f32; 3],
    pub low: f32,
    pub high: f32,
    /// Axes along which a box's upper side makes the sum least.
    falls: [bool; 3],
}

impl Row {
    /// The least coordinate of each child's box.
    #[inline(always)]
    pub fn least<F: Floats<8>>(&self, node: &Node) -> F {
        self.sum(node, true, self.low)
    }

    /// The greatest coordinate of each child's box.
    #[inline(always)]
    pub fn greatest<F: Floats<8>>(&self, node: &Node) -> F {
        self.sum(node, false, self.high)
    }

    #[inline(always)]
    fn sum<F: Floats<8>>(&self, node: &Node, least: bool, constant: f32) -> F {
        let term = |axis: usize| F::splat(self.m[axis]).mul(F::load(self.side(node, axis, least)));
        term(0).add(term(1)).add(term(2)).add(F::splat(constant))
    }

    /// The side of the children's boxes along an axis that makes the sum least, or greatest.
    #[inline(always)]
    fn side<'n>(&self, node: &'n Node, axis: usize, least: bool) -> &'n [f32; 8] {
        let (lower, upper) = (&node.bounds[axis], &node.bounds[axis + 3]);
        if self.falls[axis] == least { upper } else { lower }
    }
}

/// From a part's own coordinates, relative to its chunk's origin, to pixels of the sub-tile and depth units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoxMap {
    pub rows: [Row; 3],
}

/// Where the boxes of a node's children lie.
pub(crate) struct ChildBoxes {
    pub x: [[f32; 8]; 2],
    pub y: [[f32; 8]; 2],
    pub near: [f32; 8],
    /// Children that meet the sub-tile.
    pub mask: u32,
}

impl BoxMap {
    /// `bounds`: of the chunk, in the frame of its origin.
    pub fn new(projection: &Projection, origin: [f64; 3], bounds: &Box3, transform: Option<&[f64; 12]>) -> Self {
        let frame = projection.frame;
        let pixel_m = frame.pixel_m(frame.zmax);
        let axes = projection.axes;
        let corner = projection.corner_px.map(|v| v as f64);
        let view = [
            (axes.right.map(|v| v / pixel_m), -frame.u0_m / pixel_m - corner[0], SNAP_ROOM),
            (axes.up.map(|v| -v / pixel_m), frame.v0_m / pixel_m - corner[1], SNAP_ROOM),
            (axes.forward.map(|v| v * DEPTH_UNITS_PER_M), -frame.d0_m * DEPTH_UNITS_PER_M, 1.0),
        ];
        Self::of_rows(view, origin, bounds, transform)
    }

    /// To other coordinates: of each its coefficients of local positions, constant, and room besides that for rounding.
    pub fn of_rows(rows: [([f64; 3], f64, f64); 3], origin: [f64; 3], bounds: &Box3, transform: Option<&[f64; 12]>) -> Self {
        let reach = [0, 1, 2].map(|k| (bounds.lo[k] - origin[k]).abs().max((bounds.hi[k] - origin[k]).abs()));
        Self { rows: rows.map(|(m, c, room)| Row::new(m, c, room, origin, reach, transform)) }
    }

    /// Places the boxes of a node's children and tells which meet the sub-tile.
    #[inline(always)]
    pub fn children<L: Lanes>(&self, node: &Node) -> ChildBoxes {
        let [x, y, depth] = &self.rows;
        let (x0, x1) = (x.least::<L::Eight>(node), x.greatest::<L::Eight>(node));
        let (y0, y1) = (y.least::<L::Eight>(node), y.greatest::<L::Eight>(node));
        let (zero, side) = (L::Eight::splat(0.0), L::Eight::splat(SUBTILE_PX as f32));
        let mask = x1.at_least(zero) & side.at_least(x0) & y1.at_least(zero) & side.at_least(y0);
        let mut out = ChildBoxes { x: [[0.0; 8]; 2], y: [[0.0; 8]; 2], near: [0.0; 8], mask };
        if mask != 0 {
            x0.store(&mut out.x[0]);
            x1.store(&mut out.x[1]);
            y0.store(&mut out.y[0]);
            y1.store(&mut out.y[1]);
            depth.least::<L::Eight>(node).store(&mut out.near);
        }
        out
    }
}

impl Row {
    fn new(m: [f64; 3], c: f64, room: f64, origin: [f64; 3], reach: [f64; 3], transform: Option<&[f64; 12]>) -> Self {
        let (m, c) = match transform {
            None => (m, c),
            Some(t) => {
                let column = |k: usize| m[0] * t[k] + m[1] * t[k + 4] + m[2] * t[k + 8];
                ([column(0), column(1), column(2)], c + column(3))
            }
        };
        let constant = c + (0..3).map(|k| m[k] * origin[k]).sum::<f64>();
        let size = c.abs() + (0..3).map(|k| m[k].abs() * (origin[k].abs() + reach[k])).sum::<f64>();
        // The float64 sum's own error is far below that of float32, also when its terms are huge.
        let local = constant.abs() + (0..3).map(|k| m[k].abs() * reach[k]).sum::<f64>();
        let room = room + local * FLOAT_ROOM + size * 1e-13;
        let m = m.map(|v| v as f32);
        let (low, high) = (((constant - room) as f32).next_down(), ((constant + room) as f32).next_up());
        Self { m, low, high, falls: m.map(|v| v < 0.0) }
    }
}

/// The least key that anything at depth units ≥ `near` can have.
#[inline(always)]
pub(crate) fn least_key(near: f32) -> i32 {
    (near as i64 - BIAS_MAX - 2 - (1 << 31)).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
}
