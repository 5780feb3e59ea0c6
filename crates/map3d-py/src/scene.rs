//! A built scene, opened for tracing; blocks.

use std::path::PathBuf;

use map3d_base::tile::{MAX_LEVEL, Tile};
use map3d_base::{Frame, Vec3};
use map3d_render::RenderScene;
use numpy::ndarray::{Array1, Array2};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::codec::dict_of;
use crate::errors::{invalid, to_python};

/// Levels up to this one are answered as a whole array by `occupied`.
const MAX_OCCUPIED_LEVEL: u8 = 13;

type Point = (f64, f64, f64);
type Corners = (Point, Point);
/// Id, D, local position.
type Picked = (u32, f64, Point);

/// A built scene, opened for tracing; may be shared between threads.
#[pyclass(module = "map3d._core", frozen)]
pub struct Scene(RenderScene);

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (folder, cache_bytes=512 << 20))]
    fn new(py: Python<'_>, folder: PathBuf, cache_bytes: u64) -> PyResult<Self> {
        py.detach(|| RenderScene::open(&folder, cache_bytes)).map(Self).map_err(to_python)
    }

    /// World coordinates of the local origin.
    #[getter]
    fn origin(&self) -> Point {
        self.0.store().origin().into()
    }

    /// Local box of all content: least corner, greatest corner; zeros for an empty scene.
    #[getter(r#box)]
    fn bounds(&self) -> Corners {
        let b = self.0.store().bounds();
        if b.is_empty() { ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) } else { (b.lo.into(), b.hi.into()) }
    }

    /// Instances not counted.
    #[getter]
    fn triangle_count(&self) -> u64 {
        self.0.store().triangle_count()
    }

    /// (2^level, 2^level) [y, x]: tiles that may have content. `within`: level and (n, 2) columns and rows of the blocks to look at.
    #[pyo3(signature = (frame, level, within=None))]
    fn occupied<'py>(
        &self,
        py: Python<'py>,
        frame: &str,
        level: u8,
        within: Option<(u8, PyReadonlyArray2<u32>)>,
    ) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let frame = Frame::from_json(frame).map_err(to_python)?;
        if level > MAX_OCCUPIED_LEVEL.min(frame.zmax) {
            return Err(invalid(format!("level: {level}, at most {}", MAX_OCCUPIED_LEVEL.min(frame.zmax))));
        }
        let blocks = within.map(|(z, array)| Ok::<_, PyErr>((z, places(&array)?))).transpose()?;
        let look = || match &blocks {
            Some((z, places)) => self.0.occupied_within(&frame, level, *z, places),
            None => self.0.occupied(&frame, level),
        };
        let flags = py.detach(look).map_err(to_python)?;
        let side = 1usize << level;
        Ok(Array2::from_shape_vec((side, side), flags).map_err(|e| invalid(e.to_string()))?.into_pyarray(py))
    }

    /// Hex hash over all that a base block's bytes depend on.
    fn block_key(&self, py: Python<'_>, frame: &str, z: u8, x: u32, y: u32) -> PyResult<String> {
        let (frame, root) = place(frame, z, x, y)?;
        py.detach(|| self.0.block_key(&frame, root)).map_err(to_python)
    }

    /// The keys of the blocks of level z at (n, 2) columns and rows; every chunk is looked at once.
    fn block_keys(&self, py: Python<'_>, frame: &str, z: u8, blocks: PyReadonlyArray2<u32>) -> PyResult<Vec<String>> {
        let places = places(&blocks)?;
        let frame = Frame::from_json(frame).map_err(to_python)?;
        py.detach(|| self.0.block_keys(&frame, z, &places)).map_err(to_python)
    }

    /// A base block rooted at (z, x, y).
    fn render_block(&self, py: Python<'_>, frame: &str, z: u8, x: u32, y: u32) -> PyResult<Block> {
        let (frame, root) = place(frame, z, x, y)?;
        py.detach(|| self.0.render_block(&frame, root)).map(Block).map_err(to_python)
    }

    /// One base tile's G-buffer: color, normal, id, depth.
    fn gbuffer<'py>(&self, py: Python<'py>, frame: &str, x: u32, y: u32) -> PyResult<Bound<'py, PyDict>> {
        let frame = Frame::from_json(frame).map_err(to_python)?;
        check_tile(frame.zmax, x, y)?;
        let g = py.detach(|| self.0.gbuffer(&frame, x, y)).map_err(to_python)?;
        dict_of(py, g)
    }

    /// (id, D, local position) of what the line of sight through view coordinates (U, V) meets first.
    fn pick(&self, py: Python<'_>, frame: &str, u: f64, v: f64) -> PyResult<Option<Picked>> {
        let frame = Frame::from_json(frame).map_err(to_python)?;
        let pick = py.detach(|| self.0.pick(&frame, u, v)).map_err(to_python)?;
        Ok(pick.map(|p| (p.id, p.d_m, p.position.into())))
    }

    /// Any-hit rays from local positions (n, 3): which meet anything within `max_distance` metres.
    fn occluded<'py>(
        &self,
        py: Python<'py>,
        origins: PyReadonlyArray2<f64>,
        direction: Point,
        max_distance: f64,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let array = origins.as_array();
        if array.ncols() != 3 {
            return Err(invalid(format!("origins: shape {:?}, expected (n, 3)", array.shape())));
        }
        let points: Vec<Vec3> = array.rows().into_iter().map(|r| [r[0], r[1], r[2]]).collect();
        let hits = py.detach(|| self.0.occluded(&points, direction.into(), max_distance)).map_err(to_python)?;
        Ok(Array1::from_vec(hits).into_pyarray(py))
    }

    /// Cache hits, misses and bytes of chunks and textures.
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

