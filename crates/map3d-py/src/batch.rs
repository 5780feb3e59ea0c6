//! Batches of triangles on their way from a reader to an asset.

use map3d_base::asset;
use numpy::ndarray::{Array2, ArrayView2};
use numpy::{Element, IntoPyArray, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::errors::invalid;

/// Triangles of one or more objects, in source order.
#[pyclass(module = "map3d._core")]
pub struct Batch(pub asset::Batch);

#[pymethods]
impl Batch {
    /// (n, 3) source coordinates; a copy.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        rows(py, &self.0.positions)
    }

    /// Replaces the positions, e.g. by reprojected ones. Same shape.
    fn set_positions(&mut self, positions: PyReadonlyArray2<f64>) -> PyResult<()> {
        let points = points(positions.as_array(), "positions")?;
        if points.len() != self.0.positions.len() {
            return Err(invalid(format!("positions: {} points, expected {}", points.len(), self.0.positions.len())));
        }
        self.0.positions = points;
        Ok(())
    }

    /// True: the positions are in a prototype's own frame, not in the source's CRS.
    #[getter]
    fn prototype(&self) -> bool {
        self.0.prototype > 0
    }

    /// Index of the coordinate system of the positions among `Reader.crs_names`.
    #[getter]
    fn crs(&self) -> u16 {
        self.0.crs
    }

    #[getter]
    fn triangle_count(&self) -> usize {
        self.0.triangles.len()
    }
}

/// Copies records of `N` numbers into an (n, N) array.
pub fn rows<'py, T: Element + Copy, const N: usize>(py: Python<'py>, records: &[[T; N]]) -> Bound<'py, PyArray2<T>> {
    Array2::from_shape_vec((records.len(), N), records.as_flattened().to_vec()).expect("N numbers a record").into_pyarray(py)
}

/// Reads the rows of an (n, 3) array.
pub fn points<T: Copy>(array: ArrayView2<T>, what: &str) -> PyResult<Vec<[T; 3]>> {
    if array.ncols() != 3 {
        return Err(invalid(format!("{what}: shape {:?}, expected (n, 3)", array.shape())));
    }
    Ok(array.rows().into_iter().map(|r| [r[0], r[1], r[2]]).collect())
}
