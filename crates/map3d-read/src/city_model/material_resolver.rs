//! Resolves the surface data that target a polygon to a material and texture coordinates.

use std::collections::HashMap;
use std::fs;

use map3d_base::asset::{Material, SurfaceClass, Wrap};
use map3d_base::{Reason, Result, Vec3};

use super::appearance::{
    Appearances, Parameterization, Resolution, ResolvedMaterial, ResolvedSurfaceData, SurfaceDataKind, TargetBinding, TexCoordRange,
    TexturePlacement, TextureProperties,
};
use super::crs_table::{HorizontalKey, horizontal_key};
use super::feature_types::classify_surface;
use super::geo_transform::GeoTransform;
use super::ids::Id;
use crate::document::asset_folder::AssetFolder;
use crate::document::images::DocumentImages;
use crate::document::material_table::MaterialTable;
use crate::document::options::ReadOptions;
use crate::document::report_builder::ReportBuilder;

/// Samples along each side of a texture at which its transformation to another coordinate system is fitted.
const FIT_SAMPLES: usize = 9;
const MAX_FIT_ERROR_PX: f64 = 0.5;

pub struct MaterialResolver {
    pub images: DocumentImages,
    pub table: MaterialTable,
    pub folder: AssetFolder,
    pub options: ReadOptions,
    /// The document's transparency is opacity.
    inverted: bool,
    crs_names: HashMap<HorizontalKey, String>,
    fits: HashMap<FitKey, Fit>,
}

/// A georeferenced texture and the coordinate system of surfaces: their keys, the transformation and the size of the image.
type FitKey = (HorizontalKey, HorizontalKey, [u64; 6], [u32; 2]);

/// The transformation of a georeferenced texture to the coordinate system of surfaces.
#[derive(Clone, Copy)]
enum Fit {
    Affine(GeoTransform),
    Inexact,
    /// No transformation between the two coordinate systems is known.
    Unknown,
}

/// One ring of a polygon as written.
#[derive(Clone, Copy)]
pub struct RingPoints<'a> {
    pub id: Id,
    /// Id of the polygon.
    pub polygon: Id,
    pub points: &'a [Vec3],
    /// Coordinate system of the points, if it has a name.
    pub crs: Option<HorizontalKey>,
}

