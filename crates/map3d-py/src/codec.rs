//! G-buffers as NumPy arrays, layers as image bytes.

use std::path::PathBuf;

use map3d_base::{LayerFormat, LayerKind, LayerSpec};
use map3d_image::encode::{self, Encoder};
use map3d_image::{Arrays, GBuffer};
use map3d_texture::TextureFile;
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::errors::{invalid, to_python};

/// The arrays that a G-buffer has: color, picture (H, W, 4) uint16, normal (H, W, 3) int16, id, depth, depth2 (H, W) uint32, sun, ao (H, W) uint8, sun16
/// (H, W) uint16.
pub fn dict_of<'py>(py: Python<'py>, g: GBuffer) -> PyResult<Bound<'py, PyDict>> {
    let size = (g.height as usize, g.width as usize);
    let dict = PyDict::new(py);
    set3(&dict, "color", size, g.color)?;
    set3(&dict, "normal", size, g.normal)?;
    set2(&dict, "id", size, g.id)?;
    set2(&dict, "depth", size, g.depth)?;
    set2(&dict, "sun", size, g.sun)?;
    set2(&dict, "sun16", size, g.sun16)?;
    set2(&dict, "ao", size, g.ao)?;
    set2(&dict, "depth2", size, g.depth2)?;
    set3(&dict, "picture", size, g.picture)?;
    Ok(dict)
}

const SIZES: &str = "a G-buffer's arrays have its size";

/// Unless it is not there.
fn set2<T: numpy::Element>(dict: &Bound<'_, PyDict>, name: &str, size: (usize, usize), array: Vec<T>) -> PyResult<()> {
    if array.is_empty() {
        return Ok(());
    }
    dict.set_item(name, Array2::from_shape_vec(size, array).expect(SIZES).into_pyarray(dict.py()))
}

fn set3<T: numpy::Element, const N: usize>(dict: &Bound<'_, PyDict>, name: &str, (h, w): (usize, usize), array: Vec<[T; N]>) -> PyResult<()> {
    if array.is_empty() {
        return Ok(());
    }
    dict.set_item(name, Array3::from_shape_vec((h, w, N), array.into_flattened()).expect(SIZES).into_pyarray(dict.py()))
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

fn rows2<T: numpy::Element + Copy>(array: &Bound<'_, PyAny>, what: &str) -> PyResult<Pixels<T>> {
    let array: PyReadonlyArray2<T> = array.extract().map_err(|_| invalid(format!("{what}: expected an array (H, W) of its type")))?;
    let (h, w) = array.as_array().dim();
    Ok(((w as u32, h as u32), array.as_array().iter().copied().collect()))
}

/// Id and depth must be there.
fn gbuffer_of(dict: &Bound<'_, PyDict>) -> PyResult<GBuffer> {
    let item = |name: &str| dict.get_item(name)?.ok_or_else(|| invalid(format!("G-buffer: no {name}")));
    let (size, id) = rows2(&item("id")?, "id")?;
    let fits = |other: (u32, u32), name: &str| if other == size { Ok(()) } else { Err(invalid(format!("G-buffer: {name} differs in size from id"))) };
    let mut g = GBuffer { id, ..GBuffer::with(0, 0, Arrays::LEAST) };
    (g.width, g.height) = size;
    macro_rules! take {
        ($rows:ident, $name:ident) => {
            if let Some(array) = dict.get_item(stringify!($name))? {
                let (size, pixels) = $rows(&array, stringify!($name))?;
                fits(size, stringify!($name))?;
                g.$name = pixels;
            }
        };
    }
    item("depth")?;
    take!(rows2, depth);
    take!(rows3, color);
    take!(rows3, normal);
    take!(rows2, sun);
    take!(rows2, sun16);
    take!(rows2, ao);
    take!(rows2, depth2);
    take!(rows3, picture);
    Ok(g)
}

/// One layer of a G-buffer as image bytes.
#[pyfunction]
#[pyo3(signature = (kind, format, array, quality=80, small=false))]
pub fn encode_layer<'py>(
    py: Python<'py>,
    kind: &str,
    format: &str,
    array: &Bound<'py, PyAny>,
    quality: u8,
    small: bool,
) -> PyResult<Bound<'py, PyBytes>> {
    let spec = layer_spec(kind, format, quality)?;
    let mut encoder = if small { Encoder::small() } else { Encoder::new() };
    let bytes = match spec.kind {
        LayerKind::Color | LayerKind::Picture => rows3(array, "color").map(|(size, a)| encoder.color(size, &a, spec.format, quality)),
        LayerKind::Normal => rows3(array, "normal").map(|(size, a)| encoder.normal(size, &a, spec.format)),
        LayerKind::Id => rows2(array, "id").map(|(size, a)| encoder.id(size, &a, spec.format)),
        LayerKind::Depth | LayerKind::Depth2 => rows2(array, "depth").map(|(size, a)| encoder.depth(size, &a, spec.format)),
        LayerKind::Sun | LayerKind::Ao => rows2(array, "shades").map(|(size, a)| encoder.shade(size, &a, spec.format)),
        LayerKind::Sun16 => rows2(array, "sun16").map(|(size, a)| encoder.sun16(size, &a, spec.format)),
    }?
    .map_err(to_python)?;
    Ok(PyBytes::new(py, &bytes))
}

fn layer_spec(kind: &str, format: &str, quality: u8) -> PyResult<LayerSpec> {
    let named = |name: &str| serde_json::Value::String(name.to_owned());
    let kind: LayerKind = serde_json::from_value(named(kind)).map_err(|e| invalid(format!("kind: {e}")))?;
    let format: LayerFormat = serde_json::from_value(named(format)).map_err(|e| invalid(format!("format: {e}")))?;
    Ok(LayerSpec { quality, ..LayerSpec::new(kind, format) })
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
