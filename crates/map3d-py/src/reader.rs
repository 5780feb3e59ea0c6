//! Source documents, parsed as they are iterated.

use std::path::PathBuf;
use std::sync::Mutex;

use map3d_base::asset::{AssetReport, AssetWriter};
use map3d_read::{DocumentReader, FORMATS, PositionTransformer, ReadOptions, SourceFormat, open, write_tables};
use numpy::{PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::batch::{Batch, rows};
use crate::errors::{invalid, to_python};

/// One source document, parsed as it is iterated.
#[pyclass(module = "map3d._core", frozen)]
pub struct Reader {
    document: Mutex<Box<dyn DocumentReader + Send>>,
}

impl Reader {
    /// Writes images and tables into the asset and closes it.
    pub fn finish_into(&self, writer: AssetWriter) -> map3d_base::Result<AssetReport> {
        write_tables(self.lock().as_ref(), writer)
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Box<dyn DocumentReader + Send>> {
        self.document.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

fn find_format(name: &str) -> PyResult<&'static SourceFormat> {
    FORMATS.iter().find(|format| format.name == name).ok_or_else(|| {
        let names: Vec<&str> = FORMATS.iter().map(|format| format.name).collect();
        invalid(format!("format: {name:?}, expected {}", names.join(" or ")))
    })
}

/// Calls a Python function that transforms positions.
fn call(function: &Py<PyAny>, source: &str, target: &str, positions: &[[f64; 2]]) -> map3d_base::Result<Option<Vec<[f64; 2]>>> {
    let called = Python::attach(|py| function.call1(py, (source, target, positions.to_vec()))?.extract::<Option<Vec<[f64; 2]>>>(py));
    called.map_err(|error| map3d_base::Error::argument(format!("transformation from {source} to {target}: {error}")))
}

#[pymethods]
impl Reader {
    /// `format`: its name; `options`: JSON; `transform`: positions in one coordinate system from those in another.
    #[new]
    #[pyo3(signature = (path, format, options="{}", transform=None))]
    fn new(py: Python<'_>, path: PathBuf, format: &str, options: &str, transform: Option<Py<PyAny>>) -> PyResult<Self> {
        let format = find_format(format)?;
        let mut options = ReadOptions::from_json(options).map_err(to_python)?;
        options.transform =
            transform.map(|function| PositionTransformer::new(move |source, target, positions| call(&function, source, target, positions)));
        let document = py.detach(|| open(&path, format, &options)).map_err(to_python)?;
        Ok(Self { document: Mutex::new(document) })
    }

    /// The CRS as the source writes it; known before the first batch if the source names it in its header, else after the last.
    #[getter]
    fn srs_name(&self) -> Option<String> {
        self.lock().srs_name().map(str::to_owned)
    }

    fn __iter__(this: Py<Self>) -> Py<Self> {
        this
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Batch>> {
        let batch = py.detach(|| self.lock().next_batch()).map_err(to_python)?;
        Ok(batch.map(Batch))
    }

    /// Coordinate systems that parts of the document are in, as it writes them; the first is the document's. Known for each batch when it is returned.
    fn crs_names(&self) -> Vec<Option<String>> {
        self.lock().crs_names().into_iter().map(|name| name.map(str::to_owned)).collect()
    }

    /// (m,) indices of the instances' coordinate systems among `crs_names`, before `set_instances`; complete after the last batch.
    fn instance_crs<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u16>> {
        let document = self.lock();
        let mut numbers = document.instance_crs().to_vec();
        numbers.resize(document.instances().len(), 0);
        PyArray1::from_vec(py, numbers)
    }

    /// (m, 12) transforms of the instances, row-major 3 × 4, prototype → source CRS; complete after the last batch.
    fn instances<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let transforms: Vec<[f64; 12]> = self.lock().instances().iter().map(|i| i.transform).collect();
        rows(py, &transforms)
    }

    /// Replaces all transforms; removes the instances whose transforms are not finite and returns their number.
    fn set_instances(&self, transforms: PyReadonlyArray2<f64>) -> PyResult<usize> {
        let array = transforms.as_array();
        if array.ncols() != 12 {
            return Err(invalid(format!("transforms: shape {:?}, expected (m, 12)", array.shape())));
        }
        let rows: Vec<[f64; 12]> = array.rows().into_iter().map(|r| std::array::from_fn(|k| r[k])).collect();
        self.lock().set_instances(&rows).map_err(to_python)
    }

    /// Rasters with the heights of reliefs, as JSON; complete after the last batch.
    fn grids(&self) -> String {
        serde_json::to_string(self.lock().grids()).expect("grids are plain data")
    }

    /// report.json so far (spec/scene.md).
    fn report(&self) -> String {
        serde_json::to_string(self.lock().report()).expect("reports are plain data")
    }
}
