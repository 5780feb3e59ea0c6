//! Surfaces prepared for shading: set up once per sub-tile, then evaluated per pixel.

use map3d_base::{Isa, Result, Vec3};
use map3d_image::srgb::LINEAR16;
use map3d_scene::MaterialRecord;
use map3d_texture::sample::{POSITION_BITS, Sampler, SurfaceColors, TapPlanCache, UvMap};
use map3d_texture::{LocalTextureCache, TextureCache};
use map3d_trace::{Affine, DepthPlane, SurfaceAttributes};

/// Textures and sampling plans that the surfaces of a sub-tile share.
pub struct MaterialCache {
    pub held: LocalTextureCache,
    plans: TapPlanCache,
}

impl MaterialCache {
    /// `isa`: an instruction set that this machine supports.
    pub fn new(isa: Isa) -> Self {
        Self { held: LocalTextureCache::default(), plans: TapPlanCache::new(isa) }
    }
}

/// Diffuse colour of a surface: linear light, 16 bits.
pub enum DiffuseColor {
    /// No layer needs colours.
    Unused,
    Constant([u16; 3]),
    Textured(Sampler),
}

impl DiffuseColor {
    /// The colour is the texture times the diffuse colour of the material, or the diffuse colour alone without a texture.
    fn new(materials: &mut MaterialCache, textures: &TextureCache, material: &MaterialRecord, uv: &[Affine; 2]) -> Result<Self> {
        let diffuse = material.diffuse;
        if !material.is_textured() {
            return Ok(Self::Constant([diffuse[0], diffuse[1], diffuse[2]].map(|b| LINEAR16[b as usize])));
        }

        // The mip level and the filter taps follow from the footprint of a pixel, which is the same over the whole surface.
        let texture = materials.held.texture(textures, &material.texture)?;
        let (file, uv) = (&texture.file, uv_map(uv));
        let plan = materials.plans.plan(uv.jacobian(file.width, file.height), file.levels);
        let level = materials.held.level(textures, &texture, plan.level)?;
        let colors = SurfaceColors { diffuse, border: material.border };
        Ok(Self::Textured(Sampler::new(level, plan, file.has_alpha, &uv, material.wrap_mode(), colors)))
    }

    /// Returns the colour at a position in 2^-8 px from the sub-tile's corner.
    #[inline(always)]
    pub fn at(&self, x: i32, y: i32) -> [u16; 3] {
        match self {
            Self::Unused => [0; 3],
            Self::Constant(color) => *color,
            Self::Textured(sampler) => sampler.sample(x, y),
        }
    }

    /// Writes whole pixels of a row that starts at (i, j), with full coverage.
    #[inline(always)]
    pub fn row(&self, i: usize, j: usize, out: &mut [[u16; 4]]) {
        const HALF: i32 = 1 << (POSITION_BITS - 1);
        match self {
            Self::Unused => {}
            Self::Constant([r, g, b]) => out.fill([*r, *g, *b, 65_535]),
            Self::Textured(sampler) => sampler.sample_row((i as i32) << POSITION_BITS | HALF, (j as i32) << POSITION_BITS | HALF, out),
        }
    }
}

fn uv_map([u, v]: &[Affine; 2]) -> UvMap {
    let coefficients = |a: &Affine| [a.at0, a.dx, a.dy].map(f64::from);
    UvMap { u: coefficients(u), v: coefficients(v) }
}

/// A surface prepared for shading.
pub struct PreparedSurface {
    pub color: DiffuseColor,
    /// Object id.
    pub id: u32,
    pub depth: DepthPlane,
    /// Geometric unit normal × 32767.
    normal: [i16; 3],
    /// Set for a surface with shading normals.
    smooth: Option<Box<SurfaceAttributes>>,
}

impl PreparedSurface {
    /// `needs_color`: a layer needs colours.
    pub fn new(
        materials: &mut MaterialCache,
        textures: &TextureCache,
        material: &MaterialRecord,
        surface: &SurfaceAttributes,
        depth: DepthPlane,
        needs_color: bool,
    ) -> Result<Self> {
        Ok(Self {
            depth,
            color: if needs_color { DiffuseColor::new(materials, textures, material, &surface.uv)? } else { DiffuseColor::Unused },
            id: surface.object_id,
            normal: quantize_normal(surface.normal),
            smooth: surface.corner_normals.is_some().then(|| Box::new(*surface)),
        })
    }

    /// Returns the shading normal × 32767 at a pixel's centre.
    #[inline(always)]
    pub fn normal_at(&self, i: usize, j: usize) -> [i16; 3] {
        match &self.smooth {
            None => self.normal,
            Some(surface) => quantize_normal(surface.normal_at(i as f32 + 0.5, j as f32 + 0.5)),
        }
    }

    /// Writes the shading normals of a row of pixels that starts at (i, j).
    #[inline(always)]
    pub fn normals(&self, i: usize, j: usize, out: &mut [[i16; 3]]) {
        match &self.smooth {
            None => out.fill(self.normal),
            Some(_) => out.iter_mut().enumerate().for_each(|(k, n)| *n = self.normal_at(i + k, j)),
        }
    }

    /// Returns the cosine between the shading normal at a pixel's centre and a direction in 1/65536; 0 if it faces away.
    pub fn cosine(&self, i: usize, j: usize, towards: Vec3) -> u32 {
        let n = self.normal_at(i, j);
        let cosine = (0..3).map(|k| f64::from(n[k]) * towards[k]).sum::<f64>() / 32_767.0;
        (cosine * 65_536.0 + 0.5).clamp(0.0, 65_536.0) as u32
    }

    /// Returns the geometric unit normal, local axes.
    pub fn geometric_normal(&self) -> Vec3 {
        self.normal.map(|c| f64::from(c) / 32_767.0)
    }
}

fn quantize_normal(n: [f32; 3]) -> [i16; 3] {
    n.map(|c| (c * 32_767.0).round() as i16)
}
