//! Images: textures in mip levels, footprint sampling, G-buffers, pyramid reduction, seams and encoding. Knows no geometry but UV coordinates.

pub mod decode;
pub mod encode;
pub mod gbuffer;
pub mod raster;
pub mod reduce;
pub mod sample;
pub mod seam;
pub mod srgb;
pub mod texture;

pub use decode::ImageLimits;
pub use gbuffer::{Arrays, GBuffer};
pub use raster::Raster;
pub use reduce::reduce;
