//! How positions are read, what was read of them, and single positions.

use std::io::BufRead;

use map3d_base::{Reason, Result, Vec3};

use super::coordinates::{Dimension, parse_points};
use super::xml_reader::{XmlEvent, XmlReader};
use crate::city_model::crs_table::{CrsNumber, CrsTable, TOO_MANY};

/// How the numbers of positions are read: what the nearest elements above them say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PositionFormat {
    /// Numbers of each position, if an element says.
    pub dimension: Option<usize>,
    pub crs: CrsNumber,
}

impl PositionFormat {
    /// `crs`: of the feature that has the geometry.
    pub fn new(crs: CrsNumber) -> Self {
        Self { dimension: None, crs }
    }

    /// Returns the format of positions in the current element.
    pub fn refine<R: BufRead>(self, xml: &XmlReader<R>, crs_table: &mut CrsTable) -> Self {
        let dimension = xml.attribute("srsDimension").and_then(|n| n.trim().parse().ok());
        let crs = xml.attribute("srsName").and_then(|name| crs_table.find(&name));
        Self { dimension: dimension.or(self.dimension), crs: crs.unwrap_or(self.crs) }
    }
}

/// What was read of the positions of a polygon or a TIN.
pub struct PositionsRead {
    pub valid: bool,
    /// Coordinate system of the first positions.
    pub crs: Option<CrsNumber>,
    /// Other positions are in another one.
    pub is_mixed: bool,
    /// Some positions have no height.
    pub is_flat: bool,
}

impl Default for PositionsRead {
    fn default() -> Self {
        Self { valid: true, crs: None, is_mixed: false, is_flat: false }
    }
}

impl PositionsRead {
    /// `dimension`: `None` for positions that cannot be read.
    pub fn add_positions(&mut self, crs: CrsNumber, dimension: Option<Dimension>) {
        self.valid &= dimension.is_some();
        self.is_flat |= dimension == Some(Dimension::Two);
        self.is_mixed |= *self.crs.get_or_insert(crs) != crs;
    }

    /// Returns why the polygon has no triangles.
    pub fn fault(&self) -> Option<Reason> {
        match self {
            Self { valid: false, .. } => Some(Reason::PolygonCoordinatesUnreadable),
            Self { is_mixed: true, .. } => Some(Reason::PolygonInSeveralCrs),
            Self { crs: Some(TOO_MANY), .. } => Some(Reason::PolygonCrsTooMany),
            _ => None,
        }
    }
}

/// A position, and the coordinate system that the nearest element above it names.
#[derive(Clone, Debug)]
pub struct NamedPoint {
    pub point: Vec3,
    pub srs_name: Option<String>,
}

/// Reads the current element and returns the last valid position in it.
pub fn read_point<R: BufRead>(xml: &mut XmlReader<R>) -> Result<Option<NamedPoint>> {
    let mut found = None;
    let mut srs_name = None;
    let depth = xml.depth();
    while xml.depth() >= depth {
        match xml.next_event()? {
            XmlEvent::Start => {
                srs_name = xml.attribute("srsName").map(|name| name.into_owned()).or(srs_name);
                if !matches!(xml.local_name(), "pos" | "coordinates") {
                    continue;
                }
                let text = xml.read_text()?.replace(',', " ");
                let (mut values, mut points) = (Vec::new(), Vec::new());
                let dimension = text.split_whitespace().count();
                let point = parse_points(&text, Some(dimension), &mut values, &mut points).and_then(|_| points.first().copied());
                found = point.map(|point| NamedPoint { point, srs_name: srs_name.clone() }).or(found);
            }
            XmlEvent::Eof => break,
            _ => {}
        }
    }
    Ok(found)
}
