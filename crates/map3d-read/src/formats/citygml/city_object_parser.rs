//! Parses one top-level city object. GML alternates: an object (upper case) contains properties (lower case), a property contains objects.

use std::borrow::Cow;

use map3d_base::{Reason, Result};
use serde_json::Value;

use super::address::read_address;
use super::appearance_parser::{AppearanceParser, AppearanceScope};
use super::attribute_parser::{
    is_generic_attribute, is_generic_attribute_object, read_external_reference, read_generic_attribute, read_generic_attribute_object,
};
use super::geometry_parser::{GeometryParser, is_point_or_curve, is_surface};
use super::positions::PositionFormat;
use super::references::References;
use super::xml_reader::{XmlEvent, XmlReader};
use crate::city_model::attributes::{Attributes, add_attribute, add_code, add_data_type, add_unit, parse_property};
use crate::city_model::city_object::{CityObject, Feature, LodRepresentation, Representation};
use crate::city_model::code_lists::CodeLists;
use crate::city_model::crs_table::{CrsNumber, CrsTable};
use crate::city_model::feature_types::{FeatureKind, classify_feature, is_open_space, is_subdivision, rank_feature, rank_object};
use crate::city_model::geometry_arena::NO_NODE;
use crate::city_model::ids::{self, hash_id};
use crate::city_model::lifespan::Lifespan;
use crate::city_model::standard_codes::{Code, is_adv_code};
use crate::city_model::theme_selection::ThemeSelection;
use crate::document::asset_folder::AssetFolder;
use crate::document::options::ReadOptions;
use crate::document::report_builder::ReportBuilder;

const MAX_LOD: u8 = 4;

pub struct CityObjectParser<'a> {
    pub xml: &'a mut XmlReader,
    pub report: &'a mut ReportBuilder,
    pub options: &'a ReadOptions,
    pub city_object: &'a mut CityObject,
    pub theme: &'a mut ThemeSelection,
    pub code_lists: &'a mut CodeLists,
    pub crs_table: &'a mut CrsTable,
    pub references: &'a mut References,
    /// Folder of the files that the document names.
    pub folder: &'a mut AssetFolder,
    /// Coordinate system of the model that has the city object.
    pub crs: CrsNumber,
    /// Buffers for numbers and text.
    pub values: &'a mut Vec<f64>,
    pub text: &'a mut String,
}

