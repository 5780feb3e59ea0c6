//! Images without geometry: decoding, encoding, G-buffers, reduction to the next level, seams. Knows no assets and no textures.

pub mod data_tile;
pub mod decode;
pub mod encode;
mod fill;
pub mod gbuffer;
mod mask;
pub mod pixel_array;
pub mod raster;
pub mod reduce;
pub mod seam;
pub mod srgb;

pub use decode::ImageLimits;
pub use fill::{Filler, fill_unmarked};
pub use gbuffer::{Arrays, GBuffer, SurfaceArrays};
pub use mask::PixelMask;
pub use pixel_array::PixelArray;
pub use raster::Raster;
pub use reduce::reduce;
