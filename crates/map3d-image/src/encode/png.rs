//! Encodes PNG: 8-bit, not interlaced, one IDAT, no ancillary chunks. The whole image has one filter and one deflate method, chosen per layer by
//! measurement (docs/benchmarks.md, Encoding).

use std::io::Cursor;
use std::path::Path;

use map3d_base::{Error, Result};

pub use crate::encode::deflate::{Deflate, Deflater};

/// The filter of all rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Filter {
    None = 0,
    Sub = 1,
    Up = 2,
    Average = 3,
    Paeth = 4,
}

/// Filter and compression of an image.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    pub filter: Filter,
    pub deflate: Deflate,
}

/// The methods of a layer: the quick one and the one that gives fewer bytes.
#[derive(Clone, Copy, Debug)]
pub struct MethodPair {
    pub quick: Method,
    pub small: Method,
}

const fn methods(quick: (Filter, Deflate), small: (Filter, Deflate)) -> MethodPair {
    MethodPair { quick: Method { filter: quick.0, deflate: quick.1 }, small: Method { filter: small.0, deflate: small.1 } }
}

/// The quick method is the small one, too.
const fn alike(both: (Filter, Deflate)) -> MethodPair {
    methods(both, both)
}

pub const COLOR: MethodPair = methods((Filter::Up, Deflate::Fast), (Filter::Average, Deflate::Thorough));
pub const NORMAL: MethodPair = methods((Filter::Up, Deflate::Fast), (Filter::None, Deflate::Thorough));
pub const ID: MethodPair = methods((Filter::Up, Deflate::Fast), (Filter::Up, Deflate::Thorough));
pub const DEPTH: MethodPair = methods((Filter::Sub, Deflate::Matching), (Filter::Sub, Deflate::Thorough));
/// Light takes 7 to 70 ms a tile to trace, and 0.4 ms to encode in this way.
pub const SHADE: MethodPair = alike((Filter::Sub, Deflate::Thorough));
pub const SUN16: MethodPair = alike((Filter::None, Deflate::Thorough));

/// Method for images with one bit per pixel.
const BITS: Method = Method { filter: Filter::None, deflate: Deflate::Matching };

/// Bits per sample, and the PNG's colour type.
struct Samples {
    depth: u8,
    color_type: u8,
}

const SIGNATURE: [u8; 8] = [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1A, b'\n'];

/// Writes PNGs and reuses its buffers.
#[derive(Default)]
pub struct PngWriter {
    filtered: Vec<u8>,
    deflater: Deflater,
}

impl PngWriter {
    /// Encodes an image. `pixels`: rows of `width · channels` bytes; 1 channel (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA).
    pub fn write(&mut self, size: (u32, u32), channels: usize, pixels: &[u8], method: Method) -> Vec<u8> {
        let row = size.0 as usize * channels;
        assert_eq!(pixels.len(), row * size.1 as usize, "{size:?} × {channels} bytes");
        let color_type = [0, 4, 2, 6][channels - 1];
        self.write_rows(size, Samples { depth: 8, color_type }, pixels, channels, method)
    }

    /// Encodes an image of one bit per pixel; 1 is white. `rows`: each padded to whole bytes, the leftmost pixel in the highest bit.
    pub fn write_bits(&mut self, size: (u32, u32), rows: &[u8]) -> Vec<u8> {
        assert_eq!(rows.len(), size.0.div_ceil(8) as usize * size.1 as usize, "{size:?} bits");
        self.write_rows(size, Samples { depth: 1, color_type: 0 }, rows, 1, BITS)
    }

    /// `step`: bytes per pixel, at least 1.
    fn write_rows(&mut self, size: (u32, u32), samples: Samples, rows: &[u8], step: usize, method: Method) -> Vec<u8> {
        filter_rows(&mut self.filtered, rows, rows.len() / size.1 as usize, step, method.filter);
        let body = self.deflater.zlib(&self.filtered, method.deflate);
        let mut header = [0u8; 13];
        header[..4].copy_from_slice(&size.0.to_be_bytes());
        header[4..8].copy_from_slice(&size.1.to_be_bytes());
        header[8..10].copy_from_slice(&[samples.depth, samples.color_type]);
        let mut out = Vec::with_capacity(body.len() + 64);
        out.extend_from_slice(&SIGNATURE);
        chunk(&mut out, b"IHDR", &header);
        chunk(&mut out, b"IDAT", body);
        chunk(&mut out, b"IEND", &[]);
        out
    }
}

