//! Writes data tiles.

use map3d_base::{DEPTH_NOTHING, Error, Result};

use super::label::{Label, Shape};
use super::residuals::ResidualWriter;
use super::segments::{Pixels, Run, Segments};
use super::{FRACTION_BITS, HEADER_BYTES, MAGIC, MAX_DATA_TILE_PX, NEW, NO_DEPTHS, OWN_SLOPES, ROUGH, SHARED_SLOPES, Slopes, VERSION};
use super::{WITH_LENGTH, WITH_RESIDUALS, ZERO_SLOPES, fold, fold_long};
use crate::encode::{Deflate, Deflater};

/// Encodes data tiles one after another and reuses its buffers. One per thread.
#[derive(Default)]
pub struct DataTileEncoder {
    segments: Segments,
    residuals: ResidualWriter,
    body: Vec<u8>,
    column: Column,
    deflater: Deflater,
}

impl DataTileEncoder {
    /// Encodes pixels row by row from the top; `normals` as 0xBBGGRR. Fails for sizes of more than 1,024 px and arrays of other lengths.
    pub fn encode(&mut self, (width, height): (u32, u32), normals: &[u32], ids: &[u32], depths: &[u32], deflate: Deflate) -> Result<Vec<u8>> {
        check_size((width, height), [normals.len(), ids.len(), depths.len()])?;
        let pixels = Pixels { width: width as usize, ids, normals, depths };
        self.segments.find(pixels);
        self.fit_planes(pixels);
        self.find_residuals(pixels);
        self.write_body(pixels);
        let mut out = self.header(width, height);
        out.extend_from_slice(self.deflater.zlib(&self.body, deflate));
        Ok(out)
    }

    fn header(&self, width: u32, height: u32) -> Vec<u8> {
        let mut out = Vec::with_capacity(HEADER_BYTES + self.body.len() / 2);
        out.extend_from_slice(MAGIC);
        out.push(VERSION);
        for side in [width, height] {
            out.extend_from_slice(&(side as u16).to_le_bytes());
        }
        for n in [self.body.len(), self.segments.runs.len(), self.segments.labels.len(), self.residuals.count()] {
            out.extend_from_slice(&(n as u32).to_le_bytes());
        }
        out
    }

    fn fit_planes(&mut self, pixels: Pixels) {
        let Segments { runs, labels } = &mut self.segments;
        let mut known = KnownSlopes::new();
        for label in labels.iter_mut() {
            label.fit(known.get(label.normal));
            if let Shape::Plane(slopes) = label.shape {
                known.set(label.normal, slopes);
            }
        }
        for run in runs.iter_mut() {
            labels[run.label as usize].compare(run, depths_of(pixels, run));
        }
        labels.iter_mut().for_each(Label::settle);
    }

    fn find_residuals(&mut self, pixels: Pixels) {
        let Self { segments: Segments { runs, labels }, residuals, .. } = self;
        residuals.clear();
        for run in runs.iter_mut() {
            let (label, depths) = (&mut labels[run.label as usize], depths_of(pixels, run));
            match label.shape {
                Shape::Plane(slopes) if run.has_residuals => label.offsets(slopes, run, depths).for_each(|offset| residuals.push(offset)),
                Shape::Rough(slopes) => add_rough(label, slopes, run, depths, residuals),
                _ => {}
            }
        }
    }

    fn write_body(&mut self, pixels: Pixels) {
        let Self { segments: Segments { runs, labels }, residuals, body, column, .. } = self;
        body.clear();
        body.extend(runs.iter().map(code_of));
        column.write(body, 2, runs.iter().filter(|run| has_length(run)).map(|run| u64::from(fold(run.end.wrapping_sub(run.expected_end)))));
        let ids_before = std::iter::once(0).chain(labels.iter().map(|label| label.id));
        column.write(body, 4, labels.iter().zip(ids_before).map(|(label, before)| u64::from(label.id ^ before)));
        column.write(body, 3, labels.iter().map(|label| u64::from(label.normal)));
        let own = write_shapes(body, labels);
        column.write(body, 4, own.iter().map(|slopes| u64::from(fold(slopes.right as u32))));
        column.write(body, 4, own.iter().map(|slopes| u64::from(fold(slopes.down as u32))));
        let with_depths = labels.iter().filter(|label| label.shape != Shape::Nothing);
        column.write(body, 6, with_depths.map(|label| fold_long(label.start - start_near(pixels, label))));
        residuals.write(body);
    }
}

