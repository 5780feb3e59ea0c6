//! Surfaces that are cut out by the alpha channel of their texture.

use std::cell::OnceCell;

use map3d_base::samples::SAMPLES;
use map3d_scene::MaterialRecord;

use crate::surface::Affine;

/// Where a sample meets a surface whose material is a cut-out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutoutSample {
    /// u right, v up.
    pub uv: [f32; 2],
    /// Change of (u, v) over one pixel to the right and one pixel down; for rays over the ray's width.
    pub footprint: [[f32; 2]; 2],
}

/// Decides which samples a cut-out surface covers: those whose filtered alpha is at least one half. Asked only for materials with `is_cutout`.
pub trait Cutout {
    fn covers(&self, material: &MaterialRecord, sample: &CutoutSample) -> bool;

    /// Sets up a surface for many samples; its (u, v) are given over the pixels of a sub-tile, or over a bundle's rays in their widths. `None`: `covers` is
    /// asked of each.
    fn stencil(&self, _material: &MaterialRecord, _uv: &[Affine; 2]) -> Option<Box<dyn Stencil>> {
        None
    }
}

/// Coverage of one cut-out surface.
pub trait Stencil {
    /// Those of the `asked` samples of pixel (i, j) that the surface covers; bit k is sample k.
    fn covered(&self, i: usize, j: usize, asked: u32) -> u32;

    /// The same as `Cutout::covers` with the footprint that the surface was set up with.
    fn covers(&self, uv: [f32; 2]) -> bool;
}

/// Takes every cut-out for opaque.
#[derive(Clone, Copy, Debug, Default)]
pub struct Opaque;

impl Cutout for Opaque {
    fn covers(&self, _: &MaterialRecord, _: &CutoutSample) -> bool {
        true
    }
}

/// A triangle whose material is a cut-out; set up when its first sample is asked for.
pub(crate) struct Sheet<'a> {
    material: &'a MaterialRecord,
    uv: [Affine; 2],
    stencil: OnceCell<Option<Box<dyn Stencil>>>,
}

impl<'a> Sheet<'a> {
    pub fn new(material: &'a MaterialRecord, uv: [Affine; 2]) -> Self {
        Self { material, uv, stencil: OnceCell::new() }
    }

    /// As `Stencil::covered`.
    pub fn covered(&self, cutout: &dyn Cutout, i: usize, j: usize, asked: u32) -> u32 {
        match self.stencil.get_or_init(|| cutout.stencil(self.material, &self.uv)) {
            Some(stencil) => stencil.covered(i, j, asked),
            None => self.one_by_one(cutout, i, j, asked),
        }
    }

    fn one_by_one(&self, cutout: &dyn Cutout, i: usize, j: usize, asked: u32) -> u32 {
        let [u, v] = &self.uv;
        let covers = |k: usize| {
            let (x, y) = (i as f32 + f32::from(SAMPLES[k].0) / 16.0, j as f32 + f32::from(SAMPLES[k].1) / 16.0);
            cutout.covers(self.material, &CutoutSample { uv: [u.at(x, y), v.at(x, y)], footprint: [[u.dx, v.dx], [u.dy, v.dy]] })
        };
        (0..16).filter(|k| asked >> k & 1 != 0 && covers(*k)).fold(0, |mask, k| mask | 1 << k)
    }
}
