//! Parses GML surfaces and solids into the arena.

use std::io::BufRead;

use map3d_base::{Result, Vec3};

use super::coordinates::{Separators, parse_coordinates, parse_points};
use super::geometry_arena::{GeometryArena, NodeId, NodeKind, Ring};
use super::ids::{self, Reference, parse_reference};
use super::textured_surface::read_own_appearance;
use super::xml_reader::{XmlEvent, XmlReader};
use crate::report_builder::{LimitCheck, ReportBuilder};

/// Returns true for polygons, surfaces, solids and aggregates of them.
pub fn is_surface(local_name: &str) -> bool {
    is_polygon(local_name) || is_group(local_name)
}

fn is_polygon(local_name: &str) -> bool {
    matches!(local_name, "Polygon" | "Triangle" | "Rectangle" | "PolygonPatch")
}

fn is_group(local_name: &str) -> bool {
    matches!(
        local_name,
        "MultiSurface"
            | "CompositeSurface"
            | "OrientableSurface"
            | "Solid"
            | "CompositeSolid"
            | "MultiSolid"
            | "Surface"
            | "PolyhedralSurface"
            | "TriangulatedSurface"
            | "Tin"
            | "Shell"
            | "MultiGeometry"
            | "GeometricComplex"
            | "TexturedSurface"
    )
}

/// Returns true for points and curves, which are not converted.
pub fn is_point_or_curve(local_name: &str) -> bool {
    matches!(
        local_name,
        "Point"
            | "MultiPoint"
            | "LineString"
            | "Curve"
            | "MultiCurve"
            | "CompositeCurve"
            | "OrientableCurve"
            | "LineStringSegment"
            | "MultiLineString"
    )
}

/// Parses geometry at the current position of `xml`.
pub struct GeometryParser<'a> {
    pub xml: &'a mut XmlReader,
    pub report: &'a mut ReportBuilder,
    pub geometry: &'a mut GeometryArena,
    /// Limit on the memory of `geometry`.
    pub max_bytes: u64,
    /// Buffers for numbers and text.
    pub values: &'a mut Vec<f64>,
    pub text: &'a mut String,
}

