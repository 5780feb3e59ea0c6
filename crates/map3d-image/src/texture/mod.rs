//! The texture store: from source images to `.m3t` files, and back to levels ready to sample.

mod build;
mod cache;
mod file;
mod fill;
mod held;
mod level;
pub(crate) mod mask;
mod mips;
mod source;

pub use build::{Progress, TextureAsset, TextureInfo, TextureKeys, TextureSource, build_textures, prune_textures, source_of};
pub use cache::{CacheStats, Texture, TextureCache};
pub use file::{TextureFile, TextureKey, hex, layout, texture_key, texture_path, write};
pub use fill::fill_unused;
pub use held::HeldTextures;
pub use level::{AlphaCell, Level};
pub use mask::UsageMask;
pub use mips::{LinearRaster, first_mip, level_count, level_size, next_mip, premultiplied};
