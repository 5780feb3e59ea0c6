//! The only place that opens files named by users' data: inside the asset's folder, whatever the name says.

use std::collections::HashMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Component, Path, PathBuf};

use map3d_base::{Error, Result};

const MAX_NAME_BYTES: usize = 1024;

/// Why a name leads to no file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    Missing,
    Outside,
    Url,
    NotAFile,
    BadName,
}

impl Refusal {
    /// As reports name it.
    pub fn reason(self) -> &'static str {
        match self {
            Self::Missing => "file not found",
            Self::Outside => "file outside of the asset's folder refused",
            Self::Url => "file at a URL not fetched",
            Self::NotAFile => "not a regular file",
            Self::BadName => "file name unusable",
        }
    }
}

/// A file inside the folder; `tolerated` says what about the name was not quite right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    pub path: PathBuf,
    pub tolerated: Option<&'static str>,
}

/// The folder that a document's names may lead to.
pub struct AssetFolder {
    root: PathBuf,
    base: PathBuf,
    /// Lower-cased name → name on disk, of folders that were searched.
    listings: HashMap<PathBuf, HashMap<String, OsString>>,
}

impl AssetFolder {
    /// Of a document; names are relative to its folder and may lead anywhere inside `root` (none: that same folder).
    pub fn of_document(document: &Path, root: Option<&Path>) -> Result<Self> {
        let base = match document.parent() {
            Some(p) if !p.as_os_str().is_empty() => p,
            _ => Path::new("."),
        };
        let base = fs::canonicalize(base).map_err(|e| Error::storage(base, e))?;
        let root = match root {
            Some(root) => fs::canonicalize(root).map_err(|e| Error::storage(root, e))?,
            None => base.clone(),
        };
        Ok(Self { root, base, listings: HashMap::new() })
    }

    /// The file that a name in the document means. Backslashes, percent-encoding and another case of letters are tolerated.
    pub fn find(&mut self, name: &str) -> std::result::Result<Found, Refusal> {
        let name = name.trim();
        if name.is_empty() || name.len() > MAX_NAME_BYTES || name.contains('\0') {
            return Err(Refusal::BadName);
        }
        let name = strip_file_scheme(name)?;
        let slashed = name.replace('\\', "/");
        let decoded = percent_decoded(&slashed);
        let spellings = [(name, None), (&slashed, Some("backslashes in a file name")), (&decoded, Some("percent-encoded file name"))];
        let mut refusal = Refusal::Missing;
        for (spelling, tolerated) in spellings {
            match self.inside(&self.base.join(spelling)) {
                Ok(path) => return Ok(Found { path, tolerated }),
                Err(Refusal::Missing) => {}
                Err(other) => refusal = other,
            }
        }
        if refusal != Refusal::Missing {
            return Err(refusal);
        }
        let path = self.any_case(&slashed).or_else(|| self.any_case(&decoded)).ok_or(Refusal::Missing)?;
        Ok(Found { path: self.inside(&path)?, tolerated: Some("file name in another case") })
    }

    /// The canonical path, if it is a regular file under the root.
    fn inside(&self, path: &Path) -> std::result::Result<PathBuf, Refusal> {
        let Ok(path) = fs::canonicalize(path) else {
            return Err(if self.leaves_root(path) { Refusal::Outside } else { Refusal::Missing });
        };
        if !path.starts_with(&self.root) {
            return Err(Refusal::Outside);
        }
        if path.is_file() { Ok(path) } else { Err(Refusal::NotAFile) }
    }

    /// By its words alone: whether a path climbs out of the root. Says the same of files that exist and of those that do not.
    fn leaves_root(&self, path: &Path) -> bool {
        let mut plain = PathBuf::new();
        for part in path.components() {
            match part {
                Component::ParentDir => {
                    plain.pop();
                }
                Component::CurDir => {}
                other => plain.push(other),
            }
        }
        !plain.starts_with(&self.root)
    }

    /// Follows a relative path word by word, ignoring case.
    fn any_case(&mut self, name: &str) -> Option<PathBuf> {
        let mut at = self.base.clone();
        for part in Path::new(name).components() {
            match part {
                Component::Normal(word) => {
                    let exact = at.join(word);
                    at = if exact.exists() { exact } else { at.join(self.listed(&at, &word.to_string_lossy())?) };
                }
                Component::ParentDir => {
                    at.pop();
                }
                Component::CurDir => {}
                _ => return None,
            }
            if !at.starts_with(&self.root) {
                return None;
            }
        }
        Some(at)
    }

    fn listed(&mut self, folder: &Path, word: &str) -> Option<OsString> {
        let listing = self.listings.entry(folder.to_path_buf()).or_insert_with(|| list(folder));
        listing.get(&word.to_lowercase()).cloned()
    }
}

/// Of names that differ in case only, the first in byte order is taken.
fn list(folder: &Path) -> HashMap<String, OsString> {
    let Ok(entries) = fs::read_dir(folder) else { return HashMap::new() };
    let mut names: Vec<OsString> = entries.filter_map(|e| Some(e.ok()?.file_name())).collect();
    names.sort_unstable_by(|a, b| b.cmp(a));
    names.into_iter().map(|n| (n.to_string_lossy().to_lowercase(), n)).collect()
}

/// `file:` is dropped; any other scheme is a URL. A single letter before the colon is a drive of another system.
fn strip_file_scheme(name: &str) -> std::result::Result<&str, Refusal> {
    let Some((scheme, rest)) = name.split_once(':') else { return Ok(name) };
    if scheme.eq_ignore_ascii_case("file") {
        return Ok(rest.strip_prefix("//").unwrap_or(rest));
    }
    let is_scheme = scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    match (is_scheme, scheme.len()) {
        (true, 1) => Err(Refusal::Outside),
        (true, 2..) if rest.starts_with("//") || scheme.eq_ignore_ascii_case("data") || scheme.eq_ignore_ascii_case("urn") => Err(Refusal::Url),
        _ => Ok(name),
    }
}

/// Bytes %XX decoded; what is no valid UTF-8 afterwards stays as it was.
fn percent_decoded(name: &str) -> String {
    let bytes = name.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        let hex = bytes.get(at + 1..at + 3).filter(|_| bytes[at] == b'%');
        let byte = hex.and_then(|h| std::str::from_utf8(h).ok()).and_then(|h| u8::from_str_radix(h, 16).ok()).filter(|b| *b != 0);
        out.push(byte.unwrap_or(bytes[at]));
        at += if byte.is_some() { 3 } else { 1 };
    }
    String::from_utf8(out).unwrap_or_else(|_| name.to_owned())
}
