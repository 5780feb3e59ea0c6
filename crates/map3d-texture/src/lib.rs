//! Textures: the store that turns the images of assets into mip levels (`.m3t` files), and the sampler that filters a level over pixels.

pub mod sample;
mod store;
mod wrap;

pub use store::*;
