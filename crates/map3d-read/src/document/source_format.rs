//! What the list of formats says of each.

use std::path::Path;

use map3d_base::Result;

use super::DocumentReader;
use super::file_head::FileHead;
use super::options::ReadOptions;

/// A document that is being read.
pub type OpenDocument = Box<dyn DocumentReader + Send>;

/// A format of documents: a row of `formats::FORMATS`.
pub struct SourceFormat {
    /// Its name in assets, reports and options.
    pub name: &'static str,
    /// Raised when the reader makes another asset of the same file, so that existing scenes get the better one.
    pub version: u32,
    /// A document may be a prototype of implicit geometry in a city model.
    pub is_library_object: bool,
    /// Returns true for the beginning of a document in this format.
    pub detect: fn(&FileHead) -> bool,
    /// Opens a document. `formats`: those of the files that it may name.
    pub open: fn(path: &Path, options: &ReadOptions, formats: &'static [SourceFormat]) -> Result<OpenDocument>,
}
