//! Parses one top-level city object. GML alternates: an object (upper case) contains properties (lower case), a property contains objects.

use map3d_base::Result;
use serde_json::Value;

use super::address::read_address;
use super::appearance::ThemeSelection;
use super::appearance_parser::AppearanceParser;
use super::attributes::{
    add_attribute, is_generic_attribute, is_generic_attribute_object, parse_property, read_external_reference, read_generic_attribute,
    read_generic_attribute_object,
};
use super::city_object::{CityObject, Feature, LodRepresentation, Representation};
use super::feature_types::{FeatureKind, classify_feature, rank_feature, rank_object};
use super::geometry_arena::NO_NODE;
use super::geometry_parser::{GeometryParser, is_point_or_curve, is_surface};
use super::ids::{self, Reference, hash_id, parse_reference};
use super::implicit_geometry::read_implicit_geometry;
use super::xml_reader::{XmlEvent, XmlReader};
use crate::options::ReadOptions;
use crate::report_builder::ReportBuilder;

const DEFAULT_DIMENSION: usize = 3;

pub struct CityObjectParser<'a> {
    pub xml: &'a mut XmlReader,
    pub report: &'a mut ReportBuilder,
    pub options: &'a ReadOptions,
    pub city_object: &'a mut CityObject,
    pub theme: &'a mut ThemeSelection,
    /// Buffers for numbers and text.
    pub values: &'a mut Vec<f64>,
    pub text: &'a mut String,
}

