//! Reads data tiles.

use std::collections::HashMap;
use std::path::Path;

use map3d_base::{DEPTH_NOTHING, Error, Result};

use super::residuals::ResidualReader;
use super::{AFTER_ABOVE, FRACTION_BITS, HEADER_BYTES, MAGIC, MAX_BODY_BYTES_PER_PX, MAX_DATA_TILE_PX, MAX_START, NEW, NO_DEPTHS, OWN_SLOPES};
use super::{ROUGH, SHARED_SLOPES, Slopes, VERSION, WITH_LENGTH, WITH_RESIDUALS, unfold, unfold_long};

/// The pixels of a data tile; rows from the top.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DataTile {
    pub width: u32,
    pub height: u32,
    /// R, G, B.
    pub normals: Vec<[u8; 3]>,
    pub ids: Vec<u32>,
    pub depths: Vec<u32>,
}

/// Decodes a data tile. Refuses everything that breaks the specification; allocates at most 42 bytes per pixel of a valid size.
pub fn decode_data_tile(bytes: &[u8]) -> Result<DataTile> {
    let refuse = |what: &str| Error::format(Path::new("data tile"), what);
    let header = Header::read(bytes).map_err(|what| refuse(&what))?;
    let body = inflate(&bytes[HEADER_BYTES..], header.body_bytes).ok_or_else(|| refuse("the zlib stream is damaged or has another size"))?;
    DataTileReader::new(&header, &body).and_then(|reader| reader.read(&header)).ok_or_else(|| refuse("its columns contradict each other"))
}

struct Header {
    width: u32,
    height: u32,
    body_bytes: usize,
    runs: usize,
    labels: usize,
    residuals: usize,
}

impl Header {
    fn read(bytes: &[u8]) -> std::result::Result<Self, String> {
        if bytes.len() < HEADER_BYTES || &bytes[..3] != MAGIC {
            return Err("not a data tile".into());
        }
        if bytes[3] != VERSION {
            return Err(format!("version {}, this program reads version {VERSION}", bytes[3]));
        }
        let side = |at: usize| u32::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
        let number = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize;
        let header = Self { width: side(4), height: side(6), body_bytes: number(8), runs: number(12), labels: number(16), residuals: number(20) };
        if !header.is_valid() {
            return Err("its header is out of range".into());
        }
        Ok(header)
    }

    fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    fn is_valid(&self) -> bool {
        let (sides, pixels) = (1..=MAX_DATA_TILE_PX, self.pixels());
        sides.contains(&self.width)
            && sides.contains(&self.height)
            && self.body_bytes <= MAX_BODY_BYTES_PER_PX * pixels
            && (self.height as usize..=pixels).contains(&self.runs)
            && (1..=self.runs).contains(&self.labels)
            && self.residuals <= pixels
    }
}

/// Returns the content of a zlib stream that fills `bytes` and inflates to `size` bytes.
fn inflate(stream: &[u8], size: usize) -> Option<Vec<u8>> {
    let mut body = vec![0; size];
    let written = libdeflater::Decompressor::new().zlib_decompress(stream, &mut body).ok()?;
    let mut sum = libdeflater::Adler32::new();
    sum.update(&body);
    (written == size && stream.ends_with(&sum.sum().to_be_bytes())).then_some(body)
}

/// Numbers as planes of bytes.
#[derive(Clone, Copy)]
struct Column<'a> {
    bytes: &'a [u8],
    count: usize,
}

impl<'a> Column<'a> {
    /// Takes a column of `count` numbers of `size` bytes from the front of the body.
    fn take(body: &mut &'a [u8], count: usize, size: usize) -> Option<Self> {
        let (bytes, rest) = body.split_at_checked(count * size)?;
        *body = rest;
        Some(Self { bytes, count })
    }

    fn get(&self, at: usize) -> u64 {
        self.bytes.iter().skip(at).step_by(self.count).zip(0..).fold(0, |n, (byte, k)| n | u64::from(*byte) << (8 * k))
    }

    fn numbers(self) -> impl Iterator<Item = u64> {
        (0..self.count).map(move |at| self.get(at))
    }
}

/// A label while its runs are read.
struct DecodedLabel {
    id: u32,
    normal: [u8; 3],
    shape: u8,
    slopes: Slopes,
    /// Difference to the depth near the first pixel; then the depth there, in 2^-14 units.
    start: i64,
    x: u32,
    y: u32,
    /// For rough labels, the offset of the first pixel of the last run.
    offset: u32,
}

/// A run of the row above.
#[derive(Clone, Copy)]
struct Above {
    end: u32,
    label: usize,
}

struct DataTileReader<'a> {
    codes: std::slice::Iter<'a, u8>,
    lengths: std::vec::IntoIter<u64>,
    labels: Vec<DecodedLabel>,
    begun: usize,
    residuals: ResidualReader<'a>,
    tile: DataTile,
}

impl<'a> DataTileReader<'a> {
    /// Reads the columns; `None` if they contradict the header or each other.
    fn new(header: &Header, mut body: &'a [u8]) -> Option<Self> {
        let codes = Column::take(&mut body, header.runs, 1)?.bytes;
        let is_known = |code: &u8| *code < 2 * WITH_RESIDUALS && *code & 3 <= NEW;
        if !codes.iter().all(is_known) {
            return None;
        }
        let lengths = Column::take(&mut body, codes.iter().filter(|code| **code & WITH_LENGTH != 0).count(), 2)?;
        let labels = read_labels(header.labels, &mut body)?;
        let residuals = ResidualReader::new(body, header.residuals)?;
        let n = header.pixels();
        let tile = DataTile { width: header.width, height: header.height, normals: vec![[0; 3]; n], ids: vec![0; n], depths: vec![DEPTH_NOTHING; n] };
        Some(Self { codes: codes.iter(), lengths: lengths.numbers().collect::<Vec<_>>().into_iter(), labels, begun: 0, residuals, tile })
    }

