//! Parses app:Appearance elements.

use std::io::BufRead;

use map3d_base::asset::Wrap;
use map3d_base::{Reason, Result};

use super::coordinates::parse_numbers;
use super::positions::{NamedPoint, read_point};
use super::references::{DocumentNumber, OWN_DOCUMENT, References, Target};
use super::xml_reader::XmlReader;
use crate::city_model::appearance::{
    Appearances, Parameterization, PendingAppearance, Resolution, RingTexCoords, SurfaceData, SurfaceDataKind, TexturePlacement, TextureProperties,
};
use crate::city_model::geo_transform::GeoTransform;
use crate::city_model::ids::{self, Id};
use crate::city_model::theme_selection::ThemeSelection;
use crate::document::report_builder::{LimitCheck, ReportBuilder};

/// Diffuse colour of an X3DMaterial without one, as defined by CityGML.
const DEFAULT_DIFFUSE: f32 = 0.8;

pub struct AppearanceParser<'a, R> {
    pub xml: &'a mut XmlReader<R>,
    pub report: &'a mut ReportBuilder,
    pub appearances: &'a mut Appearances,
    pub theme: &'a mut ThemeSelection,
    pub references: &'a mut References,
    pub scope: AppearanceScope,
    /// Limit on the memory of `appearances`.
    pub max_bytes: u64,
    /// Buffers for numbers and text.
    pub values: &'a mut Vec<f64>,
    pub text: &'a mut String,
}

/// Which targets are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AppearanceScope {
    /// All: the appearances are of the document that is read, or of one that it takes geometry from.
    Document,
    /// Those in the document that is read: the appearances are of another document.
    OwnTargets,
}

/// A target of surface data and its parameterization.
struct SurfaceDataTarget {
    target: Id,
    /// The document that is read should have it.
    is_own: bool,
    parameterization: Parameterization,
}

/// The properties of one surface data element.
#[derive(Default)]
struct SurfaceDataProperties {
    is_back: bool,
    image: Option<String>,
    wrap: Option<Wrap>,
    border: Option<[f32; 4]>,
    diffuse: Option<[f32; 4]>,
    transparency: Option<f32>,
    reference_point: Option<NamedPoint>,
    orientation: Option<[f64; 4]>,
    targets: Vec<SurfaceDataTarget>,
}

