//! Blocks: rendered or reduced, with their seams.

use map3d_base::Error;
use map3d_image::Arrays;
use map3d_image::seam::read_seam;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::errors::to_python;
use crate::frame::{Frame, tile_at};

/// The result of a job: encoded tiles and the seam.
#[pyclass(module = "map3d._core", frozen)]
pub struct Block(pub map3d_render::Block);

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

/// Reduces the block rooted at (z, x, y), of `levels` levels. `seams`: (x, y, bytes) of blocks rooted at level z + levels.
#[pyfunction]
// A frame, a tile of three numbers, and the blocks below it.
#[allow(clippy::too_many_arguments)]
pub fn reduce_block(py: Python<'_>, frame: &Bound<'_, Frame>, z: u8, x: u32, y: u32, levels: u8, seams: Vec<(u32, u32, Vec<u8>)>) -> PyResult<Block> {
    let (frame, root) = (&frame.get().0, tile_at(z, x, y)?);
    let borrowed: Vec<(u32, u32, &[u8])> = seams.iter().map(|(x, y, bytes)| (*x, *y, bytes.as_slice())).collect();
    py.detach(|| map3d_render::reduce_block(frame, root, levels, &borrowed)).map(Block).map_err(to_python)
}

/// Raises FormatError unless the bytes are a whole seam of a block of this frame's pass.
#[pyfunction]
pub fn check_seam(py: Python<'_>, frame: &Bound<'_, Frame>, seam: &[u8]) -> PyResult<()> {
    let frame = &frame.get().0;
    py.detach(|| check(frame, seam)).map_err(to_python)
}

fn check(frame: &map3d_base::Frame, seam: &[u8]) -> map3d_base::Result<()> {
    let found = read_seam("seam", seam)?;
    let side = frame.tile_px;
    if (found.width, found.height) != (side, side) {
        return Err(Error::format("seam", format!("{} × {} px, expected {side} × {side}", found.width, found.height)));
    }
    let (arrays, expected) = (found.arrays().bits(), Arrays::of(&frame.layers).bits());
    if arrays != expected {
        return Err(Error::format("seam", format!("arrays {arrays:#b}, expected {expected:#b} of the pass's layers, and id and depth")));
    }
    Ok(())
}
