//! Surfaces that are cut out by the alpha channel of their texture.

use std::cell::OnceCell;

use map3d_base::samples::SAMPLES;
use map3d_base::{Projection, Vec3};
use map3d_scene::MaterialRecord;

use crate::part::LoadedPart;
use crate::perspective::PerspectiveMap;
use crate::projection::SubtileProjection;
use crate::surface::{Affine, SurfaceAttributes, perspective_map, texture_at};

/// Texture coordinates of a sample on a surface whose material is a cut-out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutoutSample {
    /// u right, v up.
    pub uv: [f32; 2],
    /// Change of (u, v) over one pixel to the right and one pixel down; for rays, over the ray's width.
    pub footprint: [[f32; 2]; 2],
}

/// Decides which samples a cut-out surface covers: those with a filtered alpha of at least one half. Called only for materials with `is_cutout`.
pub trait Cutout {
    fn covers(&self, material: &MaterialRecord, sample: &CutoutSample) -> bool;

    /// Prepares a surface for many samples. `uv` are affine over the pixels of a sub-tile or, for a ray packet, over ray widths. With `None`, the caller
    /// calls `covers` for each sample.
    fn prepare(&self, _material: &MaterialRecord, _uv: &[Affine; 2]) -> Option<Box<dyn CutoutMask>> {
        None
    }
}

/// Coverage of one cut-out surface.
pub trait CutoutMask {
    /// Returns those of the `candidates` among the samples of pixel (i, j) that the surface covers; bit k is sample k.
    fn covered(&self, i: usize, j: usize, candidates: u32) -> u32;

    /// Returns the same as `Cutout::covers` with the footprint that the surface was prepared with.
    fn covers(&self, uv: [f32; 2]) -> bool;
}

/// Treats cut-outs as opaque.
#[derive(Clone, Copy, Debug, Default)]
pub struct IgnoreCutouts;

impl Cutout for IgnoreCutouts {
    fn covers(&self, _: &MaterialRecord, _: &CutoutSample) -> bool {
        true
    }
}

/// Texture coordinates over the pixels of a sub-tile.
pub(crate) enum CutoutMap {
    Affine([Affine; 2]),
    /// With the texture coordinates of the corners.
    Perspective(Box<PerspectiveMap>, [[f32; 2]; 3]),
}

impl CutoutMap {
    /// `local`: the corners of a triangle of the part.
    pub fn new(part: &LoadedPart, triangle: u32, projection: &SubtileProjection, local: [Vec3; 3]) -> Self {
        let Projection::Perspective(view) = projection.view else {
            return Self::Affine(SurfaceAttributes::new(part, 0, triangle, &projection.project_triangle(local)).uv);
        };
        let uv = part.chunk.triangles()[triangle as usize].uv;
        match perspective_map(view, projection.corner_px, &local) {
            None => Self::Affine([0, 1].map(|k| Affine { dx: 0.0, dy: 0.0, at0: uv[0][k] })),
            Some(map) if map.is_nearly_affine(map.center(), map.half_size()) => Self::Affine(texture_at(&map, &uv, map.center())),
            Some(map) => Self::Perspective(Box::new(map), uv),
        }
    }
}

/// A triangle whose material is a cut-out; prepared when its first sample is tested.
pub(crate) struct CutoutTriangle<'a> {
    material: &'a MaterialRecord,
    map: CutoutMap,
    mask: OnceCell<Option<Box<dyn CutoutMask>>>,
}

impl<'a> CutoutTriangle<'a> {
    pub fn new(material: &'a MaterialRecord, map: CutoutMap) -> Self {
        Self { material, map, mask: OnceCell::new() }
    }

    /// Returns the same as `CutoutMask::covered`.
    pub fn covered(&self, cutout: &dyn Cutout, i: usize, j: usize, candidates: u32) -> u32 {
        match &self.map {
            CutoutMap::Affine(uv) => match self.mask.get_or_init(|| cutout.prepare(self.material, uv)) {
                Some(mask) => mask.covered(i, j, candidates),
                None => self.test_each(cutout, uv, i, j, candidates),
            },
            CutoutMap::Perspective(map, corners) => {
                let uv = texture_at(map, corners, [i as f64 + 0.5, j as f64 + 0.5]);
                match cutout.prepare(self.material, &uv) {
                    Some(mask) => mask.covered(i, j, candidates),
                    None => self.test_each(cutout, &uv, i, j, candidates),
                }
            }
        }
    }

    fn test_each(&self, cutout: &dyn Cutout, [u, v]: &[Affine; 2], i: usize, j: usize, candidates: u32) -> u32 {
        let covers = |k: usize| {
            let (x, y) = (i as f32 + f32::from(SAMPLES[k].0) / 16.0, j as f32 + f32::from(SAMPLES[k].1) / 16.0);
            cutout.covers(self.material, &CutoutSample { uv: [u.at(x, y), v.at(x, y)], footprint: [[u.dx, v.dx], [u.dy, v.dy]] })
        };
        (0..16).filter(|k| candidates >> k & 1 != 0 && covers(*k)).fold(0, |mask, k| mask | 1 << k)
    }
}
