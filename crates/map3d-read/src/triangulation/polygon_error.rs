//! Why a polygon has no triangles.

use map3d_base::Reason;

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
    pub fn reason(self) -> Reason {
        match self {
            Self::NoArea => Reason::PolygonWithoutArea,
            Self::NotFinite => Reason::CoordinateNotFinite,
            Self::TooManyVertices => Reason::PolygonWithTooManyVertices,
            Self::NumericalFailure => Reason::PolygonNotTriangulated,
        }
    }
}
