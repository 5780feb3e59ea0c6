//! Triangulates polygons with holes, and TINs of control points.

pub mod constrained_delaunay;
pub mod polygon_error;
mod t_junctions;
pub mod tin;
pub mod triangulate;
