//! Reads Wavefront OBJ with MTL.

mod batch_builder;
mod face;
mod face_material;
mod line_reader;
mod mtl;
mod obj_reader;

pub use obj_reader::ObjReader;