impl CityObjectParser<'_> {
    /// Reads the current element as a top-level city object.
    pub fn read_city_object(&mut self) -> Result<()> {
        let number = self.add_feature(classify_feature(self.xml.local_name()), None);
        self.read_properties(number)
    }

    fn read_properties(&mut self, number: u32) -> Result<()> {
        while self.xml.next_child()? {
            self.read_property(number)?;
        }
        Ok(())
    }

    /// Adds the attributes of a data type to its owner. `property`: of the owner, which contains the data type.
    fn finish_data_type(&mut self, number: u32, owner: u32, property: &str) {
        let Feature { type_name, attributes, .. } = self.feature(number);
        let (type_name, attributes) = (type_name.clone(), std::mem::take(attributes));
        let is_known = |feature: &Feature| feature.kind != FeatureKind::Unknown || !feature.representations.is_empty();
        if self.feature(number).kind == FeatureKind::Unknown && self.city_object.features[number as usize..].iter().any(is_known) {
            self.report.note(Reason::ElementUnknown, type_name.as_str());
        }
        if self.feature(owner).keeps_attributes {
            add_data_type(&mut self.feature(owner).attributes, property, &type_name, attributes);
        }
    }

    fn add_feature(&mut self, kind: FeatureKind, parent: Option<u32>) -> u32 {
        let type_name = self.xml.local_name().to_owned();
        let gml_id = self.xml.attribute("id").unwrap_or_default();
        let id = if gml_id.is_empty() { ids::NONE } else { hash_id(&gml_id) };
        let is_interior_kind = kind == FeatureKind::Interior;
        // A top-level feature of any other type, such as a surface without a building, is an object too.
        let kind = if parent.is_none() && kind != FeatureKind::Part { FeatureKind::Object } else { kind };
        let is_object = matches!(kind, FeatureKind::Object | FeatureKind::Part);
        let name = if is_object { gml_id.trim().to_owned() } else { String::new() };
        let parent_feature = parent.map(|p| &self.city_object.features[p as usize]);
        let rank = parent_feature.map_or_else(|| rank_object(&type_name), |p| rank_feature(kind, &type_name, p.rank));
        let is_interior = is_interior_kind || parent_feature.is_some_and(|p| p.is_interior);
        let crs = parent_feature.map_or(self.crs, |p| p.crs);
        let relief_lod = parent_feature.and_then(|p| p.relief_lod);
        let is_data_type = kind == FeatureKind::Unknown || is_subdivision(&type_name);
        let keeps_attributes = is_object || (is_data_type && parent_feature.is_some_and(|p| p.keeps_attributes));
        let number = self.city_object.features.len() as u32;
        if id != ids::NONE {
            self.city_object.by_id.entry(id).or_insert(number);
        }
        self.city_object.features.push(Feature {
            id,
            name,
            type_name,
            kind,
            parent,
            rank,
            is_interior,
            lifespan: Lifespan::default(),
            is_left_out: false,
            crs,
            relief_lod,
            extent: None,
            representations: Vec::new(),
            xlinks: Vec::new(),
            attributes: Attributes::default(),
            keeps_attributes,
        });
        number
    }

    fn feature(&mut self, number: u32) -> &mut Feature {
        &mut self.city_object.features[number as usize]
    }

    /// Reads the current property of a feature.
    fn read_property(&mut self, number: u32) -> Result<()> {
        let is_raster_relief = self.feature(number).type_name == "RasterRelief";
        let local_name = self.xml.local_name();
        if let Some(lod) = parse_lod_prefix(local_name) {
            return self.read_lod_property(number, lod);
        }
        if is_generic_attribute(local_name) {
            if !self.city_object.features[number as usize].keeps_attributes {
                return self.xml.skip();
            }
            return read_generic_attribute(self.xml, "", &mut self.city_object.features[number as usize].attributes);
        }
        match local_name {
            "appearance" | "appearanceMember" => self.read_appearance(),
            "tin" => {
                let lod = self.feature(number).relief_lod.unwrap_or(0);
                self.read_surfaces(number, lod, Representation::Surfaces)
            }
            "address" => self.read_address(number),
            "externalReference" => read_external_reference(self.xml, &mut self.city_object.features[number as usize].attributes),
            "lod" => {
                let lod = self.xml.read_text()?.parse().ok();
                self.feature(number).relief_lod = lod.filter(|lod| *lod <= MAX_LOD);
                Ok(())
            }
            "relationToConstruction" => {
                let is_inside = self.xml.read_text()? == "inside";
                self.feature(number).is_interior |= is_inside;
                Ok(())
            }
            "grid" if is_raster_relief => self.read_grid(number),
            "extent" if is_raster_relief => self.read_extent(number),
            "metaDataProperty" | "location" | "extent" => self.xml.skip(),
            _ => self.read_other_property(number),
        }
    }

    fn read_address(&mut self, number: u32) -> Result<()> {
        if let Some(text) = read_address(self.xml)? {
            add_attribute(&mut self.feature(number).attributes, "address", Value::String(text));
        }
        Ok(())
    }

    /// Reads a property by its content: an XLink, text (an attribute), or objects.
    fn read_other_property(&mut self, number: u32) -> Result<()> {
        let local_name = self.xml.local_name().to_owned();
        if let Some(href) = self.xml.attribute("href").map(Cow::into_owned) {
            match self.references.find_own_id(&href) {
                Some(id) if !local_name.starts_with("interior") => self.feature(number).xlinks.push(id),
                None if holds_parts(&local_name) => self.report.warn(Reason::PartInOtherFile, href)?,
                _ => {}
            }
        }
        let code_space = self.xml.attribute("codeSpace").map(|space| space.into_owned());
        let unit = self.xml.attribute("uom").map(|unit| unit.into_owned());
        let depth = self.xml.depth();
        let mut text = String::new();
        // Properties directly inside this one are those of a data type without an element.
        let mut data_type = None;
        let mut is_simple = true;
        while self.xml.depth() >= depth {
            match self.xml.next_event()? {
                XmlEvent::Start if self.xml.local_name().starts_with(|c: char| c.is_uppercase()) => {
                    is_simple = false;
                    self.read_property_value(number, &local_name)?;
                }
                XmlEvent::Start => {
                    is_simple = false;
                    let data_type = *data_type.get_or_insert_with(|| self.add_data_type(number, &local_name));
                    self.read_property(data_type)?;
                }
                XmlEvent::Text => text.push_str(self.xml.text()),
                XmlEvent::End => {}
                XmlEvent::Eof => break,
            }
        }
        if let Some(data_type) = data_type {
            self.finish_data_type(data_type, number, &local_name);
        }
        let text = text.trim();
        if is_simple && !text.is_empty() {
            self.feature(number).lifespan.add_property(&local_name, text);
            if self.feature(number).keeps_attributes {
                self.add_simple_attribute(number, &local_name, code_space.as_deref(), unit.as_deref(), text);
            }
        }
        Ok(())
    }

    fn add_data_type(&mut self, owner: u32, property: &str) -> u32 {
        let number = self.add_feature(FeatureKind::Unknown, Some(owner));
        self.feature(number).type_name = property.to_owned();
        number
    }

    fn add_simple_attribute(&mut self, number: u32, name: &str, code_space: Option<&str>, unit: Option<&str>, text: &str) {
        let attributes = &mut self.city_object.features[number as usize].attributes;
        let is_adv = attributes.get("function/code").and_then(Value::as_str).is_some_and(|code| is_adv_code(code.get(..10).unwrap_or_default()));
        let code = Code { property: name, space: code_space, text, is_adv };
        match self.code_lists.find_label(code, self.report) {
            Some(label) => add_code(attributes, name, label, text),
            None => {
                add_attribute(attributes, name, parse_property(name, unit.is_some(), text));
                add_unit(attributes, name, unit);
            }
        }
    }

    /// Reads the current element inside a property.
    fn read_property_value(&mut self, number: u32, property: &str) -> Result<()> {
        let local_name = self.xml.local_name();
        if local_name == "Envelope"
            && let Some(crs) = self.xml.attribute("srsName").and_then(|name| self.crs_table.find(&name))
        {
            self.feature(number).crs = crs;
        }
        let local_name = self.xml.local_name();
        if matches!(local_name, "Envelope" | "Null" | "PointCloud" | "Dynamizer") || is_point_or_curve(local_name) {
            return self.xml.skip();
        }
        if is_surface(local_name) {
            return self.read_geometry(number);
        }
        if local_name == "ClearanceSpace" {
            self.report.omit(Reason::SolidOfOpenSpace, 1);
            return self.xml.skip();
        }
        if is_generic_attribute_object(local_name) {
            return self.read_generic_attribute(number);
        }
        if matches!(local_name, "Address" | "AddressDetails") {
            return self.read_address(number);
        }
        let kind = classify_feature(local_name);
        let feature = self.add_feature(kind, Some(number));
        self.read_properties(feature)?;
        if kind == FeatureKind::Unknown || self.feature(feature).keeps_attributes && !self.feature(feature).is_object() {
            self.finish_data_type(feature, number, property);
        }
        Ok(())
    }

    fn read_generic_attribute(&mut self, number: u32) -> Result<()> {
        let Feature { attributes, keeps_attributes, .. } = &mut self.city_object.features[number as usize];
        if !*keeps_attributes {
            return self.xml.skip();
        }
        let (code_lists, report) = (&mut *self.code_lists, &mut *self.report);
        let mut find_label =
            |property: &str, space: &str, text: &str| code_lists.find_label(Code { property, space: Some(space), text, is_adv: false }, report);
        read_generic_attribute_object(self.xml)?.add_to("", attributes, &mut find_label);
        Ok(())
    }

    pub fn read_appearance(&mut self) -> Result<()> {
        AppearanceParser {
            xml: self.xml,
            report: self.report,
            appearances: &mut self.city_object.appearances,
            theme: self.theme,
            references: self.references,
            scope: AppearanceScope::Document,
            max_bytes: self.options.max_appearance_bytes,
            values: self.values,
            text: self.text,
        }
        .read_property()
    }

    pub fn geometry_parser(&mut self) -> GeometryParser<'_> {
        GeometryParser {
            xml: self.xml,
            report: self.report,
            geometry: &mut self.city_object.geometry,
            crs_table: self.crs_table,
            references: self.references,
            max_bytes: self.options.max_object_bytes,
            values: self.values,
            text: self.text,
        }
    }

    /// Reads a property whose name begins with `lod0` … `lod4`.
    fn read_lod_property(&mut self, number: u32, lod: u8) -> Result<()> {
        match &self.xml.local_name()["lod0".len()..] {
            "Solid" if is_open_space(&self.city_object.features[number as usize].type_name) => {
                self.report.omit(Reason::SolidOfOpenSpace, 1);
                self.xml.skip()
            }
            "ImplicitRepresentation" => self.read_implicit_representation(number, lod),
            "RoofEdge" => self.read_surfaces(number, lod, Representation::RoofEdge),
            "TerrainIntersection" | "TerrainIntersectionCurve" | "MultiCurve" | "Network" | "Point" | "MultiPoint" | "PointCloud" => {
                self.report.omit(Reason::PointsAndLines, 1);
                self.xml.skip()
            }
            _ => self.read_surfaces(number, lod, Representation::Surfaces),
        }
    }

    /// Reads the current geometry in a property that names no level of detail, as extensions have them: it counts as level 0. The geometry of a
    /// group repeats that of its members.
    fn read_geometry(&mut self, number: u32) -> Result<()> {
        if self.feature(number).type_name == "CityObjectGroup" {
            return self.xml.skip();
        }
        self.report.note(Reason::GeometryWithoutLod, self.xml.local_name());
        let first = self.city_object.geometry.nodes.len() as u32;
        let format = PositionFormat::new(self.feature(number).crs);
        let read = self.geometry_parser().read_element(NO_NODE, format);
        self.add_surfaces(number, 0, Representation::Surfaces, first, read)
    }

    fn read_surfaces(&mut self, number: u32, lod: u8, representation: fn(u32) -> Representation) -> Result<()> {
        let first = self.city_object.geometry.nodes.len() as u32;
        let format = PositionFormat::new(self.feature(number).crs);
        let read = self.geometry_parser().read_property(NO_NODE, format);
        self.add_surfaces(number, lod, representation, first, read)
    }

    /// Adds geometry that was read; `first`: number of the first node in it.
    fn add_surfaces(&mut self, number: u32, lod: u8, representation: fn(u32) -> Representation, first: u32, read: Result<Option<u32>>) -> Result<()> {
        // Where the document breaks off, the nodes so far are kept.
        let node = match &read {
            Ok(node) => *node,
            Err(_) => Some(first).filter(|node| (*node as usize) < self.city_object.geometry.nodes.len()),
        };
        if let Some(node) = node {
            self.feature(number).representations.push(LodRepresentation { lod, representation: representation(node) });
        }
        read.map(|_| ())
    }

    fn read_implicit_representation(&mut self, number: u32, lod: u8) -> Result<()> {
        while self.xml.next_child()? {
            if self.xml.local_name() != "ImplicitGeometry" {
                self.xml.skip()?;
                continue;
            }
            let crs = self.feature(number).crs;
            match self.read_implicit_geometry(crs)? {
                Ok(implicit) => {
                    let index = self.city_object.implicit_geometries.len() as u32;
                    self.city_object.implicit_geometries.push(implicit);
                    self.feature(number).representations.push(LodRepresentation { lod, representation: Representation::Implicit(index) });
                }
                Err(reason) => {
                    let at = self.xml.position();
                    self.report.skip(reason, || format!("before byte {at}"))?;
                }
            }
        }
        Ok(())
    }
}

/// Returns whether a property holds parts of an object that are drawn.
fn holds_parts(property: &str) -> bool {
    const PARTS: [&str; 11] = [
        "boundedBy",
        "boundary",
        "opening",
        "fillingSurface",
        "filling",
        "consistsOfBuildingPart",
        "buildingPart",
        "outerBuildingInstallation",
        "buildingInstallation",
        "outerConstruction",
        "trafficArea",
    ];
    PARTS.contains(&property)
}

/// Returns the level of detail of a property name that begins with `lod0` … `lod4` and continues in upper case.
fn parse_lod_prefix(local_name: &str) -> Option<u8> {
    let rest = local_name.strip_prefix("lod")?.as_bytes();
    match rest {
        [digit @ b'0'..=b'4', next, ..] if next.is_ascii_uppercase() => Some(digit - b'0'),
        _ => None,
    }
}