/// Adds the residuals of a run of a rough label, none if all are 0.
fn add_rough(label: &mut Label, slopes: Slopes, run: &mut Run, depths: &[u32], residuals: &mut ResidualWriter) {
    let (count, mut before) = (residuals.count(), label.offset);
    let mut offsets = label.offsets(slopes, run, depths);
    let first = offsets.next().unwrap_or(before);
    residuals.push(first.wrapping_sub(before));
    before = first;
    run.has_residuals = first != label.offset;
    for offset in offsets {
        residuals.push(offset.wrapping_sub(before));
        run.has_residuals |= offset != before;
        before = offset;
    }
    match run.has_residuals {
        true => label.offset = first,
        false => residuals.drop_zeros(count),
    }
}

/// Appends the shapes; returns the slopes of the labels that have their own.
fn write_shapes(body: &mut Vec<u8>, labels: &[Label]) -> Vec<Slopes> {
    let (mut known, mut own) = (KnownSlopes::new(), Vec::new());
    for label in labels {
        let (slopes, rough) = match label.shape {
            Shape::Nothing => {
                body.push(NO_DEPTHS);
                continue;
            }
            Shape::Plane(slopes) => (slopes, 0),
            Shape::Rough(slopes) => (slopes, ROUGH),
        };
        let source = if slopes == Slopes::default() {
            ZERO_SLOPES
        } else if known.get(label.normal) == Some(slopes) {
            SHARED_SLOPES
        } else {
            known.set(label.normal, slopes);
            own.push(slopes);
            OWN_SLOPES
        };
        body.push(source | rough);
    }
    own
}

/// The slopes of the last label of a normal; forgets normals that share a place with others.
struct KnownSlopes(Vec<(u32, Slopes)>);

impl KnownSlopes {
    const PLACES: u32 = 1 << 9;

    fn new() -> Self {
        Self(vec![(u32::MAX, Slopes::default()); Self::PLACES as usize])
    }

    fn place(normal: u32) -> usize {
        (normal.wrapping_mul(0x9E37_79B1) >> (32 - Self::PLACES.trailing_zeros())) as usize
    }

    fn get(&self, normal: u32) -> Option<Slopes> {
        let (known, slopes) = self.0[Self::place(normal)];
        (known == normal).then_some(slopes)
    }

    fn set(&mut self, normal: u32, slopes: Slopes) {
        self.0[Self::place(normal)] = (normal, slopes);
    }
}

/// Returns the depth from which the start of a label counts, in 2^-14 units.
fn start_near(pixels: Pixels, label: &Label) -> i64 {
    let at = label.y as usize * pixels.width + label.x as usize;
    let near = match (label.x, label.y) {
        (0, 0) => 0,
        (0, _) => pixels.depths[at - pixels.width],
        _ => pixels.depths[at - 1],
    };
    if near == DEPTH_NOTHING { 0 } else { i64::from(near) << FRACTION_BITS }
}

fn depths_of<'a>(pixels: Pixels<'a>, run: &Run) -> &'a [u32] {
    let from = run.row as usize * pixels.width;
    &pixels.depths[from + run.start as usize..from + run.end as usize]
}

fn has_length(run: &Run) -> bool {
    run.source == NEW || run.end != run.expected_end
}

fn code_of(run: &Run) -> u8 {
    run.source | if has_length(run) { WITH_LENGTH } else { 0 } | if run.has_residuals { WITH_RESIDUALS } else { 0 }
}

/// The numbers of a column, kept for its memory.
#[derive(Default)]
struct Column(Vec<u64>);

impl Column {
    /// Appends numbers as planes of bytes, the lowest first.
    fn write(&mut self, body: &mut Vec<u8>, bytes: u32, numbers: impl Iterator<Item = u64>) {
        self.0.clear();
        self.0.extend(numbers);
        for k in 0..bytes {
            body.extend(self.0.iter().map(|n| (n >> (8 * k)) as u8));
        }
    }
}

fn check_size((width, height): (u32, u32), lengths: [usize; 3]) -> Result<()> {
    let sides = 1..=MAX_DATA_TILE_PX;
    let is_right = sides.contains(&width) && sides.contains(&height) && lengths == [width as usize * height as usize; 3];
    match is_right {
        true => Ok(()),
        false => Err(Error::argument(format!(
            "{lengths:?} pixels for a data tile of {width} × {height}, expected 1 to {MAX_DATA_TILE_PX} px on each side"
        ))),
    }
}
