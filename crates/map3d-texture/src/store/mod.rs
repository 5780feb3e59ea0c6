//! The texture store: from source images to `.m3t` files, and back to levels ready to sample.

mod build;
mod cache;
mod file;
mod held;
mod level;
mod mips;
mod source;
mod usage;

pub use build::{Progress, TextureAsset, TextureInfo, TextureKeys, TextureSource, build_textures, prune_textures, source_of};
pub use cache::{CacheStats, Texture, TextureCache};
pub use file::{TEXTURE_MAGIC, TEXTURE_VERSION, TextureFile, TextureKey, hex, layout, texture_key, texture_path, write};
pub use held::HeldTextures;
pub use level::{AlphaCell, Level};
pub use mips::{LinearRaster, first_mip, level_count, level_size, next_mip, premultiplied};
pub use usage::mark_triangle;
