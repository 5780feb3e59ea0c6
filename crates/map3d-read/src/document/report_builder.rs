//! Builds the report of one document: counts skipped parts and warnings. With `strict`, the first fault is an error.

use std::path::{Path, PathBuf};

use map3d_base::asset::AssetReport;
use map3d_base::{Error, Result};

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
    pub fn triangles(got: u64, value: u64) -> Self {
        Self { what: "number of triangles", got, limit: "max_triangles", value }
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

    /// Counts valid parts that are left out by design; not an error even with `strict`.
    pub fn omit(&mut self, reason: &str, count: u64) {
        if count > 0 {
            self.report.skip(reason, count);
        }
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

    /// Notes something about the whole file.
    pub fn note_file(&mut self, reason: &str, example: impl Into<String>) {
        self.report.warn_file(reason, example);
    }

    /// Reports a fault of the whole file that was repaired or worked around.
    pub fn warn_file(&mut self, reason: &str, example: String) -> Result<()> {
        if self.strict {
            return Err(Error::format(&self.path, format!("{reason}: {example}")));
        }
        self.report.warn_file(reason, example);
        Ok(())
    }

    /// Returns the number of parts left out for a reason.
    pub fn skipped(&self, reason: &str) -> u64 {
        self.report.skipped.get(reason).copied().unwrap_or(0)
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
