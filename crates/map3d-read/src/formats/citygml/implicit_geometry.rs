//! Implicit geometry: a prototype in its own frame, placed by a matrix and a reference point.

use map3d_base::Result;

use super::city_object_parser::CityObjectParser;
use super::coordinates::parse_numbers;
use super::geometry_parser::{NamedPoint, PositionFormat, read_point};
use crate::city_model::crs_table::{CrsNumber, DOCUMENT_CRS, TOO_MANY};
use crate::city_model::geometry_arena::{NO_NODE, NodeId};

/// Row-major 3 × 4, prototype → world.
pub type Transform = [f64; 12];

#[derive(Clone, Debug)]
pub struct ImplicitGeometry {
    pub prototype: PrototypeSource,
    pub transform: Transform,
    /// Coordinate system of the reference point.
    pub crs: CrsNumber,
}

#[derive(Clone, Debug)]
pub enum PrototypeSource {
    /// `relativeGMLGeometry`: geometry or an XLink.
    Geometry(NodeId),
    /// `libraryObject`: name of a file.
    Library(String),
}

const IDENTITY: Transform = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// Reads the current ImplicitGeometry element. The inner error is the reason why it cannot be placed. `crs`: of the feature that has it.
pub fn read_implicit_geometry(parser: &mut CityObjectParser, crs: CrsNumber) -> Result<std::result::Result<ImplicitGeometry, &'static str>> {
    let (mut node, mut library_object, mut matrix, mut reference) = (None, None, Some(IDENTITY), None);
    while parser.xml.next_child()? {
        match parser.xml.local_name() {
            "transformationMatrix" => matrix = parse_matrix(&parser.xml.read_text()?),
            "libraryObject" => library_object = Some(parser.xml.read_text()?).filter(|name| !name.is_empty()),
            "relativeGMLGeometry" | "relativeGeometry" => {
                // A prototype is in a frame of its own.
                node = parser.geometry_parser().read_property(NO_NODE, PositionFormat::new(DOCUMENT_CRS))?;
            }
            "appearance" => parser.read_appearance()?,
            "referencePoint" => reference = read_point(parser.xml)?,
            _ => parser.xml.skip()?,
        }
    }
    let Some(mut transform) = matrix else { return Ok(Err("implicit geometry with an invalid transformation matrix")) };
    let Some(NamedPoint { point: reference, srs_name }) = reference else { return Ok(Err("implicit geometry without a reference point")) };
    let crs = srs_name.and_then(|name| parser.crs_table.find(&name)).unwrap_or(crs);
    if crs == TOO_MANY {
        return Ok(Err("implicit geometry in one of too many coordinate systems"));
    }
    (0..3).for_each(|k| transform[4 * k + 3] += reference[k]);
    if !transform.iter().all(|v| v.is_finite()) {
        return Ok(Err("implicit geometry with an invalid transformation matrix"));
    }
    let prototype = match (node, library_object) {
        (Some(node), _) => PrototypeSource::Geometry(node),
        (None, Some(name)) => PrototypeSource::Library(name),
        (None, None) => return Ok(Err("implicit geometry without a prototype")),
    };
    Ok(Ok(ImplicitGeometry { prototype, transform, crs }))
}

/// Parses 16 numbers, row-major. The last row must be 0 0 0 w; the other rows are divided by w.
fn parse_matrix(text: &str) -> Option<Transform> {
    let mut values = Vec::with_capacity(16);
    parse_numbers(text, &mut values)?;
    let [.., x, y, z, w] = values[..] else { return None };
    if values.len() != 16 || [x, y, z] != [0.0; 3] || w == 0.0 {
        return None;
    }
    Some(std::array::from_fn(|k| values[k] / w))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_have_sixteen_numbers_and_an_affine_last_row() {
        let rows = "2 0 0 5 0 2 0 6 0 0 2 7 0 0 0 ";
        assert_eq!(parse_matrix(&format!("{rows}1")), Some([2.0, 0.0, 0.0, 5.0, 0.0, 2.0, 0.0, 6.0, 0.0, 0.0, 2.0, 7.0]));
        assert_eq!(parse_matrix(&format!("{rows}2")), Some([1.0, 0.0, 0.0, 2.5, 0.0, 1.0, 0.0, 3.0, 0.0, 0.0, 1.0, 3.5]));
        for bad in [format!("{rows}0"), rows.to_owned(), format!("{rows}1 1"), String::new(), format!("{}1 0 0 1", &rows[..24])] {
            assert_eq!(parse_matrix(&bad), None, "{bad}");
        }
    }
}
