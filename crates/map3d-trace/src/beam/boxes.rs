//! Boxes on the way down a tree: eight at a time in float32, with room for every rounding, so that nothing that can be seen is ever left out.

use map3d_base::{Box3, DEPTH_UNITS_PER_M};
use map3d_scene::Node;

use super::project::Projection;
use super::shape::BIAS_MAX;
use crate::lanes::Lanes;
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
    /// Of each axis, which side of a box makes the sum least: 0 the lower, 3 the upper one.
    least_side: [u8; 3],
}

impl Row {
    /// The sides of the children's boxes that make a sum with these coefficients least or greatest.
    #[inline(always)]
    pub fn side<'n>(&self, node: &'n Node, axis: usize, least: bool) -> &'n [f32; 8] {
        let side = self.least_side[axis] as usize;
        &node.bounds[(axis + if least { side } else { 3 - side }) % 6]
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
        let x = [self.least(0, node), self.greatest(0, node)];
        let y = [self.least(1, node), self.greatest(1, node)];
        let mask = L::meets_square(&x, &y, SUBTILE_PX as f32);
        ChildBoxes { x, y, near: self.least(2, node), mask }
    }

    #[inline(always)]
    fn least(&self, row: usize, node: &Node) -> [f32; 8] {
        let r = &self.rows[row];
        sum(r.m, r.side(node, 0, true), r.side(node, 1, true), r.side(node, 2, true), r.low)
    }

    #[inline(always)]
    fn greatest(&self, row: usize, node: &Node) -> [f32; 8] {
        let r = &self.rows[row];
        sum(r.m, r.side(node, 0, false), r.side(node, 1, false), r.side(node, 2, false), r.high)
    }
}

#[inline(always)]
fn sum(m: [f32; 3], a: &[f32; 8], b: &[f32; 8], c: &[f32; 8], constant: f32) -> [f32; 8] {
    let mut out = [0.0; 8];
    for k in 0..8 {
        out[k] = m[0] * a[k] + m[1] * b[k] + m[2] * c[k] + constant;
    }
    out
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
        Self { m, low, high, least_side: m.map(|v| if v < 0.0 { 3 } else { 0 }) }
    }
}

/// The least key that anything at depth units ≥ `near` can have.
#[inline(always)]
pub(crate) fn least_key(near: f32) -> i32 {
    (near as i64 - BIAS_MAX - 2 - (1 << 31)).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
}
