//! The boxes of a node's children over a sub-tile.

use map3d_base::{Box3, DEPTH_UNITS_PER_M};
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

/// Returns the map from a part's boxes to pixels right and down from the sub-tile's corner and depth units from D0.
pub(crate) fn subtile_boxes(projection: &SubtileProjection, part: &LoadedPart) -> BoxProjection {
    let (frame, axes) = (projection.frame, projection.axes);
    let pixel_m = frame.pixel_m(frame.zmax);
    let corner = projection.corner_px.map(|v| v as f64);
    let coordinates = [
        AffineCoordinate { coefficients: axes.right.map(|v| v / pixel_m), constant: -frame.u0_m / pixel_m - corner[0], margin: SNAP_MARGIN },
        AffineCoordinate { coefficients: axes.up.map(|v| -v / pixel_m), constant: frame.v0_m / pixel_m - corner[1], margin: SNAP_MARGIN },
        AffineCoordinate { coefficients: axes.forward.map(|v| v * DEPTH_UNITS_PER_M), constant: -frame.d0_m * DEPTH_UNITS_PER_M, margin: 1.0 },
    ];
    let bounds: Box3 = part.chunk.bounds();
    BoxProjection::new(coordinates, part.chunk.origin(), &bounds, part.transform())
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
    pub fn new<L: Lanes>(boxes: &BoxProjection, node: &Node) -> Self {
        let [x, y, depth] = &boxes.rows;
        let (x0, x1) = (x.least::<L::Floats8>(node), x.greatest::<L::Floats8>(node));
        let (y0, y1) = (y.least::<L::Floats8>(node), y.greatest::<L::Floats8>(node));
        let (zero, side) = (L::Floats8::splat(0.0), L::Floats8::splat(SUBTILE_PX as f32));
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
    pub fn least_depth_key(&self, child: usize) -> i32 {
        least_depth_key(self.near[child])
    }

    #[inline(always)]
    pub fn groups(&self, child: usize) -> GroupBox {
        GroupBox::new([self.x[0][child], self.y[0][child], self.x[1][child], self.y[1][child]])
    }
}
