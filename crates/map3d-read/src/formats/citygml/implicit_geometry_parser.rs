//! Parses implicit geometry.

use map3d_base::{Reason, Result};

use super::city_object_parser::CityObjectParser;
use super::coordinates::parse_numbers;
use super::positions::{NamedPoint, PositionFormat, read_point};
use crate::city_model::crs_table::{CrsNumber, DOCUMENT_CRS, TOO_MANY};
use crate::city_model::geometry_arena::NO_NODE;
use crate::city_model::implicit_geometry::{ImplicitGeometry, PrototypeSource, Transform};

const IDENTITY: Transform = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

impl CityObjectParser<'_> {
    /// Reads the current ImplicitGeometry element. The inner error is the reason why it cannot be placed. `crs`: of the feature that has it.
    pub fn read_implicit_geometry(&mut self, crs: CrsNumber) -> Result<std::result::Result<ImplicitGeometry, Reason>> {
        let (mut node, mut library_object, mut matrix, mut reference) = (None, None, Some(IDENTITY), None);
        while self.xml.next_child()? {
            match self.xml.local_name() {
                "transformationMatrix" => matrix = parse_matrix(&self.xml.read_text()?),
                "libraryObject" => library_object = Some(self.xml.read_text()?).filter(|name| !name.is_empty()),
                "relativeGMLGeometry" | "relativeGeometry" => {
                    // A prototype is in a frame of its own.
                    node = self.geometry_parser().read_property(NO_NODE, PositionFormat::new(DOCUMENT_CRS))?;
                }
                "appearance" => self.read_appearance()?,
                "referencePoint" => reference = read_point(self.xml)?,
                _ => self.xml.skip()?,
            }
        }
        let Some(mut transform) = matrix else { return Ok(Err(Reason::ImplicitGeometryMatrixInvalid)) };
        let Some(NamedPoint { point: reference, srs_name }) = reference else { return Ok(Err(Reason::ImplicitGeometryWithoutReferencePoint)) };
        let crs = srs_name.and_then(|name| self.crs_table.find(&name)).unwrap_or(crs);
        if crs == TOO_MANY {
            return Ok(Err(Reason::ImplicitGeometryCrsTooMany));
        }
        (0..3).for_each(|k| transform[4 * k + 3] += reference[k]);
        if !transform.iter().all(|v| v.is_finite()) {
            return Ok(Err(Reason::ImplicitGeometryMatrixInvalid));
        }
        let prototype = match (node, library_object) {
            (Some(node), _) => PrototypeSource::Geometry(node),
            (None, Some(name)) => PrototypeSource::Library(name),
            (None, None) => return Ok(Err(Reason::ImplicitGeometryWithoutPrototype)),
        };
        Ok(Ok(ImplicitGeometry { prototype, transform, crs }))
    }
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
