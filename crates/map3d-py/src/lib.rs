//! `map3d._core`: a thin binding of the core's crates. Documents pass as JSON, arrays as NumPy, frames as classes; long calls release the GIL.
//! The contract is `python/map3d/_core.pyi`.

mod asset;
mod batch;
mod block;
mod build_scene;
mod codec;
mod coherence;
mod content;
mod errors;
mod files;
mod formats;
mod frame;
mod reader;
mod scene;
mod view;

use map3d_base::limits;
use pyo3::prelude::*;

#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = m.py();
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add("RENDER_FORMAT", map3d_base::RENDER_FORMAT)?;
    m.add("SCENE_VERSIONS", files::SCENE_VERSIONS)?;
    m.add("TILE_PX", (limits::TILE_PX[0], limits::TILE_PX[1]))?;
    m.add("DEEPEST_LEVEL", limits::DEEPEST_LEVEL)?;
    m.add("QUALITY", (limits::QUALITY[0], limits::QUALITY[1]))?;
    m.add("MAX_FROM_ORIGIN_M", map3d_base::kept_space::MAX_FROM_ORIGIN_M)?;
    m.add("MAX_SUNS", limits::MAX_SUNS)?;
    m.add("LAYERS", serde_json::to_string(&map3d_base::layers::LAYERS).expect("plain values"))?;
    m.add("AO_RADIUS_M", (limits::AO_RADIUS_M[0], limits::AO_RADIUS_M[1]))?;
    m.add("NAME_PATTERN", limits::NAME_PATTERN)?;
    m.add("MESSAGES", include_str!("../../../spec/messages.json"))?;
    m.add("OBJECTS_PER_SHARD", limits::OBJECTS_PER_SHARD)?;
    m.add("HEAD_BYTES", map3d_read::HEAD_BYTES)?;
    m.add("READER_VERSIONS", formats::reader_versions(py)?)?;
    m.add("CoreError", py.get_type::<errors::CoreError>())?;
    m.add("FormatError", py.get_type::<errors::FormatError>())?;
    m.add("SceneRebuilt", py.get_type::<errors::SceneRebuilt>())?;
    m.add("LimitError", py.get_type::<errors::LimitError>())?;
    m.add("InvalidArgument", py.get_type::<errors::InvalidArgument>())?;
    m.add("StorageError", py.get_type::<errors::StorageError>())?;
    m.add("Interrupted", py.get_type::<errors::Interrupted>())?;
    m.add_class::<batch::Batch>()?;
    m.add_class::<asset::AssetWriter>()?;
    m.add_class::<asset::AssetMesh>()?;
    m.add_class::<coherence::Survey>()?;
    m.add_class::<coherence::Surface>()?;
    m.add_class::<reader::Reader>()?;
    m.add_class::<formats::FileFinder>()?;
    m.add_class::<frame::LayerSpec>()?;
    m.add_class::<frame::Frame>()?;
    m.add_class::<view::Camera>()?;
    m.add_class::<scene::Scene>()?;
    m.add_class::<block::Block>()?;
    m.add_function(wrap_pyfunction!(build_scene::build_scene, m)?)?;
    m.add_function(wrap_pyfunction!(build_scene::find_damaged_images, m)?)?;
    m.add_function(wrap_pyfunction!(content::find_clusters, m)?)?;
    m.add_function(wrap_pyfunction!(coherence::surface_heights, m)?)?;
    m.add_function(wrap_pyfunction!(coherence::drape_objects, m)?)?;
    m.add_function(wrap_pyfunction!(coherence::write_adjustments, m)?)?;
    m.add_function(wrap_pyfunction!(coherence::read_adjustments, m)?)?;
    m.add_function(wrap_pyfunction!(block::reduce_block, m)?)?;
    m.add_function(wrap_pyfunction!(block::check_seam, m)?)?;
    m.add_function(wrap_pyfunction!(files::check_file, m)?)?;
    m.add_function(wrap_pyfunction!(formats::detect_format, m)?)?;
    m.add_function(wrap_pyfunction!(formats::xml_root, m)?)?;
    m.add_function(wrap_pyfunction!(formats::utf16_encoding, m)?)?;
    m.add_function(wrap_pyfunction!(formats::texture_map_name, m)?)?;
    m.add_function(wrap_pyfunction!(codec::encode_layer, m)?)?;
    m.add_function(wrap_pyfunction!(codec::encode_png, m)?)?;
    m.add_function(wrap_pyfunction!(codec::encode_bits, m)?)?;
    m.add_function(wrap_pyfunction!(codec::decode_png, m)?)?;
    m.add_function(wrap_pyfunction!(codec::decode_image, m)?)?;
    m.add_function(wrap_pyfunction!(codec::encode_data_tile, m)?)?;
    m.add_function(wrap_pyfunction!(codec::decode_data_tile, m)?)?;
    m.add_function(wrap_pyfunction!(codec::texture_level, m)?)?;
    Ok(())
}
