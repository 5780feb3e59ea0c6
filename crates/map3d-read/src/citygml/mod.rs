//! CityGML 1.0 and 2.0 (names are read without their namespace, so that much of 3.0 is understood too).
//!
//! Two passes over the file. The first (`survey`) keeps the CRS, the themes, appearances that stand outside of city objects, and the ids
//! that are referred to from another city object. The second (`reader`) holds one city object at a time.

mod address;
mod appearance;
mod appearance_parser;
mod attributes;
mod canvas;
mod coordinates;
mod draw;
mod feature;
mod feature_parser;
mod geometry;
mod geometry_parser;
mod georeference;
mod ids;
mod implicit;
mod kinds;
mod lod;
mod paint;
mod prototypes;
mod reader;
mod scan;
mod shared;
mod survey;
mod xml;

pub use reader::CityGmlReader;
