//! G-buffers as NumPy arrays, layers as image bytes.

use std::path::PathBuf;

use map3d_base::{LayerFormat, LayerKind, LayerSpec};
use map3d_image::GBuffer;
use map3d_image::encode::{self, Encoder};
use map3d_image::texture::TextureFile;
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::errors::{invalid, to_python};

/// color (H, W, 4) uint16, normal (H, W, 3) int16, id and depth (H, W) uint32.
pub fn dict_of<'py>(py: Python<'py>, g: GBuffer) -> PyResult<Bound<'py, PyDict>> {
    let (h, w) = (g.height as usize, g.width as usize);
    let sizes = "a G-buffer's arrays have its size";
    let dict = PyDict::new(py);
    dict.set_item("color", Array3::from_shape_vec((h, w, 4), g.color.into_flattened()).expect(sizes).into_pyarray(py))?;
    dict.set_item("normal", Array3::from_shape_vec((h, w, 3), g.normal.into_flattened()).expect(sizes).into_pyarray(py))?;
    dict.set_item("id", Array2::from_shape_vec((h, w), g.id).expect(sizes).into_pyarray(py))?;
    dict.set_item("depth", Array2::from_shape_vec((h, w), g.depth).expect(sizes).into_pyarray(py))?;
    Ok(dict)
}

/// (width, height) and the pixels, row by row.
type Pixels<T> = ((u32, u32), Vec<T>);

fn rows3<T: numpy::Element + Copy, const N: usize>(array: &Bound<'_, PyAny>, what: &str) -> PyResult<Pixels<[T; N]>> {
    let array: PyReadonlyArray3<T> = array.extract().map_err(|_| invalid(format!("{what}: expected an array (H, W, {N}) of its type")))?;
    let (h, w, n) = array.as_array().dim();
    if n != N {
        return Err(invalid(format!("{what}: shape {:?}, expected (H, W, {N})", array.shape())));
    }
    let flat: Vec<T> = array.as_array().iter().copied().collect();
    Ok(((w as u32, h as u32), flat.chunks_exact(N).map(|c| std::array::from_fn(|k| c[k])).collect()))
}

fn rows2(array: &Bound<'_, PyAny>, what: &str) -> PyResult<Pixels<u32>> {
    let array: PyReadonlyArray2<u32> = array.extract().map_err(|_| invalid(format!("{what}: expected an array (H, W) of uint32")))?;
    let (h, w) = array.as_array().dim();
    Ok(((w as u32, h as u32), array.as_array().iter().copied().collect()))
}

fn gbuffer_of(dict: &Bound<'_, PyDict>) -> PyResult<GBuffer> {
    let item = |name: &str| dict.get_item(name)?.ok_or_else(|| invalid(format!("G-buffer: no {name}")));
    let (size, color) = rows3(&item("color")?, "color")?;
    let (normal_size, normal) = rows3(&item("normal")?, "normal")?;
    let (id_size, id) = rows2(&item("id")?, "id")?;
    let (depth_size, depth) = rows2(&item("depth")?, "depth")?;
    if [normal_size, id_size, depth_size].iter().any(|s| *s != size) {
        return Err(invalid("G-buffer: its arrays differ in size"));
    }
    Ok(GBuffer { width: size.0, height: size.1, color, normal, id, depth })
}

/// One layer of a G-buffer as image bytes.
#[pyfunction]
#[pyo3(signature = (kind, format, array, quality=80))]
pub fn encode_layer<'py>(py: Python<'py>, kind: &str, format: &str, array: &Bound<'py, PyAny>, quality: u8) -> PyResult<Bound<'py, PyBytes>> {
    let spec = layer_spec(kind, format, quality)?;
    let mut encoder = Encoder::new();
    let bytes = match spec.kind {
        LayerKind::Color => rows3(array, "color").map(|(size, a)| encoder.color(size, &a, spec.format, quality)),
        LayerKind::Normal => rows3(array, "normal").map(|(size, a)| encoder.normal(size, &a, spec.format)),
        LayerKind::Id => rows2(array, "id").map(|(size, a)| encoder.id(size, &a, spec.format)),
        LayerKind::Depth => rows2(array, "depth").map(|(size, a)| encoder.depth(size, &a, spec.format)),
    }?
    .map_err(to_python)?;
    Ok(PyBytes::new(py, &bytes))
}

fn layer_spec(kind: &str, format: &str, quality: u8) -> PyResult<LayerSpec> {
    let named = |name: &str| serde_json::Value::String(name.to_owned());
    let kind: LayerKind = serde_json::from_value(named(kind)).map_err(|e| invalid(format!("kind: {e}")))?;
    let format: LayerFormat = serde_json::from_value(named(format)).map_err(|e| invalid(format!("format: {e}")))?;
    Ok(LayerSpec { kind, format, quality })
}

/// (H, W, C) of an 8-bit PNG.
#[pyfunction]
pub fn decode_png<'py>(py: Python<'py>, data: &[u8]) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let image = encode::decode_png(data).map_err(to_python)?;
    let shape = (image.height as usize, image.width as usize, image.channels);
    Ok(Array3::from_shape_vec(shape, image.pixels).map_err(|e| invalid(e.to_string()))?.into_pyarray(py))
}

/// Parent of up to four children in the order TL, TR, BL, BR (spec/pyramid.md §7); at least one must be there.
#[pyfunction]
pub fn reduce_gbuffers<'py>(py: Python<'py>, children: Vec<Option<Bound<'py, PyDict>>>) -> PyResult<Bound<'py, PyDict>> {
    let buffers = children.iter().map(|c| c.as_ref().map(gbuffer_of).transpose()).collect::<PyResult<Vec<_>>>()?;
    let side = buffers.iter().flatten().map(|g| g.width).next().ok_or_else(|| invalid("children: all four are None"))?;
    if buffers.len() != 4 || buffers.iter().flatten().any(|g| (g.width, g.height) != (side, side)) {
        return Err(invalid("children: expected four, square and of one size"));
    }
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| buffers[k].as_ref());
    dict_of(py, map3d_image::reduce([a, b, c, d], side))
}

/// (H, W, 4) uint8, sRGB with straight alpha, unused texels filled: a level of a .m3t file.
#[pyfunction]
pub fn texture_level<'py>(py: Python<'py>, path: PathBuf, level: u32) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let raster = py.detach(|| TextureFile::open(&path)?.level(level)).map_err(to_python)?;
    let flat = raster.pixels.into_flattened();
    let array = numpy::PyArray1::from_vec(py, flat);
    array.reshape([raster.height as usize, raster.width as usize, 4])
}
