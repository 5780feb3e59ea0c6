//! Implicit geometry: a prototype in its own frame, placed by a matrix and a reference point.

use super::crs_table::CrsNumber;
use super::geometry_arena::NodeId;

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
