//! What a face looks like: the entry of the table of materials, and how texture coordinates are taken.

use map3d_base::Result;
use map3d_base::asset::{Material, Wrap};

use super::mtl::{Library, MtlEntry};
use crate::asset_folder::AssetFolder;
use crate::image_file::Textures;
use crate::materials::MaterialTable;
use crate::options::ReadOptions;
use crate::report::Log;

/// Colour of what has none.
const DEFAULT_GREY: f32 = 0.8;
/// Vertex colours become colours of faces in this many steps a channel.
const COLOR_STEPS: f32 = 31.0;

/// A material in use. `textured` needs texture coordinates; `plain` is for faces without.
#[derive(Clone, Copy, Debug)]
pub struct Skin {
    pub plain: u32,
    pub textured: Option<u32>,
    pub wrap: Wrap,
    pub scale: [f64; 2],
    pub offset: [f64; 2],
    /// Fully transparent: not taken over.
    pub invisible: bool,
    /// No material is known: vertex colours count.
    pub unnamed: bool,
}

/// Everything that materials are made from.
pub struct Palette {
    pub library: Library,
    pub textures: Textures,
    pub table: MaterialTable,
    pub folder: AssetFolder,
}

impl Palette {
    /// The skin of a `usemtl` name; none or an unknown one is grey.
    pub fn skin(&mut self, name: Option<&str>, options: &ReadOptions, log: &mut Log) -> Result<Skin> {
        let entry = match name {
            None => None,
            Some(name) => match self.library.get(name).cloned() {
                Some(entry) => Some((name, entry)),
                None => {
                    log.warn("material not defined", name)?;
                    None
                }
            },
        };
        match entry {
            Some((name, entry)) => self.named(name, &entry, options, log),
            None => Ok(Skin::plain(self.table.index_of(Material::default()), true)),
        }
    }

    fn named(&mut self, name: &str, entry: &MtlEntry, options: &ReadOptions, log: &mut Log) -> Result<Skin> {
        let opacity = entry.opacity.unwrap_or(1.0);
        let [r, g, b] = entry.diffuse.unwrap_or([DEFAULT_GREY; 3]);
        let material = Material { name: name.to_owned(), diffuse: [r, g, b, opacity], ..Material::default() };
        let mut skin = Skin::plain(self.table.index_of(material.clone()), false);
        skin.invisible = opacity <= 0.0;
        let Some(map) = &entry.color_map else {
            if let Some(map) = &entry.opacity_map {
                log.note("map_d without map_Kd ignored", map.name.as_str());
            }
            return Ok(skin);
        };
        let Some(texture) = self.textures.get(&map.name, &mut self.folder, options, log)?.cloned() else { return Ok(skin) };
        let alpha = self.opacity_image(entry, &texture.key, options, log)?;
        let [r, g, b] = tint(entry.diffuse, name, log);
        let textured = Material {
            diffuse: [r, g, b, opacity],
            cutout: texture.transparent || alpha.is_some(),
            texture: Some(texture.key),
            alpha,
            wrap: if map.clamp { Wrap::Clamp } else { Wrap::Wrap },
            ..material
        };
        (skin.wrap, skin.scale, skin.offset) = (textured.wrap, map.scale, map.offset);
        skin.textured = Some(self.table.index_of(textured));
        Ok(skin)
    }

    /// Key of the opacity map's image; none when it is the colour map itself, whose own alpha then counts.
    fn opacity_image(&mut self, entry: &MtlEntry, color_key: &str, options: &ReadOptions, log: &mut Log) -> Result<Option<String>> {
        let Some(map) = &entry.opacity_map else { return Ok(None) };
        let image = self.textures.get(&map.name, &mut self.folder, options, log)?;
        Ok(image.map(|t| t.key.clone()).filter(|key| key != color_key))
    }

    /// The material of a face whose corners have these colours (sRGB bytes).
    pub fn of_vertex_colors(&mut self, corners: impl Iterator<Item = [u8; 3]>) -> u32 {
        let (mut sum, mut n) = ([0.0f32; 3], 0.0f32);
        for color in corners {
            n += 1.0;
            (0..3).for_each(|k| sum[k] += f32::from(color[k]));
        }
        let [r, g, b] = sum.map(|v| (v / n.max(1.0) / 255.0 * COLOR_STEPS).round() / COLOR_STEPS);
        self.table.index_of(Material { name: "vertex colour".into(), diffuse: [r, g, b, 1.0], ..Material::default() })
    }
}

/// The colour that multiplies a texture. Writers that mean "the texture alone" put black there.
fn tint(diffuse: Option<[f32; 3]>, name: &str, log: &mut Log) -> [f32; 3] {
    match diffuse {
        None => [1.0; 3],
        Some([0.0, 0.0, 0.0]) => {
            log.note("black Kd beside map_Kd taken as white", name);
            [1.0; 3]
        }
        Some(color) => color,
    }
}

impl Skin {
    fn plain(material: u32, unnamed: bool) -> Self {
        Self { plain: material, textured: None, wrap: Wrap::Wrap, scale: [1.0; 2], offset: [0.0; 2], invisible: false, unnamed }
    }

    /// Texture coordinates as the image takes them.
    pub fn uv(&self, uv: [f32; 2]) -> [f64; 2] {
        [0, 1].map(|k| f64::from(uv[k]) * self.scale[k] + self.offset[k])
    }
}
