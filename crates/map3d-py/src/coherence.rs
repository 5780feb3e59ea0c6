//! What the check of coherence needs of assets.

use std::path::PathBuf;

use map3d_base::asset::Adjustments;
use map3d_build::coherence::{self, Draping, SurveyedObject};
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyArray1, PyArray3, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::batch::points;
use crate::errors::{invalid, to_python};

/// The objects of an asset, as imported: arrays with an entry for each.
#[pyclass(module = "map3d._core", frozen)]
pub struct Survey(coherence::Survey);

#[pymethods]
impl Survey {
    /// Reads the survey of an asset's folder; makes it unless the folder has that of its mesh.
    #[new]
    fn new(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        py.detach(|| coherence::read_or_survey(&folder)).map(Self).map_err(to_python)
    }

    /// Names of the classes.
    #[getter]
    fn classes(&self) -> Vec<String> {
        self.0.classes.clone()
    }

    /// Levels of detail; the first is empty.
    #[getter]
    fn lods(&self) -> Vec<String> {
        self.0.lods.clone()
    }

    /// (n, 2, 3) low and high corners, world coordinates; infinite, low above high, without geometry.
    #[getter]
    fn boxes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        let flat: Vec<f64> = self.0.objects.iter().flat_map(|o| o.bounds).collect();
        Array3::from_shape_vec((self.0.objects.len(), 2, 3), flat).expect("six numbers an object").into_pyarray(py)
    }

    /// (n,) hashes of names; 0 without one.
    #[getter]
    fn names<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        self.column(py, |o| o.name)
    }

    /// (n,) hashes of the geometry; 0 without any.
    #[getter]
    fn contents<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        self.column(py, |o| o.content)
    }

    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.column(py, |o| o.triangles)
    }

    /// (n,) numbers of the parents; -1 at the top.
    #[getter]
    fn parents<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.column(py, |o| if o.parent == u32::MAX { -1 } else { i64::from(o.parent) })
    }

    /// (n,) indices into `classes`.
    #[getter]
    fn class_numbers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u16>> {
        self.column(py, |o| o.class)
    }

    /// (n,) indices into `lods`.
    #[getter]
    fn lod_numbers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u16>> {
        self.column(py, |o| o.lod)
    }

    /// (n,) bit 0: some triangle is textured; bit 1: the object has placed prototypes.
    #[getter]
    fn flags<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.column(py, |o| o.flags)
    }
}

impl Survey {
    fn column<'py, T: numpy::Element>(&self, py: Python<'py>, of: impl Fn(&SurveyedObject) -> T) -> Bound<'py, PyArray1<T>> {
        self.0.objects.iter().map(of).collect::<Vec<T>>().into_pyarray(py)
    }
}

/// A surface of the ground.
#[pyclass(module = "map3d._core", frozen)]
pub struct Surface(coherence::Surface);

#[pymethods]
impl Surface {
    /// The triangles of some objects of an asset's folder, as drawn or as imported.
    #[staticmethod]
    fn of_asset(folder: PathBuf, objects: PyReadonlyArray1<bool>, is_adjusted: bool) -> Self {
        Self(coherence::Surface::Asset { folder, objects: objects.as_array().to_vec(), is_adjusted })
    }

    /// (n, 3) world coordinates and (t, 3) vertex numbers.
    #[staticmethod]
    fn of_mesh(positions: PyReadonlyArray2<f64>, triangles: PyReadonlyArray2<u32>) -> PyResult<Self> {
        let (positions, triangles) = (points(positions.as_array(), "positions")?, points(triangles.as_array(), "triangles")?);
        Ok(Self(coherence::Surface::Mesh { positions, triangles }))
    }
}

/// Returns the (n,) heights of the highest surface at (n, 2) points, NaN where there is none.
#[pyfunction]
pub fn surface_heights<'py>(
    py: Python<'py>,
    surfaces: Vec<Bound<'py, Surface>>,
    points: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let points = plan_points(&points)?;
    let surfaces: Vec<coherence::Surface> = surfaces.iter().map(|s| s.get().0.clone()).collect();
    let found = py.detach(|| coherence::surface_heights(&surfaces, &points)).map_err(to_python)?;
    Ok(found.into_pyarray(py))
}

/// Drapes objects of an asset's folder over the ground; returns the number of triangles that stand for them.
#[pyfunction]
#[pyo3(signature = (folder, bases, scale, surfaces, fallback=None))]
pub fn drape_objects(
    py: Python<'_>,
    folder: PathBuf,
    bases: PyReadonlyArray1<f64>,
    scale: f64,
    surfaces: Vec<Bound<'_, Surface>>,
    fallback: Option<Bound<'_, Surface>>,
) -> PyResult<u64> {
    let bases = bases.as_array().to_vec();
    let surfaces: Vec<coherence::Surface> = surfaces.iter().map(|s| s.get().0.clone()).collect();
    let fallback = fallback.map(|s| s.get().0.clone());
    let draping = Draping { bases: &bases, scale, surfaces: &surfaces, fallback: fallback.as_ref() };
    py.detach(|| coherence::drape(&folder, &draping)).map_err(to_python)
}

/// Writes the adjustments of an asset's folder.
#[pyfunction]
pub fn write_adjustments(py: Python<'_>, folder: PathBuf, scale: f64, shifts: PyReadonlyArray1<f64>) -> PyResult<()> {
    let adjustments = Adjustments { scale, shifts: shifts.as_array().to_vec() };
    py.detach(|| adjustments.write(&folder)).map_err(to_python)
}

/// Returns the scale and the (n,) shifts of an asset's folder; None if it is drawn as imported.
#[pyfunction]
pub fn read_adjustments(py: Python<'_>, folder: PathBuf) -> PyResult<Option<(f64, Bound<'_, PyArray1<f64>>)>> {
    let found = py.detach(|| Adjustments::read(&folder)).map_err(to_python)?;
    Ok(found.map(|a| (a.scale, a.shifts.into_pyarray(py))))
}

fn plan_points(points: &PyReadonlyArray2<f64>) -> PyResult<Vec<[f64; 2]>> {
    let array = points.as_array();
    if array.ncols() != 2 {
        return Err(invalid(format!("points: shape {:?}, expected (n, 2)", array.shape())));
    }
    Ok(array.rows().into_iter().map(|r| [r[0], r[1]]).collect())
}
