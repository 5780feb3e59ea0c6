//! All tests of rendering in one program, which is linked once.

mod blocks;
mod cutouts;
mod edges;
mod golden;
mod lights;
mod normals;
mod tiles;
mod town;
