//! Surfaces that are cut out by the alpha channel of their texture.

use map3d_scene::MaterialRecord;

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
}

/// Takes every cut-out for opaque.
#[derive(Clone, Copy, Debug, Default)]
pub struct Opaque;

impl Cutout for Opaque {
    fn covers(&self, _: &MaterialRecord, _: &CutoutSample) -> bool {
        true
    }
}
