//! Asset folders: written batch by batch, and their meshes read back.

use std::collections::BTreeMap;
use std::path::PathBuf;

use map3d_base::KeptSpace;
use map3d_base::asset::{self, AssetReport, Materials, Object, Rank};
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::batch::{Batch, points, rows};
use crate::errors::{invalid, to_python};
use crate::frame::{Corners, corners_of};
use crate::reader::Reader;

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

    /// Appends a mesh made in Python: positions (n, 3) world, triangles (t, 3), uvs (t, 3, 2) or None.
    #[pyo3(signature = (positions, triangles, uvs, material, object, rank))]
    // Three arrays and the three numbers that all triangles share.
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
        let rank = Rank::from_number(rank).ok_or_else(|| invalid(format!("rank {rank} is out of range 0 to 5")))?;
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

    /// Sets the tables of an asset made in Python: materials.json and a JSON list of objects. The caller puts images into `textures/`.
    fn set_tables(&mut self, materials: &str, objects: &str) -> PyResult<()> {
        self.tables = Tables {
            materials: serde_json::from_str(materials).map_err(|e| invalid(format!("materials: {e}")))?,
            objects: serde_json::from_str(objects).map_err(|e| invalid(format!("objects: {e}")))?,
        };
        Ok(())
    }

    /// Closes the files and returns report.json. Writes the reader's tables and textures; without a reader, those of `set_tables`.
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
    invalid("asset writer: already finished")
}

fn corners(uvs: &PyReadonlyArray3<f32>, n: usize) -> PyResult<Vec<[[f32; 2]; 3]>> {
    if uvs.shape() != [n, 3, 2] {
        return Err(invalid(format!("uvs: shape {:?}, expected ({n}, 3, 2)", uvs.shape())));
    }
    let uv = uvs.as_array();
    Ok((0..n).map(|t| [0, 1, 2].map(|c| [uv[[t, c, 0]], uv[[t, c, 1]]])).collect())
}

/// Boxes of objects, and of prototypes by their numbers; triangles of each object outside the extent.
type Boxes = (Vec<Option<Corners>>, BTreeMap<u32, Corners>, Vec<u32>);

/// The mesh of an asset folder, mapped; every index is in range.
#[pyclass(module = "map3d._core", frozen)]
pub struct AssetMesh(asset::AssetMesh);

#[pymethods]
impl AssetMesh {
    /// Maps a `mesh.m3a` and checks all of it.
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        py.detach(|| asset::AssetMesh::open(&path)).map(Self).map_err(to_python)
    }

    /// (nv, 3) world coordinates, those of a prototype in its own frame; a copy, like all arrays of a mesh.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        rows(py, self.0.positions())
    }

    /// (nt, 3) vertex numbers.
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<u32>> {
        rows(py, self.0.triangles())
    }

    /// (nt, 3, 2) texture coordinates of the corners.
    #[getter]
    fn uvs<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f32>> {
        let flat = self.0.uvs().as_flattened().as_flattened().to_vec();
        Array3::from_shape_vec((self.0.uvs().len(), 3, 2), flat).expect("six numbers a triangle").into_pyarray(py)
    }

    /// (nt,) indices into the asset's materials.
    #[getter]
    fn materials<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, self.0.materials())
    }

    /// (nt,) indices into the asset's objects.
    #[getter]
    fn objects<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, self.0.objects())
    }

    /// (nt,) numbers of prototypes; 0 for world geometry.
    #[getter]
    fn prototypes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, self.0.prototypes())
    }

    /// The transform of an instance of an object as drawn; None if the object is left out.
    fn placed(&self, object: u32, transform: [f64; 12]) -> Option<[f64; 12]> {
        self.0.placed(object, &transform)
    }

    /// Boxes of `count` objects as drawn, in world coordinates, without placed prototypes, and of each prototype in its own frame; None if there is no
    /// geometry. With an extent (JSON of `find_clusters`), boxes of what is in it, and for each object the number of triangles that are not.
    #[pyo3(signature = (count, extent=None))]
    fn boxes(&self, py: Python<'_>, count: usize, extent: Option<&str>) -> PyResult<Boxes> {
        let extent: Option<KeptSpace> = extent.map(serde_json::from_str).transpose().map_err(|e| invalid(format!("extent: {e}")))?;
        let boxes = py.detach(|| self.0.boxes(count, extent.as_ref())).map_err(to_python)?;
        let prototypes = boxes.prototypes.iter().filter_map(|(k, bounds)| corners_of(bounds).map(|c| (*k, c)));
        Ok((boxes.objects.iter().map(corners_of).collect(), prototypes.collect(), boxes.outside))
    }
}
