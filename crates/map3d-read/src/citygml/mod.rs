//! Reads CityGML 0.4 to 3.0. Element names are matched without their namespace.
//!
//! The file is read twice. The first pass (`pre_scan`) collects the CRS, the themes, appearances outside city objects, and the ids that other
//! city objects refer to. The second pass (`citygml_reader`) parses and converts one city object at a time.

mod address;
mod appearance;
mod appearance_parser;
mod attributes;
mod city_object;
mod city_object_parser;
mod citygml_reader;
mod code_lists;
mod converter;
mod coordinates;
mod crs_table;
mod feature_types;
mod geo_transform;
mod geometry_arena;
mod geometry_parser;
mod grid_parser;
mod grid_values;
mod ids;
mod implicit_geometry;
mod lod_selection;
mod material_resolver;
mod other_documents;
mod polygons;
mod pre_scan;
mod prototype_table;
mod references;
mod relief_extent;
mod shared_geometry;
mod standard_codes;
mod tag_scanner;
mod tessellate;
mod textured_surface;
mod tin_parser;
mod xml_reader;

pub use citygml_reader::CityGmlReader;