impl CityObjectParser<'_> {
    /// Reads the current element as a top-level city object.
    pub fn read_city_object(&mut self) -> Result<()> {
        self.read_feature(classify_feature(self.xml.local_name()), None)
    }

    fn read_feature(&mut self, kind: FeatureKind, parent: Option<u32>) -> Result<()> {
        let number = self.add_feature(kind, parent);
        while self.xml.next_child()? {
            self.read_property(number)?;
        }
        Ok(())
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
        let relief_lod = parent_feature.and_then(|p| p.relief_lod);
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
            relief_lod,
            representations: Vec::new(),
            xlinks: Vec::new(),
            attributes: Default::default(),
        });
        number
    }

    fn feature(&mut self, number: u32) -> &mut Feature {
        &mut self.city_object.features[number as usize]
    }

    /// Reads the current property of a feature.
    fn read_property(&mut self, number: u32) -> Result<()> {
        let local_name = self.xml.local_name();
        if let Some(lod) = parse_lod_prefix(local_name) {
            return self.read_lod_property(number, lod);
        }
        if is_generic_attribute(local_name) {
            return read_generic_attribute(self.xml, "", &mut self.city_object.features[number as usize].attributes);
        }
        match local_name {
            "appearance" | "appearanceMember" => self.read_appearance(),
            "tin" => {
                let lod = self.feature(number).relief_lod.unwrap_or(0);
                self.read_surfaces(number, lod, Representation::Surfaces)
            }
            "address" => {
                if let Some(text) = read_address(self.xml)? {
                    add_attribute(&mut self.feature(number).attributes, "address", Value::String(text));
                }
                Ok(())
            }
            "externalReference" => read_external_reference(self.xml, &mut self.city_object.features[number as usize].attributes),
            "lod" => {
                let lod = self.xml.read_text()?.parse().ok();
                self.feature(number).relief_lod = lod;
                Ok(())
            }
            "metaDataProperty" | "location" | "extent" => self.xml.skip(),
            _ => self.read_other_property(number),
        }
    }

    /// Reads a property by its content: an XLink, text (an attribute), or objects.
    fn read_other_property(&mut self, number: u32) -> Result<()> {
        let local_name = self.xml.local_name().to_owned();
        let reference = self.xml.attribute("href").map(|href| parse_reference(&href));
        if let Some(Reference::Internal(id)) = reference.filter(|_| !local_name.starts_with("interior")) {
            self.feature(number).xlinks.push(id);
        }
        let depth = self.xml.depth();
        let mut text = String::new();
        let mut is_simple = true;
        while self.xml.depth() >= depth {
            match self.xml.next_event()? {
                XmlEvent::Start => {
                    is_simple = false;
                    self.read_property_value(number)?;
                }
                XmlEvent::Text => text.push_str(self.xml.text()),
                XmlEvent::End => {}
                XmlEvent::Eof => break,
            }
        }
        let text = text.trim();
        if is_simple && !text.is_empty() && self.feature(number).is_object() {
            add_attribute(&mut self.feature(number).attributes, &local_name, parse_property(&local_name, text));
        }
        Ok(())
    }

    /// Reads the current element inside a property.
    fn read_property_value(&mut self, number: u32) -> Result<()> {
        let local_name = self.xml.local_name();
        if local_name == "Envelope" || local_name == "Null" || is_point_or_curve(local_name) {
            return self.xml.skip();
        }
        if is_surface(local_name) {
            self.report.note("geometry without a level of detail ignored", local_name);
            return self.xml.skip();
        }
        if is_generic_attribute_object(local_name) {
            return read_generic_attribute_object(self.xml, &mut self.city_object.features[number as usize].attributes);
        }
        if !local_name.starts_with(|c: char| c.is_uppercase()) {
            return self.xml.skip();
        }
        let kind = classify_feature(local_name);
        if kind == FeatureKind::Unknown && !matches!(local_name, "Address" | "AddressDetails" | "ExternalReference") {
            self.report.note("unknown element; features inside it are read", local_name);
        }
        self.read_feature(kind, Some(number))
    }

    fn read_appearance(&mut self) -> Result<()> {
        AppearanceParser {
            xml: self.xml,
            report: self.report,
            appearances: &mut self.city_object.appearances,
            theme: self.theme,
            max_bytes: self.options.max_appearance_bytes,
            values: self.values,
            text: self.text,
        }
        .read_property()
    }

    fn geometry_parser(&mut self) -> GeometryParser<'_> {
        GeometryParser {
            xml: self.xml,
            report: self.report,
            geometry: &mut self.city_object.geometry,
            max_bytes: self.options.max_object_bytes,
            values: self.values,
            text: self.text,
        }
    }

    /// Reads a property whose name begins with `lod0` … `lod4`.
    fn read_lod_property(&mut self, number: u32, lod: u8) -> Result<()> {
        match &self.xml.local_name()["lod0".len()..] {
            "ImplicitRepresentation" => self.read_implicit_representation(number, lod),
            "RoofEdge" => self.read_surfaces(number, lod, Representation::RoofEdge),
            "TerrainIntersection" | "TerrainIntersectionCurve" | "MultiCurve" | "Network" | "Point" | "MultiPoint" | "PointCloud" => {
                self.report.omit("points and lines");
                self.xml.skip()
            }
            _ => self.read_surfaces(number, lod, Representation::Surfaces),
        }
    }

    fn read_surfaces(&mut self, number: u32, lod: u8, representation: fn(u32) -> Representation) -> Result<()> {
        let node = self.geometry_parser().read_property(NO_NODE, DEFAULT_DIMENSION)?;
        if let Some(node) = node {
            self.feature(number).representations.push(LodRepresentation { lod, representation: representation(node) });
        }
        Ok(())
    }

    fn read_implicit_representation(&mut self, number: u32, lod: u8) -> Result<()> {
        while self.xml.next_child()? {
            if self.xml.local_name() != "ImplicitGeometry" {
                self.xml.skip()?;
                continue;
            }
            match read_implicit_geometry(&mut self.geometry_parser(), DEFAULT_DIMENSION)? {
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

/// Returns the level of detail of a property name that begins with `lod0` … `lod4` and continues in upper case.
fn parse_lod_prefix(local_name: &str) -> Option<u8> {
    let rest = local_name.strip_prefix("lod")?.as_bytes();
    match rest {
        [digit @ b'0'..=b'4', next, ..] if next.is_ascii_uppercase() => Some(digit - b'0'),
        _ => None,
    }
}
