//! `map3d._core`: a thin skin over the core's crates. Structured arguments travel as JSON, arrays as NumPy; the GIL is released in every long call.
//! The contract is `python/map3d/_core.pyi`.

mod asset;
mod build;
mod codec;
mod errors;
mod reader;
mod scene;

use pyo3::prelude::*;

#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = m.py();
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add("RENDER_FORMAT", map3d_base::RENDER_FORMAT)?;
    m.add("CoreError", py.get_type::<errors::CoreError>())?;
    m.add("FormatError", py.get_type::<errors::FormatError>())?;
    m.add("LimitError", py.get_type::<errors::LimitError>())?;
    m.add("InvalidArgument", py.get_type::<errors::InvalidArgument>())?;
    m.add("StorageError", py.get_type::<errors::StorageError>())?;
    m.add("Interrupted", py.get_type::<errors::Interrupted>())?;
    m.add_class::<asset::Batch>()?;
    m.add_class::<asset::AssetWriter>()?;
    m.add_class::<reader::Reader>()?;
    m.add_class::<scene::Scene>()?;
    m.add_class::<scene::Block>()?;
    m.add_function(wrap_pyfunction!(build::build_scene, m)?)?;
    m.add_function(wrap_pyfunction!(scene::reduce_block, m)?)?;
    m.add_function(wrap_pyfunction!(codec::encode_layer, m)?)?;
    m.add_function(wrap_pyfunction!(codec::decode_png, m)?)?;
    m.add_function(wrap_pyfunction!(codec::reduce_gbuffers, m)?)?;
    m.add_function(wrap_pyfunction!(codec::texture_level, m)?)?;
    Ok(())
}
