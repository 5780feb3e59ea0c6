//! What one thread holds of the cache while it shades a sub-tile: a level is asked for once, then it is at hand without a lock.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::sync::Arc;

use map3d_base::Result;

use crate::store::cache::{Texture, TextureCache};
use crate::store::file::TextureKey;
use crate::store::level::Level;

/// Levels stay alive while they are held, also those that the cache drops meanwhile.
#[derive(Default)]
pub struct HeldTextures {
    textures: HashMap<TextureKey, Arc<Texture>, KeyHash>,
    levels: HashMap<(TextureKey, u32), Arc<Level>, KeyHash>,
}

impl HeldTextures {
    pub fn texture(&mut self, cache: &TextureCache, key: &TextureKey) -> Result<Arc<Texture>> {
        if let Some(texture) = self.textures.get(key) {
            return Ok(texture.clone());
        }
        let texture = cache.texture(key)?;
        self.textures.insert(*key, texture.clone());
        Ok(texture)
    }

    pub fn level(&mut self, cache: &TextureCache, texture: &Texture, level: u32) -> Result<Arc<Level>> {
        if let Some(level) = self.levels.get(&(texture.key, level)) {
            return Ok(level.clone());
        }
        let made = cache.level(texture, level)?;
        self.levels.insert((texture.key, level), made.clone());
        Ok(made)
    }

    /// Lets go of all.
    pub fn release(&mut self) {
        self.textures.clear();
        self.levels.clear();
    }
}

type KeyHash = BuildHasherDefault<KeyHasher>;

/// Keys are hashes already: their last bytes do.
#[derive(Default)]
struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        if let Some(tail) = bytes.last_chunk::<8>() {
            self.0 ^= u64::from_le_bytes(*tail);
        }
    }

    fn write_u32(&mut self, level: u32) {
        self.0 = self.0.rotate_left(7) ^ u64::from(level);
    }

    fn write_usize(&mut self, _length: usize) {}
}
