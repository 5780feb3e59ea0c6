//! Detection of the formats of documents.

use map3d_read::{FORMATS, FileHead, detect};
use pyo3::prelude::*;
use pyo3::types::PyDict;

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
