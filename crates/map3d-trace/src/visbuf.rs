//! The result of a beam: which surface each sample of a sub-tile meets.

use std::sync::Arc;

use map3d_base::{DEPTH_NOTHING, Frame, ViewAxes};
use map3d_scene::{Chunk, InstanceRecord};

pub use crate::beam::buffer::MIXED;
use crate::beam::buffer::{BLOCKS_PER_ROW, SampleBuffer, Track};
use crate::beam::project::{Projection, units_of_plane};
use crate::lanes::equal_lanes;
use crate::plane::DepthPlane;
use crate::surface::{Placed, Surface};

/// Side of a sub-tile in pixels: its buffers stay in the second-level cache.
pub const SUBTILE_PX: usize = 64;
/// The slot of samples that meet nothing.
pub const NOTHING: u32 = u32::MAX;

/// What the 16 samples of a pixel meet, as slots for `VisBuf::surface`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pixel<'a> {
    Nothing,
    /// All 16 samples meet this surface.
    One(u32),
    /// A slot per sample, in the order of `map3d_base::samples::SAMPLES`; `NOTHING` where there is none.
    Mixed(&'a [u32; 16]),
}

/// A part that the beam met: its chunk, and its placement if it is an instance.
#[derive(Clone, Debug)]
pub(crate) struct MetPart {
    pub chunk: Arc<Chunk>,
    pub instance: Option<(u32, InstanceRecord)>,
}

/// Samples of `SUBTILE_PX`² pixels. Slots number the surfaces that won a sample at some time; not every slot is still seen.
pub struct VisBuf {
    pub(crate) samples: SampleBuffer,
    pub(crate) tracks: Vec<Track>,
    pub(crate) parts: Vec<MetPart>,
    pub(crate) frame: Frame,
    pub(crate) axes: ViewAxes,
    /// Top left pixel of level zmax.
    pub(crate) corner_px: [u64; 2],
}

impl VisBuf {
    pub(crate) fn new(frame: &Frame) -> Self {
        let (samples, axes) = (SampleBuffer::new(), frame.axes());
        Self { samples, tracks: Vec::new(), parts: Vec::new(), frame: frame.clone(), axes, corner_px: [0; 2] }
    }

    pub(crate) fn restart(&mut self, corner_px: [u64; 2]) {
        self.samples.clear();
        self.tracks.clear();
        self.parts.clear();
        self.corner_px = corner_px;
    }

    /// No sample meets anything.
    pub fn is_empty(&self) -> bool {
        self.tracks.is_empty()
    }

    /// Slots are 0..slot_count().
    pub fn slot_count(&self) -> usize {
        self.tracks.len()
    }

    /// Column i and row j of the sub-tile, each below `SUBTILE_PX`.
    #[inline]
    pub fn pixel(&self, i: usize, j: usize) -> Pixel<'_> {
        let p = j * SUBTILE_PX + i;
        match self.samples.slot_of(p) {
            NOTHING => Pixel::Nothing,
            MIXED => Pixel::Mixed(&self.samples.slots[p]),
            slot => Pixel::One(slot),
        }
    }

    /// The slot of sample 0, the pixel's centre, whose id, normal and depth the pixel shows.
    #[inline]
    pub fn center_slot(&self, i: usize, j: usize) -> Option<u32> {
        match self.pixel(i, j) {
            Pixel::Nothing => None,
            Pixel::One(slot) => Some(slot),
            Pixel::Mixed(slots) => (slots[0] != NOTHING).then_some(slots[0]),
        }
    }

    /// The slots of a row of pixels, `MIXED` for those whose samples meet several, `NOTHING` where there is none.
    #[inline(always)]
    pub fn row(&self, j: usize) -> &[u32] {
        self.samples.slot[j * BLOCKS_PER_ROW..][..BLOCKS_PER_ROW].as_flattened()
    }

    /// The slots of a `MIXED` pixel's samples.
    #[inline(always)]
    pub fn mixed(&self, i: usize, j: usize) -> &[u32; 16] {
        &self.samples.slots[j * SUBTILE_PX + i]
    }

    /// The samples of a `MIXED` pixel that meet a slot.
    #[inline(always)]
    pub fn samples_of(slots: &[u32; 16], slot: u32) -> u32 {
        equal_lanes(slots, slot)
    }

    /// What shading needs of a slot; computed anew at each call (some 100 ns), so keep it while shading a sub-tile.
    pub fn surface(&self, slot: u32) -> Surface {
        self.surface_and_depth(slot).0
    }

    /// The same with its depth plane.
    pub fn surface_and_depth(&self, slot: u32) -> (Surface, DepthPlane) {
        let track = &self.tracks[slot as usize];
        let part = &self.parts[track.part as usize];
        let placed = self.placed(track, part);
        let surface = Surface::new(track.part, &part.chunk, track.triangle, part.instance.as_ref().map(|(k, r)| (*k, r)), &placed);
        (surface, DepthPlane::new(&placed.pixel))
    }

    /// The chunk of a `Surface::chunk`.
    pub fn chunk(&self, number: u32) -> &Arc<Chunk> {
        &self.parts[number as usize].chunk
    }

    /// Depth of a slot's surface at the centre of pixel (i, j), in units of 2^-10 m from D0.
    pub fn depth(&self, slot: u32, i: usize, j: usize) -> u32 {
        let track = &self.tracks[slot as usize];
        let placed = self.placed(track, &self.parts[track.part as usize]);
        units_of_plane(&placed.pixel, i as f64 + 0.5, j as f64 + 0.5)
    }

    /// Depth of the centre sample, `DEPTH_NOTHING` where it meets nothing.
    pub fn center_depth(&self, i: usize, j: usize) -> u32 {
        self.center_slot(i, j).map_or(DEPTH_NOTHING, |slot| self.depth(slot, i, j))
    }

    fn placed(&self, track: &Track, part: &MetPart) -> Placed<'_> {
        let leaf = &part.chunk.leaves()[track.leaf as usize];
        let projection = Projection { frame: &self.frame, axes: &self.axes, corner_px: self.corner_px };
        let local = projection.local_corners(leaf, track.lane as usize, part.chunk.origin(), part.instance.as_ref().map(|i| &i.1.transform));
        Placed { local, pixel: local.map(|p| projection.pixel(p)), axes: &self.axes }
    }
}
