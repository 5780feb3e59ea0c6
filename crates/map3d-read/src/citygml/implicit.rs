//! Implicit geometry: a prototype in a frame of its own, placed by a matrix and a reference point.

use std::io::BufRead;

use map3d_base::{Result, Vec3};

use super::coordinates::{parse_list, parse_points};
use super::geometry::NodeId;
use super::geometry_parser::{GeometryParser, TOP};
use super::xml::{Step, Xml};

/// Row-major 3 × 4, prototype → world.
pub type Transform = [f64; 12];

#[derive(Clone, Debug)]
pub struct Implicit {
    /// Geometry inside, or a link to it.
    pub node: Option<NodeId>,
    /// File name of a prototype in another format.
    pub library_object: Option<String>,
    pub transform: Transform,
}

const IDENTITY: Transform = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// The ImplicitGeometry element that has just started. `Err` of the inner result: why it cannot be placed.
pub fn implicit(parser: &mut GeometryParser, dimension: usize) -> Result<std::result::Result<Implicit, &'static str>> {
    let (mut node, mut library_object, mut matrix, mut reference) = (None, None, Some(IDENTITY), None);
    while parser.xml.next_child()? {
        match parser.xml.local() {
            "transformationMatrix" => matrix = parse_matrix(&parser.xml.whole_text()?),
            "libraryObject" => library_object = Some(parser.xml.whole_text()?).filter(|name| !name.is_empty()),
            "relativeGMLGeometry" | "relativeGeometry" => node = parser.property(TOP, dimension)?,
            "referencePoint" => reference = point(parser.xml)?,
            _ => parser.xml.skip()?,
        }
    }
    let Some(mut transform) = matrix else { return Ok(Err("implicit geometry with an unusable transformation matrix")) };
    let Some(reference) = reference else { return Ok(Err("implicit geometry without a reference point")) };
    (0..3).for_each(|k| transform[4 * k + 3] += reference[k]);
    if !transform.iter().all(|v| v.is_finite()) {
        return Ok(Err("implicit geometry with an unusable transformation matrix"));
    }
    if node.is_none() && library_object.is_none() {
        return Ok(Err("implicit geometry without a prototype"));
    }
    Ok(Ok(Implicit { node, library_object, transform }))
}

/// 16 numbers, row by row; the last row must be 0 0 0 w, by which the others are divided.
fn parse_matrix(text: &str) -> Option<Transform> {
    let mut values = Vec::with_capacity(16);
    parse_list(text, &mut values)?;
    let [.., x, y, z, w] = values[..] else { return None };
    if values.len() != 16 || [x, y, z] != [0.0; 3] || w == 0.0 {
        return None;
    }
    Some(std::array::from_fn(|k| values[k] / w))
}

/// The first position inside the open element.
pub fn point<R: BufRead>(xml: &mut Xml<R>) -> Result<Option<Vec3>> {
    let mut found = None;
    let depth = xml.depth();
    while xml.depth() >= depth {
        match xml.step()? {
            Step::Start if matches!(xml.local(), "pos" | "coordinates") => {
                let text = xml.whole_text()?.replace(',', " ");
                let (mut values, mut points) = (Vec::new(), Vec::new());
                let dimension = text.split_whitespace().count();
                found = parse_points(&text, dimension, &mut values, &mut points).and(points.first().copied()).or(found);
            }
            Step::Eof => break,
            _ => {}
        }
    }
    Ok(found)
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