/// What a job yields: encoded tiles and the seam.
#[pyclass(module = "map3d._core", frozen)]
pub struct Block(map3d_render::Block);

#[pymethods]
impl Block {
    /// (layer number, z, x, y, encoded bytes); tiles without content are not listed.
    #[getter]
    fn tiles<'py>(&self, py: Python<'py>) -> Vec<(usize, u8, u32, u32, Bound<'py, PyBytes>)> {
        self.0.tiles.iter().map(|t| (t.layer, t.tile.z, t.tile.x, t.tile.y, PyBytes::new(py, &t.bytes))).collect()
    }

    /// None: the block has no content.
    #[getter]
    fn seam<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        self.0.seam.as_ref().map(|s| PyBytes::new(py, s))
    }

    /// Seconds of processor time by stage, and counts.
    #[getter]
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let s = &self.0.stats;
        let rows = [
            ("visibility_s", s.visibility_s),
            ("shade_s", s.shade_s),
            ("light_s", s.light_s),
            ("reduce_s", s.reduce_s),
            ("encode_s", s.encode_s),
            ("seam_s", s.seam_s),
            ("traced_tiles", s.traced_tiles as f64),
            ("tiles", s.tiles as f64),
            ("shades", s.shades as f64),
            ("setups", s.setups as f64),
        ];
        let dict = PyDict::new(py);
        rows.into_iter().try_for_each(|(name, value)| dict.set_item(name, value))?;
        Ok(dict)
    }
}

/// A reduce block of root (z, x, y) with `levels` levels; seams: (x, y, bytes) of blocks rooted at level z + levels.
#[pyfunction]
pub fn reduce_block(py: Python<'_>, frame: &str, z: u8, x: u32, y: u32, levels: u8, seams: Vec<(u32, u32, Vec<u8>)>) -> PyResult<Block> {
    let (frame, root) = place(frame, z, x, y)?;
    let borrowed: Vec<(u32, u32, &[u8])> = seams.iter().map(|(x, y, bytes)| (*x, *y, bytes.as_slice())).collect();
    py.detach(|| map3d_render::reduce_block(&frame, root, levels, &borrowed)).map(Block).map_err(to_python)
}

/// (n, 2) columns and rows.
fn places(array: &PyReadonlyArray2<u32>) -> PyResult<Vec<[u32; 2]>> {
    let array = array.as_array();
    if array.ncols() != 2 {
        return Err(invalid(format!("blocks: shape {:?}, expected (n, 2)", array.shape())));
    }
    Ok(array.rows().into_iter().map(|r| [r[0], r[1]]).collect())
}

fn place(frame: &str, z: u8, x: u32, y: u32) -> PyResult<(Frame, Tile)> {
    check_tile(z, x, y)?;
    Ok((Frame::from_json(frame).map_err(to_python)?, Tile { z, x, y }))
}

fn check_tile(z: u8, x: u32, y: u32) -> PyResult<()> {
    let side = 1u32.checked_shl(u32::from(z)).unwrap_or(0);
    if z > MAX_LEVEL || x >= side || y >= side {
        return Err(invalid(format!("tile {z}/{x}/{y} does not exist")));
    }
    Ok(())
}
