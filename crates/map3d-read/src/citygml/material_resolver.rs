//! Resolves the surface data that target a polygon to a material and texture coordinates.

use std::fs;

use map3d_base::asset::{Material, SurfaceClass, Wrap};
use map3d_base::{Result, Vec3};

use super::appearance::{
    Appearances, Parameterization, Resolution, ResolvedMaterial, ResolvedSurfaceData, SurfaceDataKind, TargetBinding, TexCoordRange,
    TexturePlacement, TextureProperties,
};
use super::crs_table::HorizontalKey;
use super::feature_types::classify_surface;
use super::geo_transform::GeoTransform;
use super::ids::Id;
use crate::asset_folder::AssetFolder;
use crate::image_file::ImageFiles;
use crate::material_table::MaterialTable;
use crate::options::ReadOptions;
use crate::report_builder::ReportBuilder;

const OTHER_SYSTEM: &str = "georeferenced texture in another coordinate system than the surface, not used";

pub struct MaterialResolver {
    pub images: ImageFiles,
    pub table: MaterialTable,
    pub folder: AssetFolder,
    pub options: ReadOptions,
    /// The document's transparency is opacity.
    inverted: bool,
}

/// One ring of a polygon as written.
#[derive(Clone, Copy)]
pub struct RingPoints<'a> {
    pub id: Id,
    pub points: &'a [Vec3],
    /// Coordinate system of the points, if it has a name.
    pub crs: Option<HorizontalKey>,
}

impl MaterialResolver {
    /// `inverted`: the document's transparency is opacity.
    pub fn new(folder: AssetFolder, options: ReadOptions, inverted: bool) -> Self {
        Self { images: ImageFiles::default(), table: MaterialTable::default(), folder, options, inverted }
    }

    /// Finds the nearest usable texture or, without one, the nearest X3DMaterial; first of those for the front, then of those for the back, since
    /// both sides of a polygon have one material. `target_ids`: from the polygon up. For a texture, fills `uvs` with one pair per point of `rings`.
    pub fn resolve(
        &mut self,
        target_ids: &[Id],
        rings: &[RingPoints],
        sources: &mut [&mut Appearances],
        uvs: &mut Vec<[f64; 2]>,
        report: &mut ReportBuilder,
    ) -> Result<Option<ResolvedMaterial>> {
        match self.resolve_side(true, target_ids, rings, sources, uvs, report)? {
            None if sources.iter().any(|a| a.has_backs) => self.resolve_side(false, target_ids, rings, sources, uvs, report),
            front => Ok(front),
        }
    }

    fn resolve_side(
        &mut self,
        is_front: bool,
        target_ids: &[Id],
        rings: &[RingPoints],
        sources: &mut [&mut Appearances],
        uvs: &mut Vec<[f64; 2]>,
        report: &mut ReportBuilder,
    ) -> Result<Option<ResolvedMaterial>> {
        let mut untextured = None;
        for id in target_ids {
            for appearances in sources.iter_mut().filter(|a| !a.is_empty()) {
                let is_side = |b: &TargetBinding| appearances.surface_data[b.surface_data as usize].is_front == is_front;
                let bindings: Vec<TargetBinding> = appearances.theme_bindings(*id).filter(is_side).collect();
                for binding in bindings {
                    let Some(surface_data) = self.resolve_surface_data(appearances, binding.surface_data, report)? else { continue };
                    if !surface_data.material.textured {
                        untextured.get_or_insert(surface_data.material);
                    } else if compute_uvs(appearances, binding.parameterization, &surface_data, rings, uvs, report)? {
                        return Ok(Some(surface_data.material));
                    }
                }
            }
        }
        Ok(untextured)
    }

    /// Returns the material of a surface without an appearance. `type_names`: of the surface and of its object.
    pub fn resolve_default(&mut self, type_names: [&str; 2]) -> ResolvedMaterial {
        let class = type_names.into_iter().find_map(classify_surface).unwrap_or(SurfaceClass::Other);
        let material = Material { name: format!("default {}", class.name()), surface: Some(class), ..Material::default() };
        ResolvedMaterial { index: self.table.add(material), wrap: Wrap::Wrap, textured: false, invisible: false }
    }

    fn resolve_surface_data(
        &mut self,
        appearances: &mut Appearances,
        number: u32,
        report: &mut ReportBuilder,
    ) -> Result<Option<ResolvedSurfaceData>> {
        let surface_data = &mut appearances.surface_data[number as usize];
        match surface_data.resolution {
            Resolution::Resolved(resolved) => return Ok(Some(resolved)),
            Resolution::Unusable => return Ok(None),
            Resolution::Unresolved => {}
        }
        let resolved = match &surface_data.kind {
            SurfaceDataKind::Unsupported => None,
            SurfaceDataKind::X3DMaterial { color, transparency } => {
                let (color, transparency) = (*color, *transparency);
                Some(self.resolve_x3d_material(color, transparency))
            }
            SurfaceDataKind::Texture(texture) => self.resolve_texture(texture, report)?,
        };
        surface_data.resolution = resolved.map_or(Resolution::Unusable, Resolution::Resolved);
        Ok(resolved)
    }

    fn resolve_x3d_material(&mut self, [r, g, b]: [f32; 3], transparency: Option<f32>) -> ResolvedSurfaceData {
        let opacity = transparency.map_or(1.0, |t| if self.inverted { t } else { 1.0 - t });
        let diffuse = [r, g, b, opacity];
        let index = self.table.add(Material { name: "X3DMaterial".into(), diffuse, ..Material::default() });
        let material = ResolvedMaterial { index, wrap: Wrap::Wrap, textured: false, invisible: diffuse[3] <= 0.0 };
        ResolvedSurfaceData { material, geo_transform: None, crs: None, size_px: [0; 2] }
    }

