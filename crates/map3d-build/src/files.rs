//! Writes the files of a scene atomically, and only when they change.

use std::fs;
use std::path::Path;

use map3d_base::{Error, Result};

/// Writes a temporary file and renames it; returns false when the file already has these bytes.
pub(crate) fn write_if_changed(path: &Path, bytes: &[u8]) -> Result<bool> {
    if fs::metadata(path).is_ok_and(|m| m.len() == bytes.len() as u64) && fs::read(path).is_ok_and(|old| old == bytes) {
        return Ok(false);
    }
    let io = |e| Error::storage(path, e);
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(io)?;
    }
    let part = path.with_extension("part");
    let mut file = fs::File::create(&part).map_err(io)?;
    std::io::Write::write_all(&mut file, bytes).and_then(|()| file.sync_all()).map_err(io)?;
    fs::rename(&part, path).map_err(io)?;
    Ok(true)
}

/// Removes the files of a folder that `keep` rejects.
pub(crate) fn prune(folder: &Path, keep: impl Fn(&str) -> bool) -> Result<()> {
    let entries = match fs::read_dir(folder) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        other => other.map_err(|e| Error::storage(folder, e))?,
    };
    for entry in entries {
        let path = entry.map_err(|e| Error::storage(folder, e))?.path();
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or("");
        if path.is_file() && !keep(name) {
            fs::remove_file(&path).map_err(|e| Error::storage(&path, e))?;
        }
    }
    Ok(())
}
