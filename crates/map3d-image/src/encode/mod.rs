//! Encodes G-buffer arrays as the images of layers (spec/pyramid.md §6). The same array gives the same bytes on every machine.

mod color;
mod data;
mod deflate;
mod jpeg;
mod png;
mod webp;

use map3d_base::{Error, LayerFormat, LayerKind, LayerSpec, Result};

pub use color::{bytes_from_linear, color_from_linear};
pub use data::{bytes_from_normals, bytes_from_u16, bytes_from_u32};
pub(crate) use deflate::Deflater;
pub use jpeg::encode_jpeg;
pub use png::{Deflate, Filter, PngImage, decode_png, encode_png};
pub use webp::encode_webp;

use crate::data_tile::DataTileEncoder;
use crate::gbuffer::GBuffer;
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
            LayerKind::Color => self.color(size, &g.color, spec.format, spec.quality),
            LayerKind::Normal => self.normal(size, &g.normal, spec.format),
            LayerKind::Id => self.id(size, &g.id, spec.format),
            LayerKind::Depth => self.depth(size, &g.depth, spec.format),
            LayerKind::Sun => self.shade(size, &g.sun, spec.format),
            LayerKind::Sun16 => self.sun16(size, &g.sun16, spec.format),
            LayerKind::Ao => self.shade(size, &g.ao, spec.format),
            LayerKind::Depth2 => self.depth(size, &g.depth2, spec.format),
            LayerKind::Picture => self.color(size, &g.picture, spec.format, spec.quality),
            LayerKind::Data => self.data_tile(size, &g.normal, &g.id, &g.depth),
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

    pub fn normal(&mut self, size: (u32, u32), normals: &[[i16; 3]], format: LayerFormat) -> Result<Vec<u8>> {
        only_png("normal", format)?;
        check_length(size, normals.len())?;
        Ok(self.png(size, 3, &bytes_from_normals(normals), png::NORMAL))
    }

    pub fn id(&mut self, size: (u32, u32), ids: &[u32], format: LayerFormat) -> Result<Vec<u8>> {
        only_png("id", format)?;
        check_length(size, ids.len())?;
        Ok(self.png(size, 4, bytes_from_u32(ids), png::ID))
    }

    pub fn depth(&mut self, size: (u32, u32), depths: &[u32], format: LayerFormat) -> Result<Vec<u8>> {
        only_png("depth", format)?;
        check_length(size, depths.len())?;
        Ok(self.png(size, 4, bytes_from_u32(depths), png::DEPTH))
    }

    /// Encodes normal, id and depth as one data tile.
    pub fn data_tile(&mut self, size: (u32, u32), normals: &[[i16; 3]], ids: &[u32], depths: &[u32]) -> Result<Vec<u8>> {
        let deflate = if self.small { Deflate::Thorough } else { Deflate::Matching };
        self.data.encode(size, &data::packed_normals(normals), ids, depths, deflate)
    }

    /// Encodes one byte per pixel: sun, ambient occlusion.
    pub fn shade(&mut self, size: (u32, u32), shades: &[u8], format: LayerFormat) -> Result<Vec<u8>> {
        only_png("sun or ao", format)?;
        check_length(size, shades.len())?;
        Ok(self.png(size, 1, shades, png::SHADE))
    }

    /// Encodes one bit per sun.
    pub fn sun16(&mut self, size: (u32, u32), suns: &[u16], format: LayerFormat) -> Result<Vec<u8>> {
        only_png("sun16", format)?;
        check_length(size, suns.len())?;
        Ok(self.png(size, 2, bytes_from_u16(suns), png::SUN16))
    }
}

fn methods_of(kind: LayerKind) -> Result<png::MethodPair> {
    Ok(match kind {
        LayerKind::Color | LayerKind::Picture => png::COLOR,
        LayerKind::Normal => png::NORMAL,
        LayerKind::Id => png::ID,
        LayerKind::Depth | LayerKind::Depth2 => png::DEPTH,
        LayerKind::Sun | LayerKind::Ao => png::SHADE,
        LayerKind::Sun16 => png::SUN16,
        LayerKind::Data => return Err(Error::argument("a data tile is no PNG")),
    })
}

fn only_png(layer: &str, format: LayerFormat) -> Result<()> {
    match format {
        LayerFormat::Png => Ok(()),
        _ => Err(Error::argument(format!("layer {layer} is lossless: its format is png, not {format:?}"))),
    }
}

fn check_length((width, height): (u32, u32), got: usize) -> Result<()> {
    match width as usize * height as usize == got && got > 0 {
        true => Ok(()),
        false => Err(Error::argument(format!("{got} pixels, expected {width} × {height}"))),
    }
}
