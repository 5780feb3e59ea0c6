//! Surfaces prepared for shading: set up once per sub-tile, then evaluated per pixel.

use std::sync::Arc;

use map3d_base::asset::Wrap;
use map3d_base::{Isa, Result, Vec3};
use map3d_image::srgb::LINEAR16;
use map3d_scene::MaterialRecord;
use map3d_texture::sample::{POSITION_BITS, Sampler, SurfaceColors, TapPlanCache, UvMap};
use map3d_texture::{LocalTextureCache, Texture, TextureCache};

use crate::cutout::outside_alpha;
use map3d_trace::{Affine, CurvedSurface, DepthPlane, PerspectiveMap, SurfaceAttributes, texture_at};

/// Sub-tiles for which textures are held: those of a tile of 256 px. Longer, and the shared cache would drop textures that are in use as not used.
const HELD_SUBTILES: u32 = 16;

/// Textures and sampling plans that surfaces share.
pub struct MaterialCache {
    held: LocalTextureCache,
    /// Sub-tiles since the textures are held.
    subtiles: u32,
    plans: TapPlanCache,
}

impl MaterialCache {
    /// `isa`: an instruction set that this machine supports.
    pub fn new(isa: Isa) -> Self {
        Self { held: LocalTextureCache::default(), subtiles: 0, plans: TapPlanCache::new(isa) }
    }

    /// As `new`, for views in perspective.
    pub fn in_perspective(isa: Isa) -> Self {
        Self { plans: TapPlanCache::rough(isa), ..Self::new(isa) }
    }

    /// Drops the textures after some sub-tiles.
    pub fn finish_subtile(&mut self) {
        self.subtiles += 1;
        if self.subtiles == HELD_SUBTILES {
            self.held.clear();
            self.subtiles = 0;
        }
    }
}

/// Diffuse colour of a surface: linear light, 16 bits.
pub enum DiffuseColor {
    /// No layer needs colours.
    Unused,
    Constant([u16; 3]),
    Textured(Sampler),
    /// Textured in perspective, where the footprint differs from pixel to pixel.
    Curved(Box<CurvedTexture>),
}

impl DiffuseColor {
    /// The colour is the texture times the diffuse colour of the material, or the diffuse colour alone without a texture.
    fn new(materials: &mut MaterialCache, textures: &TextureCache, material: &MaterialRecord, uv: &[Affine; 2]) -> Result<Self> {
        let diffuse = material.diffuse;
        if !material.is_textured() {
            return Ok(Self::Constant([diffuse[0], diffuse[1], diffuse[2]].map(|b| LINEAR16[b as usize])));
        }

        let texture = materials.held.texture(textures, &material.texture)?;
        Ok(Self::Textured(sampler(materials, textures, material, &texture, uv)?))
    }

    /// Writes the colours at positions in 2^-8 px from the sub-tile's corner.
    pub fn each(&self, positions: &[[i32; 2]], out: &mut [[u16; 3]], materials: &mut MaterialCache, textures: &TextureCache) -> Result<()> {
        match self {
            Self::Unused => out.fill([0; 3]),
            Self::Constant(color) => out.fill(*color),
            Self::Textured(sampler) => sampler.sample_each(positions, out),
            Self::Curved(texture) => {
                for ([x, y], color) in positions.iter().zip(out) {
                    *color = texture.at(*x, *y, materials, textures)?;
                }
            }
        }
        Ok(())
    }

    /// Writes whole pixels of a row that starts at (i, j), with full coverage.
    #[inline(always)]
    pub fn row(&self, i: usize, j: usize, out: &mut [[u16; 4]], materials: &mut MaterialCache, textures: &TextureCache) -> Result<()> {
        match self {
            Self::Unused => {}
            Self::Constant([r, g, b]) => out.fill([*r, *g, *b, 65_535]),
            Self::Textured(sampler) => sampler.sample_row(center_of(i), center_of(j), out),
            Self::Curved(texture) => texture.row(i, j, out, materials, textures)?,
        }
        Ok(())
    }
}

/// Texture coordinates this far outside [0,1] count as inside: sources round them.
const UV_ROUNDING: f32 = 1.0 / 1024.0;

/// Returns the material of a triangle with the wrap mode of its colours. A texture that ends at its edges is clamped where the triangle shows nothing beyond
/// them; otherwise the filter of a pixel at an edge would take in the colour outside.
pub fn clamp_at_edges(material: &MaterialRecord, uv: &[[f32; 2]; 3]) -> MaterialRecord {
    let is_inside = || uv.as_flattened().iter().all(|c| (-UV_ROUNDING..=1.0 + UV_ROUNDING).contains(c));
    let shows_outside = match material.wrap_mode() {
        Wrap::Border | Wrap::None if material.is_cutout() && outside_alpha(material) < 128 => false,
        Wrap::Border | Wrap::None => !is_inside(),
        _ => true,
    };
    if shows_outside { *material } else { MaterialRecord { wrap: Wrap::Clamp as u8, ..*material } }
}

