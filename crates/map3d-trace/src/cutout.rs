//! Surfaces that are cut out by the alpha channel of their texture.

use std::cell::OnceCell;

use map3d_base::samples::SAMPLES;
use map3d_scene::MaterialRecord;

use crate::surface::Affine;

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

/// A triangle whose material is a cut-out; prepared when its first sample is tested.
pub(crate) struct CutoutTriangle<'a> {
    material: &'a MaterialRecord,
    uv: [Affine; 2],
    mask: OnceCell<Option<Box<dyn CutoutMask>>>,
}

impl<'a> CutoutTriangle<'a> {
    pub fn new(material: &'a MaterialRecord, uv: [Affine; 2]) -> Self {
        Self { material, uv, mask: OnceCell::new() }
    }

    /// Returns the same as `CutoutMask::covered`.
    pub fn covered(&self, cutout: &dyn Cutout, i: usize, j: usize, candidates: u32) -> u32 {
        match self.mask.get_or_init(|| cutout.prepare(self.material, &self.uv)) {
            Some(mask) => mask.covered(i, j, candidates),
            None => self.test_each(cutout, i, j, candidates),
        }
    }

    fn test_each(&self, cutout: &dyn Cutout, i: usize, j: usize, candidates: u32) -> u32 {
        let [u, v] = &self.uv;
        let covers = |k: usize| {
            let (x, y) = (i as f32 + f32::from(SAMPLES[k].0) / 16.0, j as f32 + f32::from(SAMPLES[k].1) / 16.0);
            cutout.covers(self.material, &CutoutSample { uv: [u.at(x, y), v.at(x, y)], footprint: [[u.dx, v.dx], [u.dy, v.dy]] })
        };
        (0..16).filter(|k| candidates >> k & 1 != 0 && covers(*k)).fold(0, |mask, k| mask | 1 << k)
    }
}
