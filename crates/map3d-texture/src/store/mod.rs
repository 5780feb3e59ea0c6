//! The texture store: turns source images into `.m3t` files, and these into levels ready to sample.

mod build_textures;
mod cache;
mod file;
mod layout;
mod level;
mod mips;
mod packed;
mod roots;
mod source;
mod usage;

pub use build_textures::{
    MissingImages, Progress, TextureAsset, TextureFault, TextureInfo, TextureKeys, TextureSource, build_textures, find_damaged_images,
    prune_textures, texture_source,
};
pub use cache::{CacheStats, LocalTextureCache, Texture, TextureCache};
pub use file::{TEXTURE_MAGIC, TEXTURE_VERSION, TextureFile, TextureKey, encode_texture, hex, texture_key, texture_path, write_texture};
pub(crate) use layout::{STRIP_BITS, STRIP_PITCH, StripLayout};
pub use level::{AlphaCell, Level};
pub use mips::{LinearRaster, first_mip, level_count, level_size, next_mip, premultiplied};
pub use usage::mark_triangle;
