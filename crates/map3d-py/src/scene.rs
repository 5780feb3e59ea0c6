//! A built scene, opened for tracing.

use std::path::PathBuf;

use map3d_base::Vec3;
use map3d_render::{CPU, HitSelection, RenderScene, ViewRequest};
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::block::Block;
use crate::codec::dict_of;
use crate::errors::{invalid, to_python};
use crate::frame::{Corners, Frame, LayerSpec, corners_of, tile_at};
use crate::view::{self, Camera, PickedHit};

/// A one-dimensional numpy array.
type Values<'py> = Bound<'py, PyArray1<f64>>;

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

    /// Returns the object, the area in square metres and the side of a texel in metres, NaN without a texture, of triangles spread evenly over the
    /// scene; always the same ones.
    fn sample_surfaces<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyArray1<u32>>, Values<'py>, Values<'py>)> {
        let samples = py.detach(|| self.0.store().sample_surfaces()).map_err(to_python)?;
        let objects = samples.iter().map(|s| s.object).collect();
        let areas = samples.iter().map(|s| s.area_m2).collect();
        let texels = samples.iter().map(|s| s.texel_m.unwrap_or(f64::NAN)).collect();
        Ok((PyArray1::from_vec(py, objects), PyArray1::from_vec(py, areas), PyArray1::from_vec(py, texels)))
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

    /// Returns the keys of the blocks of level z at (n, 2) columns and rows: hex hashes over everything that a base block's bytes depend on. `device`: class
    /// of devices that render.
    #[pyo3(signature = (frame, z, blocks, device=CPU))]
    fn block_keys(&self, py: Python<'_>, frame: &Bound<'_, Frame>, z: u8, blocks: PyReadonlyArray2<u32>, device: &str) -> PyResult<Vec<String>> {
        let (frame, blocks) = (&frame.get().0, blocks_of(&blocks)?);
        py.detach(|| self.0.block_keys(frame, device, z, &blocks)).map_err(to_python)
    }

    /// Returns the key of the block at (z, x, y).
    #[pyo3(signature = (frame, z, x, y, device=CPU))]
    fn block_key(&self, py: Python<'_>, frame: &Bound<'_, Frame>, z: u8, x: u32, y: u32, device: &str) -> PyResult<String> {
        let frame = &frame.get().0;
        py.detach(|| self.0.block_keys(frame, device, z, &[[x, y]])).map(|keys| keys.concat()).map_err(to_python)
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

    /// Renders any view of the scene. Returns the arrays of the layers, color, normal, id and depth for none.
    #[pyo3(signature = (camera, layers, *, samples=16, threads=1, deadline_s=None, r#box=None, objects=None, region=None))]
    // A view and what is drawn of it, each by its name.
    #[allow(clippy::too_many_arguments)]
    fn render_view<'py>(
        &self,
        py: Python<'py>,
        camera: &Bound<'py, Camera>,
        layers: Vec<Bound<'py, LayerSpec>>,
        samples: u32,
        threads: usize,
        deadline_s: Option<f64>,
        r#box: Option<(Vec3, Vec3)>,
        objects: Option<PyReadonlyArray1<u32>>,
        region: Option<(u32, u32, u32, u32)>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let request = ViewRequest {
            camera: camera.get().0,
            layers: layers.iter().map(|l| l.get().0.clone()).collect(),
            samples,
            cut: view::box_of(r#box),
            objects: objects.map(|ids| ids.as_array().to_vec()),
            region: view::region_of(region),
            threads,
            deadline_s,
        };
        view::render_view(py, &self.0, &request)
    }

    /// Returns the first surfaces on the line of sight through (x, y) in pixels: (id, metres, local position, normal) of each.
    #[pyo3(signature = (camera, x_px, y_px, count=1, *, r#box=None, objects=None))]
    // A point of a view and what is drawn of it.
    #[allow(clippy::too_many_arguments)]
    fn pick_ray(
        &self,
        py: Python<'_>,
        camera: &Bound<'_, Camera>,
        x_px: f64,
        y_px: f64,
        count: usize,
        r#box: Option<(Vec3, Vec3)>,
        objects: Option<PyReadonlyArray1<u32>>,
    ) -> PyResult<Vec<PickedHit>> {
        let selection = HitSelection { count, cut: view::box_of(r#box), objects: objects.map(|ids| ids.as_array().to_vec()) };
        view::pick_ray(py, &self.0, camera.get(), [x_px, y_px], &selection)
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

    /// Seconds of the threads' CPU time that all views so far took, by stage.
    fn view_times<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let t = self.0.view_times();
        let rows = [("visibility_s", t.visibility_s), ("shade_s", t.shade_s), ("light_s", t.light_s), ("convert_s", t.convert_s)];
        let dict = PyDict::new(py);
        rows.into_iter().try_for_each(|(name, seconds)| dict.set_item(name, seconds))?;
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
