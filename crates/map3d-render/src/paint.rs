//! What a surface looks like over the pixels of a sub-tile: set up once, then asked per pixel.

use map3d_base::{Isa, Result, Vec3};
use map3d_image::srgb::LINEAR16;
use map3d_scene::MaterialRecord;
use map3d_texture::sample::{Outside, POSITION_BITS, Sampler, TapPlans, UvMap};
use map3d_texture::{HeldTextures, TextureCache};
use map3d_trace::{Affine, DepthPlane, Surface};

use crate::cutout::wrap_of;

/// Where textures come from and what is kept of them between surfaces.
pub struct Palette {
    pub held: HeldTextures,
    plans: TapPlans,
}

impl Palette {
    /// `isa`: one that this machine has.
    pub fn new(isa: Isa) -> Self {
        Self { held: HeldTextures::default(), plans: TapPlans::new(isa) }
    }
}

/// Colour of a surface, linear light, 16 bits.
pub enum Paint {
    /// Nobody asks for it.
    None,
    Flat([u16; 3]),
    Textured(Sampler),
}

impl Paint {
    /// A texture is multiplied by the diffuse colour; without one the diffuse colour stands alone.
    fn new(palette: &mut Palette, cache: &TextureCache, material: &MaterialRecord, uv: &[Affine; 2]) -> Result<Self> {
        let diffuse = material.diffuse;
        if !material.is_textured() {
            return Ok(Self::Flat([diffuse[0], diffuse[1], diffuse[2]].map(|b| LINEAR16[b as usize])));
        }
        let texture = palette.held.texture(cache, &material.texture)?;
        let (file, uv) = (&texture.file, uv_map(uv));
        let plan = palette.plans.of(uv.jacobian(file.width, file.height), file.levels);
        let level = palette.held.level(cache, &texture, plan.level)?;
        let outside = Outside { diffuse, border: material.border };
        Ok(Self::Textured(Sampler::new(level, plan, file.has_alpha, &uv, wrap_of(material), outside)))
    }

    /// At a position in 2^-8 px from the sub-tile's corner.
    #[inline(always)]
    pub fn at(&self, x: i32, y: i32) -> [u16; 3] {
        match self {
            Self::None => [0; 3],
            Self::Flat(color) => *color,
            Self::Textured(sampler) => sampler.sample(x, y),
        }
    }

    /// Whole pixels of a row, the first of which is (i, j); full coverage.
    #[inline(always)]
    pub fn row(&self, i: usize, j: usize, out: &mut [[u16; 4]]) {
        const HALF: i32 = 1 << (POSITION_BITS - 1);
        match self {
            Self::None => {}
            Self::Flat([r, g, b]) => out.fill([*r, *g, *b, 65_535]),
            Self::Textured(sampler) => sampler.row((i as i32) << POSITION_BITS | HALF, (j as i32) << POSITION_BITS | HALF, out),
        }
    }
}

fn uv_map([u, v]: &[Affine; 2]) -> UvMap {
    let line = |a: &Affine| [a.at0, a.dx, a.dy].map(f64::from);
    UvMap { u: line(u), v: line(v) }
}

/// A surface ready to shade.
pub struct Shaded {
    pub paint: Paint,
    pub id: u32,
    pub depth: DepthPlane,
    /// Of flat surfaces.
    normal: [i16; 3],
    /// Of surfaces with shading normals.
    smooth: Option<Box<Surface>>,
}

impl Shaded {
    /// `is_painted`: somebody asks for colours.
    pub fn new(
        palette: &mut Palette,
        cache: &TextureCache,
        material: &MaterialRecord,
        surface: &Surface,
        depth: DepthPlane,
        is_painted: bool,
    ) -> Result<Self> {
        Ok(Self {
            depth,
            paint: if is_painted { Paint::new(palette, cache, material, &surface.uv)? } else { Paint::None },
            id: surface.object_id,
            normal: stored(surface.normal),
            smooth: surface.corner_normals.is_some().then(|| Box::new(*surface)),
        })
    }

    /// Stored normal at a pixel's centre.
    #[inline(always)]
    pub fn normal_at(&self, i: usize, j: usize) -> [i16; 3] {
        match &self.smooth {
            None => self.normal,
            Some(surface) => stored(surface.normal_at(i as f32 + 0.5, j as f32 + 0.5)),
        }
    }

    /// Cosine between the shading normal at a pixel's centre and a direction in 1/65536, 0 where it faces away.
    pub fn cosine(&self, i: usize, j: usize, towards: Vec3) -> u32 {
        let n = self.normal_at(i, j);
        let cosine = (0..3).map(|k| f64::from(n[k]) * towards[k]).sum::<f64>() / 32_767.0;
        (cosine * 65_536.0 + 0.5).clamp(0.0, 65_536.0) as u32
    }

    /// Geometric unit normal, local axes.
    pub fn geometric_normal(&self) -> Vec3 {
        self.normal.map(|c| f64::from(c) / 32_767.0)
    }

    /// Those of a row of pixels, the first of which is (i, j).
    #[inline(always)]
    pub fn normals(&self, i: usize, j: usize, out: &mut [[i16; 3]]) {
        match &self.smooth {
            None => out.fill(self.normal),
            Some(_) => out.iter_mut().enumerate().for_each(|(k, n)| *n = self.normal_at(i + k, j)),
        }
    }
}

fn stored(n: [f32; 3]) -> [i16; 3] {
    n.map(|c| (c * 32_767.0).round() as i16)
}