    fn read(mut self, header: &Header) -> Option<DataTile> {
        let (mut above, mut row) = (Vec::new(), Vec::new());
        for y in 0..header.height {
            self.read_row(y, &above, &mut row)?;
            std::mem::swap(&mut above, &mut row);
            row.clear();
        }
        let is_done = self.codes.next().is_none() && self.begun == self.labels.len() && self.residuals.is_done();
        is_done.then_some(self.tile)
    }

    fn read_row(&mut self, y: u32, above: &[Above], row: &mut Vec<Above>) -> Option<()> {
        let (mut x, mut at) = (0, 0);
        while x < self.tile.width {
            let code = *self.codes.next()?;
            while above.get(at).is_some_and(|run| run.end <= x) {
                at += 1;
            }
            let run = match code & 3 {
                NEW => Above { end: x, label: self.begin_label(x, y)? },
                source => *above.get(at + usize::from(source == AFTER_ABOVE))?,
            };
            let length = if code & WITH_LENGTH == 0 { 0 } else { unfold(self.lengths.next()? as u32) };
            let end = run.end.wrapping_add(length);
            if end <= x || end > self.tile.width {
                return None;
            }
            self.fill_run(run.label, y, x, end, code & WITH_RESIDUALS != 0)?;
            row.push(Above { end, ..run });
            x = end;
        }
        Some(())
    }

    /// Returns the number of the label that begins at a pixel.
    fn begin_label(&mut self, x: u32, y: u32) -> Option<usize> {
        let number = self.begun;
        let at = y as usize * self.tile.width as usize + x as usize;
        let near = match (x, y) {
            (0, 0) => 0,
            (0, _) => self.tile.depths[at - self.tile.width as usize],
            _ => self.tile.depths[at - 1],
        };
        let label = self.labels.get_mut(number)?;
        label.start += if near == DEPTH_NOTHING { 0 } else { i64::from(near) << FRACTION_BITS };
        (label.x, label.y) = (x, y);
        self.begun += 1;
        (label.shape == NO_DEPTHS || (0..MAX_START).contains(&label.start)).then_some(number)
    }

    fn fill_run(&mut self, label: usize, y: u32, x: u32, end: u32, has_residuals: bool) -> Option<()> {
        let Self { labels, residuals, tile, .. } = self;
        let label = &mut labels[label];
        let row = y as usize * tile.width as usize;
        let pixels = row + x as usize..row + end as usize;
        tile.normals[pixels.clone()].fill(label.normal);
        tile.ids[pixels.clone()].fill(label.id);
        if label.shape == NO_DEPTHS {
            return (!has_residuals).then_some(());
        }
        let is_rough = label.shape & ROUGH != 0;
        let right = i64::from(label.slopes.right);
        let mut value =
            label.start + right * (i64::from(x) - i64::from(label.x)) + i64::from(label.slopes.down) * (i64::from(y) - i64::from(label.y));
        let mut offset = label.offset;
        for (depth, k) in tile.depths[pixels].iter_mut().zip(0..) {
            let residual = if has_residuals { residuals.read()? } else { 0 };
            offset = residual.wrapping_add(if is_rough { offset } else { 0 });
            if k == 0 && is_rough {
                label.offset = offset;
            }
            *depth = ((value >> FRACTION_BITS) as u32).wrapping_add(offset);
            value += right;
        }
        Some(())
    }
}

fn read_labels(count: usize, body: &mut &[u8]) -> Option<Vec<DecodedLabel>> {
    let ids = Column::take(body, count, 4)?;
    let normals = Column::take(body, count, 3)?;
    let shapes = Column::take(body, count, 1)?.bytes;
    if shapes.iter().any(|shape| *shape >= 2 * ROUGH || *shape == ROUGH) {
        return None;
    }
    let own = shapes.iter().filter(|shape| **shape & 3 == OWN_SLOPES).count();
    let (right, down) = (Column::take(body, own, 4)?, Column::take(body, own, 4)?);
    let mut own =
        right.numbers().zip(down.numbers()).map(|(right, down)| Slopes { right: unfold(right as u32) as i32, down: unfold(down as u32) as i32 });
    let mut starts = Column::take(body, shapes.iter().filter(|shape| **shape != NO_DEPTHS).count(), 6)?.numbers();
    let (mut known, mut id) = (HashMap::new(), 0);
    let mut labels = Vec::with_capacity(count);
    for ((step, normal), shape) in ids.numbers().zip(normals.numbers()).zip(shapes) {
        id ^= step as u32;
        if shape & 3 == OWN_SLOPES {
            known.insert(normal, own.next()?);
        }
        let slopes = if shape & 3 >= OWN_SLOPES { *known.get(&normal)? } else { Slopes::default() };
        let start = if *shape == NO_DEPTHS { 0 } else { unfold_long(starts.next()?) };
        let normal = [normal as u8, (normal >> 8) as u8, (normal >> 16) as u8];
        labels.push(DecodedLabel { id, normal, shape: *shape, slopes, start, x: 0, y: 0, offset: 0 });
    }
    Some(labels)
}

const _: () = assert!(SHARED_SLOPES == OWN_SLOPES + 1, "shapes with slopes come last");
