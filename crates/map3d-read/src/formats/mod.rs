//! The formats that are read: a folder and a row each.

pub mod citygml;
pub mod obj;

use std::path::Path;

use map3d_base::Result;

use self::citygml::CITYGML;
use self::obj::OBJ;
use crate::document::file_head::FileHead;
use crate::document::options::ReadOptions;
use crate::document::source_format::{OpenDocument, SourceFormat};

pub static FORMATS: &[SourceFormat] = &[CITYGML, OBJ];

/// Returns the format of the document that begins so.
pub fn detect(head: &FileHead) -> Option<&'static SourceFormat> {
    FORMATS.iter().find(|format| (format.detect)(head))
}

/// Opens a document for reading.
pub fn open(path: &Path, format: &SourceFormat, options: &ReadOptions) -> Result<OpenDocument> {
    (format.open)(path, options, FORMATS)
}