    fn resolve_texture(&mut self, texture: &TextureProperties, report: &mut ReportBuilder) -> Result<Option<ResolvedSurfaceData>> {
        let TextureProperties { image: name, wrap, border, placement } = texture;
        let Some(image) = self.images.get(name, &mut self.folder, &self.options, report)?.cloned() else { return Ok(None) };
        let (geo_transform, crs) = match placement {
            TexturePlacement::Parameterized => (None, None),
            TexturePlacement::Georeferenced { transform, crs } => (Some(*transform), *crs),
            TexturePlacement::WorldFile => match self.read_world_file(name, report)? {
                None => return Ok(None),
                found => (found, None),
            },
        };
        let border = if *wrap == Wrap::Border { *border } else { [0.0; 4] };
        let index = self.table.add(Material {
            name: name.clone(),
            diffuse: [1.0; 4],
            texture: Some(image.key),
            wrap: *wrap,
            border,
            cutout: image.transparent || (*wrap == Wrap::Border && border[3] < 0.5),
            ..Material::default()
        });
        let material = ResolvedMaterial { index, wrap: *wrap, textured: true, invisible: false };
        Ok(Some(ResolvedSurfaceData { material, geo_transform, crs, size_px: [image.width_px, image.height_px] }))
    }

    /// Reads the world file of an image: `a.tfw`, `a.tifw` or `a.wld` for `a.tif`.
    fn read_world_file(&mut self, image: &str, report: &mut ReportBuilder) -> Result<Option<GeoTransform>> {
        let (stem, extension) = image.rsplit_once('.').unwrap_or((image, ""));
        let letters: Vec<char> = extension.chars().collect();
        let short: String = letters.first().into_iter().chain(letters.last()).chain(&['w']).collect();
        let names = [format!("{stem}.{short}"), format!("{stem}.{extension}w"), format!("{stem}.wld")];
        let file = names.iter().find_map(|name| self.folder.find(name).ok());
        let geo_transform = file.and_then(|f| fs::read_to_string(f.path).ok()).and_then(|text| GeoTransform::parse_world_file(&text));
        if geo_transform.is_none() {
            report.warn("georeferenced texture without reference point or world file", image)?;
        }
        Ok(geo_transform)
    }
}

/// Fills `uvs` with one pair per point of all rings. Returns false if the texture has no coordinates for this polygon.
fn compute_uvs(
    appearances: &Appearances,
    parameterization: Parameterization,
    surface_data: &ResolvedSurfaceData,
    rings: &[RingPoints],
    uvs: &mut Vec<[f64; 2]>,
    report: &mut ReportBuilder,
) -> Result<bool> {
    uvs.clear();
    let points = || rings.iter().flat_map(|r| r.points);
    if let Some(geo_transform) = surface_data.geo_transform {
        uvs.extend(points().map(|p| geo_transform.compute_uv(*p, surface_data.size_px)));
        return check_place(surface_data, rings, uvs, report);
    }
    match appearances.resolve_parameterization(parameterization) {
        Parameterization::TexCoordGen(matrix) => {
            uvs.extend(points().map(|p| appearances.project(matrix, *p)));
            Ok(true)
        }
        Parameterization::TexCoordList(range) => copy_listed_uvs(appearances, range, rings, uvs, report),
        Parameterization::None | Parameterization::XLink(_) => {
            report.warn("texture without a parameterization", String::new())?;
            Ok(false)
        }
    }
}

/// Returns false, after a warning, for a texture whose reference point names another coordinate system and that lies elsewhere: equal places
/// show that the two are the same by another name.
fn check_place(surface_data: &ResolvedSurfaceData, rings: &[RingPoints], uvs: &[[f64; 2]], report: &mut ReportBuilder) -> Result<bool> {
    let crs = rings.first().and_then(|ring| ring.crs);
    let is_other = surface_data.crs.is_some_and(|texture| crs.is_some_and(|surface| surface != texture));
    let overlaps = |axis: usize| uvs.iter().any(|uv| uv[axis] <= 1.0) && uvs.iter().any(|uv| uv[axis] >= 0.0);
    if is_other && !(overlaps(0) && overlaps(1)) {
        report.warn(OTHER_SYSTEM, String::new())?;
        return Ok(false);
    }
    Ok(true)
}

fn copy_listed_uvs(
    appearances: &Appearances,
    range: TexCoordRange,
    rings: &[RingPoints],
    uvs: &mut Vec<[f64; 2]>,
    report: &mut ReportBuilder,
) -> Result<bool> {
    for (k, ring) in rings.iter().enumerate() {
        let Some(found) = appearances.find_ring_uvs(range, ring.id) else {
            // The list belongs to other polygons of the target, or lacks one of the interior rings.
            if k > 0 {
                report.warn("texture without coordinates for an interior ring", String::new())?;
            }
            return Ok(false);
        };
        let as_f64 = |uv: &[f32; 2]| uv.map(f64::from);
        uvs.extend(found.iter().take(ring.points.len()).map(as_f64));
        match ring.points.len().saturating_sub(found.len()) {
            0 => {}
            // The list omits the closing point.
            1 if !found.is_empty() => uvs.push(as_f64(&found[0])),
            _ => {
                report.warn("fewer texture coordinates than points", format!("{} for {}", found.len(), ring.points.len()))?;
                return Ok(false);
            }
        }
    }
    Ok(true)
}
