//! Parses the grid of a `dem:RasterRelief`: heights in the document become triangles, a raster file becomes a `ReliefGrid`.

use map3d_base::{Reason, Result};

use super::city_object_parser::CityObjectParser;
use super::coordinates::parse_numbers;
use super::grid_values::{GridValues, ValueOrder, ValueSeparators};
use super::positions::PositionFormat;
use super::relief_extent::ReliefExtent;
use super::xml_reader::XmlEvent;
use crate::city_model::city_object::{LodRepresentation, Representation};
use crate::city_model::crs_table::{CrsNumber, TOO_MANY};
use crate::city_model::geometry_arena::{GeometryNode, NO_NODE, NodeId, NodeKind, Ring};
use crate::city_model::ids;
use crate::document::ReliefGrid;
use crate::document::asset_folder::RELIEF;

/// Greater absolute heights count as gaps.
const MAX_HEIGHT_M: f64 = 100_000.0;

/// A grid as written.
#[derive(Default)]
struct WrittenGrid {
    /// Grid coordinates of the first and the last point.
    low: Vec<f64>,
    high: Vec<f64>,
    origin: Vec<f64>,
    vectors: Vec<Vec<f64>>,
    labels: Vec<String>,
    crs: Option<CrsNumber>,
    order: ValueOrder,
    values: GridValues,
    /// It has no place in the world.
    is_plain: bool,
}

/// Where the values of a grid are: the one at (column, row) is at first + column · column_step + row · row_step.
#[derive(Clone, Copy)]
pub struct GridPlace {
    columns: u64,
    rows: u64,
    first: [f64; 2],
    column_step: [f64; 2],
    row_step: [f64; 2],
}

impl GridPlace {
    fn at(&self, column: u64, row: u64) -> [f64; 2] {
        let (column, row) = (column as f64, row as f64);
        std::array::from_fn(|k| self.first[k] + column * self.column_step[k] + row * self.row_step[k])
    }

    /// Twice the signed area of a cell.
    fn cell_area(&self) -> f64 {
        self.column_step[0] * self.row_step[1] - self.column_step[1] * self.row_step[0]
    }
}

impl WrittenGrid {
    /// Returns the place of the values, or why the grid is unusable.
    fn place(&self) -> std::result::Result<GridPlace, Reason> {
        if self.is_plain {
            return Err(Reason::ReliefGridWithoutPlace);
        }
        let [low, high] = [&self.low, &self.high].map(|v| v.first_chunk::<2>().copied().filter(|v| v.iter().all(|v| v.fract() == 0.0)));
        let vectors: Vec<[f64; 2]> = self.vectors.iter().filter_map(|v| v.first_chunk::<2>().copied()).collect();
        let (Some(low), Some(high), Some(origin), [u, v]) = (low, high, self.origin.first_chunk::<2>(), &*vectors) else {
            return Err(Reason::ReliefGridIncomplete);
        };
        let counts: [f64; 2] = std::array::from_fn(|k| high[k] - low[k] + 1.0);
        if !counts.iter().all(|n| (2.0..=4e9).contains(n)) {
            return Err(Reason::ReliefGridTooSmall);
        }
        let [fast, slow] = self.order.axes(&self.labels).ok_or(Reason::ReliefGridOrderNotRead)?;
        let start: [f64; 2] = std::array::from_fn(|axis| {
            let descends = [fast, slow].iter().any(|along| along.axis == axis && along.descends);
            if descends { high[axis] } else { low[axis] }
        });
        let step = |axis: usize, descends: bool| [u, v][axis].map(|d| if descends { -d } else { d });
        let place = GridPlace {
            columns: counts[fast.axis] as u64,
            rows: counts[slow.axis] as u64,
            first: std::array::from_fn(|k| origin[k] + start[0] * u[k] + start[1] * v[k]),
            column_step: step(fast.axis, fast.descends),
            row_step: step(slow.axis, slow.descends),
        };
        let is_finite = place.first.iter().chain(&place.column_step).chain(&place.row_step).all(|v| v.is_finite());
        match is_finite && place.cell_area() != 0.0 && place.cell_area().is_finite() {
            true => Ok(place),
            false => Err(Reason::ReliefGridWithoutArea),
        }
    }
}

