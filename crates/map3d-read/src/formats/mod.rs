//! The formats that are read, a folder each.

pub mod citygml;
pub mod detect;
pub mod obj;
pub mod open;
