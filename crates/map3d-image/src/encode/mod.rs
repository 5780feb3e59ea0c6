//! Encodes G-buffer arrays as the images of layers (spec/pyramid.md §6). The same array gives the same bytes on every machine.

mod color;
mod data;
mod deflate;
mod jpeg;
mod png;
mod webp;

use map3d_base::layers::{DEPTH, ID, NORMAL, PixelType};
use map3d_base::{Error, LayerFormat, LayerKind, LayerSpec, Result};

pub use color::{bytes_from_linear, color_from_linear};
pub use data::{bytes_from_normals, bytes_from_u32};
pub(crate) use deflate::Deflater;
pub use jpeg::encode_jpeg;
pub use png::{Deflate, Filter, PngImage, decode_png, encode_png};
pub use webp::encode_webp;

use crate::data_tile::DataTileEncoder;
use crate::gbuffer::GBuffer;
use crate::pixel_array::PixelArray;
use crate::raster::Raster;

/// Encodes layers one after another and reuses its buffers. One per thread.
#[derive(Default)]
pub struct Encoder {
    png: png::PngWriter,
    data: DataTileEncoder,
    small: bool,
}

impl Encoder {
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns an encoder that spends more time for fewer bytes. (`layer` follows its `LayerSpec` instead.)
    pub fn small() -> Self {
        Self { small: true, ..Self::default() }
    }

    fn png(&mut self, size: (u32, u32), channels: usize, pixels: &[u8], methods: png::MethodPair) -> Vec<u8> {
        self.png.write(size, channels, pixels, if self.small { methods.small } else { methods.quick })
    }

    /// Encodes channels of pixels of `channels` bytes each, in the given order, by the method of a kind of layer.
    pub fn channels(&mut self, size: (u32, u32), kind: LayerKind, (channels, pixels): (usize, &[u8]), order: &[usize]) -> Result<Vec<u8>> {
        if !(1..=4).contains(&order.len()) || order.iter().any(|k| *k >= channels) {
            return Err(Error::argument(format!("order {order:?}: expected 1 to 4 of the channels 0 to {}", channels.saturating_sub(1))));
        }
        check_length(size, pixels.len() / channels)?;
        let is_same = order.len() == channels && order.iter().enumerate().all(|(k, from)| k == *from);
        let methods = methods_of(kind)?;
        Ok(match is_same {
            true => self.png(size, channels, pixels, methods),
            false => self.png(size, order.len(), &data::reordered(pixels, channels, order), methods),
        })
    }

    /// Encodes one bit per pixel: true is white.
    pub fn bits(&mut self, size: (u32, u32), bits: &[bool]) -> Result<Vec<u8>> {
        check_length(size, bits.len())?;
        Ok(self.png.write_bits(size, &data::packed_rows(bits, size.0 as usize)))
    }

    /// Encodes one layer of a G-buffer.
    pub fn layer(&mut self, g: &GBuffer, spec: &LayerSpec) -> Result<Vec<u8>> {
        let size = (g.width, g.height);
        self.small = spec.small;
        match spec.kind {
            LayerKind::Data => {
                check_format(spec.kind, spec.format)?;
                self.data_tile(size, &g[NORMAL], &g[ID], &g[DEPTH])
            }
            kind => self.array(size, kind, &g.by_code()[kind as usize], spec.format, spec.quality),
        }
    }

    /// Encodes the array of a kind of layer; `quality` 1..=100 for lossy formats.
    pub fn array(&mut self, size: (u32, u32), kind: LayerKind, array: &PixelArray, format: LayerFormat, quality: u8) -> Result<Vec<u8>> {
        check_format(kind, format)?;
        check_length(size, array.len())?;
        let methods = methods_of(kind)?;
        match array {
            PixelArray::U16x4(color) => self.color(size, color, format, quality),
            PixelArray::I16x3(normals) => Ok(self.png(size, 3, &bytes_from_normals(normals), methods)),
            _ => Ok(self.png(size, array.bytes().len() / array.len(), array.bytes(), methods)),
        }
    }

    /// Encodes linear premultiplied colour; `quality` 1..=100 for lossy formats.
    pub fn color(&mut self, size: (u32, u32), color: &[[u16; 4]], format: LayerFormat, quality: u8) -> Result<Vec<u8>> {
        if !(1..=100).contains(&quality) {
            return Err(Error::argument(format!("quality is {quality}, expected 1 to 100")));
        }
        check_length(size, color.len())?;
        let image = color_from_linear(size, color);
        match format {
            LayerFormat::Webp => encode_webp(&image, quality, self.small),
            LayerFormat::Jpeg => encode_jpeg(&image, quality),
            LayerFormat::Png => Ok(self.color_png(&image)),
            LayerFormat::M3d => Err(Error::argument("a data tile holds no colour")),
        }
    }

    /// Encodes a PNG, without an alpha channel if the tile is opaque.
    fn color_png(&mut self, image: &Raster) -> Vec<u8> {
        let size = (image.width, image.height);
        if image.has_alpha() {
            return self.png(size, 4, image.pixels.as_flattened(), png::COLOR);
        }
        let rgb: Vec<u8> = image.pixels.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
        self.png(size, 3, &rgb, png::COLOR)
    }

    /// Encodes normal, id and depth as one data tile.
    pub fn data_tile(&mut self, size: (u32, u32), normals: &[[i16; 3]], ids: &[u32], depths: &[u32]) -> Result<Vec<u8>> {
        let deflate = if self.small { Deflate::Thorough } else { Deflate::Matching };
        self.data.encode(size, &data::packed_normals(normals), ids, depths, deflate)
    }
}

fn methods_of(kind: LayerKind) -> Result<png::MethodPair> {
    let row = kind.row();
    let array = row.array.ok_or_else(|| Error::argument(format!("layer {kind:?} is not a PNG")))?;
    Ok(match array.pixel {
        PixelType::U16x4 => png::COLOR,
        PixelType::I16x3 => png::NORMAL,
        PixelType::U32 if row.unit_m.is_some() => png::DEPTH,
        PixelType::U32 => png::ID,
        PixelType::U8 => png::SHADE,
        PixelType::U16 => png::SUN16,
    })
}

fn check_format(kind: LayerKind, format: LayerFormat) -> Result<()> {
    let formats = kind.row().formats;
    match formats.contains(&format) {
        true => Ok(()),
        false => Err(Error::argument(format!("layer {kind:?}: its format is {format:?}, expected one of {formats:?}"))),
    }
}

fn check_length((width, height): (u32, u32), got: usize) -> Result<()> {
    match width as usize * height as usize == got && got > 0 {
        true => Ok(()),
        false => Err(Error::argument(format!("{got} pixels, expected {width} × {height}"))),
    }
}
