//! Assets to chunks and textures.

use std::path::PathBuf;

use map3d_build::BuildRequest;
use map3d_texture::find_damaged_images as find_damaged;
use pyo3::prelude::*;

use crate::errors::{invalid, to_python};

/// Builds a scene's folder and returns the report (JSON). `progress(stage, done, total)` returns False to stop; the build then raises `Interrupted`.
#[pyfunction]
#[pyo3(signature = (folder, request, progress=None))]
pub fn build_scene(py: Python<'_>, folder: PathBuf, request: &str, progress: Option<Py<PyAny>>) -> PyResult<String> {
    let request: BuildRequest = serde_json::from_str(request).map_err(|e| invalid(format!("request: {e}")))?;
    let mut failure = None;
    let mut report_progress = |stage: &str, done: u64, total: u64| {
        let Some(progress) = &progress else { return true };
        let must_continue = Python::attach(|py| {
            py.check_signals()?;
            progress.call1(py, (stage, done, total))?.is_truthy(py)
        });
        must_continue.unwrap_or_else(|error| {
            failure = Some(error);
            false
        })
    };
    let report = py.detach(|| map3d_build::build_scene(&folder, &request, &mut report_progress));
    match failure {
        Some(error) => Err(error),
        None => report.map(|r| serde_json::to_string(&r).expect("reports are plain data")).map_err(to_python),
    }
}

/// Decodes all images of an asset; returns those that cannot be used, by their keys: {key: {"code", "values"}} (JSON). `threads` = 0: one per core.
#[pyfunction]
#[pyo3(signature = (folder, threads=0))]
pub fn find_damaged_images(py: Python<'_>, folder: PathBuf, threads: usize) -> PyResult<String> {
    let faults = py.detach(|| find_damaged(&folder, threads)).map_err(to_python)?;
    Ok(serde_json::to_string(&faults).expect("faults are plain data"))
}
