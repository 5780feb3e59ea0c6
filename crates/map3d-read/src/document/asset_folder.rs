//! Resolves file names from user data. Only this module opens such files, and only inside the asset's folder.

use std::collections::HashMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Component, Path, PathBuf};

use map3d_base::{Error, Reason, Result};

const MAX_NAME_BYTES: usize = 1024;

/// The reason why a name does not resolve to a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileError {
    NotFound,
    OutsideFolder,
    Url,
    NotAFile,
    InvalidName,
}

pub const IMAGE: [Reason; 5] = [
    Reason::ImageFileNotFound,
    Reason::ImageFileOutsideFolder,
    Reason::ImageUrlNotFetched,
    Reason::ImageNotARegularFile,
    Reason::ImageFileNameInvalid,
];
pub const LIBRARY_OBJECT: [Reason; 5] = [
    Reason::LibraryObjectNotFound,
    Reason::LibraryObjectOutsideFolder,
    Reason::LibraryObjectUrlNotFetched,
    Reason::LibraryObjectNotARegularFile,
    Reason::LibraryObjectFileNameInvalid,
];
pub const MATERIAL_LIBRARY: [Reason; 5] = [
    Reason::MaterialLibraryNotFound,
    Reason::MaterialLibraryOutsideFolder,
    Reason::MaterialLibraryUrlNotFetched,
    Reason::MaterialLibraryNotARegularFile,
    Reason::MaterialLibraryFileNameInvalid,
];
pub const OTHER_FILE: [Reason; 5] = [
    Reason::OtherFileNotFound,
    Reason::OtherFileOutsideFolder,
    Reason::OtherFileUrlNotFetched,
    Reason::OtherFileNotARegularFile,
    Reason::OtherFileNameInvalid,
];
pub const RELIEF: [Reason; 5] = [
    Reason::ReliefFileNotFound,
    Reason::ReliefFileOutsideFolder,
    Reason::ReliefUrlNotFetched,
    Reason::ReliefFileNotARegularFile,
    Reason::ReliefFileNameInvalid,
];

impl FileError {
    /// Returns the reason as written to reports. `reasons`: those of the kind of file, in the order of the errors.
    pub fn reason(self, reasons: [Reason; 5]) -> Reason {
        reasons[self as usize]
    }

    pub fn describe(self) -> &'static str {
        match self {
            Self::NotFound => "file not found",
            Self::OutsideFolder => "file outside the asset's folder not read",
            Self::Url => "URL not fetched",
            Self::NotAFile => "not a regular file",
            Self::InvalidName => "invalid file name",
        }
    }
}

/// A file inside the folder. `note` describes how the name deviates from the file's actual name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LocatedFile {
    pub path: PathBuf,
    pub note: Option<Reason>,
}

/// The folder in which a document's file names are resolved.
pub struct AssetFolder {
    root: PathBuf,
    base: PathBuf,
    /// Directory listings read so far: lower-case name → name on disk.
    listings: HashMap<PathBuf, HashMap<String, OsString>>,
}

