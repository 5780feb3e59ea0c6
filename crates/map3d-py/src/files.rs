//! Checks of binary files.

use std::path::PathBuf;

use map3d_base::asset::{MESH_MAGIC, MESH_VERSION};
use map3d_base::file;
use map3d_scene::records::{CHUNK_MAGIC, INSTANCES_MAGIC, VERSION};
use map3d_texture::{TEXTURE_MAGIC, TEXTURE_VERSION};
use pyo3::prelude::*;

use crate::errors::to_python;

const FORMATS: [(&[u8; 4], u32); 4] =
    [(MESH_MAGIC, MESH_VERSION), (CHUNK_MAGIC, VERSION), (INSTANCES_MAGIC, VERSION), (TEXTURE_MAGIC, TEXTURE_VERSION)];

/// Versions of the files of a built scene: chunks and instances, textures.
pub const SCENE_VERSIONS: (u32, u32) = (VERSION, TEXTURE_VERSION);

/// Raises FormatError unless a mesh, chunk, instance or texture file has a known version and the checksum of its header.
#[pyfunction]
pub fn check_file(py: Python<'_>, path: PathBuf) -> PyResult<()> {
    py.detach(|| file::check_any(&path, &FORMATS)).map_err(to_python)
}
