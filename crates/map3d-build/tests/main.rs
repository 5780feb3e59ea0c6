//! All tests of building scenes in one program, which is linked once.

mod build;
mod fixture;
mod incremental;