impl GeometryParser<'_> {
    /// Reads the current property element: an XLink or geometry. Returns its first node, or `None` if there is nothing to convert.
    pub fn read_property(&mut self, parent: NodeId, dimension: usize) -> Result<Option<NodeId>> {
        let mut first = self.read_xlink(parent)?;
        while self.xml.next_child()? {
            let node = self.read_element(parent, dimension)?;
            first = first.or(node);
        }
        Ok(first)
    }

    fn read_xlink(&mut self, parent: NodeId) -> Result<Option<NodeId>> {
        let Some(href) = self.xml.attribute("href") else { return Ok(None) };
        match parse_reference(&href) {
            Reference::Internal(id) => Ok(Some(self.geometry.add(ids::NONE, parent, NodeKind::XLink(id)))),
            Reference::External => {
                let href = href.into_owned();
                self.report.warn("reference to another document not followed", href)?;
                Ok(None)
            }
        }
    }

    /// Reads the current geometry element.
    pub fn read_element(&mut self, parent: NodeId, dimension: usize) -> Result<Option<NodeId>> {
        let dimension = self.parse_dimension().unwrap_or(dimension);
        let local_name = self.xml.local_name();
        if is_polygon(local_name) {
            self.read_polygon(parent, dimension).map(Some)
        } else if is_group(local_name) {
            self.read_group(parent, dimension).map(Some)
        } else {
            if is_point_or_curve(local_name) {
                self.report.omit("points and lines", 1);
            } else {
                self.report.omit("unsupported geometry type", 1);
                self.report.note("unsupported geometry element", local_name);
            }
            self.xml.skip()?;
            Ok(None)
        }
    }

    fn parse_dimension(&self) -> Option<usize> {
        self.xml.attribute("srsDimension")?.trim().parse().ok()
    }

    fn read_group(&mut self, parent: NodeId, dimension: usize) -> Result<NodeId> {
        let node = self.geometry.add(self.xml.gml_id(), parent, NodeKind::Group);
        self.geometry.nodes[node as usize].reversed = self.xml.attribute("orientation").is_some_and(|o| o.trim() == "-");
        while self.xml.next_child()? {
            match self.xml.local_name() {
                "boundedBy" | "name" | "description" | "metaDataProperty" | "controlPoint" => self.xml.skip()?,
                "appearance" => {
                    let appearance = read_own_appearance(self.xml, node)?;
                    self.geometry.own_appearances.extend(appearance);
                }
                _ => {
                    self.read_property(node, dimension)?;
                }
            }
        }
        Ok(node)
    }

    fn read_polygon(&mut self, parent: NodeId, dimension: usize) -> Result<NodeId> {
        let id = self.xml.gml_id();
        let first_ring = self.geometry.rings.len() as u32;
        let mut valid = true;
        while self.xml.next_child()? {
            match self.xml.local_name() {
                "exterior" | "interior" | "outerBoundaryIs" | "innerBoundaryIs" => valid &= self.read_boundary(dimension)?,
                _ => self.xml.skip()?,
            }
        }
        self.check_size()?;
        let rings = self.geometry.rings.len() as u32 - first_ring;
        if !valid {
            let at = self.xml.position();
            self.report.skip("polygon with unreadable coordinates", || format!("before byte {at}"))?;
            self.geometry.rings.truncate(first_ring as usize);
            return Ok(self.geometry.add(id, parent, NodeKind::Group));
        }
        Ok(self.geometry.add(id, parent, NodeKind::Polygon { first_ring, rings }))
    }

    fn check_size(&self) -> Result<()> {
        let got = self.geometry.byte_count();
        self.report.check_limit(LimitCheck { what: "geometry of one city object, bytes", got, limit: "max_object_bytes", value: self.max_bytes })
    }

    /// Reads the current exterior or interior: a LinearRing, or a Ring of curves. Returns false if coordinates are unreadable.
    fn read_boundary(&mut self, dimension: usize) -> Result<bool> {
        let mut valid = true;
        while self.xml.next_child()? {
            let id = self.xml.gml_id();
            let start = self.geometry.points.len() as u32;
            let dimension = self.parse_dimension().unwrap_or(dimension);
            valid &= self.read_ring_points(dimension)?;
            let end = self.geometry.points.len() as u32;
            self.geometry.rings.push(Ring { id, start, end });
        }
        Ok(valid)
    }

    /// Reads all positions in the current element, at any depth.
    fn read_ring_points(&mut self, dimension: usize) -> Result<bool> {
        let mut valid = true;
        let depth = self.xml.depth();
        while self.xml.depth() >= depth {
            match self.xml.next_tag()? {
                XmlEvent::Start => valid &= self.read_positions(dimension)?,
                XmlEvent::Eof => break,
                XmlEvent::End | XmlEvent::Text => {}
            }
        }
        Ok(valid)
    }

    /// Reads the current element up to its end if it contains positions; enters any other element.
    fn read_positions(&mut self, dimension: usize) -> Result<bool> {
        let dimension = self.parse_dimension().unwrap_or(dimension);
        match self.xml.local_name() {
            "posList" | "pos" => {
                self.text.clear();
                self.xml.append_text(self.text)?;
                Ok(parse_points(self.text, dimension, self.values, &mut self.geometry.points).is_some())
            }
            "coordinates" => {
                let separators = self.parse_separators();
                self.text.clear();
                self.xml.append_text(self.text)?;
                Ok(parse_coordinates(self.text, &separators, &mut self.geometry.points).is_some())
            }
            "coord" => self.read_coord(),
            _ => Ok(true),
        }
    }

    fn parse_separators(&self) -> Separators {
        let default = Separators::default();
        let parse = |name, otherwise| self.xml.attribute(name).and_then(|v| v.chars().next()).unwrap_or(otherwise);
        Separators { decimal: parse("decimal", default.decimal), coordinate: parse("cs", default.coordinate), tuple: parse("ts", default.tuple) }
    }

    fn read_coord(&mut self) -> Result<bool> {
        let mut point: Vec3 = [0.0; 3];
        let mut valid = true;
        while self.xml.next_child()? {
            let axis = ["X", "Y", "Z"].iter().position(|name| *name == self.xml.local_name());
            let value = self.xml.read_text()?.parse();
            match (axis, value) {
                (Some(axis), Ok(value)) => point[axis] = value,
                _ => valid = false,
            }
        }
        self.geometry.points.push(point);
        Ok(valid)
    }
}

/// Reads the current element and returns the last valid position in it.
pub fn read_point<R: BufRead>(xml: &mut XmlReader<R>) -> Result<Option<Vec3>> {
    let mut found = None;
    let depth = xml.depth();
    while xml.depth() >= depth {
        match xml.next_event()? {
            XmlEvent::Start if matches!(xml.local_name(), "pos" | "coordinates") => {
                let text = xml.read_text()?.replace(',', " ");
                let (mut values, mut points) = (Vec::new(), Vec::new());
                let dimension = text.split_whitespace().count();
                found = parse_points(&text, dimension, &mut values, &mut points).and(points.first().copied()).or(found);
            }
            XmlEvent::Eof => break,
            _ => {}
        }
    }
    Ok(found)
}