/// Returns a pixel's centre in 2^-8 px.
#[inline(always)]
fn center_of(i: usize) -> i32 {
    (i as i32) << POSITION_BITS | 1 << (POSITION_BITS - 1)
}

/// Returns the sampler of affine texture coordinates. The mip level and the filter taps follow from the footprint of a pixel, which is the same wherever the
/// coordinates hold.
fn sampler(
    materials: &mut MaterialCache,
    textures: &TextureCache,
    material: &MaterialRecord,
    texture: &Texture,
    uv: &[Affine; 2],
) -> Result<Sampler> {
    let (file, uv) = (&texture.file, uv_map(uv));
    let plan = materials.plans.plan(uv.jacobian(file.width, file.height), file.levels);
    let level = materials.held.level(textures, texture, plan.level)?;
    let colors = SurfaceColors { diffuse: material.diffuse, border: material.border };
    Ok(Sampler::new(level, plan, file.has_alpha, &uv, material.wrap_mode(), colors))
}

/// A texture in perspective: its coordinates are replaced by affine ones, pixel by pixel or over as many pixels of a row as they are near enough.
pub struct CurvedTexture {
    map: PerspectiveMap,
    /// Texture coordinates of the corners.
    uv: [[f32; 2]; 3],
    material: MaterialRecord,
    texture: Arc<Texture>,
}

impl CurvedTexture {
    fn sampler(&self, position: [f64; 2], materials: &mut MaterialCache, textures: &TextureCache) -> Result<Sampler> {
        sampler(materials, textures, &self.material, &self.texture, &texture_at(&self.map, &self.uv, position))
    }

    fn at(&self, x: i32, y: i32, materials: &mut MaterialCache, textures: &TextureCache) -> Result<[u16; 3]> {
        let position = [x, y].map(|v| f64::from(v) / f64::from(1 << POSITION_BITS));
        Ok(self.sampler(position, materials, textures)?.sample(x, y))
    }

    fn row(&self, i: usize, j: usize, out: &mut [[u16; 4]], materials: &mut MaterialCache, textures: &TextureCache) -> Result<()> {
        let mut done = 0;
        while done < out.len() {
            let (first, y) = (i + done, j as f64 + 0.5);
            let count = self.map.affine_pixels(first as f64 + 0.5, y).min(out.len() - done);
            let middle = [first as f64 + count as f64 / 2.0, y];
            self.sampler(middle, materials, textures)?.sample_row(center_of(first), center_of(j), &mut out[done..done + count]);
            done += count;
        }
        Ok(())
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
    smooth: Option<Box<SmoothSurface>>,
}

/// Shading normals.
struct SmoothSurface {
    attributes: SurfaceAttributes,
    /// The weights of the corners in perspective, where those of `attributes` are not near enough.
    map: Option<PerspectiveMap>,
}

impl SmoothSurface {
    fn normal_at(&self, x: f32, y: f32) -> [f32; 3] {
        match &self.map {
            None => self.attributes.normal_at(x, y),
            Some(map) => self.attributes.normal_of_weights(map.weights(f64::from(x), f64::from(y)).map(|w| w as f32)),
        }
    }
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
            smooth: surface.corner_normals.is_some().then(|| Box::new(SmoothSurface { attributes: *surface, map: None })),
        })
    }

    /// As `new`, in perspective.
    pub fn curved(
        materials: &mut MaterialCache,
        textures: &TextureCache,
        material: &MaterialRecord,
        surface: CurvedSurface,
        needs_color: bool,
    ) -> Result<Self> {
        let CurvedSurface { attributes, depth, map, uv } = surface;
        let Some(map) = map else { return Self::new(materials, textures, material, &attributes, depth, needs_color) };
        let is_curved = needs_color && material.is_textured();
        let mut out = Self::new(materials, textures, material, &attributes, depth, needs_color && !is_curved)?;
        if is_curved {
            let texture = materials.held.texture(textures, &material.texture)?;
            out.color = DiffuseColor::Curved(Box::new(CurvedTexture { map, uv, material: *material, texture }));
        }
        if let Some(smooth) = &mut out.smooth {
            smooth.map = Some(map);
        }
        Ok(out)
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
