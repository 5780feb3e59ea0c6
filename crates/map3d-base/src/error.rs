//! The one error type of the core; each message says what, where, got and expected.

use std::path::{Path, PathBuf};

pub type Result<T> = std::result::Result<T, Error>;

#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file is truncated or malformed, or has another magic, version or checksum.
    #[error("{path}: {what}")]
    Format { path: PathBuf, what: String },
    /// A file of a scene is not the one that the opened index names: the scene was rebuilt meanwhile.
    #[error("{path}: hash {found}, scene.json says {expected}: the scene was rebuilt, open it again")]
    Rebuilt { path: PathBuf, found: String, expected: String },
    /// The input exceeds a limit.
    #[error("{path}: {what} is {got}, over the limit {limit} = {value}")]
    Limit { path: PathBuf, what: &'static str, got: u64, limit: &'static str, value: u64 },
    /// A call took longer than its caller allowed.
    #[error("deadline_s = {limit_s} passed after {done} of {total} {what}; allow more time or ask for less")]
    Deadline { what: &'static str, done: usize, total: usize, limit_s: f64 },
    /// A caller's misuse.
    #[error("{0}")]
    Argument(String),
    /// Reading or writing failed.
    #[error("{path}: {source}")]
    Storage { path: PathBuf, source: std::io::Error },
    /// A callback asked to stop; finished files stay.
    #[error("interrupted; what is finished stays")]
    Interrupted,
}

impl Error {
    pub fn format(path: impl AsRef<Path>, what: impl Into<String>) -> Self {
        Self::Format { path: path.as_ref().to_path_buf(), what: what.into() }
    }

    pub fn storage(path: impl AsRef<Path>, source: std::io::Error) -> Self {
        Self::Storage { path: path.as_ref().to_path_buf(), source }
    }

    pub fn argument(what: impl Into<String>) -> Self {
        Self::Argument(what.into())
    }
}
