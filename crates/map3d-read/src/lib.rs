//! Reads source documents (OBJ, CityGML) into batches of triangles in source coordinates, with materials, objects and a report.
//!
//! Bad input is data: a broken polygon or a missing image is skipped, counted and reported. With `strict`, the first one is an error.

mod city_model;
mod document;
mod formats;
mod triangulation;

pub use document::asset_folder::{AssetFolder, FileError, LocatedFile};
pub use document::file_head::{FileHead, HEAD_BYTES};
pub use document::images::{DocumentImage, ImageSource};
pub use document::options::{PositionTransformer, ReadOptions};
pub use document::source_format::{OpenDocument, SourceFormat};
pub use document::text_input::find_utf16;
pub use document::transparency::Transparency;
pub use document::write_tables::write_tables;
pub use document::{DocumentReader, ReliefGrid};
pub use formats::citygml::CITYGML;
pub use formats::obj::{OBJ, library_names, texture_name};
pub use formats::{FORMATS, detect, open};
pub use triangulation::polygon_error::PolygonError;
pub use triangulation::triangulate::{Coverage, Triangulator};
