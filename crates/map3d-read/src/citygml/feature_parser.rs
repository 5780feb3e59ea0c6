//! One top-level city object with everything in it. GML alternates: an object (upper case) holds properties (lower case), a property holds objects.

use map3d_base::Result;
use serde_json::Value;

use super::address::address;
use super::appearance_parser::{AppearanceParser, Theme};
use super::attributes::{external_reference, generic, generic_object, is_generic, is_generic_object, put, simple_value};
use super::feature::{Feature, Form, Member, Placed};
use super::geometry_parser::{GeometryParser, TOP, is_surface, is_thin};
use super::ids::{self, Target, id_of, target_of};
use super::implicit::implicit;
use super::kinds::{Kind, kind_of, rank_below, rank_of_object};
use super::xml::{Step, Xml};
use crate::options::ReadOptions;
use crate::report::Log;

const DIMENSION: usize = 3;

pub struct FeatureParser<'a> {
    pub xml: &'a mut Xml,
    pub log: &'a mut Log,
    pub options: &'a ReadOptions,
    pub member: &'a mut Member,
    pub theme: &'a mut Theme,
    pub values: &'a mut Vec<f64>,
    pub text: &'a mut String,
}

impl FeatureParser<'_> {
    /// The city object that has just started, to its end.
    pub fn city_object(&mut self) -> Result<()> {
        let kind = match kind_of(self.xml.local()) {
            Kind::Unknown => Kind::Object,
            known => known,
        };
        self.feature(kind, None)
    }

    fn feature(&mut self, kind: Kind, parent: Option<u32>) -> Result<()> {
        let number = self.open(kind, parent);
        while self.xml.next_child()? {
            self.property(number)?;
        }
        Ok(())
    }

    fn open(&mut self, kind: Kind, parent: Option<u32>) -> u32 {
        let local = self.xml.local().to_owned();
        let written = self.xml.attribute("id").unwrap_or_default();
        let id = if written.is_empty() { ids::NONE } else { id_of(&written) };
        let is_object = matches!(kind, Kind::Object | Kind::Part);
        let name = if is_object { written.trim().to_owned() } else { String::new() };
        let above = parent.map(|p| &self.member.features[p as usize]);
        let rank = above.map_or_else(|| rank_of_object(&local), |above| rank_below(kind, &local, above.rank));
        let interior = kind == Kind::Interior || above.is_some_and(|above| above.interior);
        let lod_hint = above.and_then(|above| above.lod_hint);
        let number = self.member.features.len() as u32;
        if id != ids::NONE {
            self.member.by_id.entry(id).or_insert(number);
        }
        let (placed, links, attributes) = Default::default();
        self.member.features.push(Feature { id, name, local, kind, parent, rank, interior, lod_hint, placed, links, attributes });
        number
    }

    fn this(&mut self, number: u32) -> &mut Feature {
        &mut self.member.features[number as usize]
    }

    /// The property that has just started, to its end.
    fn property(&mut self, number: u32) -> Result<()> {
        let local = self.xml.local();
        if let Some(lod) = lod_of(local) {
            return self.at_lod(number, lod);
        }
        if is_generic(local) {
            return generic(self.xml, "", &mut self.member.features[number as usize].attributes);
        }
        match local {
            "appearance" | "appearanceMember" => self.appearance(),
            "tin" => {
                let lod = self.this(number).lod_hint.unwrap_or(0);
                self.surfaces(number, lod, Form::Surfaces)
            }
            "address" => {
                if let Some(text) = address(self.xml)? {
                    put(&mut self.this(number).attributes, "address", Value::String(text));
                }
                Ok(())
            }
            "externalReference" => external_reference(self.xml, &mut self.member.features[number as usize].attributes),
            "lod" => {
                let lod = self.xml.whole_text()?.parse().ok();
                self.this(number).lod_hint = lod;
                Ok(())
            }
            "metaDataProperty" | "location" | "extent" => self.xml.skip(),
            _ => self.other(number),
        }
    }

    /// A property by its content: a reference, text (an attribute), or objects.
    fn other(&mut self, number: u32) -> Result<()> {
        let local = self.xml.local().to_owned();
        let target = self.xml.attribute("href").map(|href| target_of(&href));
        if let Some(Target::Here(id)) = target.filter(|_| !local.starts_with("interior")) {
            self.this(number).links.push(id);
        }
        let depth = self.xml.depth();
        let mut text = String::new();
        let mut simple = true;
        while self.xml.depth() >= depth {
            match self.xml.step()? {
                Step::Start => {
                    simple = false;
                    self.content(number)?;
                }
                Step::Text => text.push_str(self.xml.text()),
                Step::End => {}
                Step::Eof => break,
            }
        }
        let text = text.trim();
        if simple && !text.is_empty() && self.this(number).is_object() {
            put(&mut self.this(number).attributes, &local, simple_value(&local, text));
        }
        Ok(())
    }

    /// An element inside of a property.
    fn content(&mut self, number: u32) -> Result<()> {
        let local = self.xml.local();
        if local == "Envelope" || local == "Null" || is_thin(local) {
            return self.xml.skip();
        }
        if is_surface(local) {
            let local = local.to_owned();
            self.log.note("geometry outside of a level of detail not drawn", local);
            return self.xml.skip();
        }
        if is_generic_object(local) {
            return generic_object(self.xml, &mut self.member.features[number as usize].attributes);
        }
        if !local.starts_with(|c: char| c.is_uppercase()) {
            return self.xml.skip();
        }
        let kind = kind_of(local);
        if kind == Kind::Unknown && !matches!(local, "Address" | "AddressDetails" | "ExternalReference") {
            let local = local.to_owned();
            self.log.note("unknown element looked through", local);
        }
        self.feature(kind, Some(number))
    }

    fn appearance(&mut self) -> Result<()> {
        AppearanceParser {
            xml: self.xml,
            log: self.log,
            into: &mut self.member.appearances,
            theme: self.theme,
            max_bytes: self.options.max_appearance_bytes,
            values: self.values,
            text: self.text,
        }
        .property()
    }

    fn geometry(&mut self) -> GeometryParser<'_> {
        GeometryParser {
            xml: self.xml,
            log: self.log,
            geometry: &mut self.member.geometry,
            max_bytes: self.options.max_object_bytes,
            values: self.values,
            text: self.text,
        }
    }

    /// A property whose name begins with `lod0` … `lod4`.
    fn at_lod(&mut self, number: u32, lod: u8) -> Result<()> {
        let local = &self.xml.local()[4..];
        match local {
            "ImplicitRepresentation" => self.implicit(number, lod),
            "RoofEdge" => self.surfaces(number, lod, Form::RoofEdge),
            "TerrainIntersection" | "TerrainIntersectionCurve" | "MultiCurve" | "Network" | "Point" | "MultiPoint" | "PointCloud" => {
                self.log.report.skip("points and lines", 1);
                self.xml.skip()
            }
            _ => self.surfaces(number, lod, Form::Surfaces),
        }
    }

    fn surfaces(&mut self, number: u32, lod: u8, form: fn(u32) -> Form) -> Result<()> {
        let node = self.geometry().property(TOP, DIMENSION)?;
        if let Some(node) = node {
            self.this(number).placed.push(Placed { lod, form: form(node) });
        }
        Ok(())
    }

    fn implicit(&mut self, number: u32, lod: u8) -> Result<()> {
        while self.xml.next_child()? {
            if self.xml.local() != "ImplicitGeometry" {
                self.xml.skip()?;
                continue;
            }
            match implicit(&mut self.geometry(), DIMENSION)? {
                Ok(found) => {
                    let index = self.member.implicits.len() as u32;
                    self.member.implicits.push(found);
                    self.this(number).placed.push(Placed { lod, form: Form::Implicit(index) });
                }
                Err(why) => {
                    let at = self.xml.position();
                    self.log.skip(why, || format!("before byte {at}"))?;
                }
            }
        }
        Ok(())
    }
}

fn lod_of(local: &str) -> Option<u8> {
    let rest = local.strip_prefix("lod")?.as_bytes();
    match rest {
        [digit @ b'0'..=b'4', next, ..] if next.is_ascii_uppercase() => Some(digit - b'0'),
        _ => None,
    }
}
