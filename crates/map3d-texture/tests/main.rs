//! All tests of textures in one program, which is linked once.

#[path = "../../map3d-image/tests/common.rs"]
mod common;
mod sampler;
mod textures;
