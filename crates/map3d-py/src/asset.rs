//! Batches and asset folders.

use std::path::PathBuf;

use map3d_base::asset::{self, AssetReport, Materials, Object, Rank};
use numpy::ndarray::{Array2, ArrayView2};
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::errors::{invalid, to_python};
use crate::reader::Reader;

/// Triangles of one or more objects, in source order.
#[pyclass(module = "map3d._core")]
pub struct Batch(pub asset::Batch);

#[pymethods]
impl Batch {
    /// (n, 3) source coordinates; a copy.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let flat = self.0.positions.as_flattened().to_vec();
        Array2::from_shape_vec((self.0.positions.len(), 3), flat).expect("three numbers a point").into_pyarray(py)
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

    #[getter]
    fn triangle_count(&self) -> usize {
        self.0.triangles.len()
    }
}

/// Tables of an asset that is made in Python.
#[derive(Default)]
struct Tables {
    materials: Materials,
    objects: Vec<Object>,
}

/// Writes an asset folder (spec/scene.md).
#[pyclass(module = "map3d._core")]
pub struct AssetWriter {
    /// None after `finish`.
    writer: Option<asset::AssetWriter>,
    tables: Tables,
}

#[pymethods]
impl AssetWriter {
    #[new]
    fn new(folder: PathBuf) -> PyResult<Self> {
        let writer = asset::AssetWriter::create(&folder).map_err(to_python)?;
        Ok(Self { writer: Some(writer), tables: Tables::default() })
    }

    fn append(&mut self, py: Python<'_>, batch: PyRef<'_, Batch>) -> PyResult<()> {
        let (writer, batch) = (self.open()?, &batch.0);
        py.detach(|| writer.append(batch)).map_err(to_python)
    }

    /// For assets made in Python: positions (n, 3) world, triangles (t, 3), uvs (t, 3, 2) or None.
    #[pyo3(signature = (positions, triangles, uvs, material, object, rank))]
    // The six things that a mesh of one material, object and rank is made of.
    #[allow(clippy::too_many_arguments)]
    fn append_mesh(
        &mut self,
        py: Python<'_>,
        positions: PyReadonlyArray2<f64>,
        triangles: PyReadonlyArray2<u32>,
        uvs: Option<PyReadonlyArray3<f32>>,
        material: u32,
        object: u32,
        rank: u8,
    ) -> PyResult<()> {
        let positions = points(positions.as_array(), "positions")?;
        let triangles = points(triangles.as_array(), "triangles")?;
        let n = triangles.len();
        let uvs = uvs.map(|uv| corners(&uv, n)).transpose()?.unwrap_or_default();
        let rank = rank_of(rank)?;
        let batch = asset::Batch {
            positions,
            triangles,
            uvs,
            materials: vec![material; n],
            objects: vec![object; n],
            ranks: vec![rank; n],
            ..asset::Batch::default()
        };
        let writer = self.open()?;
        py.detach(|| writer.append(&batch)).map_err(to_python)
    }

    /// `materials.json` and the objects as a JSON list, for assets made in Python; the caller puts images into `textures/`.
    fn set_tables(&mut self, materials: &str, objects: &str) -> PyResult<()> {
        self.tables = Tables {
            materials: serde_json::from_str(materials).map_err(|e| invalid(format!("materials: {e}")))?,
            objects: serde_json::from_str(objects).map_err(|e| invalid(format!("objects: {e}")))?,
        };
        Ok(())
    }

    /// Closes the files; returns report.json. With a reader, its tables and textures are written; without, those of `set_tables`.
    #[pyo3(signature = (reader=None))]
    fn finish(&mut self, py: Python<'_>, reader: Option<&Bound<'_, Reader>>) -> PyResult<String> {
        let writer = self.writer.take().ok_or_else(closed)?;
        let tables = &self.tables;
        let reader = reader.map(Bound::get);
        let report = py
            .detach(|| match reader {
                Some(reader) => reader.finish_into(writer),
                None => writer.finish(&tables.materials, &tables.objects, AssetReport { format: "python".into(), ..AssetReport::default() }),
            })
            .map_err(to_python)?;
        Ok(serde_json::to_string(&report).expect("reports are plain data"))
    }
}

impl AssetWriter {
    fn open(&mut self) -> PyResult<&mut asset::AssetWriter> {
        self.writer.as_mut().ok_or_else(closed)
    }
}

fn closed() -> PyErr {
    invalid("this asset writer is finished")
}

fn rank_of(rank: u8) -> PyResult<Rank> {
    [Rank::Terrain, Rank::Road, Rank::Ground, Rank::Other, Rank::Installation, Rank::Opening]
        .into_iter()
        .find(|r| *r as u8 == rank)
        .ok_or_else(|| invalid(format!("rank: {rank}, expected 0..=5")))
}

/// Rows of three.
fn points<T: Copy>(array: ArrayView2<T>, what: &str) -> PyResult<Vec<[T; 3]>> {
    if array.ncols() != 3 {
        return Err(invalid(format!("{what}: shape {:?}, expected (n, 3)", array.shape())));
    }
    Ok(array.rows().into_iter().map(|r| [r[0], r[1], r[2]]).collect())
}

fn corners(uvs: &PyReadonlyArray3<f32>, n: usize) -> PyResult<Vec<[[f32; 2]; 3]>> {
    if uvs.shape() != [n, 3, 2] {
        return Err(invalid(format!("uvs: shape {:?}, expected ({n}, 3, 2)", uvs.shape())));
    }
    let uv = uvs.as_array();
    Ok((0..n).map(|t| [0, 1, 2].map(|c| [uv[[t, c, 0]], uv[[t, c, 1]]])).collect())
}
