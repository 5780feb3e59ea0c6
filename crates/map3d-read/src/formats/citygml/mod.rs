//! Reads CityGML 0.4 to 3.0. Element names are matched without their namespace.
//!
//! The file is read twice. The first pass (`pre_scan`) collects the CRS, the themes, appearances outside city objects, and the ids that other
//! city objects refer to. The second pass (`citygml_reader`) parses and converts one city object at a time.

mod address;
mod appearance_parser;
pub mod attributes;
mod city_object_parser;
mod citygml_reader;
mod coordinates;
mod geometry_parser;
mod grid_parser;
mod grid_values;
pub mod implicit_geometry;
mod other_documents;
mod pre_scan;
pub mod references;
mod relief_extent;
mod tag_scanner;
pub mod textured_surface;
mod tin_parser;
pub mod xml_reader;

pub use citygml_reader::CityGmlReader;
