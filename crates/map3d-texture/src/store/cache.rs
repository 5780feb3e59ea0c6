//! Caches of levels ready to sample: one shared by all threads, limited in bytes, and one per thread that needs no lock.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock};

use map3d_base::{Error, Result};

use crate::store::file::{TextureFile, TextureKey, texture_path};
use crate::store::level::Level;

/// An open texture file whose checksum has been verified.
#[derive(Debug)]
pub struct Texture {
    pub key: TextureKey,
    pub file: TextureFile,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CacheStats {
    pub hits: u64,
    pub misses: u64,
    pub bytes: u64,
    pub levels: u64,
    pub evicted: u64,
    /// Decoded source images (level 0).
    pub decoded: u64,
}

/// A value that the first thread to need it computes, or its error.
type Shared<T> = Arc<OnceLock<std::result::Result<Arc<T>, String>>>;
/// Texture and level.
type LevelKey = (TextureKey, u32);

struct LevelEntry {
    level: Shared<Level>,
    /// 0 until the level is computed.
    bytes: u64,
    last_used: u64,
}

#[derive(Default)]
struct Levels {
    entries: HashMap<LevelKey, LevelEntry>,
    bytes: u64,
    clock: u64,
}

/// Shared by all threads of a scene. Drops the least recently used levels over its capacity, but not the level that was added last; a level in use
/// stays alive until its users drop it.
pub struct TextureCache {
    folder: PathBuf,
    capacity_bytes: u64,
    textures: Mutex<HashMap<TextureKey, Shared<Texture>>>,
    levels: Mutex<Levels>,
    hits: AtomicU64,
    misses: AtomicU64,
    evicted: AtomicU64,
    decoded: AtomicU64,
}

impl TextureCache {
    /// `folder`: a scene's `textures/`.
    pub fn new(folder: PathBuf, capacity_bytes: u64) -> Self {
        Self {
            folder,
            capacity_bytes,
            textures: Mutex::default(),
            levels: Mutex::default(),
            hits: AtomicU64::new(0),
            misses: AtomicU64::new(0),
            evicted: AtomicU64::new(0),
            decoded: AtomicU64::new(0),
        }
    }

    /// Opens a texture; reads and verifies its file the first time. A damaged file remains an error.
    pub fn texture(&self, key: &TextureKey) -> Result<Arc<Texture>> {
        let shared = self.textures.lock().expect("no thread panicked").entry(*key).or_default().clone();
        let path = || texture_path(&self.folder, key);
        let texture = shared.get_or_init(|| TextureFile::open(&path()).map(|file| Arc::new(Texture { key: *key, file })).map_err(|e| e.to_string()));
        texture.clone().map_err(|what| Error::Format { path: path(), what })
    }

    /// Returns a level of a texture; the first thread to ask computes it.
    pub fn level(&self, texture: &Texture, level: u32) -> Result<Arc<Level>> {
        let key = (texture.key, level);
        let shared = self.slot(key);
        let mut is_new = false;
        let result = shared.get_or_init(|| {
            is_new = true;
            self.compute(texture, level).map(Arc::new).map_err(|e| e.to_string())
        });
        let counter = if is_new { &self.misses } else { &self.hits };
        counter.fetch_add(1, Ordering::Relaxed);
        let result = result.clone().map_err(|what| Error::Format { path: texture_path(&self.folder, &texture.key), what })?;
        if is_new {
            self.add_bytes(key, result.bytes());
        }
        Ok(result)
    }

    pub fn stats(&self) -> CacheStats {
        let levels = self.levels.lock().expect("no thread panicked");
        CacheStats {
            hits: self.hits.load(Ordering::Relaxed),
            misses: self.misses.load(Ordering::Relaxed),
            bytes: levels.bytes,
            levels: levels.entries.len() as u64,
            evicted: self.evicted.load(Ordering::Relaxed),
            decoded: self.decoded.load(Ordering::Relaxed),
        }
    }

    fn slot(&self, key: LevelKey) -> Shared<Level> {
        let mut levels = self.levels.lock().expect("no thread panicked");
        levels.clock += 1;
        let clock = levels.clock;
        let entry = levels.entries.entry(key).or_insert_with(|| LevelEntry { level: Shared::default(), bytes: 0, last_used: 0 });
        entry.last_used = clock;
        entry.level.clone()
    }

    fn compute(&self, texture: &Texture, level: u32) -> Result<Level> {
        if level > 0 {
            return texture.file.stored_level(level);
        }
        self.decoded.fetch_add(1, Ordering::Relaxed);
        texture.file.decoded_level_0()
    }

    /// Counts the bytes of a new level and drops the least recently used ones over the capacity.
    fn add_bytes(&self, key: LevelKey, bytes: u64) {
        let mut levels = self.levels.lock().expect("no thread panicked");
        if let Some(entry) = levels.entries.get_mut(&key) {
            entry.bytes = bytes;
            levels.bytes += bytes;
        }
        if levels.bytes > self.capacity_bytes {
            self.evict(&mut levels, key);
        }
    }

    /// Drops levels until nine tenths of the capacity remain, so that a full cache does not sort at every miss.
    fn evict(&self, levels: &mut Levels, keep: LevelKey) {
        let mut order: Vec<(u64, LevelKey)> =
            levels.entries.iter().filter(|(key, e)| e.bytes > 0 && **key != keep).map(|(key, e)| (e.last_used, *key)).collect();
        order.sort_unstable();
        for (_, key) in order {
            if levels.bytes <= self.capacity_bytes / 10 * 9 {
                break;
            }
            let entry = levels.entries.remove(&key).expect("listed above");
            levels.bytes -= entry.bytes;
            self.evicted.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// The texture cache of one thread while it shades some sub-tiles: asks the shared cache once per texture and level. Levels stay alive here even when the shared
/// cache drops them.
#[derive(Default)]
pub struct LocalTextureCache {
    textures: HashMap<TextureKey, Arc<Texture>, KeyHash>,
    levels: HashMap<LevelKey, Arc<Level>, KeyHash>,
}

impl LocalTextureCache {
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
        let shared = cache.level(texture, level)?;
        self.levels.insert((texture.key, level), shared.clone());
        Ok(shared)
    }

    pub fn clear(&mut self) {
        self.textures.clear();
        self.levels.clear();
    }
}

type KeyHash = BuildHasherDefault<KeyHasher>;

/// Takes the last bytes of a key, which is a hash already.
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
