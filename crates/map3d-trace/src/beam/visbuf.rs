//! The visibility buffer that a beam fills: the surface that each sample of a sub-tile shows.

use std::sync::Arc;

use map3d_base::{DEPTH_NOTHING, Frame, ViewAxes};
use map3d_scene::Chunk;

use super::pixels::SUBTILE_PX;
use super::sample_buffer::{MIXED, NOTHING, SPANS_PER_ROW, SampleBuffer, VisibleTriangle};
use crate::depth_plane::DepthPlane;
use crate::lanes::equal_lanes;
use crate::part::LoadedPart;
use crate::projection::{ProjectedTriangle, SubtileProjection, depth_units_at};
use crate::surface::SurfaceAttributes;

/// The surfaces that the 16 samples of a pixel show, as slots for `VisBuf::surface`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pixel<'a> {
    Nothing,
    /// All 16 samples show this surface.
    One(u32),
    /// A slot per sample in the order of `map3d_base::samples::SAMPLES`; `NOTHING` for a sample without a surface.
    Mixed(&'a [u32; 16]),
}

/// Samples of `SUBTILE_PX`² pixels. Slots number the surfaces that have won a sample; later surfaces may have hidden some of them again.
pub struct VisBuf {
    pub(super) samples: SampleBuffer,
    /// By slot.
    pub(super) triangles: Vec<VisibleTriangle>,
    pub(super) parts: Vec<LoadedPart>,
    pub(super) frame: Frame,
    pub(super) axes: ViewAxes,
    /// Top left pixel of level zmax.
    pub(super) corner_px: [u64; 2],
}

impl VisBuf {
    pub(super) fn new(frame: &Frame) -> Self {
        let (samples, axes) = (SampleBuffer::new(), frame.axes());
        Self { samples, triangles: Vec::new(), parts: Vec::new(), frame: frame.clone(), axes, corner_px: [0; 2] }
    }

    pub(super) fn restart(&mut self, corner_px: [u64; 2]) {
        self.samples.clear();
        self.triangles.clear();
        self.parts.clear();
        self.corner_px = corner_px;
    }

    /// Returns whether no sample shows a surface.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Slots are 0..slot_count().
    pub fn slot_count(&self) -> usize {
        self.triangles.len()
    }

    /// Returns the pixel in column i and row j of the sub-tile, each below `SUBTILE_PX`.
    #[inline]
    pub fn pixel(&self, i: usize, j: usize) -> Pixel<'_> {
        let p = j * SUBTILE_PX + i;
        match self.samples.slot_of(p) {
            NOTHING => Pixel::Nothing,
            MIXED => Pixel::Mixed(&self.samples.sample_slots[p]),
            slot => Pixel::One(slot),
        }
    }

    /// Returns the slot of sample 0, the pixel's centre, which gives the pixel its id, normal and depth.
    #[inline]
    pub fn center_slot(&self, i: usize, j: usize) -> Option<u32> {
        match self.pixel(i, j) {
            Pixel::Nothing => None,
            Pixel::One(slot) => Some(slot),
            Pixel::Mixed(slots) => (slots[0] != NOTHING).then_some(slots[0]),
        }
    }

    /// Returns the slots of a row of pixels, with `MIXED` for pixels that show several surfaces and `NOTHING` for empty ones.
    #[inline(always)]
    pub fn row(&self, j: usize) -> &[u32] {
        self.samples.slot[j * SPANS_PER_ROW..][..SPANS_PER_ROW].as_flattened()
    }

    /// Returns the slots of a `MIXED` pixel's samples.
    #[inline(always)]
    pub fn mixed(&self, i: usize, j: usize) -> &[u32; 16] {
        &self.samples.sample_slots[j * SUBTILE_PX + i]
    }

    /// Returns the mask of the samples of a `MIXED` pixel that show a slot.
    #[inline(always)]
    pub fn samples_of(slots: &[u32; 16], slot: u32) -> u32 {
        equal_lanes(slots, slot)
    }

    /// Computes the shading attributes of a slot. A call takes about 100 ns, so keep the result while shading a sub-tile.
    pub fn surface(&self, slot: u32) -> SurfaceAttributes {
        self.surface_and_depth(slot).0
    }

    /// Computes the shading attributes and the depth plane of a slot.
    pub fn surface_and_depth(&self, slot: u32) -> (SurfaceAttributes, DepthPlane) {
        let visible = &self.triangles[slot as usize];
        let projected = self.project(visible);
        let surface = SurfaceAttributes::new(&self.parts[visible.part as usize], visible.part, visible.triangle, &projected);
        (surface, DepthPlane::new(&projected.pixel))
    }

    /// Returns the chunk of a `SurfaceAttributes::chunk`.
    pub fn chunk(&self, number: u32) -> &Arc<Chunk> {
        &self.parts[number as usize].chunk
    }

    /// Returns the depth of a slot's surface at the centre of pixel (i, j), in units of 2^-10 m from D0.
    pub fn depth(&self, slot: u32, i: usize, j: usize) -> u32 {
        let projected = self.project(&self.triangles[slot as usize]);
        depth_units_at(&projected.pixel, i as f64 + 0.5, j as f64 + 0.5)
    }

    /// Returns the depth of the centre sample, `DEPTH_NOTHING` if it shows nothing.
    pub fn center_depth(&self, i: usize, j: usize) -> u32 {
        self.center_slot(i, j).map_or(DEPTH_NOTHING, |slot| self.depth(slot, i, j))
    }

    fn project(&self, visible: &VisibleTriangle) -> ProjectedTriangle {
        let part = &self.parts[visible.part as usize];
        let projection = SubtileProjection { frame: &self.frame, axes: &self.axes, corner_px: self.corner_px };
        projection.project_triangle(part.triangle_corners(&part.chunk.leaves()[visible.leaf as usize], visible.lane as usize))
    }
}
