//! Parses a `gml:Tin` that has no triangles but control points, break lines and stop lines, and triangulates it.

use map3d_base::{Reason, Result, Vec3};

use super::geometry_parser::GeometryParser;
use super::positions::PositionFormat;
use super::tin_parts::{PreparedTin, TinParts};
use crate::city_model::crs_table::{DOCUMENT_CRS, estimate_metres_per_unit};
use crate::city_model::geometry_arena::{GeometryNode, NO_NODE, NodeId, NodeKind, Ring};
use crate::city_model::ids;
use crate::triangulation::tin::{TinTriangles, triangulate_tin};

impl GeometryParser<'_> {
    /// Reads the current property of a Tin. Returns false, and reads nothing, if it is another one.
    pub fn read_tin_property(&mut self, format: PositionFormat, tin: &mut TinParts) -> Result<bool> {
        match self.xml.local_name() {
            "controlPoint" => {
                let points = self.read_tin_points(format, tin)?;
                tin.control_points.extend(points);
            }
            "breakLines" => {
                let lines = self.read_tin_lines(format, tin)?;
                tin.break_lines.extend(lines);
            }
            "stopLines" => {
                let lines = self.read_tin_lines(format, tin)?;
                tin.stop_lines.extend(lines);
            }
            "maxLength" => tin.max_length = self.read_max_length()?,
            _ => return Ok(false),
        }
        self.check_size_with(tin.byte_count())?;
        Ok(true)
    }

    /// Reads all positions in the current element.
    fn read_tin_points(&mut self, format: PositionFormat, tin: &mut TinParts) -> Result<Vec<Vec3>> {
        let start = self.geometry.points.len();
        let format = format.refine(self.xml, self.crs_table);
        self.read_ring_points(format, &mut tin.read)?;
        Ok(self.geometry.points.split_off(start))
    }

    /// Reads the lines in the current property: one for each child.
    fn read_tin_lines(&mut self, format: PositionFormat, tin: &mut TinParts) -> Result<Vec<Vec<Vec3>>> {
        let format = format.refine(self.xml, self.crs_table);
        let mut lines = Vec::new();
        while self.xml.next_child()? {
            lines.push(self.read_tin_points(format, tin)?);
        }
        Ok(lines)
    }

    /// Reads a length in metres.
    fn read_max_length(&mut self) -> Result<Option<f64>> {
        let unit = self.xml.attribute("uom").and_then(|uom| find_metres(&uom));
        let text = self.xml.read_text()?;
        let length = text.parse::<f64>().ok().zip(unit.or(Some(1.0))).map(|(length, metres)| length * metres);
        let length = length.filter(|length| length.is_finite() && *length > 0.0);
        if length.is_none() {
            self.report.warn(Reason::TinMaxLengthInvalid, text)?;
        }
        Ok(length)
    }

    /// Adds the triangles of a Tin that has none of its own, or skips and counts it.
    pub fn add_tin(&mut self, node: NodeId, tin: TinParts) -> Result<()> {
        if self.geometry.node(node).first_child != NO_NODE {
            self.report.omit(Reason::PointsAndLines, (tin.break_lines.len() + tin.stop_lines.len()) as u64);
            return Ok(());
        }
        let at = self.xml.position();
        let location = || format!("before byte {at}");
        if let Some(fault) = tin.fault() {
            return self.report.skip(fault.reason(), location);
        }
        let crs = tin.read.crs.unwrap_or(DOCUMENT_CRS);
        let prepared = PreparedTin::new(&tin, estimate_metres_per_unit(self.crs_table.names()[crs as usize].as_deref()));
        self.report.skip_many(Reason::TinPointNotFinite, prepared.not_finite, location)?;
        match triangulate_tin(&prepared.source) {
            Err(error) => self.report.skip(error.reason(), location),
            Ok(triangles) => {
                self.report_tin(&triangles)?;
                self.geometry.nodes[node as usize].crs = crs;
                self.geometry.nodes[node as usize].is_flat = tin.read.is_flat;
                self.add_tin_triangles(node, &prepared.points, &triangles.triangles)
            }
        }
    }

    fn report_tin(&mut self, tin: &TinTriangles) -> Result<()> {
        let at = self.xml.position();
        let location = || format!("before byte {at}");
        if tin.other_heights > 0 {
            self.report.warn(Reason::TinHeightsDiffer, format!("{}, {}", tin.other_heights, location()))?;
        }
        self.report.skip_many(Reason::TinBreakLinesCross, tin.crossing_breaks, location)?;
        self.report.omit(Reason::TinTriangleAtStopLine, tin.stopped);
        self.report.omit(Reason::TinTriangleTooLong, tin.too_long);
        Ok(())
    }

    fn add_tin_triangles(&mut self, node: NodeId, points: &[Vec3], triangles: &[[u32; 3]]) -> Result<()> {
        const BYTES: usize = size_of::<GeometryNode>() + size_of::<Ring>() + 4 * size_of::<Vec3>();
        self.check_size_with((triangles.len() * BYTES) as u64)?;
        let GeometryNode { crs, is_flat, .. } = *self.geometry.node(node);
        for [a, b, c] in triangles {
            let (first_ring, start) = (self.geometry.rings.len() as u32, self.geometry.points.len() as u32);
            self.geometry.points.extend([a, b, c, a].map(|k| points[*k as usize]));
            self.geometry.rings.push(Ring { id: ids::NONE, start, end: start + 4 });
            let triangle = self.geometry.add(ids::NONE, node, NodeKind::Polygon { first_ring, rings: 1 });
            self.geometry.nodes[triangle as usize].crs = crs;
            self.geometry.nodes[triangle as usize].is_flat = is_flat;
        }
        Ok(())
    }
}

/// Returns the metres of a unit of length, by its symbol, name or EPSG code.
fn find_metres(uom: &str) -> Option<f64> {
    let last = uom.trim().rsplit([':', '#', '/']).next().unwrap_or_default().to_ascii_lowercase();
    Some(match last.as_str() {
        "m" | "metre" | "meter" | "9001" => 1.0,
        "km" | "9036" => 1000.0,
        "cm" | "1033" => 0.01,
        "mm" | "1025" => 0.001,
        "ft" | "foot" | "[ft_i]" | "9002" => 0.3048,
        "us-ft" | "ftus" | "[ft_us]" | "9003" => 1200.0 / 3937.0,
        _ => return None,
    })
}