impl MaterialResolver {
    /// `inverted`: the document's transparency is opacity.
    pub fn new(folder: AssetFolder, options: ReadOptions, inverted: bool) -> Self {
        Self {
            images: DocumentImages::default(),
            table: MaterialTable::default(),
            folder,
            options,
            inverted,
            crs_names: HashMap::new(),
            fits: HashMap::new(),
        }
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
                let is_own = matches!(rings, [ring] if *id == ring.id || *id == ring.polygon);
                for binding in bindings {
                    let Some(surface_data) = self.resolve_surface_data(appearances, binding.surface_data, report)? else { continue };
                    if !surface_data.material.textured {
                        untextured.get_or_insert(surface_data.material);
                        continue;
                    }
                    let parameterization = match binding.parameterization {
                        Parameterization::TexCoordList(range) if is_own => Parameterization::OwnTexCoordList(range),
                        other => other,
                    };
                    if self.compute_uvs(appearances, parameterization, &surface_data, rings, uvs, report)? {
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
        let TextureProperties { image: name, wrap, border, placement, crs_name } = texture;
        let Some(image) = self.images.get(name, &mut self.folder, &self.options, report)?.cloned() else { return Ok(None) };
        let geo_transform = match placement {
            TexturePlacement::Parameterized => None,
            TexturePlacement::Georeferenced(transform) => Some(*transform),
            TexturePlacement::WorldFile => match self.read_world_file(name, report)? {
                None => return Ok(None),
                found => found,
            },
        };
        let crs = crs_name.as_deref().map(|name| self.add_crs(name));
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

    /// Keeps the name of a coordinate system, and returns its key.
    pub fn add_crs(&mut self, name: &str) -> HorizontalKey {
        let key = horizontal_key(name);
        self.crs_names.entry(key).or_insert_with(|| name.to_owned());
        key
    }

    /// Returns the transformation of a georeferenced texture to another coordinate system.
    fn fit(&mut self, transform: GeoTransform, size_px: [u32; 2], texture: HorizontalKey, surface: HorizontalKey) -> Result<Fit> {
        let GeoTransform { a, b, c, d, e, f } = transform;
        let key = (surface, texture, [a, b, c, d, e, f].map(f64::to_bits), size_px);
        if let Some(fit) = self.fits.get(&key) {
            return Ok(*fit);
        }
        let fit = self.compute_fit(transform, size_px, texture, surface)?;
        self.fits.insert(key, fit);
        Ok(fit)
    }

    fn compute_fit(&self, transform: GeoTransform, size_px: [u32; 2], texture: HorizontalKey, surface: HorizontalKey) -> Result<Fit> {
        let (Some(convert), [Some(from), Some(to)]) = (&self.options.transform, [texture, surface].map(|key| self.crs_names.get(&key))) else {
            return Ok(Fit::Unknown);
        };
        let along = |k: usize, side: usize| k as f64 / (FIT_SAMPLES - 1) as f64 * f64::from(size_px[side]) - 0.5;
        let pixels: Vec<[f64; 2]> = (0..FIT_SAMPLES.pow(2)).map(|k| [along(k % FIT_SAMPLES, 0), along(k / FIT_SAMPLES, 1)]).collect();
        let positions: Vec<[f64; 2]> = pixels.iter().map(|pixel| transform.to_world(*pixel)).collect();
        let Some(positions) = convert.transform(from, to, &positions)? else { return Ok(Fit::Unknown) };
        Ok(match GeoTransform::fit(&pixels, &positions) {
            Some((fitted, error_px)) if error_px <= MAX_FIT_ERROR_PX => Fit::Affine(fitted),
            _ => Fit::Inexact,
        })
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
            report.warn(Reason::GeoreferencedTextureWithoutPlace, image)?;
        }
        Ok(geo_transform)
    }

    /// Fills `uvs` with one pair per point of all rings. Returns false if the texture has no coordinates for this polygon.
    fn compute_uvs(
        &mut self,
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
            return self.compute_georeferenced_uvs(geo_transform, surface_data, rings, uvs, report);
        }
        match appearances.resolve_parameterization(parameterization) {
            Parameterization::TexCoordGen(matrix) => {
                uvs.extend(points().map(|p| appearances.project(matrix, *p)));
                Ok(true)
            }
            Parameterization::TexCoordList(range) => copy_listed_uvs(appearances, range, false, rings, uvs, report),
            Parameterization::OwnTexCoordList(range) => copy_listed_uvs(appearances, range, true, rings, uvs, report),
            Parameterization::None | Parameterization::XLink(_) => {
                report.warn(Reason::TextureWithoutParameterization, String::new())?;
                Ok(false)
            }
        }
    }

    /// Computes the texture coordinates of a georeferenced texture, whose reference point may name another coordinate system than the surface.
    fn compute_georeferenced_uvs(
        &mut self,
        geo_transform: GeoTransform,
        surface_data: &ResolvedSurfaceData,
        rings: &[RingPoints],
        uvs: &mut Vec<[f64; 2]>,
        report: &mut ReportBuilder,
    ) -> Result<bool> {
        let size_px = surface_data.size_px;
        let crs = rings.first().and_then(|ring| ring.crs);
        let other = surface_data.crs.zip(crs).filter(|(texture, surface)| texture != surface);
        let fit = match other {
            Some((texture, surface)) => self.fit(geo_transform, size_px, texture, surface)?,
            None => Fit::Affine(geo_transform),
        };
        let geo_transform = match fit {
            Fit::Affine(fitted) => fitted,
            Fit::Unknown => geo_transform,
            Fit::Inexact => {
                report.warn(Reason::GeoreferencedTextureInexact, String::new())?;
                return Ok(false);
            }
        };
        let points = || rings.iter().flat_map(|r| r.points);
        uvs.extend(points().map(|p| geo_transform.compute_uv(*p, size_px)));
        if !overlap_image(uvs) {
            // World files have the easting first, documents perhaps the northing.
            let swapped: Vec<[f64; 2]> = points().map(|&[x, y, z]| geo_transform.compute_uv([y, x, z], size_px)).collect();
            if overlap_image(&swapped) {
                *uvs = swapped;
            }
        }
        check_place(matches!(fit, Fit::Unknown), uvs, report)
    }
}

/// Returns whether the box of texture coordinates shares a part of the image.
fn overlap_image(uvs: &[[f64; 2]]) -> bool {
    [0, 1].into_iter().all(|axis| uvs.iter().any(|uv| uv[axis] <= 1.0) && uvs.iter().any(|uv| uv[axis] >= 0.0))
}

/// Returns false, after a warning, for a texture whose reference point names another coordinate system and that lies elsewhere: equal places
/// show that the two are the same by another name.
fn check_place(is_other: bool, uvs: &[[f64; 2]], report: &mut ReportBuilder) -> Result<bool> {
    if is_other && !overlap_image(uvs) {
        report.warn(Reason::GeoreferencedTextureInOtherCrs, String::new())?;
        return Ok(false);
    }
    Ok(true)
}

fn copy_listed_uvs(
    appearances: &Appearances,
    range: TexCoordRange,
    is_own: bool,
    rings: &[RingPoints],
    uvs: &mut Vec<[f64; 2]>,
    report: &mut ReportBuilder,
) -> Result<bool> {
    for (k, ring) in rings.iter().enumerate() {
        let only = || appearances.find_only_ring_uvs(range).filter(|uvs| is_own && matches!(ring.points.len().wrapping_sub(uvs.len()), 0 | 1));
        let Some(found) = appearances.find_ring_uvs(range, ring.id).or_else(only) else {
            // The list belongs to other polygons of the target, or lacks one of the interior rings.
            if k > 0 {
                report.warn(Reason::TextureCoordinatesMissingForHole, String::new())?;
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
                report.warn(Reason::TextureCoordinatesTooFew, format!("{} for {}", found.len(), ring.points.len()))?;
                return Ok(false);
            }
        }
    }
    Ok(true)
}
