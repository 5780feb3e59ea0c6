//! A built scene, opened for tracing.

use std::path::PathBuf;

use map3d_render::RenderScene;
use numpy::{PyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::block::Block;
use crate::codec::dict_of;
use crate::errors::{invalid, to_python};
use crate::frame::{Corners, Frame, corners_of, tile_at};

/// A built scene, opened for tracing; may be shared between threads.
#[pyclass(module = "map3d._core", frozen)]
pub struct Scene(RenderScene);

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (folder, cache_bytes=536_870_912))]
    fn new(py: Python<'_>, folder: PathBuf, cache_bytes: u64) -> PyResult<Self> {
        py.detach(|| RenderScene::open(&folder, cache_bytes)).map(Self).map_err(to_python)
    }

    /// World coordinates of the local origin.
    #[getter]
    fn origin(&self) -> (f64, f64, f64) {
        self.0.store().origin().into()
    }

    /// Local box of all content; zeros for an empty scene.
    #[getter(r#box)]
    fn bounds(&self) -> Corners {
        corners_of(&self.0.store().bounds()).unwrap_or_default()
    }

    /// Triangles of all chunks and prototypes; a prototype counts once.
    #[getter]
    fn triangle_count(&self) -> u64 {
        self.0.store().triangle_count()
    }

    /// Returns the tiles of a level that may have content, as sorted Morton numbers. `within`: a level above and (n, 2) columns and rows of its blocks;
    /// only their tiles are examined.
    #[pyo3(signature = (frame, level, within=None))]
    fn occupied<'py>(
        &self,
        py: Python<'py>,
        frame: &Bound<'py, Frame>,
        level: u8,
        within: Option<(u8, PyReadonlyArray2<u32>)>,
    ) -> PyResult<Bound<'py, PyArray1<u64>>> {
        let frame = &frame.get().0;
        if level > frame.zmax {
            return Err(invalid(format!("level is {level}, expected at most the frame's deepest, {}", frame.zmax)));
        }
        let blocks = within.map(|(z, array)| Ok::<_, PyErr>((z, blocks_of(&array)?))).transpose()?;
        let find = || match &blocks {
            Some((z, blocks)) => self.0.occupied_within(frame, level, *z, blocks),
            None => self.0.occupied(frame, level),
        };
        Ok(PyArray1::from_vec(py, py.detach(find).map_err(to_python)?))
    }

    /// Returns the keys of the blocks of level z at (n, 2) columns and rows: hex hashes over everything that a base block's bytes depend on.
    fn block_keys(&self, py: Python<'_>, frame: &Bound<'_, Frame>, z: u8, blocks: PyReadonlyArray2<u32>) -> PyResult<Vec<String>> {
        let (frame, blocks) = (&frame.get().0, blocks_of(&blocks)?);
        py.detach(|| self.0.block_keys(frame, z, &blocks)).map_err(to_python)
    }

    /// Renders the base block rooted at (z, x, y).
    fn render_block(&self, py: Python<'_>, frame: &Bound<'_, Frame>, z: u8, x: u32, y: u32) -> PyResult<Block> {
        let (frame, root) = (&frame.get().0, tile_at(z, x, y)?);
        py.detach(|| self.0.render_block(frame, root)).map(Block).map_err(to_python)
    }

    /// Renders one base tile's G-buffer (spec/pyramid.md §5): id, depth and the arrays of the frame's layers; color, normal, id, depth without any.
    fn gbuffer<'py>(&self, py: Python<'py>, frame: &Bound<'py, Frame>, x: u32, y: u32) -> PyResult<Bound<'py, PyDict>> {
        let frame = &frame.get().0;
        tile_at(frame.zmax, x, y)?;
        let g = py.detach(|| self.0.gbuffer(frame, x, y)).map_err(to_python)?;
        dict_of(py, g)
    }

    /// Returns the local box of an object; None when the scene does not have it.
    fn object_box(&self, py: Python<'_>, id: u32) -> PyResult<Option<Corners>> {
        let bounds = py.detach(|| self.0.store().object_box(id)).map_err(to_python)?;
        Ok(corners_of(&bounds))
    }

    /// Hits, misses and bytes of the caches of chunks and textures.
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let s = self.0.stats();
        let rows = [
            ("chunks_mapped", s.chunks.chunks_mapped),
            ("chunk_bytes", s.chunks.chunk_bytes),
            ("chunk_hits", s.chunks.chunk_hits),
            ("chunk_misses", s.chunks.chunk_misses),
            ("texture_hits", s.textures.hits),
            ("texture_misses", s.textures.misses),
            ("texture_bytes", s.textures.bytes),
            ("texture_levels", s.textures.levels),
            ("texture_evicted", s.textures.evicted),
            ("texture_decoded", s.textures.decoded),
        ];
        let dict = PyDict::new(py);
        rows.into_iter().try_for_each(|(name, value)| dict.set_item(name, value))?;
        Ok(dict)
    }
}

/// Reads (n, 2) columns and rows.
fn blocks_of(array: &PyReadonlyArray2<u32>) -> PyResult<Vec<[u32; 2]>> {
    let array = array.as_array();
    if array.ncols() != 2 {
        return Err(invalid(format!("blocks: shape {:?}, expected (n, 2)", array.shape())));
    }
    Ok(array.rows().into_iter().map(|r| [r[0], r[1]]).collect())
}
