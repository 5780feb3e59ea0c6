//! G-buffers as NumPy arrays, layers as image bytes.

use std::path::{Path, PathBuf};

use map3d_base::layers::PixelType;
use map3d_image::encode::{self, Encoder};
use map3d_image::{GBuffer, ImageLimits, PixelArray, Raster, data_tile, decode};
use map3d_texture::TextureFile;
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::errors::{invalid, to_python};
use crate::frame::{name_of, parse_format, parse_kind};

/// Returns the arrays that a G-buffer has, by kind, with the types of spec/layers.json: (H, W), or (H, W, C) for several channels.
pub fn dict_of<'py>(py: Python<'py>, g: GBuffer) -> PyResult<Bound<'py, PyDict>> {
    let size = (g.height as usize, g.width as usize);
    let dict = PyDict::new(py);
    for (kind, array) in g.into_arrays() {
        let name = name_of(kind);
        match array {
            PixelArray::U8(pixels) => set2(&dict, &name, size, pixels),
            PixelArray::U16(pixels) => set2(&dict, &name, size, pixels),
            PixelArray::U32(pixels) => set2(&dict, &name, size, pixels),
            PixelArray::I16x3(pixels) => set3(&dict, &name, size, pixels),
            PixelArray::U16x4(pixels) => set3(&dict, &name, size, pixels),
        }?;
    }
    Ok(dict)
}

const SIZES: &str = "an image's arrays have its size";

/// Sets an array of a size (height, width) unless it is empty.
pub fn set2<T: numpy::Element>(dict: &Bound<'_, PyDict>, name: &str, size: (usize, usize), array: Vec<T>) -> PyResult<()> {
    if array.is_empty() {
        return Ok(());
    }
    dict.set_item(name, Array2::from_shape_vec(size, array).expect(SIZES).into_pyarray(dict.py()))
}

/// As `set2`, with `N` numbers per pixel.
pub fn set3<T: numpy::Element, const N: usize>(dict: &Bound<'_, PyDict>, name: &str, (h, w): (usize, usize), array: Vec<[T; N]>) -> PyResult<()> {
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

/// Encodes one layer of a G-buffer as an image.
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
    let (kind, format) = (parse_kind(kind)?, parse_format(format)?);
    let mut encoder = if small { Encoder::small() } else { Encoder::new() };
    let Some(row) = kind.row().array else { return Err(invalid("layer data: call encode_data_tile")) };
    let (size, array) = match row.pixel {
        PixelType::U8 => rows2(array, &name_of(kind)).map(|(size, pixels)| (size, PixelArray::U8(pixels))),
        PixelType::U16 => rows2(array, &name_of(kind)).map(|(size, pixels)| (size, PixelArray::U16(pixels))),
        PixelType::U32 => rows2(array, &name_of(kind)).map(|(size, pixels)| (size, PixelArray::U32(pixels))),
        PixelType::I16x3 => rows3(array, &name_of(kind)).map(|(size, pixels)| (size, PixelArray::I16x3(pixels))),
        PixelType::U16x4 => rows3(array, &name_of(kind)).map(|(size, pixels)| (size, PixelArray::U16x4(pixels))),
    }?;
    let bytes = encoder.array(size, kind, &array, format, quality).map_err(to_python)?;
    Ok(PyBytes::new(py, &bytes))
}

/// Encodes normal (H, W, 3) int16, id and depth (H, W) uint32 as one data tile.
#[pyfunction]
#[pyo3(signature = (normal, id, depth, small=false))]
pub fn encode_data_tile<'py>(
    py: Python<'py>,
    normal: &Bound<'py, PyAny>,
    id: &Bound<'py, PyAny>,
    depth: &Bound<'py, PyAny>,
    small: bool,
) -> PyResult<Bound<'py, PyBytes>> {
    let (size, normals) = rows3(normal, "normal")?;
    let ((_, ids), (_, depths)) = (rows2(id, "id")?, rows2(depth, "depth")?);
    let mut encoder = if small { Encoder::small() } else { Encoder::new() };
    let bytes = py.detach(|| encoder.data_tile(size, &normals, &ids, &depths)).map_err(to_python)?;
    Ok(PyBytes::new(py, &bytes))
}

