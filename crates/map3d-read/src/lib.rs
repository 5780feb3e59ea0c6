//! Reads source documents (OBJ, CityGML) into batches of triangles in source coordinates, with materials, objects and a report.
//!
//! Bad input is data: a broken polygon or a missing image is skipped, counted and reported. With `strict`, the first one is an error.

mod asset_folder;
mod byte_source;
mod citygml;
mod constrained_delaunay;
mod detect;
mod document;
mod image_file;
mod material_table;
mod mended_utf8;
mod obj;
mod open;
mod options;
mod report_builder;
mod t_junctions;
mod text_input;
mod tin;
mod transparency;
mod triangulate;

pub use asset_folder::{AssetFolder, FileError, LocatedFile};
pub use detect::{Format, detect_format};
pub use document::{DocumentReader, ReliefGrid};
pub use image_file::ImageFile;
pub use open::{open, write_tables};
pub use options::{PositionTransformer, ReadOptions, Split, Up};
pub use transparency::Transparency;
pub use triangulate::{Coverage, PolygonError, Triangulator};