impl<R: BufRead> AppearanceParser<'_, R> {
    /// Reads the current property and the appearances in it. An appearance that it refers to by XLink is read where it is defined.
    pub fn read_property(&mut self) -> Result<()> {
        while self.xml.next_child()? {
            if self.xml.local_name() == "Appearance" {
                self.read_appearance()?;
            } else {
                self.xml.skip()?;
            }
        }
        Ok(())
    }

    /// Reads the current appearance element. Where the document breaks off in it, the surface data so far are kept.
    pub fn read_appearance(&mut self) -> Result<()> {
        let first = self.appearances.surface_data.len();
        let (mut theme, mut xlinks) = (String::new(), Vec::new());
        let read = self.read_appearance_members(&mut theme, &mut xlinks);
        self.add_to_theme(theme, first, xlinks);
        read
    }

    fn read_appearance_members(&mut self, theme: &mut String, xlinks: &mut Vec<Id>) -> Result<()> {
        while self.xml.next_child()? {
            match self.xml.local_name() {
                "theme" => *theme = self.xml.read_text()?,
                "surfaceDataMember" | "surfaceData" => {
                    if let Some(Ok(target)) = self.xml.attribute("href").map(|href| self.references.resolve(&href)) {
                        xlinks.push(target.id);
                    }
                    while self.xml.next_child()? {
                        self.read_surface_data()?;
                    }
                }
                _ => self.xml.skip()?,
            }
        }
        Ok(())
    }

    /// Adds the surface data from number `first` on to their theme.
    fn add_to_theme(&mut self, theme: String, first: usize, xlinks: Vec<Id>) {
        let is_empty = first == self.appearances.surface_data.len() && xlinks.is_empty();
        if is_empty && self.scope == AppearanceScope::OwnTargets {
            return;
        }
        self.theme.register(&theme);
        if !self.theme.is_chosen() {
            let surface_data = first..self.appearances.surface_data.len();
            self.appearances.pending.push(PendingAppearance { theme, surface_data, xlinks });
            return;
        }
        if self.theme.selected() == Some(&theme) {
            self.appearances.surface_data[first..].iter_mut().for_each(|d| d.in_theme = true);
            self.appearances.theme_xlinks.extend(xlinks);
        } else {
            self.report.note(Reason::AppearanceOfOtherTheme, theme);
        }
    }

    fn read_surface_data(&mut self) -> Result<()> {
        let type_name = self.xml.local_name().to_owned();
        let id = self.xml.gml_id();
        let mut properties = SurfaceDataProperties::default();
        while self.xml.next_child()? {
            self.read_surface_data_property(&mut properties)?;
        }
        let targets = std::mem::take(&mut properties.targets);
        if targets.is_empty() && self.scope == AppearanceScope::OwnTargets {
            return self.check_size();
        }
        let is_front = !properties.is_back;
        let kind = build_kind(&type_name, properties);
        if kind == SurfaceDataKind::Unsupported {
            self.report.warn(Reason::SurfaceDataNotRead, type_name)?;
        }
        if !is_front {
            self.report.note(Reason::AppearanceOfBackSide, kind.describe());
        }
        let number = self.appearances.add_surface_data(id, SurfaceData { kind, is_front, in_theme: false, resolution: Resolution::Unresolved });
        for SurfaceDataTarget { target, is_own, parameterization } in targets {
            self.appearances.bind(target, number, parameterization);
            if !is_own {
                self.appearances.mark_found(target);
            }
        }
        self.check_size()
    }

    fn check_size(&self) -> Result<()> {
        let got = self.appearances.byte_count();
        self.report.check_limit(LimitCheck { what: "appearances, bytes", got, limit: "max_appearance_bytes", value: self.max_bytes })
    }

    fn read_surface_data_property(&mut self, properties: &mut SurfaceDataProperties) -> Result<()> {
        match self.xml.local_name() {
            "isFront" => properties.is_back = matches!(self.xml.read_text()?.as_str(), "false" | "0"),
            "imageURI" => {
                let name = Some(self.xml.read_text()?).filter(|name| !name.is_empty());
                properties.image = name.map(|name| self.references.relocate(name));
            }
            "wrapMode" => properties.wrap = self.read_wrap_mode()?,
            "borderColor" => properties.border = self.read_color()?,
            "diffuseColor" => properties.diffuse = self.read_color()?,
            "transparency" => properties.transparency = parse_transparency(&self.xml.read_text()?),
            "referencePoint" => properties.reference_point = read_point(self.xml)?,
            "orientation" => properties.orientation = self.read_numbers()?.and_then(|v| v.try_into().ok()),
            "target" => self.read_target(properties)?,
            "textureParameterization" => self.read_texture_association(properties)?,
            _ => self.xml.skip()?,
        }
        Ok(())
    }

    fn read_wrap_mode(&mut self) -> Result<Option<Wrap>> {
        let text = self.xml.read_text()?;
        Ok(match text.to_ascii_lowercase().as_str() {
            "none" => Some(Wrap::None),
            "wrap" => Some(Wrap::Wrap),
            "mirror" => Some(Wrap::Mirror),
            "clamp" => Some(Wrap::Clamp),
            "border" => Some(Wrap::Border),
            _ => {
                self.report.warn(Reason::WrapModeUnknown, text)?;
                None
            }
        })
    }

    fn read_numbers(&mut self) -> Result<Option<Vec<f64>>> {
        let mut values = Vec::new();
        Ok(parse_numbers(&self.xml.read_text()?, &mut values).map(|()| values))
    }

    /// Reads red, green, blue and an optional opacity.
    fn read_color(&mut self) -> Result<Option<[f32; 4]>> {
        let values = self.read_numbers()?.unwrap_or_default();
        let channel = |k: usize| values.get(k).map(|v: &f64| if v.is_finite() { v.clamp(0.0, 1.0) as f32 } else { 0.0 });
        Ok(channel(2).map(|blue| [channel(0).unwrap_or(0.0), channel(1).unwrap_or(0.0), blue, channel(3).unwrap_or(1.0)]))
    }

    /// Reads `<target uri="#a">parameterization</target>` or `<target>#a</target>`.
    fn read_target(&mut self, properties: &mut SurfaceDataProperties) -> Result<()> {
        let Some(uri) = self.xml.attribute("uri").map(|uri| uri.into_owned()) else {
            let text = self.xml.read_text()?;
            let target = if text.is_empty() { None } else { self.resolve_target(&text)? };
            self.add_target(target, Parameterization::None, properties);
            return Ok(());
        };
        let xlink = self.xml.attribute("href").map(|href| self.references.resolve(&href));
        let target = self.resolve_target(&uri)?;
        let mut parameterization = match xlink {
            Some(Ok(target)) => Parameterization::XLink(target.id),
            _ => Parameterization::None,
        };
        while self.xml.next_child()? {
            parameterization = self.read_parameterization(target)?;
        }
        self.add_target(target, parameterization, properties);
        Ok(())
    }

    /// Returns what a reference leads to; `None`, after a warning, if that is nothing.
    fn resolve_target(&mut self, href: &str) -> Result<Option<Target>> {
        match self.references.resolve(href) {
            Ok(target) => {
                if target.document == OWN_DOCUMENT && self.scope == AppearanceScope::OwnTargets {
                    self.references.add_own_target(target.id, href);
                }
                if target.document != OWN_DOCUMENT && !self.references.is_in_other_document() {
                    self.report.note(Reason::AppearanceForOtherFile, href);
                }
                Ok(Some(target))
            }
            Err(reason) => self.report.warn(reason, href).map(|()| None),
        }
    }

    fn add_target(&self, target: Option<Target>, parameterization: Parameterization, properties: &mut SurfaceDataProperties) {
        let is_kept = |target: &Target| self.scope == AppearanceScope::Document || target.document == OWN_DOCUMENT;
        // Targets of appearances in other documents are looked for there (`other_documents`).
        let is_here = self.scope == AppearanceScope::Document && !self.references.is_in_other_document();
        properties.targets.extend(target.filter(is_kept).map(|target| SurfaceDataTarget {
            target: target.id,
            is_own: is_here && target.document == OWN_DOCUMENT,
            parameterization,
        }));
    }

    /// Reads a TextureAssociation of CityGML 3.0: target and parameterization are siblings.
    fn read_texture_association(&mut self, properties: &mut SurfaceDataProperties) -> Result<()> {
        while self.xml.next_child()? {
            let (mut target, mut parameterization) = (None, Parameterization::None);
            while self.xml.next_child()? {
                if self.xml.local_name() == "target" {
                    let href = self.xml.read_text()?;
                    target = self.resolve_target(&href)?;
                    continue;
                }
                while self.xml.next_child()? {
                    parameterization = self.read_parameterization(target)?;
                }
            }
            self.add_target(target, parameterization, properties);
        }
        Ok(())
    }

    /// Reads the current parameterization. Rings without the name of a file are in the document of the target.
    fn read_parameterization(&mut self, target: Option<Target>) -> Result<Parameterization> {
        let id = self.xml.gml_id();
        let parameterization = match self.xml.local_name() {
            "TexCoordList" => self.read_tex_coord_list(target)?,
            "TexCoordGen" => self.read_tex_coord_gen()?,
            other => {
                self.report.warn(Reason::TextureParameterizationUnknown, other)?;
                self.xml.skip()?;
                Parameterization::None
            }
        };
        self.appearances.register_parameterization(id, parameterization);
        Ok(parameterization)
    }

    fn read_tex_coord_list(&mut self, target: Option<Target>) -> Result<Parameterization> {
        let first = self.appearances.rings.len();
        let document = target.map(|target| target.document);
        // In CityGML 3.0, `ring` elements follow the coordinates in the same order.
        let mut next_ring = first;
        while self.xml.next_child()? {
            if self.xml.local_name() == "ring" {
                let href = self.xml.read_text()?;
                let ring = resolve_ring(self.references, &href, document);
                if let Some(entry) = self.appearances.rings.get_mut(next_ring) {
                    entry.ring = ring;
                }
                next_ring += 1;
                continue;
            }
            let ring = self.xml.attribute("ring").map_or(ids::NONE, |href| resolve_ring(self.references, &href, document));
            self.read_tex_coords(ring)?;
        }
        Ok(self.appearances.finish_tex_coord_list(first))
    }

    fn read_tex_coords(&mut self, ring: Id) -> Result<()> {
        self.text.clear();
        self.xml.append_text(self.text)?;
        self.values.clear();
        let start = self.appearances.uvs.len() as u32;
        if parse_numbers(self.text, self.values).is_none() || !self.values.len().is_multiple_of(2) {
            return self.report.warn(Reason::TextureCoordinatesUnreadable, self.text.chars().take(40).collect::<String>());
        }
        self.appearances.uvs.extend(self.values.as_chunks::<2>().0.iter().map(|uv| uv.map(|v| v as f32)));
        self.appearances.rings.push(RingTexCoords { ring, start, count: self.appearances.uvs.len() as u32 - start });
        Ok(())
    }

    fn read_tex_coord_gen(&mut self) -> Result<Parameterization> {
        let mut parameterization = Parameterization::None;
        while self.xml.next_child()? {
            let matrix = self.read_numbers()?.and_then(|v| <[f64; 12]>::try_from(v).ok());
            match matrix {
                Some(matrix) => parameterization = self.appearances.add_matrix(matrix),
                None => self.report.warn(Reason::TextureMatrixUnreadable, "TexCoordGen")?,
            }
        }
        Ok(parameterization)
    }
}

