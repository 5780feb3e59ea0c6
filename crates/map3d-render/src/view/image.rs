//! The layers of a rendered view.

use map3d_base::layers::{LAYERS, LayerRow, PixelType};
use map3d_base::{DEPTH_NOTHING, LayerKind};
use map3d_image::encode::{bytes_from_linear, bytes_from_normals};
use map3d_image::{Arrays, GBuffer, PixelArray};

/// Layers as arrays with `width · height` pixels, row by row, in the order of their codes; without those that were not asked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewImage {
    pub width: usize,
    pub height: usize,
    pub layers: Vec<(LayerKind, ViewPixels)>,
}

/// Pixels of a layer, by their type in the G-buffer.
#[derive(Clone, Debug, PartialEq)]
pub enum ViewPixels {
    /// sRGB and coverage; 0 where nothing is.
    Color(Vec<[u8; 4]>),
    /// As in spec/pyramid.md §6; 0 where nothing is.
    Normal(Vec<[u8; 3]>),
    /// Metres along the camera's `forward`; NaN where nothing is.
    Metres(Vec<f32>),
    /// As in the G-buffer.
    Numbers(Vec<u32>),
    /// As in the G-buffer.
    Shades(Vec<u8>),
}

impl ViewPixels {
    /// Returns `count` pixels where nothing is; `None` for a kind that is in no view.
    fn empty(row: &LayerRow, count: usize) -> Option<Self> {
        let array = row.array.filter(|_| row.view)?;
        match array.pixel {
            PixelType::U16x4 => Some(Self::Color(vec![[0; 4]; count])),
            PixelType::I16x3 => Some(Self::Normal(vec![[0; 3]; count])),
            PixelType::U32 if row.unit_m.is_some() => Some(Self::Metres(vec![f32::NAN; count])),
            PixelType::U32 => Some(Self::Numbers(vec![array.nothing; count])),
            PixelType::U8 => Some(Self::Shades(vec![array.nothing as u8; count])),
            PixelType::U16 => None,
        }
    }

    /// Copies pixels of a G-buffer's array.
    fn put(&mut self, array: &PixelArray, from: std::ops::Range<usize>, to: std::ops::Range<usize>, depth_m: impl Fn(u32) -> f32) {
        match (self, array) {
            (Self::Color(out), PixelArray::U16x4(color)) => out[to].copy_from_slice(&bytes_from_linear(&color[from])),
            (Self::Normal(out), PixelArray::I16x3(normals)) => out[to].as_flattened_mut().copy_from_slice(&bytes_from_normals(&normals[from])),
            (Self::Numbers(out), PixelArray::U32(numbers)) => out[to].copy_from_slice(&numbers[from]),
            (Self::Shades(out), PixelArray::U8(shades)) => out[to].copy_from_slice(&shades[from]),
            (Self::Metres(out), PixelArray::U32(depths)) => {
                let metres = |units: &u32| if *units == DEPTH_NOTHING { f32::NAN } else { depth_m(*units) };
                out[to].iter_mut().zip(&depths[from]).for_each(|(out, units)| *out = metres(units));
            }
            _ => unreachable!("the pixels are those of the kind's row"),
        }
    }
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
        let mut rows: Vec<&LayerRow> = LAYERS.iter().filter(|row| layers.has(row.kind)).collect();
        rows.sort_by_key(|row| row.code);
        let layers = rows.into_iter().filter_map(|row| Some((row.kind, ViewPixels::empty(row, width * height)?))).collect();
        Self { width, height, layers }
    }

    /// Returns the pixels of a layer.
    pub fn layer(&self, kind: LayerKind) -> Option<&ViewPixels> {
        self.layers.iter().find(|(k, _)| *k == kind).map(|(_, pixels)| pixels)
    }

    /// Copies a rectangle of a tile's G-buffer. `depth_m` converts stored depths.
    pub(super) fn put(&mut self, g: &GBuffer, rows: TileRows, depth_m: impl Fn(u32) -> f32) {
        for row in 0..rows.height {
            let first = (rows.from[1] + row) * g.width as usize + rows.from[0];
            let (from, at) = (first..first + rows.width, (rows.to[1] + row) * self.width + rows.to[0]);
            for (kind, pixels) in &mut self.layers {
                pixels.put(&g.by_code()[*kind as usize], from.clone(), at..at + rows.width, &depth_m);
            }
        }
    }
}
