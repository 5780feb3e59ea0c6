//! Groups of content far from each other, and the extent of those that a scene keeps.

use std::path::{Path, PathBuf};

use map3d_base::Vec3;
use map3d_build::BuildOptions;
use map3d_build::content::Content;
use pyo3::prelude::*;
use serde_json::json;

use crate::errors::{invalid, to_python};

/// Returns JSON: "clusters", largest first; "extent" of what stays, null when everything does; "outside": numbers of the folders with other content.
#[pyfunction]
pub fn find_clusters(py: Python<'_>, folders: Vec<PathBuf>, origin: Vec3, options: &str) -> PyResult<String> {
    let options: BuildOptions = serde_json::from_str(options).map_err(|e| invalid(format!("options: {e}")))?;
    let find = || -> map3d_base::Result<String> {
        let content = Content::of_assets(folders.iter().map(AsRef::as_ref))?;
        let extent = content.extent(options.choice(), origin)?;
        let mut outside = Vec::new();
        for (number, folder) in folders.iter().enumerate() {
            let folder: &Path = folder;
            if let Some(extent) = &extent
                && Content::of_assets([folder].into_iter())?.reaches_outside(extent)
            {
                outside.push(number);
            }
        }
        Ok(json!({ "clusters": content.clusters(), "extent": extent, "outside": outside }).to_string())
    };
    py.detach(find).map_err(to_python)
}
