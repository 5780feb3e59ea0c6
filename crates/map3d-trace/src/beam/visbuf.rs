//! The visibility buffer that a beam fills: the surface that each sample of a sub-tile shows.

use std::sync::Arc;

use map3d_base::{DEPTH_NOTHING, DEPTH_UNITS_PER_M, Projection, Vec3};
use map3d_scene::Chunk;

use super::pixels::SUBTILE_PX;
use super::sample_buffer::{MIXED, NOTHING, SPANS_PER_ROW, SampleBuffer, VisibleTriangle};
use crate::depth_plane::{AffineDepth, DepthPlane};
use crate::lanes::equal_lanes;
use crate::part::LoadedPart;
use crate::perspective::{PerspectiveMap, homogeneous, inverse_depth};
use crate::projection::{ProjectedTriangle, SubtileProjection, depth_units_at, each_corner};
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

/// A surface in perspective.
pub struct CurvedSurface {
    pub attributes: SurfaceAttributes,
    pub depth: DepthPlane,
    /// The exact weights of the corners; `None` where the affine functions of `attributes` are near enough.
    pub map: Option<PerspectiveMap>,
    /// Texture coordinates of the corners.
    pub uv: [[f32; 2]; 3],
}

/// Samples of `SUBTILE_PX`² pixels. Slots number the surfaces that have won a sample; later surfaces may have hidden some of them again.
pub struct VisBuf {
    pub(super) samples: SampleBuffer,
    /// By slot.
    pub(super) triangles: Vec<VisibleTriangle>,
    pub(super) parts: Vec<LoadedPart>,
    pub(super) view: Projection,
    /// Top left pixel.
    pub(super) corner_px: [u64; 2],
}

impl VisBuf {
    pub(super) fn new(view: Projection) -> Self {
        Self { samples: SampleBuffer::new(), triangles: Vec::new(), parts: Vec::new(), view, corner_px: [0; 2] }
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
        match &self.view {
            Projection::Parallel(_) => {
                let projected = self.project(visible);
                let surface = SurfaceAttributes::new(&self.parts[visible.part as usize], visible.part, visible.triangle, &projected);
                (surface, DepthPlane::Parallel(AffineDepth::new(&projected.pixel)))
            }
            Projection::Perspective(_) => {
                let CurvedSurface { attributes, depth, .. } = self.curved_surface(slot);
                (attributes, depth)
            }
        }
    }

    /// Computes the shading of a slot in perspective.
    pub fn curved_surface(&self, slot: u32) -> CurvedSurface {
        let visible = &self.triangles[slot as usize];
        let (part, local) = (&self.parts[visible.part as usize], self.triangle_corners(visible));
        let projected = ProjectedTriangle { local, pixel: local, forward: self.view.line_of_sight(local[0]) };
        let (map, depth) = match &self.view {
            Projection::Parallel(_) => (None, DepthPlane::of_corners(&self.view, &local, self.corner_px)),
            Projection::Perspective(view) => {
                let (corners, near) = (each_corner(&local, |p| homogeneous(view, self.corner_px, p)), view.near_m * DEPTH_UNITS_PER_M);
                let inverse = inverse_depth(&corners);
                let map = inverse.and_then(|inverse| PerspectiveMap::with_inverse(&corners, inverse, near, SUBTILE_PX as f64));
                (map, DepthPlane::of_homogeneous(&corners, inverse, near))
            }
        };
        CurvedSurface {
            attributes: SurfaceAttributes::in_perspective(part, visible.part, visible.triangle, &projected, map.as_ref()),
            depth,
            map: map.filter(|map| !map.is_nearly_affine(map.center(), map.half_size())),
            uv: part.chunk.triangles()[visible.triangle as usize].uv,
        }
    }

    /// The view that was traced.
    pub fn view(&self) -> &Projection {
        &self.view
    }

    /// Returns the chunk of a `SurfaceAttributes::chunk`.
    pub fn chunk(&self, number: u32) -> &Arc<Chunk> {
        &self.parts[number as usize].chunk
    }

    /// Returns the depth of a slot's surface at the centre of pixel (i, j), in units of 2^-10 m.
    pub fn depth(&self, slot: u32, i: usize, j: usize) -> u32 {
        let visible = &self.triangles[slot as usize];
        match &self.view {
            Projection::Parallel(_) => depth_units_at(&self.project(visible).pixel, i as f64 + 0.5, j as f64 + 0.5),
            Projection::Perspective(_) => DepthPlane::of_corners(&self.view, &self.triangle_corners(visible), self.corner_px).units(i, j),
        }
    }

    /// Returns the depth of the centre sample, `DEPTH_NOTHING` if it shows nothing.
    pub fn center_depth(&self, i: usize, j: usize) -> u32 {
        self.center_slot(i, j).map_or(DEPTH_NOTHING, |slot| self.depth(slot, i, j))
    }

    fn project(&self, visible: &VisibleTriangle) -> ProjectedTriangle {
        SubtileProjection { view: &self.view, corner_px: self.corner_px }.project_triangle(self.triangle_corners(visible))
    }

    fn triangle_corners(&self, visible: &VisibleTriangle) -> [Vec3; 3] {
        let part = &self.parts[visible.part as usize];
        part.triangle_corners(&part.chunk.leaves()[visible.leaf as usize], visible.lane as usize)
    }
}
