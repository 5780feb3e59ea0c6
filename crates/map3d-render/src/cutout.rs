//! Cut-outs by the alpha of the scene's textures (spec/pyramid.md §4).

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use map3d_base::asset::Wrap;
use map3d_scene::MaterialRecord;
use map3d_texture::sample::{AlphaSampler, UvMap};
use map3d_texture::{Level, Texture, TextureCache, TextureKey};
use map3d_trace::{Affine, Cutout, CutoutSample, Stencil};

/// Wrap mode of a material record.
pub(crate) fn wrap_of(material: &MaterialRecord) -> Wrap {
    match material.wrap {
        1 => Wrap::Mirror,
        2 => Wrap::Clamp,
        3 => Wrap::Border,
        4 => Wrap::None,
        _ => Wrap::Wrap,
    }
}

/// Tests samples against the filtered alpha of a texture. A texture that cannot be read counts as opaque and as a failure, which the
/// renderer turns into an error when the beam is done.
pub struct TextureCutout<'a> {
    cache: &'a TextureCache,
    failures: AtomicU64,
    last: RefCell<Option<Last>>,
}

/// Samples come surface by surface: the level of the last one is at hand.
struct Last {
    key: TextureKey,
    footprint: [[f32; 2]; 2],
    texture: Arc<Texture>,
    number: u32,
    level: Arc<Level>,
}

impl<'a> TextureCutout<'a> {
    pub fn new(cache: &'a TextureCache) -> Self {
        Self { cache, failures: AtomicU64::new(0), last: RefCell::new(None) }
    }

    /// Samples that met a texture that cannot be read.
    pub fn failures(&self) -> u64 {
        self.failures.load(Ordering::Relaxed)
    }

    fn level(&self, material: &MaterialRecord, sample: &CutoutSample) -> map3d_base::Result<Arc<Level>> {
        let mut last = self.last.borrow_mut();
        if let Some(l) = last.as_ref().filter(|l| l.key == material.texture && l.footprint == sample.footprint) {
            return Ok(l.level.clone());
        }
        let texture = match last.as_ref().filter(|l| l.key == material.texture) {
            Some(l) => l.texture.clone(),
            None => self.cache.texture(&material.texture)?,
        };
        let number = AlphaSampler::level_for(&texture, &uv_map(sample));
        let held = last.as_ref().filter(|l| l.key == material.texture && l.number == number).map(|l| l.level.clone());
        let level = held.map_or_else(|| self.cache.level(&texture, number), Ok)?;
        *last = Some(Last { key: material.texture, footprint: sample.footprint, texture, number, level: level.clone() });
        Ok(level)
    }
}

fn uv_map(sample: &CutoutSample) -> UvMap {
    let [right, down] = sample.footprint.map(|d| d.map(f64::from));
    UvMap { u: [f64::from(sample.uv[0]), right[0], down[0]], v: [f64::from(sample.uv[1]), right[1], down[1]] }
}

impl Cutout for TextureCutout<'_> {
    fn covers(&self, material: &MaterialRecord, sample: &CutoutSample) -> bool {
        if !material.is_textured() {
            return true;
        }
        match self.level(material, sample) {
            Ok(level) => AlphaSampler::with(level, &uv_map(sample), wrap_of(material), material.border[3]).covers(0, 0),
            Err(_) => {
                self.failures.fetch_add(1, Ordering::Relaxed);
                true
            }
        }
    }

    fn stencil(&self, material: &MaterialRecord, [u, v]: &[Affine; 2]) -> Option<Box<dyn Stencil>> {
        if !material.is_textured() {
            return None;
        }
        let origin = CutoutSample { uv: [u.at0, v.at0], footprint: [[u.dx, v.dx], [u.dy, v.dy]] };
        let level = self.level(material, &origin).ok()?;
        Some(Box::new(AlphaStencil(AlphaSampler::with(level, &uv_map(&origin), wrap_of(material), material.border[3]))))
    }
}

/// A surface's alpha.
struct AlphaStencil(AlphaSampler);

impl Stencil for AlphaStencil {
    fn covered(&self, i: usize, j: usize, asked: u32) -> u32 {
        self.0.covered(i as i32, j as i32, asked)
    }

    fn covers(&self, uv: [f32; 2]) -> bool {
        self.0.covers_at(uv.map(f64::from))
    }
}
