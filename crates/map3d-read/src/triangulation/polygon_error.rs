//! Why a polygon has no triangles.

/// The reason why a polygon has no triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PolygonError {
    NoArea,
    NotFinite,
    /// Its triangulation would take too much memory or time.
    TooManyVertices,
    /// Rounding defeated the triangulation.
    NumericalFailure,
}

impl PolygonError {
    /// Returns the reason as written to reports.
    pub fn reason(self) -> &'static str {
        match self {
            Self::NoArea => "polygon without area",
            Self::NotFinite => "coordinate is not a finite number",
            Self::TooManyVertices => "polygon with too many vertices to triangulate",
            Self::NumericalFailure => "polygon that could not be triangulated",
        }
    }
}
