//! Detection of the formats of documents, and of the files that they name.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use map3d_read::{AssetFolder, FORMATS, FileError, FileHead, detect, find_utf16, library_names, texture_name};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::to_python;

/// Returns the name of the format of the document that begins so. `head`: the first HEAD_BYTES of the file, unpacked, or all.
#[pyfunction]
pub fn detect_format(head: &[u8]) -> Option<&'static str> {
    detect(&FileHead::new(head.to_vec())).map(|format| format.name)
}

/// Returns the local name of the first element of XML, empty without one; None for anything else.
#[pyfunction]
pub fn xml_root(head: &[u8]) -> Option<String> {
    let head = FileHead::new(head.to_vec());
    head.is_xml().then(|| head.xml_root().unwrap_or_default().to_owned())
}

/// Returns the versions of the readers by the names of their formats.
pub fn reader_versions(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let versions = PyDict::new(py);
    FORMATS.iter().try_for_each(|format| versions.set_item(format.name, format.version))?;
    Ok(versions)
}

/// Returns the name of the encoding if a text is in UTF-16, with a byte order mark or without; None for any other. `head`: its first bytes.
#[pyfunction]
pub fn utf16_encoding(head: &[u8]) -> Option<&'static str> {
    find_utf16(head).map(|encoding| encoding.name())
}

/// Returns the file name in a `map_…` statement of a material library. `statement`: what follows the keyword.
#[pyfunction]
pub fn texture_map_name(statement: &[u8]) -> Option<String> {
    texture_name(statement)
}

/// Finds the files that documents name, as the readers do.
#[pyclass(module = "map3d._core", frozen)]
pub struct FileFinder(Mutex<AssetFolder>);

impl FileFinder {
    fn lock(&self) -> MutexGuard<'_, AssetFolder> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl FileFinder {
    /// `base`: folder to which names are relative; `root`: folder that they may lead into, by default `base`.
    #[new]
    #[pyo3(signature = (base, root=None))]
    fn new(base: PathBuf, root: Option<PathBuf>) -> PyResult<Self> {
        AssetFolder::new(&base, root.as_deref()).map(|folder| Self(Mutex::new(folder))).map_err(to_python)
    }

    /// Returns the file of a name as the document writes it, None if there is none; and whether the name is that of a file rather than a URL.
    fn find(&self, name: &str) -> (Option<PathBuf>, bool) {
        match self.lock().find(name) {
            Ok(file) => (Some(file.path), true),
            Err(error) => (None, error != FileError::Url),
        }
    }

    /// Returns the names of the files of a `mtllib` statement of an OBJ file. `statement`: what follows the keyword.
    fn library_names(&self, statement: &[u8]) -> Vec<String> {
        library_names(statement, &mut self.lock())
    }
}
