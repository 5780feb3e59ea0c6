//! The layers of a rendered view.

use map3d_base::{DEPTH_NOTHING, LayerKind};
use map3d_image::encode::{bytes_from_linear, bytes_from_normals};
use map3d_image::{Arrays, GBuffer};

/// Layers as arrays with `width · height` entries, row by row; empty if not asked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewImage {
    pub width: usize,
    pub height: usize,
    /// sRGB and coverage; 0 where nothing is.
    pub color: Vec<[u8; 4]>,
    /// As in spec/pyramid.md §6; 0 where nothing is.
    pub normal: Vec<[u8; 3]>,
    /// 0 where nothing is.
    pub id: Vec<u32>,
    /// Metres along the camera's `forward`; NaN where nothing is.
    pub depth: Vec<f32>,
    /// 255: lit, or nothing.
    pub sun: Vec<u8>,
    /// 255: open, or nothing.
    pub ao: Vec<u8>,
    /// As `color`, lit.
    pub picture: Vec<[u8; 4]>,
}

/// A rectangle of a tile's pixels and its place in the image.
#[derive(Clone, Copy)]
pub(super) struct TileRows {
    /// First pixel in the tile: left, top.
    pub from: [usize; 2],
    /// First pixel in the image.
    pub to: [usize; 2],
    pub width: usize,
    pub height: usize,
}

impl ViewImage {
    /// Returns an image that shows nothing.
    pub(super) fn empty(width: usize, height: usize, layers: Arrays) -> Self {
        let count = |kind| if layers.has(kind) { width * height } else { 0 };
        Self {
            width,
            height,
            color: vec![[0; 4]; count(LayerKind::Color)],
            normal: vec![[0; 3]; count(LayerKind::Normal)],
            id: vec![0; count(LayerKind::Id)],
            depth: vec![f32::NAN; count(LayerKind::Depth)],
            sun: vec![255; count(LayerKind::Sun)],
            ao: vec![255; count(LayerKind::Ao)],
            picture: vec![[0; 4]; count(LayerKind::Picture)],
        }
    }

    /// Copies a rectangle of a tile's G-buffer. `depth_m` converts stored depths.
    pub(super) fn put(&mut self, g: &GBuffer, rows: TileRows, depth_m: impl Fn(u32) -> f32) {
        for row in 0..rows.height {
            let first = (rows.from[1] + row) * g.width as usize + rows.from[0];
            let (from, at) = (first..first + rows.width, (rows.to[1] + row) * self.width + rows.to[0]);
            let to = at..at + rows.width;
            if !self.color.is_empty() {
                self.color[to.clone()].copy_from_slice(&bytes_from_linear(&g.color[from.clone()]));
            }
            if !self.picture.is_empty() {
                self.picture[to.clone()].copy_from_slice(&bytes_from_linear(&g.picture[from.clone()]));
            }
            if !self.normal.is_empty() {
                self.normal[to.clone()].as_flattened_mut().copy_from_slice(&bytes_from_normals(&g.normal[from.clone()]));
            }
            if !self.id.is_empty() {
                self.id[to.clone()].copy_from_slice(&g.id[from.clone()]);
            }
            if !self.sun.is_empty() {
                self.sun[to.clone()].copy_from_slice(&g.sun[from.clone()]);
            }
            if !self.ao.is_empty() {
                self.ao[to.clone()].copy_from_slice(&g.ao[from.clone()]);
            }
            if !self.depth.is_empty() {
                let metres = |units: &u32| if *units == DEPTH_NOTHING { f32::NAN } else { depth_m(*units) };
                self.depth[to].iter_mut().zip(&g.depth[from]).for_each(|(out, units)| *out = metres(units));
            }
        }
    }
}
