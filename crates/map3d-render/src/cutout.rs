//! Cut-outs by the alpha channel of the scene's textures (spec/pyramid.md §4).

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use map3d_base::asset::Wrap;
use map3d_scene::MaterialRecord;
use map3d_texture::sample::{AlphaSampler, UvMap};
use map3d_texture::{Level, Texture, TextureCache, TextureKey};
use map3d_trace::{Affine, Cutout, CutoutMask, CutoutSample};

/// Tests samples against the filtered alpha of a texture. A texture that cannot be read counts as opaque and as a failure, which the renderer reports as an
/// error after the beam.
pub struct TextureCutout<'a> {
    cache: &'a TextureCache,
    failures: AtomicU64,
    recent: RefCell<Option<RecentLevel>>,
}

/// The texture level of the last sample; consecutive samples usually belong to one surface.
struct RecentLevel {
    key: TextureKey,
    footprint: [[f32; 2]; 2],
    texture: Arc<Texture>,
    number: u32,
    level: Arc<Level>,
}

impl<'a> TextureCutout<'a> {
    pub fn new(cache: &'a TextureCache) -> Self {
        Self { cache, failures: AtomicU64::new(0), recent: RefCell::new(None) }
    }

    /// Returns the number of samples whose texture could not be read.
    pub fn failures(&self) -> u64 {
        self.failures.load(Ordering::Relaxed)
    }

    /// Returns the texture level for a sample's footprint.
    fn level(&self, material: &MaterialRecord, sample: &CutoutSample) -> map3d_base::Result<Arc<Level>> {
        // Same texture and footprint.
        let mut recent = self.recent.borrow_mut();
        if let Some(r) = recent.as_ref().filter(|r| r.key == material.texture && r.footprint == sample.footprint) {
            return Ok(r.level.clone());
        }

        // Same texture, perhaps another level.
        let texture = match recent.as_ref().filter(|r| r.key == material.texture) {
            Some(r) => r.texture.clone(),
            None => self.cache.texture(&material.texture)?,
        };
        let number = AlphaSampler::level_for(&texture, &uv_map(sample));
        let same = recent.as_ref().filter(|r| r.key == material.texture && r.number == number).map(|r| r.level.clone());
        let level = same.map_or_else(|| self.cache.level(&texture, number), Ok)?;
        *recent = Some(RecentLevel { key: material.texture, footprint: sample.footprint, texture, number, level: level.clone() });
        Ok(level)
    }
}

/// Returns the alpha of a cut-out outside its texture: with `Wrap::None` there is no surface.
pub(crate) fn outside_alpha(material: &MaterialRecord) -> u8 {
    if material.wrap_mode() == Wrap::Border { material.border[3] } else { 0 }
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
            Ok(level) => AlphaSampler::new(level, &uv_map(sample), material.wrap_mode(), outside_alpha(material)).covers(0, 0),
            Err(_) => {
                self.failures.fetch_add(1, Ordering::Relaxed);
                true
            }
        }
    }

    fn prepare(&self, material: &MaterialRecord, [u, v]: &[Affine; 2]) -> Option<Box<dyn CutoutMask>> {
        if !material.is_textured() {
            return None;
        }
        let origin = CutoutSample { uv: [u.at0, v.at0], footprint: [[u.dx, v.dx], [u.dy, v.dy]] };
        let level = self.level(material, &origin).ok()?;
        Some(Box::new(AlphaMask(AlphaSampler::new(level, &uv_map(&origin), material.wrap_mode(), outside_alpha(material)))))
    }
}

/// The alpha channel of one surface.
struct AlphaMask(AlphaSampler);

impl CutoutMask for AlphaMask {
    fn covered(&self, i: usize, j: usize, candidates: u32) -> u32 {
        self.0.covered_samples(i as i32, j as i32, candidates)
    }

    fn covers(&self, uv: [f32; 2]) -> bool {
        self.0.covers_uv(uv.map(f64::from))
    }
}
