//! Reads source documents (OBJ, CityGML) into batches of triangles in source coordinates, with materials, objects and a report.
//!
//! Bad input is data: a broken polygon or a missing image is skipped, counted and reported. With `strict`, the first one is an error.

mod city_model;
mod document;
mod formats;
mod triangulation;

pub use document::asset_folder::{AssetFolder, FileError, LocatedFile};
pub use document::image_file::ImageFile;
pub use document::options::{PositionTransformer, ReadOptions, Split, Up};
pub use document::transparency::Transparency;
pub use document::{DocumentReader, ReliefGrid};
pub use formats::detect::{Format, detect_format};
pub use formats::open::{open, write_tables};
pub use triangulation::polygon_error::PolygonError;
pub use triangulation::triangulate::{Coverage, Triangulator};
