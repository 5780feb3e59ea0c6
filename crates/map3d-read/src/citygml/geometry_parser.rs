//! GML surfaces and solids into the arena.

use map3d_base::{Error, Result, Vec3};

use super::coordinates::{Separators, parse_coordinates, parse_points};
use super::geometry::{Geometry, NO_NODE, NodeId, Ring, Shape};
use super::ids::{self, Id, Target, id_of, target_of};
use super::xml::{Step, Xml};
use crate::report::Log;

/// Elements that are surfaces, or groups of them.
pub fn is_surface(local: &str) -> bool {
    is_polygon(local) || is_group(local)
}

fn is_polygon(local: &str) -> bool {
    matches!(local, "Polygon" | "Triangle" | "Rectangle" | "PolygonPatch")
}

fn is_group(local: &str) -> bool {
    matches!(
        local,
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

/// Points, curves and the like: nothing to draw.
pub fn is_thin(local: &str) -> bool {
    matches!(
        local,
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

/// Parses geometry from where `xml` stands.
pub struct GeometryParser<'a> {
    pub xml: &'a mut Xml,
    pub log: &'a mut Log,
    pub geometry: &'a mut Geometry,
    pub max_bytes: u64,
    pub values: &'a mut Vec<f64>,
    pub text: &'a mut String,
}

impl GeometryParser<'_> {
    /// The property element that has just started: a reference, or geometry inside. `None`: nothing to draw.
    pub fn property(&mut self, parent: NodeId, dimension: usize) -> Result<Option<NodeId>> {
        let linked = self.link(parent)?;
        let mut first = linked;
        while self.xml.next_child()? {
            let node = self.element(parent, dimension)?;
            first = first.or(node);
        }
        Ok(first)
    }

    fn link(&mut self, parent: NodeId) -> Result<Option<NodeId>> {
        let Some(href) = self.xml.attribute("href") else { return Ok(None) };
        match target_of(&href) {
            Target::Here(id) => Ok(Some(self.geometry.add(ids::NONE, parent, Shape::Link(id)))),
            Target::OtherDocument => {
                let href = href.into_owned();
                self.log.warn("reference to another document not followed", href)?;
                Ok(None)
            }
        }
    }

    /// The geometry element that has just started, to its end.
    pub fn element(&mut self, parent: NodeId, dimension: usize) -> Result<Option<NodeId>> {
        let dimension = self.dimension().unwrap_or(dimension);
        let local = self.xml.local();
        if is_polygon(local) {
            self.polygon(parent, dimension).map(Some)
        } else if is_group(local) {
            self.group(parent, dimension).map(Some)
        } else {
            let (thin, local) = (is_thin(local), local.to_owned());
            self.log.report.skip(if thin { "points and lines" } else { "geometry of other kinds" }, 1);
            if !thin {
                self.log.note("geometry element not drawn", local);
            }
            self.xml.skip()?;
            Ok(None)
        }
    }

    fn dimension(&self) -> Option<usize> {
        self.xml.attribute("srsDimension")?.trim().parse().ok()
    }

    fn id(&self) -> Id {
        self.xml.attribute("id").map_or(ids::NONE, |id| id_of(&id))
    }

    fn group(&mut self, parent: NodeId, dimension: usize) -> Result<NodeId> {
        let node = self.geometry.add(self.id(), parent, Shape::Group);
        self.geometry.nodes[node as usize].flip = self.xml.attribute("orientation").is_some_and(|o| o.trim() == "-");
        while self.xml.next_child()? {
            match self.xml.local() {
                "boundedBy" | "name" | "description" | "metaDataProperty" | "controlPoint" => self.xml.skip()?,
                "appearance" => {
                    self.log.note("appearance of a TexturedSurface (CityGML 1.0) not drawn", "TexturedSurface");
                    self.xml.skip()?;
                }
                _ => {
                    self.property(node, dimension)?;
                }
            }
        }
        Ok(node)
    }

    fn polygon(&mut self, parent: NodeId, dimension: usize) -> Result<NodeId> {
        let id = self.id();
        let first_ring = self.geometry.rings.len() as u32;
        let mut sound = true;
        while self.xml.next_child()? {
            match self.xml.local() {
                "exterior" | "interior" | "outerBoundaryIs" | "innerBoundaryIs" => sound &= self.boundary(dimension)?,
                _ => self.xml.skip()?,
            }
        }
        self.check_size()?;
        let rings = self.geometry.rings.len() as u32 - first_ring;
        if !sound {
            let at = self.xml.position();
            self.log.skip("polygon whose coordinates cannot be read", || format!("before byte {at}"))?;
            self.geometry.rings.truncate(first_ring as usize);
            return Ok(self.geometry.add(id, parent, Shape::Group));
        }
        Ok(self.geometry.add(id, parent, Shape::Polygon { first_ring, rings }))
    }

    fn check_size(&self) -> Result<()> {
        let (got, value) = (self.geometry.bytes(), self.max_bytes);
        if got <= value {
            return Ok(());
        }
        Err(Error::Limit { path: self.log.path().to_path_buf(), what: "geometry of one city object, bytes", got, limit: "max_object_bytes", value })
    }

    /// One exterior or interior: a LinearRing, or a Ring of curves. False: coordinates that cannot be read.
    fn boundary(&mut self, dimension: usize) -> Result<bool> {
        let mut sound = true;
        while self.xml.next_child()? {
            let id = self.id();
            let start = self.geometry.points.len() as u32;
            let dimension = self.dimension().unwrap_or(dimension);
            sound &= self.ring_points(dimension)?;
            let end = self.geometry.points.len() as u32;
            self.geometry.rings.push(Ring { id, start, end });
        }
        Ok(sound)
    }

    /// All positions inside the open element, at any depth.
    fn ring_points(&mut self, dimension: usize) -> Result<bool> {
        let mut sound = true;
        let depth = self.xml.depth();
        while self.xml.depth() >= depth {
            match self.xml.next_tag()? {
                Step::Start => sound &= self.positions(dimension)?,
                Step::Eof => break,
                Step::End | Step::Text => {}
            }
        }
        Ok(sound)
    }

    /// If the element that has just started holds positions, reads it to its end.
    fn positions(&mut self, dimension: usize) -> Result<bool> {
        let dimension = self.dimension().unwrap_or(dimension);
        match self.xml.local() {
            "posList" | "pos" => {
                self.text.clear();
                self.xml.append_text(self.text)?;
                Ok(parse_points(self.text, dimension, self.values, &mut self.geometry.points).is_some())
            }
            "coordinates" => {
                let separators = self.separators();
                self.text.clear();
                self.xml.append_text(self.text)?;
                Ok(parse_coordinates(self.text, &separators, &mut self.geometry.points).is_some())
            }
            "coord" => self.coord(),
            _ => Ok(true),
        }
    }

    fn separators(&self) -> Separators {
        let default = Separators::default();
        let one = |name, otherwise| self.xml.attribute(name).and_then(|v| v.chars().next()).unwrap_or(otherwise);
        Separators { decimal: one("decimal", default.decimal), within: one("cs", default.within), between: one("ts", default.between) }
    }

    fn coord(&mut self) -> Result<bool> {
        let mut point: Vec3 = [0.0; 3];
        let mut sound = true;
        while self.xml.next_child()? {
            let axis = ["X", "Y", "Z"].iter().position(|name| *name == self.xml.local());
            let value = self.xml.whole_text()?.parse();
            match (axis, value) {
                (Some(axis), Ok(value)) => point[axis] = value,
                _ => sound = false,
            }
        }
        self.geometry.points.push(point);
        Ok(sound)
    }
}

/// Geometry of a property outside of any other node.
pub const TOP: NodeId = NO_NODE;