impl AssetFolder {
    /// Names are relative to the document's folder and may lead anywhere inside `root` (by default, the document's folder).
    pub fn for_document(document: &Path, root: Option<&Path>) -> Result<Self> {
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

    /// Finds the file that a name in the document refers to. Accepts backslashes, percent-encoding and differences in case.
    pub fn find(&mut self, name: &str) -> std::result::Result<LocatedFile, FileError> {
        let name = name.trim();
        if name.is_empty() || name.len() > MAX_NAME_BYTES || name.contains('\0') {
            return Err(FileError::InvalidName);
        }
        let name = strip_file_scheme(name)?;
        let slashed = name.replace('\\', "/");
        let decoded = decode_percent(&slashed);
        let spellings = [(name, None), (&slashed, Some(Reason::FileNameBackslashes)), (&decoded, Some(Reason::FileNamePercentEncoded))];
        let mut error = FileError::NotFound;
        for (spelling, note) in spellings {
            match self.canonicalize_inside(&self.base.join(spelling)) {
                Ok(path) => return Ok(LocatedFile { path, note }),
                Err(FileError::NotFound) => {}
                Err(other) => error = other,
            }
        }
        if error != FileError::NotFound {
            return Err(error);
        }
        let path = self.find_ignoring_case(&slashed).or_else(|| self.find_ignoring_case(&decoded)).ok_or(FileError::NotFound)?;
        Ok(LocatedFile { path: self.canonicalize_inside(&path)?, note: Some(Reason::FileNameCaseDiffers) })
    }

    /// Returns true for a canonical path of a regular file under the root.
    pub fn contains(&self, path: &Path) -> bool {
        path.starts_with(&self.root) && path.is_file()
    }

    /// Returns the canonical path of a regular file under the root.
    fn canonicalize_inside(&self, path: &Path) -> std::result::Result<PathBuf, FileError> {
        let Ok(path) = fs::canonicalize(path) else {
            return Err(if self.is_lexically_outside(path) { FileError::OutsideFolder } else { FileError::NotFound });
        };
        if !path.starts_with(&self.root) {
            return Err(FileError::OutsideFolder);
        }
        if path.is_file() { Ok(path) } else { Err(FileError::NotAFile) }
    }

    /// Returns true if a path leaves the root, without file system access: the answer does not reveal whether the file exists.
    fn is_lexically_outside(&self, path: &Path) -> bool {
        let mut normalized = PathBuf::new();
        for component in path.components() {
            match component {
                Component::ParentDir => {
                    normalized.pop();
                }
                Component::CurDir => {}
                other => normalized.push(other),
            }
        }
        !normalized.starts_with(&self.root)
    }

    /// Follows a relative path component by component, ignoring case.
    fn find_ignoring_case(&mut self, name: &str) -> Option<PathBuf> {
        let mut path = self.base.clone();
        for component in Path::new(name).components() {
            match component {
                Component::Normal(word) => {
                    let exact = path.join(word);
                    path = if exact.exists() { exact } else { path.join(self.find_entry(&path, &word.to_string_lossy())?) };
                }
                Component::ParentDir => {
                    path.pop();
                }
                Component::CurDir => {}
                _ => return None,
            }
            if !path.starts_with(&self.root) {
                return None;
            }
        }
        Some(path)
    }

    fn find_entry(&mut self, folder: &Path, name: &str) -> Option<OsString> {
        let listing = self.listings.entry(folder.to_path_buf()).or_insert_with(|| list_folder(folder));
        listing.get(&name.to_lowercase()).cloned()
    }
}

/// Maps lower-case names to names on disk. Of names that differ only in case, the first in byte order wins.
fn list_folder(folder: &Path) -> HashMap<String, OsString> {
    let Ok(entries) = fs::read_dir(folder) else { return HashMap::new() };
    let mut names: Vec<OsString> = entries.filter_map(|e| Some(e.ok()?.file_name())).collect();
    names.sort_unstable_by(|a, b| b.cmp(a));
    names.into_iter().map(|n| (n.to_string_lossy().to_lowercase(), n)).collect()
}

/// Removes `file:`; any other scheme is a URL. A single letter before the colon is a Windows drive.
fn strip_file_scheme(name: &str) -> std::result::Result<&str, FileError> {
    let Some((scheme, rest)) = name.split_once(':') else { return Ok(name) };
    if scheme.eq_ignore_ascii_case("file") {
        return Ok(rest.strip_prefix("//").unwrap_or(rest));
    }
    let is_scheme = scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    match (is_scheme, scheme.len()) {
        (true, 1) => Err(FileError::OutsideFolder),
        (true, 2..) if rest.starts_with("//") || scheme.eq_ignore_ascii_case("data") || scheme.eq_ignore_ascii_case("urn") => Err(FileError::Url),
        _ => Ok(name),
    }
}

/// Decodes `%XX`. Returns the name unchanged if the result is not valid UTF-8.
fn decode_percent(name: &str) -> String {
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
