//! Wavefront OBJ with MTL.

mod face;
mod lines;
mod mtl;
mod palette;
mod pending;
mod reader;

pub use reader::ObjReader;
