//! Resolves file names from user data. Only this module opens such files, and only inside the asset's folder.

use std::collections::HashMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Component, Path, PathBuf};

use map3d_base::{Error, Reason, Result};
use unicode_normalization::UnicodeNormalization;

use super::text_input::decode_name;

const MAX_NAME_BYTES: usize = 1024;
/// Most parts of an absolute path that are searched below the folder.
const MAX_TAIL_PARTS: usize = 16;

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
        Self::new(base, root)
    }

    /// `base`: the folder to which names are relative; `root`: the folder that they may lead into, by default `base`.
    pub fn new(base: &Path, root: Option<&Path>) -> Result<Self> {
        let base = fs::canonicalize(base).map_err(|e| Error::storage(base, e))?;
        let root = match root {
            Some(root) => fs::canonicalize(root).map_err(|e| Error::storage(root, e))?,
            None => base.clone(),
        };
        Ok(Self { root, base, listings: HashMap::new() })
    }

    /// Finds the file that a name in the document refers to. Accepts quotes, backslashes, percent-encoding, differences in case and in Unicode
    /// normalization, and the absolute paths of another computer if the file lies below the folder.
    pub fn find(&mut self, name: &str) -> std::result::Result<LocatedFile, FileError> {
        let name = unquote(name.trim());
        if name.is_empty() || name.len() > MAX_NAME_BYTES || name.contains('\0') {
            return Err(FileError::InvalidName);
        }
        let WrittenName { path, is_absolute } = parse_name(name)?;
        let slashed = path.replace('\\', "/");
        let decoded = decode_percent(&slashed);
        let spellings = [(path, None), (&slashed, Some(Reason::FileNameBackslashes)), (&decoded, Some(Reason::FileNamePercentEncoded))];
        let mut error = FileError::NotFound;
        for (spelling, note) in spellings {
            match self.canonicalize_inside(&self.base.join(spelling)) {
                Ok(path) => return Ok(LocatedFile { path, note }),
                Err(FileError::NotFound) => {}
                Err(other) => error = other,
            }
        }
        if is_absolute {
            let path = self.find_tail(&slashed).or_else(|| self.find_tail(&decoded)).ok_or(FileError::OutsideFolder)?;
            return Ok(LocatedFile { path, note: Some(Reason::FileNameAbsolute) });
        }
        if error != FileError::NotFound {
            return Err(error);
        }
        let base = self.base.clone();
        let found = self.find_ignoring_case(&base, &slashed).map(|path| (path, &slashed));
        let (path, written) = found.or_else(|| Some((self.find_ignoring_case(&base, &decoded)?, &decoded))).ok_or(FileError::NotFound)?;
        let note = if ends_in(&path, written) { None } else { Some(Reason::FileNameCaseDiffers) };
        Ok(LocatedFile { path: self.canonicalize_inside(&path)?, note })
    }

    /// Finds the last parts of an absolute path, as many as possible, below the folder of the document or below the root.
    fn find_tail(&mut self, name: &str) -> Option<PathBuf> {
        let parts: Vec<&str> = name.split('/').filter(|part| !matches!(*part, "" | ".")).collect();
        let tails = (parts.len().saturating_sub(MAX_TAIL_PARTS)..parts.len()).map(|first| parts[first..].join("/"));
        let bases = if self.base == self.root { vec![self.base.clone()] } else { vec![self.base.clone(), self.root.clone()] };
        let places: Vec<(PathBuf, String)> = tails.flat_map(|tail| bases.iter().map(move |base| (base.clone(), tail.clone()))).collect();
        places.into_iter().find_map(|(base, tail)| {
            let path = self.find_ignoring_case(&base, &tail)?;
            self.canonicalize_inside(&path).ok()
        })
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

    /// Follows a relative path component by component, ignoring case and Unicode normalization.
    fn find_ignoring_case(&mut self, base: &Path, name: &str) -> Option<PathBuf> {
        let mut path = base.to_path_buf();
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
        listing.get(&fold(name)).cloned()
    }
}

/// Maps folded names to names on disk. Of names that fold to the same, the first in byte order wins.
fn list_folder(folder: &Path) -> HashMap<String, OsString> {
    let Ok(entries) = fs::read_dir(folder) else { return HashMap::new() };
    let mut names: Vec<OsString> = entries.filter_map(|e| Some(e.ok()?.file_name())).collect();
    names.sort_unstable_by(|a, b| b.cmp(a));
    names.into_iter().map(|n| (fold(&decode_name(n.as_encoded_bytes())), n)).collect()
}

/// Returns a name in lower case and composed (NFC): macOS writes names decomposed (NFD).
fn fold(name: &str) -> String {
    name.nfc().collect::<String>().to_lowercase()
}

/// Returns true if a path ends in a name, apart from Unicode normalization.
fn ends_in(path: &Path, name: &str) -> bool {
    let composed = |text: &str| text.nfc().collect::<String>();
    composed(&decode_name(path.as_os_str().as_encoded_bytes())).ends_with(&composed(name.trim_start_matches("./")))
}

/// Removes the quotes around a name.
fn unquote(name: &str) -> &str {
    let inner = |quote: char| name.strip_prefix(quote)?.strip_suffix(quote).map(str::trim);
    inner('"').or_else(|| inner('\'')).unwrap_or(name)
}

/// A name without its scheme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct WrittenName<'a> {
    path: &'a str,
    /// It begins at the root of a file system, perhaps of another computer.
    is_absolute: bool,
}

/// Removes `file:` and the letter of a Windows drive; any other scheme is a URL.
fn parse_name(name: &str) -> std::result::Result<WrittenName<'_>, FileError> {
    let begins_at_root = |path: &str| path.starts_with(['/', '\\']);
    let Some((scheme, rest)) = name.split_once(':') else { return Ok(WrittenName { path: name, is_absolute: begins_at_root(name) }) };
    if scheme.eq_ignore_ascii_case("file") {
        let path = rest.strip_prefix("//").unwrap_or(rest);
        let is_absolute = rest.starts_with("//") || begins_at_root(rest) || path.as_bytes().get(1) == Some(&b':');
        return Ok(WrittenName { path, is_absolute });
    }
    let is_scheme = scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    match (is_scheme, scheme.len()) {
        (true, 1) => Ok(WrittenName { path: rest, is_absolute: true }),
        (true, 2..) if rest.starts_with("//") || scheme.eq_ignore_ascii_case("data") || scheme.eq_ignore_ascii_case("urn") => Err(FileError::Url),
        _ => Ok(WrittenName { path: name, is_absolute: begins_at_root(name) }),
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
