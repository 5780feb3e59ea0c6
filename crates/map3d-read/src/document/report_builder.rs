//! Builds the report of one document: counts skipped parts and warnings. With `strict`, the first fault is an error.

use std::path::{Path, PathBuf};

use map3d_base::asset::AssetReport;
use map3d_base::reason::{Message, Reason, Severity};
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

    /// Notes the day that decides which versions have ended.
    pub fn set_versions_on(&mut self, day: String) {
        self.report.versions_on = Some(day);
    }

    /// Counts a broken part that is left out. `location` describes where it is; the report keeps the first.
    pub fn skip(&mut self, reason: impl Into<Message>, location: impl FnOnce() -> String) -> Result<()> {
        self.skip_many(reason, 1, location)
    }

    pub fn skip_many(&mut self, reason: impl Into<Message>, count: u64, location: impl FnOnce() -> String) -> Result<()> {
        self.add(reason.into(), Severity::Skipped, count, location)
    }

    /// Counts valid parts that are left out by design; not an error even with `strict`.
    pub fn omit(&mut self, reason: Reason, count: u64) {
        self.add(reason.into(), Severity::Omitted, count, String::new).expect("not a fault");
    }

    /// Counts one valid part that is left out by design.
    pub fn omit_one(&mut self, reason: impl Into<Message>, example: &str) {
        self.add(reason.into(), Severity::Omitted, 1, || example.to_owned()).expect("not a fault");
    }

    /// Counts a fault that was repaired or worked around.
    pub fn warn(&mut self, reason: impl Into<Message>, example: impl Into<String>) -> Result<()> {
        self.add(reason.into(), Severity::Warning, 1, || example.into())
    }

    /// Counts something worth knowing that is not a fault; not an error even with `strict`.
    pub fn note(&mut self, reason: Reason, example: impl Into<String>) {
        self.add(reason.into(), Severity::Note, 1, || example.into()).expect("not a fault");
    }

    fn add(&mut self, message: Message, severity: Severity, count: u64, example: impl FnOnce() -> String) -> Result<()> {
        debug_assert_eq!(message.reason.severity(), severity, "{}", message.reason.code());
        if count > 0 && self.strict && matches!(severity, Severity::Warning | Severity::Skipped) {
            return Err(Error::format(&self.path, format!("{message}: {}", example())));
        }
        self.report.add(message, count, example);
        Ok(())
    }

    /// Returns the number of parts with a reason.
    pub fn count(&self, reason: Reason) -> u64 {
        self.report.count(reason)
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
