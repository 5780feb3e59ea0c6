//! All tests of images, tiles and reduction in one program, which is linked once.

mod common;
mod data_tile;
mod decode;
mod encode;
mod jpeg;
mod layers;
mod reduce;