/// Decodes a data tile into normal (H, W, 3) uint8, id and depth (H, W) uint32.
#[pyfunction]
pub fn decode_data_tile<'py>(py: Python<'py>, data: &[u8]) -> PyResult<Bound<'py, PyDict>> {
    let tile = py.detach(|| data_tile::decode_data_tile(data)).map_err(to_python)?;
    let size = (tile.height as usize, tile.width as usize);
    let dict = PyDict::new(py);
    set3(&dict, "normal", size, tile.normals)?;
    set2(&dict, "id", size, tile.ids)?;
    set2(&dict, "depth", size, tile.depths)?;
    Ok(dict)
}

/// Encodes channels of (H, W, C) bytes, in the given order, as an 8-bit PNG, by the method of a kind of layer.
#[pyfunction]
#[pyo3(signature = (kind, pixels, order, small=false))]
pub fn encode_png<'py>(
    py: Python<'py>,
    kind: &str,
    pixels: PyReadonlyArray3<'py, u8>,
    order: Vec<usize>,
    small: bool,
) -> PyResult<Bound<'py, PyBytes>> {
    let kind = parse_kind(kind)?;
    let array = pixels.as_array();
    let (h, w, channels) = array.dim();
    if h == 0 || w == 0 || channels == 0 {
        return Err(invalid(format!("pixels: shape ({h}, {w}, {channels}), expected no empty axis")));
    }
    let flat = array.as_standard_layout();
    let bytes = flat.as_slice().expect("standard layout");
    let mut encoder = if small { Encoder::small() } else { Encoder::new() };
    let encode = || encoder.channels((w as u32, h as u32), kind, (channels, bytes), &order);
    Ok(PyBytes::new(py, &py.detach(encode).map_err(to_python)?))
}

/// Encodes (H, W) as a PNG of one bit per pixel: true is white.
#[pyfunction]
pub fn encode_bits<'py>(py: Python<'py>, bits: PyReadonlyArray2<'py, bool>) -> PyResult<Bound<'py, PyBytes>> {
    let (h, w) = bits.as_array().dim();
    let flat: Vec<bool> = bits.as_array().iter().copied().collect();
    let encode = || Encoder::new().bits((w as u32, h as u32), &flat);
    Ok(PyBytes::new(py, &py.detach(encode).map_err(to_python)?))
}

/// Decodes an 8-bit PNG into (H, W, C).
#[pyfunction]
pub fn decode_png<'py>(py: Python<'py>, data: &[u8]) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let image = encode::decode_png(data).map_err(to_python)?;
    let shape = (image.height as usize, image.width as usize, image.channels);
    Ok(Array3::from_shape_vec(shape, image.pixels).map_err(|e| invalid(e.to_string()))?.into_pyarray(py))
}

/// Decodes the image of a texture, in any format that is read, into (H, W, 4) uint8, sRGB with straight alpha.
#[pyfunction]
pub fn decode_image<'py>(py: Python<'py>, data: &[u8]) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let raster = py.detach(|| decode::decode(Path::new("image"), data, &ImageLimits::default())).map_err(to_python)?;
    rows4(py, raster)
}

/// Decodes a level of a .m3t file into (H, W, 4) uint8, sRGB with straight alpha, unused texels filled.
#[pyfunction]
pub fn texture_level<'py>(py: Python<'py>, path: PathBuf, level: u32) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let raster = py.detach(|| TextureFile::open(&path)?.level(level)).map_err(to_python)?;
    rows4(py, raster)
}

fn rows4(py: Python<'_>, raster: Raster) -> PyResult<Bound<'_, PyArray3<u8>>> {
    let flat = raster.pixels.into_flattened();
    let array = numpy::PyArray1::from_vec(py, flat);
    array.reshape([raster.height as usize, raster.width as usize, 4])
}