/// Encodes a single image; see `PngWriter::write`.
pub fn encode_png(size: (u32, u32), channels: usize, pixels: &[u8], filter: Filter, deflate: Deflate) -> Vec<u8> {
    PngWriter::default().write(size, channels, pixels, Method { filter, deflate })
}

fn chunk(out: &mut Vec<u8>, name: &[u8; 4], body: &[u8]) {
    out.extend_from_slice(&(body.len() as u32).to_be_bytes());
    let from = out.len();
    out.extend_from_slice(name);
    out.extend_from_slice(body);
    let crc = crc32fast::hash(&out[from..]);
    out.extend_from_slice(&crc.to_be_bytes());
}

/// Writes each row after its filter's number.
fn filter_rows(out: &mut Vec<u8>, pixels: &[u8], row: usize, step: usize, filter: Filter) {
    out.clear();
    out.resize(pixels.len() + pixels.len() / row, 0);
    let zeros = vec![0u8; row];
    let mut above: &[u8] = &zeros;
    for (to, from) in out.chunks_exact_mut(row + 1).zip(pixels.chunks_exact(row)) {
        to[0] = filter as u8;
        filter_row(&mut to[1..], from, above, step, filter);
        above = from;
    }
}

fn filter_row(to: &mut [u8], from: &[u8], above: &[u8], step: usize, filter: Filter) {
    match filter {
        Filter::None => to.copy_from_slice(from),
        Filter::Up => to.iter_mut().zip(from.iter().zip(above)).for_each(|(t, (f, a))| *t = f.wrapping_sub(*a)),
        Filter::Sub => {
            to[..step].copy_from_slice(&from[..step]);
            to[step..].iter_mut().zip(from[step..].iter().zip(from)).for_each(|(t, (f, l))| *t = f.wrapping_sub(*l));
        }
        Filter::Average | Filter::Paeth => {
            for i in 0..from.len() {
                let (left, corner) = if i < step { (0, 0) } else { (from[i - step], above[i - step]) };
                let guess = if filter == Filter::Paeth { paeth(left, above[i], corner) } else { ((u16::from(left) + u16::from(above[i])) / 2) as u8 };
                to[i] = from[i].wrapping_sub(guess);
            }
        }
    }
}

fn paeth(left: u8, above: u8, corner: u8) -> u8 {
    let (a, b, c) = (i16::from(left), i16::from(above), i16::from(corner));
    let (pa, pb, pc) = ((b - c).abs(), (a - c).abs(), (a + b - 2 * c).abs());
    if pa <= pb && pa <= pc {
        left
    } else if pb <= pc {
        above
    } else {
        corner
    }
}

/// A decoded PNG.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PngImage {
    pub width: u32,
    pub height: u32,
    pub channels: usize,
    /// Rows of `width · channels` bytes.
    pub pixels: Vec<u8>,
}

/// Decodes a PNG, for checks; converts other depths and palettes to 8-bit channels.
pub fn decode_png(bytes: &[u8]) -> Result<PngImage> {
    let refuse = |e: png::DecodingError| Error::format(Path::new("png"), e.to_string());
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png::Limits { bytes: 512 << 20 });
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    let mut reader = decoder.read_info().map_err(refuse)?;
    let size = reader.output_buffer_size().ok_or_else(|| Error::format(Path::new("png"), "too large"))?;
    if size > 512 << 20 {
        return Err(Error::format(Path::new("png"), format!("{size} bytes, at most 512 MiB")));
    }
    let mut pixels = vec![0; size];
    let info = reader.next_frame(&mut pixels).map_err(refuse)?;
    pixels.truncate(info.buffer_size());
    Ok(PngImage { width: info.width, height: info.height, channels: info.color_type.samples(), pixels })
}
