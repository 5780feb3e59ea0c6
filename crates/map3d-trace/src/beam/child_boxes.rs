//! The boxes of a node's children over a sub-tile.

use map3d_base::{DEPTH_UNITS_PER_M, ParallelProjection, PerspectiveProjection, Projection};
use map3d_scene::Node;

use super::pixels::SUBTILE_PX;
use super::sample_buffer::GroupBox;
use crate::boxes::{AffineCoordinate, BoxProjection};
use crate::depth_key::least_depth_key;
use crate::lanes::{Floats, Lanes};
use crate::part::LoadedPart;
use crate::projection::SubtileProjection;

/// Margin for the snapping of corners, in pixels.
const SNAP_MARGIN: f64 = 1.0 / 128.0;
const SIDE: f32 = SUBTILE_PX as f32;

/// Maps a part's boxes to a sub-tile.
pub(crate) enum SubtileBoxes {
    /// Pixels right and down from the sub-tile's corner, and depth units from D0.
    Parallel(BoxProjection),
    /// Pixels right and down from the sub-tile's centre times the depth in units, and that depth; nothing nearer than `near` units is drawn.
    Perspective { boxes: BoxProjection, near: f32 },
}

impl SubtileBoxes {
    pub fn new(projection: &SubtileProjection, part: &LoadedPart) -> Self {
        match projection.view {
            Projection::Parallel(view) => Self::Parallel(parallel_boxes(view, projection.corner_px, part)),
            Projection::Perspective(view) => {
                let near = ((view.near_m * DEPTH_UNITS_PER_M) as f32).next_down();
                Self::Perspective { boxes: perspective_boxes(view, projection.corner_px, part), near }
            }
        }
    }
}

/// Returns the map from a part's boxes to pixels right and down from the sub-tile's corner and depth units from D0.
fn parallel_boxes(view: &ParallelProjection, corner_px: [u64; 2], part: &LoadedPart) -> BoxProjection {
    let (axes, [width, height]) = (&view.axes, view.pixel_m);
    let corner = corner_px.map(|v| v as f64);
    let coordinates = [
        AffineCoordinate { coefficients: axes.right.map(|v| v / width), constant: -view.u0_m / width - corner[0], margin: SNAP_MARGIN },
        AffineCoordinate { coefficients: axes.up.map(|v| -v / height), constant: view.v0_m / height - corner[1], margin: SNAP_MARGIN },
        AffineCoordinate { coefficients: axes.forward.map(|v| v * DEPTH_UNITS_PER_M), constant: -view.d0_m * DEPTH_UNITS_PER_M, margin: 1.0 },
    ];
    BoxProjection::new(coordinates, part.chunk.origin(), &part.chunk.bounds(), part.transform())
}

fn perspective_boxes(view: &PerspectiveProjection, corner_px: [u64; 2], part: &LoadedPart) -> BoxProjection {
    let half = SUBTILE_PX as f64 / 2.0;
    let [width, height] = view.pixel.map(|side| side / DEPTH_UNITS_PER_M);
    let center = [view.left + (corner_px[0] as f64 + half) * view.pixel[0], view.top - (corner_px[1] as f64 + half) * view.pixel[1]];
    let coordinate = |[a, b, c, constant]: [f64; 4], scale: f64, margin: f64| AffineCoordinate {
        coefficients: [a * scale, b * scale, c * scale],
        constant: constant * scale,
        margin,
    };
    let forward = view.ahead();
    let coordinates = [
        coordinate(view.beside(center[0]), 1.0 / width, 0.0),
        coordinate(view.above(center[1]), -1.0 / height, 0.0),
        coordinate(forward, DEPTH_UNITS_PER_M, 1.0),
    ];
    BoxProjection::new(coordinates, part.chunk.origin(), &part.chunk.bounds(), part.transform())
}

/// The projected boxes of a node's children: least and greatest x and y in pixels, least depth in units.
pub(crate) struct ChildBoxes {
    x: [[f32; 8]; 2],
    y: [[f32; 8]; 2],
    near: [f32; 8],
    /// Children whose boxes overlap the sub-tile; the other lanes are not computed if it is empty.
    pub mask: u32,
}

impl ChildBoxes {
    #[inline(always)]
    pub fn new<L: Lanes>(boxes: &SubtileBoxes, node: &Node) -> Self {
        match boxes {
            SubtileBoxes::Parallel(boxes) => Self::parallel::<L>(boxes, node),
            SubtileBoxes::Perspective { boxes, near } => Self::perspective::<L>(boxes, *near, node),
        }
    }

    #[inline(always)]
    fn parallel<L: Lanes>(boxes: &BoxProjection, node: &Node) -> Self {
        let [x, y, depth] = &boxes.rows;
        let (x0, x1) = (x.least::<L::Floats8>(node), x.greatest::<L::Floats8>(node));
        let (y0, y1) = (y.least::<L::Floats8>(node), y.greatest::<L::Floats8>(node));
        let (zero, side) = (L::Floats8::splat(0.0), L::Floats8::splat(SIDE));
        let mask = x1.at_least(zero) & side.at_least(x0) & y1.at_least(zero) & side.at_least(y0);
        let mut out = Self { x: [[0.0; 8]; 2], y: [[0.0; 8]; 2], near: [0.0; 8], mask };
        if mask != 0 {
            x0.store(&mut out.x[0]);
            x1.store(&mut out.x[1]);
            y0.store(&mut out.y[0]);
            y1.store(&mut out.y[1]);
            depth.least::<L::Floats8>(node).store(&mut out.near);
        }
        out
    }

    #[inline(always)]
    fn perspective<L: Lanes>(boxes: &BoxProjection, near: f32, node: &Node) -> Self {
        // The visible depths of the boxes.
        let [x, y, depth] = &boxes.rows;
        let near = L::Floats8::splat(near);
        let (first, last) = (depth.least::<L::Floats8>(node).max(near), depth.greatest::<L::Floats8>(node));
        let visible = last.at_least(near);
        if visible == 0 {
            return Self { x: [[0.0; 8]; 2], y: [[0.0; 8]; 2], near: [0.0; 8], mask: 0 };
        }

        // Pixels are least and greatest at one of these depths.
        const MARGIN: f32 = 1.0 / 64.0;
        let half = SIDE / 2.0;
        let least = |v: L::Floats8| v.div(first).min(v.div(last)).add(L::Floats8::splat(half - MARGIN));
        let greatest = |v: L::Floats8| v.div(first).max(v.div(last)).add(L::Floats8::splat(half + MARGIN));
        let (x0, x1) = (least(x.least(node)), greatest(x.greatest(node)));
        let (y0, y1) = (least(y.least(node)), greatest(y.greatest(node)));
        let (zero, side) = (L::Floats8::splat(0.0), L::Floats8::splat(SIDE));
        let mask = visible & x1.at_least(zero) & side.at_least(x0) & y1.at_least(zero) & side.at_least(y0);
        let mut out = Self { x: [[0.0; 8]; 2], y: [[0.0; 8]; 2], near: [0.0; 8], mask };
        x0.store(&mut out.x[0]);
        x1.store(&mut out.x[1]);
        y0.store(&mut out.y[0]);
        y1.store(&mut out.y[1]);
        first.store(&mut out.near);
        out
    }

    #[inline(always)]
    pub fn least_depth_key(&self, child: usize) -> i32 {
        least_depth_key(self.near[child])
    }

    #[inline(always)]
    pub fn groups(&self, child: usize) -> GroupBox {
        GroupBox::new([self.x[0][child], self.y[0][child], self.x[1][child], self.y[1][child]])
    }
}
