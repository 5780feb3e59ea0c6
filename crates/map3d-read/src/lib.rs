//! Readers: source documents (OBJ, CityGML) to batches of triangles in source coordinates, with materials, objects and a report.
//!
//! Bad input is data: a broken polygon or a missing image is skipped, counted and reported; with `strict` the first one is an error.

mod asset_folder;
mod citygml;
mod detect;
mod document;
mod image_file;
mod import;
mod materials;
mod mend;
mod obj;
mod options;
mod report;
mod text;
mod triangulate;

pub use asset_folder::{AssetFolder, Found, Refusal};
pub use detect::{Format, detect_format};
pub use document::{DocumentReader, open};
pub use image_file::Texture;
pub use import::{import, write_tables};
pub use options::{ReadOptions, Split, Up};
pub use triangulate::{Fault, Triangulator};
