//! All tests of assets, limits, messages and test vectors in one program, which is linked once.

mod asset;
mod layers;
mod limits;
mod messages;
mod vectors;
