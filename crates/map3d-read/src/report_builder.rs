//! Builds the report of one document: counts skipped parts and warnings. With `strict`, the first fault is an error.

use std::path::{Path, PathBuf};

use map3d_base::asset::AssetReport;
use map3d_base::{Error, Result};

use crate::options::ReadOptions;

pub struct ReportBuilder {
    report: AssetReport,
    path: PathBuf,
    strict: bool,
}

/// A measured quantity and the limit it must not exceed.
pub struct LimitCheck {
    pub what: &'static str,
    pub got: u64,
    /// Name of the option that raises the limit.
    pub limit: &'static str,
    pub value: u64,
}

impl LimitCheck {
    #[inline]
    pub fn triangles(got: u64, options: &ReadOptions) -> Self {
        Self { what: "number of triangles", got, limit: "max_triangles", value: options.max_triangles }
    }
}

impl ReportBuilder {
    /// `path`: the document; `format`: its name in the report.
    pub fn new(path: &Path, format: &str, strict: bool) -> Self {
        Self { report: AssetReport { format: format.to_owned(), ..AssetReport::default() }, path: path.to_path_buf(), strict }
    }

    pub fn report(&self) -> &AssetReport {
        &self.report
    }

    /// Path of the document.
    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn set_crs(&mut self, crs: Option<String>) {
        self.report.crs = crs;
    }

    /// Counts a broken part that is left out. `location` describes where it is; the report keeps the first.
    pub fn skip(&mut self, reason: &str, location: impl FnOnce() -> String) -> Result<()> {
        self.skip_many(reason, 1, location)
    }

    pub fn skip_many(&mut self, reason: &str, count: u64, location: impl FnOnce() -> String) -> Result<()> {
        if count == 0 {
            return Ok(());
        }
        if self.strict {
            return Err(Error::format(&self.path, format!("{reason}: {}", location())));
        }
        if !self.report.skipped.contains_key(reason) {
            self.report.warn(&format!("skipped: {reason}"), location());
        } else if let Some(w) = self.report.warnings.iter_mut().find(|w| w.reason.strip_prefix("skipped: ") == Some(reason)) {
            w.count += count;
        }
        self.report.skip(reason, count);
        Ok(())
    }

    /// Counts a valid part that is left out by design; not an error even with `strict`.
    pub fn omit(&mut self, reason: &str) {
        self.report.skip(reason, 1);
    }

    /// Counts a fault that was repaired or worked around.
    pub fn warn(&mut self, reason: &str, example: impl Into<String>) -> Result<()> {
        if self.strict {
            return Err(Error::format(&self.path, format!("{reason}: {}", example.into())));
        }
        self.report.warn(reason, example);
        Ok(())
    }

    /// Counts something worth knowing that is not a fault; not an error even with `strict`.
    pub fn note(&mut self, reason: &str, example: impl Into<String>) {
        self.report.warn(reason, example);
    }

    /// Returns an error if a quantity exceeds its limit.
    #[inline]
    pub fn check_limit(&self, LimitCheck { what, got, limit, value }: LimitCheck) -> Result<()> {
        if got <= value {
            return Ok(());
        }
        Err(Error::Limit { path: self.path.clone(), what, got, limit, value })
    }
}
