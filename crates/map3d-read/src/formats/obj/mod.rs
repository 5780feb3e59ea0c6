//! Reads Wavefront OBJ with MTL.

mod batch_builder;
mod face;
mod face_material;
mod line_reader;
mod mtl;
mod obj_reader;
mod options;

pub use self::mtl::{library_names, texture_name};
use self::obj_reader::{NAME, ObjReader};
use crate::document::file_head::FileHead;
use crate::document::source_format::SourceFormat;

pub const OBJ: SourceFormat = SourceFormat {
    name: NAME,
    version: 4,
    is_library_object: true,
    detect: is_probably_obj,
    open: |path, options, _| Ok(Box::new(ObjReader::open(path, options)?)),
};

/// Common OBJ keywords.
const KEYWORDS: [&str; 14] = ["v", "vt", "vn", "vp", "f", "l", "p", "o", "g", "s", "mtllib", "usemtl", "usemap", "call"];

/// Returns true if at least 90 % of the lines that are not empty or comments begin with an OBJ keyword.
fn is_probably_obj(head: &FileHead) -> bool {
    let (mut lines, mut known) = (0, 0);
    for line in head.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        lines += 1;
        known += usize::from(line.split_whitespace().next().is_some_and(|word| KEYWORDS.contains(&word)));
    }
    known > 0 && known * 10 >= lines * 9
}