/// Returns the id of a ring; `document`: of a ring without the name of a file, by default the current one.
fn resolve_ring(references: &mut References, href: &str, document: Option<DocumentNumber>) -> Id {
    let target = match document {
        Some(document) => references.resolve_within(href, document),
        None => references.resolve(href),
    };
    target.map_or(ids::NONE, |target| target.id)
}

/// Returns a transparency in [0, 1]; `None` for what is not a finite number.
pub fn parse_transparency(text: &str) -> Option<f32> {
    text.trim().parse::<f32>().ok().filter(|v| v.is_finite()).map(|v| v.clamp(0.0, 1.0))
}

fn build_kind(type_name: &str, properties: SurfaceDataProperties) -> SurfaceDataKind {
    let placement = choose_placement(type_name, &properties);
    match (type_name, properties.image) {
        ("X3DMaterial", _) => {
            let [r, g, b, _] = properties.diffuse.unwrap_or([DEFAULT_DIFFUSE; 4]);
            SurfaceDataKind::X3DMaterial { color: [r, g, b], transparency: properties.transparency }
        }
        ("ParameterizedTexture" | "GeoreferencedTexture", Some(image)) => SurfaceDataKind::Texture(TextureProperties {
            image,
            wrap: properties.wrap.unwrap_or_default(),
            border: properties.border.unwrap_or([0.0; 4]),
            placement,
            crs_name: properties.reference_point.and_then(|point| point.srs_name).filter(|name| !name.trim().is_empty()),
        }),
        _ => SurfaceDataKind::Unsupported,
    }
}

/// Chooses the source of texture coordinates. A GeoreferencedTexture without a usable reference point and orientation needs a world file.
fn choose_placement(type_name: &str, properties: &SurfaceDataProperties) -> TexturePlacement {
    if type_name != "GeoreferencedTexture" {
        return TexturePlacement::Parameterized;
    }
    let (Some(NamedPoint { point, .. }), Some(orientation)) = (&properties.reference_point, properties.orientation) else {
        return TexturePlacement::WorldFile;
    };
    GeoTransform::new(*point, orientation).map_or(TexturePlacement::WorldFile, TexturePlacement::Georeferenced)
}
