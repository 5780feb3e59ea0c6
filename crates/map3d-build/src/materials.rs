//! Converts the materials of all assets to chunk records and merges equal ones.

use std::collections::HashMap;

use map3d_base::Result;
use map3d_base::asset::{Material, SurfaceClass};
use map3d_scene::records::{MATERIAL_CUTOUT, MATERIAL_TEXTURED, MaterialRecord};
use map3d_texture::TextureKeys;

use crate::BuildOptions;
use crate::asset_summary::record_hash;
use crate::assets::Asset;
use crate::surface_colors::SurfaceColors;

pub(crate) struct BuildMaterials {
    pub records: Vec<MaterialRecord>,
    /// Per asset.
    assets: Vec<AssetMaterials>,
    /// Hash of each record.
    hashes: Vec<u64>,
    /// Per asset: materials that name an image that is missing or broken.
    pub without_their_texture: Vec<u64>,
}

/// The asset's material → index into the records.
struct AssetMaterials {
    numbers: Vec<MaterialNumber>,
    colors: SurfaceColors,
    /// By palette and surface class.
    colored: Vec<[u32; SurfaceClass::ALL.len()]>,
}

#[derive(Clone, Copy)]
enum MaterialNumber {
    Own(u32),
    /// The source gives no colour.
    OfSurface(SurfaceClass),
}

/// sRGB of the ground plane: light grey.
const GROUND: [u8; 4] = [200, 198, 192, 255];

impl BuildMaterials {
    pub fn new(assets: &[&Asset], textures: &TextureKeys, options: &BuildOptions) -> Result<Self> {
        let mut out = Self { records: Vec::new(), assets: Vec::new(), hashes: Vec::new(), without_their_texture: Vec::new() };
        let mut known = HashMap::new();
        for asset in assets {
            let numbers = asset.materials.iter().map(|m| match surface_of(m, textures) {
                Some(class) => MaterialNumber::OfSurface(class),
                None => MaterialNumber::Own(out.add(record_of(m, textures), options.merge_materials, &mut known)),
            });
            let numbers = numbers.collect();
            let has_uncolored = asset.materials.iter().any(|m| surface_of(m, textures).is_some());
            let colors = if has_uncolored { SurfaceColors::read(&asset.objects_path(), &options.style)? } else { SurfaceColors::default() };
            let colored = (0..colors.len()).map(|palette| {
                SurfaceClass::ALL.map(|class| out.add(plain(colors.color(palette, class, &options.style)), options.merge_materials, &mut known))
            });
            let colored = colored.collect();
            out.assets.push(AssetMaterials { numbers, colors, colored });
            out.without_their_texture.push(asset.materials.iter().filter(|m| lacks_texture(m, textures)).count() as u64);
        }
        Ok(out)
    }

    fn add(&mut self, record: MaterialRecord, merge: bool, known: &mut HashMap<MaterialRecord, u32>) -> u32 {
        if let Some(number) = known.get(&record).filter(|_| merge) {
            return *number;
        }
        let number = self.push(record);
        known.insert(record, number);
        number
    }

    fn push(&mut self, record: MaterialRecord) -> u32 {
        self.records.push(record);
        self.hashes.push(record_hash(&record));
        self.records.len() as u32 - 1
    }

    /// Adds the ground plane's material.
    pub fn ground(&mut self) -> u32 {
        self.push(Self::ground_record())
    }

    pub fn ground_record() -> MaterialRecord {
        plain(GROUND)
    }

    /// Returns the number of a triangle's material. `object`: in the asset; none in a prototype. `up`: the z of the triangle's unit normal.
    pub fn number(&self, asset: usize, material: u32, object: Option<u32>, up: impl FnOnce() -> f64) -> u32 {
        let asset = &self.assets[asset];
        match asset.numbers[material as usize] {
            MaterialNumber::Own(number) => number,
            MaterialNumber::OfSurface(class) => {
                let palette = asset.colors.of(object);
                asset.colored[palette][asset.colors.class(palette, class, up) as usize]
            }
        }
    }

    /// Hash of a material's record.
    pub fn hash(&self, number: u32) -> u64 {
        self.hashes[number as usize]
    }

    /// Returns the hashes of an asset's materials, without those that depend on the object.
    pub fn hashes_of(&self, asset: usize) -> Vec<u64> {
        let own = |n: &MaterialNumber| if let MaterialNumber::Own(number) = n { Some(self.hash(*number)) } else { None };
        self.assets[asset].numbers.iter().filter_map(own).collect()
    }

    pub fn is_textured(&self, number: u32) -> bool {
        self.records[number as usize].is_textured()
    }
}

/// Returns true for a material whose image is missing or broken.
fn lacks_texture(material: &Material, textures: &TextureKeys) -> bool {
    (material.texture.is_some() || material.alpha.is_some()) && textures.get(material).is_none()
}

/// Returns what a surface without a colour of its own is: white stands for the colours of an image, also of one that is missing.
fn surface_of(material: &Material, textures: &TextureKeys) -> Option<SurfaceClass> {
    let is_white = material.diffuse == [1.0; 4];
    material.surface.or_else(|| (is_white && lacks_texture(material, textures)).then_some(SurfaceClass::Other))
}

fn record_of(material: &Material, textures: &TextureKeys) -> MaterialRecord {
    let texture = textures.get(material);
    let cutout = material.cutout && texture.is_some_and(|t| t.has_alpha);
    MaterialRecord {
        diffuse: material.diffuse.map(byte),
        border: material.border.map(byte),
        wrap: material.wrap as u8,
        flags: if texture.is_some() { MATERIAL_TEXTURED } else { 0 } | if cutout { MATERIAL_CUTOUT } else { 0 },
        padding: [0; 6],
        texture: texture.map_or([0; 16], |t| t.key),
        reserved: [0; 32],
    }
}

fn plain(color: [u8; 4]) -> MaterialRecord {
    MaterialRecord { diffuse: color, border: [0; 4], wrap: 0, flags: 0, padding: [0; 6], texture: [0; 16], reserved: [0; 32] }
}

/// NaN becomes 0.
fn byte(v: f32) -> u8 {
    (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}
