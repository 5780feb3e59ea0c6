//! Counts what was skipped and what was odd; with `strict`, the first fault is an error.

use std::path::{Path, PathBuf};

use map3d_base::asset::AssetReport;
use map3d_base::{Error, Result};

/// The growing report of one document.
pub struct Log {
    pub report: AssetReport,
    path: PathBuf,
    strict: bool,
}

impl Log {
    pub fn new(path: &Path, format: &str, strict: bool) -> Self {
        Self { report: AssetReport { format: format.to_owned(), ..AssetReport::default() }, path: path.to_path_buf(), strict }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Counts a part that is not taken over; `place` says where the first of its kind is.
    pub fn skip(&mut self, reason: &str, place: impl FnOnce() -> String) -> Result<()> {
        self.skip_many(reason, 1, place)
    }

    pub fn skip_many(&mut self, reason: &str, count: u64, place: impl FnOnce() -> String) -> Result<()> {
        if count == 0 {
            return Ok(());
        }
        if self.strict {
            return Err(Error::format(&self.path, format!("{reason}: {}", place())));
        }
        if !self.report.skipped.contains_key(reason) {
            self.report.warn(&format!("skipped: {reason}"), place());
        } else if let Some(w) = self.report.warnings.iter_mut().find(|w| w.reason.strip_prefix("skipped: ") == Some(reason)) {
            w.count += count;
        }
        self.report.skip(reason, count);
        Ok(())
    }

    /// Counts a fault that was mended or worked around.
    pub fn warn(&mut self, reason: &str, example: impl Into<String>) -> Result<()> {
        if self.strict {
            return Err(Error::format(&self.path, format!("{reason}: {}", example.into())));
        }
        self.report.warn(reason, example);
        Ok(())
    }

    /// Counts something worth knowing that is no fault, not even when strict.
    pub fn note(&mut self, reason: &str, example: impl Into<String>) {
        self.report.warn(reason, example);
    }
}
