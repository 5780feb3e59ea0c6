//! Resolves `usemtl` names to entries of the material table and texture coordinate transformations.

use map3d_base::asset::{Material, Wrap};
use map3d_base::{Reason, Result};

use super::mtl::{MaterialLibrary, MtlMaterial};
use crate::document::asset_folder::AssetFolder;
use crate::document::images::DocumentImages;
use crate::document::material_table::MaterialTable;
use crate::document::options::ReadOptions;
use crate::document::report_builder::ReportBuilder;
use crate::document::transparency::Transparency;

/// Diffuse colour of a material without `Kd`.
const DEFAULT_GREY: f32 = 0.8;
/// Quantization steps per channel for face colours that are computed from vertex colours.
const COLOR_STEPS: f32 = 31.0;

/// The material of a face: `textured` if the face has texture coordinates, else `untextured`.
#[derive(Clone, Copy, Debug)]
pub struct FaceMaterial {
    pub untextured: u32,
    pub textured: Option<u32>,
    pub wrap: Wrap,
    pub scale: [f64; 2],
    pub offset: [f64; 2],
    /// The material is fully transparent; its faces are skipped.
    pub invisible: bool,
    /// The material is missing or undefined; vertex colours replace it.
    pub is_fallback: bool,
}

pub struct FaceMaterialResolver {
    pub library: MaterialLibrary,
    pub images: DocumentImages,
    pub table: MaterialTable,
    pub folder: AssetFolder,
}

impl FaceMaterialResolver {
    pub fn new(folder: AssetFolder, transparency: Transparency) -> Self {
        Self { library: MaterialLibrary::new(transparency), images: DocumentImages::default(), table: MaterialTable::default(), folder }
    }

    /// Resolves a `usemtl` name. A missing or undefined material is grey.
    pub fn resolve(&mut self, name: Option<&str>, options: &ReadOptions, report: &mut ReportBuilder) -> Result<FaceMaterial> {
        if let Some(name) = name {
            if let Some(definition) = self.library.get(name).cloned() {
                return self.resolve_definition(name, &definition, options, report);
            }
            report.warn(Reason::MaterialNotDefined, name)?;
        }
        Ok(FaceMaterial::untextured(self.table.add(Material::default()), true))
    }

    fn resolve_definition(
        &mut self,
        name: &str,
        definition: &MtlMaterial,
        options: &ReadOptions,
        report: &mut ReportBuilder,
    ) -> Result<FaceMaterial> {
        let opacity = definition.opacity.unwrap_or(1.0);
        let [r, g, b] = definition.diffuse.unwrap_or([DEFAULT_GREY; 3]);
        let material = Material { name: name.to_owned(), diffuse: [r, g, b, opacity], ..Material::default() };
        let mut resolved = FaceMaterial::untextured(self.table.add(material.clone()), false);
        resolved.invisible = opacity <= 0.0;
        let Some(map) = &definition.color_map else {
            if let Some(map) = &definition.opacity_map {
                report.note(Reason::AlphaMapIgnored, map.name.as_str());
            }
            return Ok(resolved);
        };
        let Some(image) = self.images.get(&map.name, &mut self.folder, options, report)?.cloned() else { return Ok(resolved) };
        let alpha = self.find_opacity_image(definition, &image.key, options, report)?;
        let [r, g, b] = choose_tint(definition.diffuse, name, report);
        let textured = Material {
            diffuse: [r, g, b, opacity],
            cutout: image.transparent || alpha.is_some(),
            texture: Some(image.key),
            alpha,
            wrap: if map.clamp { Wrap::Clamp } else { Wrap::Wrap },
            ..material
        };
        (resolved.wrap, resolved.scale, resolved.offset) = (textured.wrap, map.scale, map.offset);
        resolved.textured = Some(self.table.add(textured));
        Ok(resolved)
    }

    /// Returns the key of the opacity map's image. Returns `None` if it is the colour map itself: its own alpha channel applies.
    fn find_opacity_image(
        &mut self,
        definition: &MtlMaterial,
        color_key: &str,
        options: &ReadOptions,
        report: &mut ReportBuilder,
    ) -> Result<Option<String>> {
        let Some(map) = &definition.opacity_map else { return Ok(None) };
        let image = self.images.get(&map.name, &mut self.folder, options, report)?;
        Ok(image.map(|i| i.key.clone()).filter(|key| key != color_key))
    }

    /// Returns the material of a face from the colours of its vertices (sRGB bytes).
    pub fn average_vertex_colors(&mut self, colors: impl Iterator<Item = [u8; 3]>) -> u32 {
        let (mut sum, mut n) = ([0.0f32; 3], 0.0f32);
        for color in colors {
            n += 1.0;
            (0..3).for_each(|k| sum[k] += f32::from(color[k]));
        }
        let [r, g, b] = sum.map(|v| (v / n.max(1.0) / 255.0 * COLOR_STEPS).round() / COLOR_STEPS);
        self.table.add(Material { name: "vertex colour".into(), diffuse: [r, g, b, 1.0], ..Material::default() })
    }
}

/// Returns the colour that multiplies the texture. Some writers use a black `Kd` to mean "texture only".
fn choose_tint(diffuse: Option<[f32; 3]>, name: &str, report: &mut ReportBuilder) -> [f32; 3] {
    match diffuse {
        None => [1.0; 3],
        Some([0.0, 0.0, 0.0]) => {
            report.note(Reason::BlackMaterialWithTexture, name);
            [1.0; 3]
        }
        Some(color) => color,
    }
}

impl FaceMaterial {
    fn untextured(material: u32, is_fallback: bool) -> Self {
        Self { untextured: material, textured: None, wrap: Wrap::Wrap, scale: [1.0; 2], offset: [0.0; 2], invisible: false, is_fallback }
    }

    pub fn transform_uv(&self, uv: [f32; 2]) -> [f64; 2] {
        [0, 1].map(|k| f64::from(uv[k]) * self.scale[k] + self.offset[k])
    }
}
