//! Parses GML surfaces and solids into the arena.

use map3d_base::{Reason, Result, Vec3};

use super::coordinates::{Dimension, Separators, parse_coordinates, parse_points};
use super::positions::{PositionFormat, PositionsRead};
use super::references::References;
use super::textured_surface_parser::read_own_appearance;
use super::tin_parts::TinParts;
use super::xml_reader::{XmlEvent, XmlReader};
use crate::city_model::crs_table::CrsTable;
use crate::city_model::geometry_arena::{GeometryArena, NodeId, NodeKind, Ring};
use crate::city_model::ids;
use crate::document::report_builder::{LimitCheck, ReportBuilder};

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
    pub crs_table: &'a mut CrsTable,
    pub references: &'a mut References,
    /// Limit on the memory of `geometry`.
    pub max_bytes: u64,
    /// Buffers for numbers and text.
    pub values: &'a mut Vec<f64>,
    pub text: &'a mut String,
}

impl GeometryParser<'_> {
    /// Reads the current property element: an XLink or geometry. Returns its first node, or `None` if there is nothing to convert.
    pub fn read_property(&mut self, parent: NodeId, format: PositionFormat) -> Result<Option<NodeId>> {
        let mut first = self.read_xlink(parent)?;
        while self.xml.next_child()? {
            let node = self.read_element(parent, format)?;
            first = first.or(node);
        }
        Ok(first)
    }

    fn read_xlink(&mut self, parent: NodeId) -> Result<Option<NodeId>> {
        let Some(href) = self.xml.attribute("href") else { return Ok(None) };
        match self.references.resolve_geometry(&href) {
            Ok(id) => Ok(Some(self.geometry.add(ids::NONE, parent, NodeKind::XLink(id)))),
            Err(reason) => {
                let href = href.into_owned();
                self.report.warn(reason, href)?;
                Ok(None)
            }
        }
    }

    /// Reads the current geometry element.
    pub fn read_element(&mut self, parent: NodeId, format: PositionFormat) -> Result<Option<NodeId>> {
        let format = format.refine(self.xml, self.crs_table);
        let local_name = self.xml.local_name();
        if is_polygon(local_name) {
            self.read_polygon(parent, format).map(Some)
        } else if is_group(local_name) {
            self.read_group(parent, format).map(Some)
        } else {
            if is_point_or_curve(local_name) {
                self.report.omit(Reason::PointsAndLines, 1);
            } else {
                self.report.omit_one(Reason::GeometryTypeNotRead, local_name);
            }
            self.xml.skip()?;
            Ok(None)
        }
    }

    fn read_group(&mut self, parent: NodeId, format: PositionFormat) -> Result<NodeId> {
        let mut tin = (self.xml.local_name() == "Tin").then(TinParts::default);
        let node = self.geometry.add(self.xml.gml_id(), parent, NodeKind::Group);
        self.geometry.nodes[node as usize].reversed = self.xml.attribute("orientation").is_some_and(|o| o.trim() == "-");
        while self.xml.next_child()? {
            if let Some(tin) = &mut tin
                && self.read_tin_property(format, tin)?
            {
                continue;
            }
            match self.xml.local_name() {
                "boundedBy" | "name" | "description" | "metaDataProperty" | "controlPoint" => self.xml.skip()?,
                "appearance" => {
                    let appearance = read_own_appearance(self.xml, node)?;
                    self.geometry.own_appearances.extend(appearance);
                }
                _ => {
                    self.read_property(node, format)?;
                }
            }
        }
        if let Some(tin) = tin {
            self.add_tin(node, tin)?;
        }
        Ok(node)
    }

    fn read_polygon(&mut self, parent: NodeId, format: PositionFormat) -> Result<NodeId> {
        let id = self.xml.gml_id();
        let first_ring = self.geometry.rings.len() as u32;
        let mut read = PositionsRead::default();
        while self.xml.next_child()? {
            match self.xml.local_name() {
                "exterior" | "interior" | "outerBoundaryIs" | "innerBoundaryIs" => self.read_boundary(format, &mut read)?,
                _ => self.xml.skip()?,
            }
        }
        self.check_size()?;
        let rings = self.geometry.rings.len() as u32 - first_ring;
        if let Some(reason) = read.fault() {
            let at = self.xml.position();
            self.report.skip(reason, || format!("before byte {at}"))?;
            self.geometry.rings.truncate(first_ring as usize);
            return Ok(self.geometry.add(id, parent, NodeKind::Group));
        }
        let node = self.geometry.add(id, parent, NodeKind::Polygon { first_ring, rings });
        self.geometry.nodes[node as usize].crs = read.crs.unwrap_or(format.crs);
        self.geometry.nodes[node as usize].is_flat = read.is_flat;
        Ok(node)
    }

    fn check_size(&self) -> Result<()> {
        self.check_size_with(0)
    }

    /// `added_bytes`: memory of what is not in the arena yet.
    pub fn check_size_with(&self, added_bytes: u64) -> Result<()> {
        let got = self.geometry.byte_count() + added_bytes;
        self.report.check_limit(LimitCheck { what: "geometry of one city object, bytes", got, limit: "max_object_bytes", value: self.max_bytes })
    }

    /// Reads the current exterior or interior: a LinearRing, or a Ring of curves.
    fn read_boundary(&mut self, format: PositionFormat, read: &mut PositionsRead) -> Result<()> {
        while self.xml.next_child()? {
            let id = self.xml.gml_id();
            let start = self.geometry.points.len() as u32;
            let format = format.refine(self.xml, self.crs_table);
            self.read_ring_points(format, read)?;
            let end = self.geometry.points.len() as u32;
            self.geometry.rings.push(Ring { id, start, end });
        }
        Ok(())
    }

    /// Reads all positions in the current element, at any depth.
    pub fn read_ring_points(&mut self, format: PositionFormat, read: &mut PositionsRead) -> Result<()> {
        let depth = self.xml.depth();
        // Depths and formats of the enclosing elements that say how positions are read.
        let mut formats = vec![(depth, format)];
        while self.xml.depth() >= depth {
            match self.xml.next_tag()? {
                XmlEvent::Start => {
                    let at = self.xml.depth();
                    formats.retain(|(depth, _)| *depth < at);
                    let outer = formats.last().map_or(format, |(_, format)| *format);
                    let format = outer.refine(self.xml, self.crs_table);
                    if format != outer {
                        formats.push((at, format));
                    }
                    self.read_positions(format, read)?;
                }
                XmlEvent::Eof => break,
                XmlEvent::End | XmlEvent::Text => {}
            }
        }
        Ok(())
    }

    /// Reads the current element up to its end if it contains positions; enters any other element.
    fn read_positions(&mut self, format: PositionFormat, read: &mut PositionsRead) -> Result<()> {
        let dimension = match self.xml.local_name() {
            "posList" | "pos" => {
                self.text.clear();
                self.xml.append_text(self.text)?;
                parse_points(self.text, format.dimension, self.values, &mut self.geometry.points)
            }
            "coordinates" => {
                let separators = self.parse_separators();
                self.text.clear();
                self.xml.append_text(self.text)?;
                parse_coordinates(self.text, &separators, &mut self.geometry.points)
            }
            "coord" => self.read_coord()?,
            _ => return Ok(()),
        };
        read.add_positions(format.crs, dimension);
        Ok(())
    }

    fn parse_separators(&self) -> Separators {
        let default = Separators::default();
        let parse = |name, otherwise| self.xml.attribute(name).and_then(|v| v.chars().next()).unwrap_or(otherwise);
        Separators { decimal: parse("decimal", default.decimal), coordinate: parse("cs", default.coordinate), tuple: parse("ts", default.tuple) }
    }

    fn read_coord(&mut self) -> Result<Option<Dimension>> {
        let mut point: Vec3 = [0.0; 3];
        let mut dimension = Some(Dimension::Two);
        while self.xml.next_child()? {
            let axis = ["X", "Y", "Z"].iter().position(|name| *name == self.xml.local_name());
            let value = self.xml.read_text()?.parse();
            match (axis, value) {
                (Some(axis), Ok(value)) => {
                    point[axis] = value;
                    dimension = if axis == 2 { dimension.and(Some(Dimension::Three)) } else { dimension };
                }
                _ => dimension = None,
            }
        }
        self.geometry.points.push(point);
        Ok(dimension)
    }
}
