//! Parts as the rays of a direction see them.

use map3d_base::{Box3, Vec3, ViewAxes};
use map3d_scene::lattice::EXACT_REACH_M;
use map3d_scene::records::EMPTY;
use map3d_scene::{Leaf, Node};

use super::NearPart;
use super::rays::{Reach, Triangle};
use crate::beam::boxes::BoxMap;
use crate::lanes::Floats;

/// Room around boxes in metres, beside that for rounding.
const ROOM_M: f64 = 1e-4;

/// A part in the coordinates of the rays.
pub(crate) struct PartView {
    pub boxes: BoxMap,
    /// Exact steps from the chunk's positions to those relative to the center; zeros for an instance.
    shift: [f64; 3],
    /// Sums of a shift and a position are exact in float32.
    is_exact: bool,
    /// Right, up, along: coefficients and constant, of shifted positions.
    rows: [([f32; 3], f32); 3],
}

impl PartView {
    pub fn new(part: &NearPart, center: Vec3, axes: &ViewAxes) -> Self {
        let (origin, transform) = (part.chunk.origin(), part.instance.as_ref().map(|i| &i.1.transform));
        let across = [axes.right, axes.up, axes.forward];
        let from_center = |m: Vec3| (0..3).map(|k| -m[k] * center[k]).sum::<f64>();
        let boxes = BoxMap::of_rows(across.map(|m| (m, from_center(m), ROOM_M)), origin, &part.chunk.bounds(), transform);
        match transform {
            None => {
                let shift = [0, 1, 2].map(|k| origin[k] - center[k]);
                let bounds = part.chunk.bounds();
                let near = |k: usize| [shift[k], bounds.lo[k] - center[k], bounds.hi[k] - center[k]].iter().all(|v| v.abs() <= EXACT_REACH_M);
                Self { boxes, shift, is_exact: (0..3).all(near), rows: across.map(|m| (m.map(|v| v as f32), 0.0)) }
            }
            Some(t) => {
                let column = |m: Vec3, k: usize| m[0] * t[k] + m[1] * t[k + 4] + m[2] * t[k + 8];
                let row = |m: Vec3| {
                    let turned = [column(m, 0), column(m, 1), column(m, 2)];
                    let moved = [0, 1, 2].map(|k| t[4 * k + 3] - center[k]);
                    let constant: f64 = (0..3).map(|k| m[k] * moved[k] + turned[k] * origin[k]).sum();
                    (turned.map(|v| v as f32), constant as f32)
                };
                Self { boxes, shift: [0.0; 3], is_exact: true, rows: across.map(row) }
            }
        }
    }

    /// The corners of a leaf's triangles.
    #[inline(always)]
    pub fn corners<F: Floats<8>>(&self, leaf: &Leaf) -> Corners {
        let mut out = Corners([[[0.0; 8]; 3]; 3]);
        for corner in 0..3 {
            let c = &leaf.corners;
            let from = [&c[corner * 3], &c[corner * 3 + 1], &c[corner * 3 + 2]];
            let p = if self.is_exact { self.shifted::<F>(from) } else { self.shifted_far::<F>(from) };
            for row in 0..3 {
                let (m, c) = self.rows[row];
                sum(m, p, F::splat(c)).store(&mut out.0[row][corner]);
            }
        }
        out
    }

    #[inline(always)]
    fn shifted<F: Floats<8>>(&self, from: [&[f32; 8]; 3]) -> [F; 3] {
        let at = |axis: usize| F::load(from[axis]).add(F::splat(self.shift[axis] as f32));
        [at(0), at(1), at(2)]
    }

    #[cold]
    #[inline(never)]
    fn shifted_far<F: Floats<8>>(&self, from: [&[f32; 8]; 3]) -> [F; 3] {
        [0, 1, 2].map(|axis| F::load(&from[axis].map(|v| (f64::from(v) + self.shift[axis]) as f32)))
    }
}

#[inline(always)]
fn sum<F: Floats<8>>(m: [f32; 3], p: [F; 3], constant: F) -> F {
    F::splat(m[0]).mul(p[0]).add(F::splat(m[1]).mul(p[1])).add(F::splat(m[2]).mul(p[2])).add(constant)
}

/// Right, up, along of the three corners of eight triangles; NaN when unused.
pub(super) struct Corners([[[f32; 8]; 3]; 3]);

impl Corners {
    /// Lanes whose boxes meet the rays' reach.
    #[inline(always)]
    pub fn meeting<F: Floats<8>>(&self, reach: &Reach) -> u32 {
        let mut mask = u32::MAX;
        for row in 0..3 {
            let c = &self.0[row];
            let (a, b, c) = (F::load(&c[0]), F::load(&c[1]), F::load(&c[2]));
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            mask &= high.at_least(F::splat(reach.lo[row])) & F::splat(reach.hi[row]).at_least(low);
        }
        mask
    }

    #[inline(always)]
    pub fn triangle(&self, lane: usize) -> Option<Triangle> {
        let of = |row: usize| [self.0[row][0][lane], self.0[row][1][lane], self.0[row][2][lane]];
        Triangle::new(of(0), of(1), of(2))
    }
}

/// Children whose boxes meet the rays' reach, and where each begins along them.
#[inline(always)]
pub(super) fn children<F: Floats<8>>(map: &BoxMap, node: &Node, reach: &Reach) -> (u32, [f32; 8]) {
    let mut mask = u32::MAX;
    let mut near = [0.0; 8];
    for axis in 0..3 {
        let row = &map.rows[axis];
        let (lo, hi) = (row.least::<F>(node), row.greatest::<F>(node));
        mask &= hi.at_least(F::splat(reach.lo[axis])) & F::splat(reach.hi[axis]).at_least(lo);
        if axis == 2 {
            lo.store(&mut near);
        }
    }
    (mask, near)
}

/// The boxes of parts, eight a node, relative to the center and rounded outwards.
pub(crate) struct Crowd {
    pub nodes: Vec<Node>,
}

impl Crowd {
    /// Box k is child k % 8 of node k / 8, whose number it bears.
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

    /// The map for its nodes.
    pub fn map(&self, axes: &ViewAxes) -> BoxMap {
        let mut all = Box3::EMPTY;
        for node in &self.nodes {
            for k in (0..8).filter(|k| node.child[*k] != EMPTY) {
                all.add_point([0, 1, 2].map(|a| f64::from(node.bounds[a][k])));
                all.add_point([3, 4, 5].map(|a| f64::from(node.bounds[a][k])));
            }
        }
        BoxMap::of_rows([axes.right, axes.up, axes.forward].map(|m| (m, 0.0, ROOM_M)), [0.0; 3], &all, None)
    }
}