impl CityObjectParser<'_> {
    /// Reads the current `grid` property of a RasterRelief.
    pub fn read_grid(&mut self, number: u32) -> Result<()> {
        let at = self.xml.position();
        if let Some(href) = self.xml.attribute("href").map(|href| href.into_owned()) {
            self.report.warn(Reason::ReliefGridElsewhere, href)?;
        }
        let grid = self.read_written_grid()?;
        let location = || format!("before byte {at}");
        let place = match (grid.place(), &grid.values) {
            (_, GridValues::None) => return self.report.skip(Reason::ReliefGridWithoutHeights, location),
            (_, GridValues::TooMany) => return self.report.skip(Reason::ReliefGridWithTooManyHeights, location),
            (Err(reason), _) => return self.report.skip(reason, location),
            (Ok(_), _) if grid.crs == Some(TOO_MANY) => {
                return self.report.skip(Reason::ReliefGridCrsTooMany, location);
            }
            (Ok(place), _) => place,
        };
        let crs = grid.crs.unwrap_or(self.city_object.features[number as usize].crs);
        match grid.values {
            GridValues::None | GridValues::TooMany => Ok(()),
            GridValues::File(name) => self.add_raster(number, place, crs, name),
            GridValues::Inline(heights) if heights.len() as u64 == place.columns * place.rows => self.add_heights(number, place, crs, &heights),
            GridValues::Inline(heights) => {
                let (got, columns, rows) = (heights.len(), place.columns, place.rows);
                self.report.skip(Reason::ReliefGridHeightsDoNotFit, || format!("{got} for {columns} × {rows}"))
            }
        }
    }

    fn read_written_grid(&mut self) -> Result<WrittenGrid> {
        let mut grid = WrittenGrid::default();
        let depth = self.xml.depth();
        let mut text = String::new();
        while self.xml.depth() >= depth {
            match self.xml.next_tag()? {
                XmlEvent::Start => self.read_grid_element(&mut grid, &mut text)?,
                XmlEvent::Eof => break,
                XmlEvent::End | XmlEvent::Text => {}
            }
        }
        Ok(grid)
    }

    /// Reads the current element in a grid, or enters it.
    fn read_grid_element(&mut self, grid: &mut WrittenGrid, text: &mut String) -> Result<()> {
        if let Some(crs) = self.xml.attribute("srsName").and_then(|name| self.crs_table.find(&name)) {
            grid.crs.get_or_insert(crs);
        }
        let name = self.xml.local_name().to_owned();
        text.clear();
        match name.as_str() {
            "Grid" => grid.is_plain = true,
            "low" => grid.low = self.read_numbers(text)?,
            "high" => grid.high = self.read_numbers(text)?,
            "pos" | "coordinates" => grid.origin = self.read_numbers(text)?,
            "offsetVector" => {
                let vector = self.read_numbers(text)?;
                grid.vectors.push(vector);
            }
            "axisName" | "axisLabels" => grid.labels.extend(self.xml.read_text()?.split_whitespace().map(str::to_owned)),
            "sequenceRule" => {
                let order = self.xml.attribute("order").or_else(|| self.xml.attribute("axisOrder")).map(|order| order.into_owned());
                grid.order = ValueOrder { order, rule: self.xml.read_text()? };
            }
            "tupleList" | "doubleOrNilReasonTupleList" | "QuantityList" => {
                let separators = ValueSeparators::of(self.xml);
                self.xml.append_text(text)?;
                // Far more text than the triangles of a grid may need is not turned into numbers.
                let is_too_long = text.len() as u64 > self.options.max_object_bytes / 8;
                grid.values = if is_too_long { GridValues::TooMany } else { GridValues::Inline(separators.parse(text)) };
            }
            "fileName" | "fileReference" => grid.values = GridValues::File(self.xml.read_text()?),
            "rangeParameters" | "metaDataProperty" | "boundedBy" | "startPoint" => self.xml.skip()?,
            _ => {}
        }
        Ok(())
    }

    /// Returns the numbers of the current element; none if it is unreadable.
    fn read_numbers(&mut self, text: &mut String) -> Result<Vec<f64>> {
        self.xml.append_text(text)?;
        let mut values = Vec::new();
        let is_readable = parse_numbers(&text.replace(',', " "), &mut values).is_some();
        Ok(if is_readable { values } else { Vec::new() })
    }

    /// Adds a raster file of the folder, or counts why it is not read.
    fn add_raster(&mut self, number: u32, place: GridPlace, crs: CrsNumber, name: String) -> Result<()> {
        let file = match self.folder.find(&name) {
            Ok(file) => file,
            Err(error) => return self.report.skip(error.reason(RELIEF), || name),
        };
        if let Some(note) = file.note {
            self.report.note(note, name.as_str());
        }
        let lod = self.relief_lod(number);
        let index = self.city_object.grids.len() as u32;
        let GridPlace { columns, rows, first, column_step, row_step } = place;
        let crs = self.crs_table.names()[crs as usize].clone();
        let object = self.city_object.features[self.city_object.find_object(number) as usize].name.clone();
        let has_extent = self.city_object.features[number as usize].extent.is_some();
        self.city_object.grids.push(ReliefGrid { object, file: file.path, columns, rows, first, column_step, row_step, crs });
        if has_extent {
            self.report.note(Reason::ReliefExtentNotApplied, name);
        }
        self.city_object.features[number as usize].representations.push(LodRepresentation { lod, representation: Representation::Raster(index) });
        Ok(())
    }

    fn relief_lod(&self, number: u32) -> u8 {
        self.city_object.features[number as usize].relief_lod.unwrap_or(0)
    }

    /// Adds the triangles between the heights of a grid that lie in the extent of the relief.
    fn add_heights(&mut self, number: u32, place: GridPlace, crs: CrsNumber, heights: &[f64]) -> Result<()> {
        const BYTES: u64 = 2 * (size_of::<GeometryNode>() + size_of::<Ring>() + 4 * size_of::<[f64; 3]>()) as u64;
        let (got, value) = ((place.columns - 1) * (place.rows - 1) * BYTES + self.city_object.geometry.byte_count(), self.options.max_object_bytes);
        if got > value {
            let (columns, rows) = (place.columns, place.rows);
            return self.report.skip(Reason::ReliefGridWithTooManyHeights, || format!("{columns} × {rows}"));
        }
        let is_gap = |height: &f64| !height.is_finite() || height.abs() > MAX_HEIGHT_M;
        self.report.omit(Reason::GridPointsWithoutHeight, heights.iter().filter(|height| is_gap(height)).count() as u64);
        let extent = self.city_object.features[number as usize].extent.map(|nodes| ReliefExtent::new(&self.city_object.geometry, nodes));
        let group = self.city_object.geometry.add(ids::NONE, NO_NODE, NodeKind::Group);
        let mut outside = 0;
        for row in 0..place.rows - 1 {
            for column in 0..place.columns - 1 {
                let corner = |dc: u64, dr: u64| {
                    let height = heights[((row + dr) * place.columns + column + dc) as usize];
                    let [x, y] = place.at(column + dc, row + dr);
                    (!is_gap(&height)).then_some([x, y, height])
                };
                let cell = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                for triangle in split_cell(cell).into_iter().flatten() {
                    match extent.as_ref().is_none_or(|extent| extent.contains(triangle)) {
                        true => self.add_triangle(group, crs, triangle, place.cell_area() < 0.0),
                        false => outside += 1,
                    }
                }
            }
        }
        self.report.omit(Reason::ReliefTriangleOutsideExtent, outside);
        let lod = self.relief_lod(number);
        let representation = Representation::Surfaces(group);
        self.city_object.features[number as usize].representations.push(LodRepresentation { lod, representation });
        Ok(())
    }

    fn add_triangle(&mut self, group: NodeId, crs: CrsNumber, [a, b, c]: [[f64; 3]; 3], reversed: bool) {
        let geometry = &mut self.city_object.geometry;
        let (first_ring, start) = (geometry.rings.len() as u32, geometry.points.len() as u32);
        geometry.points.extend(if reversed { [a, c, b, a] } else { [a, b, c, a] });
        geometry.rings.push(Ring { id: ids::NONE, start, end: start + 4 });
        let triangle = geometry.add(ids::NONE, group, NodeKind::Polygon { first_ring, rings: 1 });
        geometry.nodes[triangle as usize].crs = crs;
    }

    /// Reads the current `extent` property of a relief: the area in which it is valid.
    pub fn read_extent(&mut self, number: u32) -> Result<()> {
        let first = self.city_object.geometry.nodes.len() as u32;
        let format = PositionFormat::new(self.city_object.features[number as usize].crs);
        self.geometry_parser().read_property(NO_NODE, format)?;
        let end = self.city_object.geometry.nodes.len() as u32;
        self.city_object.features[number as usize].extent = Some((first, end)).filter(|_| end > first);
        Ok(())
    }
}

/// Splits a cell with corners in order along the shorter step of heights; without one corner, the others are a triangle.
fn split_cell(cell: [Option<[f64; 3]>; 4]) -> [Option<[[f64; 3]; 3]>; 2] {
    match cell {
        [Some(a), Some(b), Some(c), Some(d)] if (a[2] - c[2]).abs() <= (b[2] - d[2]).abs() => [Some([a, b, c]), Some([a, c, d])],
        [Some(a), Some(b), Some(c), Some(d)] => [Some([a, b, d]), Some([b, c, d])],
        [None, Some(b), Some(c), Some(d)] => [Some([b, c, d]), None],
        [Some(a), None, Some(c), Some(d)] => [Some([a, c, d]), None],
        [Some(a), Some(b), None, Some(d)] => [Some([a, b, d]), None],
        [Some(a), Some(b), Some(c), None] => [Some([a, b, c]), None],
        _ => [None, None],
    }
}
