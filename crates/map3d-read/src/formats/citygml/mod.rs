//! Reads CityGML 0.4 to 3.0, also in the feature collections that web feature services answer with. Element names are matched without their namespace.
//!
//! The file is read twice. The first pass (`pre_scan`) collects the CRS, the themes, appearances outside city objects, and the ids that other
//! city objects refer to. The second pass (`citygml_reader`) parses and converts one city object at a time.

mod address;
mod appearance_parser;
mod attribute_parser;
mod city_object_parser;
mod citygml_reader;
mod coordinates;
mod dictionary_parser;
mod geometry_parser;
mod grid_parser;
mod grid_values;
mod implicit_geometry_parser;
mod members;
mod options;
mod other_documents;
mod positions;
mod pre_scan;
mod references;
mod relief_extent;
mod tag_scanner;
mod textured_surface_parser;
mod tin_parser;
mod tin_parts;
mod xml_reader;

use self::citygml_reader::{CityGmlReader, NAME};
use self::members::is_city_model;
use crate::document::source_format::SourceFormat;

pub const CITYGML: SourceFormat = SourceFormat {
    name: NAME,
    version: 13,
    is_library_object: false,
    detect: is_city_model,
    open: |path, options, formats| Ok(Box::new(CityGmlReader::open(path, options, formats)?)),
};
