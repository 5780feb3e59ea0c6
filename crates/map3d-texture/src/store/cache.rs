//! Levels ready to sample, under a cap of bytes. A surface asks once for its level and then holds it; no lock is taken per sample.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock};

use map3d_base::{Error, Result};

use crate::store::file::{TextureFile, TextureKey, texture_path};
use crate::store::level::Level;

/// A texture of the store, opened and checked.
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
    /// Times a source image was decoded (levels 0 and 1).
    pub decoded: u64,
}

type Made<T> = Arc<OnceLock<std::result::Result<Arc<T>, String>>>;

struct Entry {
    made: Made<Level>,
    bytes: u64,
    used: u64,
}

#[derive(Default)]
struct Levels {
    entries: HashMap<(TextureKey, u32), Entry>,
    bytes: u64,
    clock: u64,
}

/// Shared by all threads of a scene. The cap is kept by dropping the least recently used levels; a level that is in use or alone stays.
pub struct TextureCache {
    folder: PathBuf,
    cap_bytes: u64,
    textures: Mutex<HashMap<TextureKey, Made<Texture>>>,
    levels: Mutex<Levels>,
    hits: AtomicU64,
    misses: AtomicU64,
    evicted: AtomicU64,
    decoded: AtomicU64,
}

impl TextureCache {
    /// `folder`: a scene's `textures/`.
    pub fn new(folder: PathBuf, cap_bytes: u64) -> Self {
        Self {
            folder,
            cap_bytes,
            textures: Mutex::default(),
            levels: Mutex::default(),
            hits: AtomicU64::new(0),
            misses: AtomicU64::new(0),
            evicted: AtomicU64::new(0),
            decoded: AtomicU64::new(0),
        }
    }

    /// Opens a texture; its file is read and checked the first time. A damaged one stays an error.
    pub fn texture(&self, key: &TextureKey) -> Result<Arc<Texture>> {
        let made = self.textures.lock().expect("no thread panicked").entry(*key).or_default().clone();
        let path = || texture_path(&self.folder, key);
        let texture = made.get_or_init(|| TextureFile::open(&path()).map(|file| Arc::new(Texture { key: *key, file })).map_err(|e| e.to_string()));
        texture.clone().map_err(|what| Error::Format { path: path(), what })
    }

    /// A level of a texture; made once, however many threads ask.
    pub fn level(&self, texture: &Texture, level: u32) -> Result<Arc<Level>> {
        let name = (texture.key, level);
        let made = self.slot(name);
        let mut fresh = false;
        let result = made.get_or_init(|| {
            fresh = true;
            self.make(texture, level).map(Arc::new).map_err(|e| e.to_string())
        });
        let counter = if fresh { &self.misses } else { &self.hits };
        counter.fetch_add(1, Ordering::Relaxed);
        let result = result.clone().map_err(|what| Error::Format { path: texture_path(&self.folder, &texture.key), what })?;
        if fresh {
            self.account(name, result.bytes());
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

    fn slot(&self, name: (TextureKey, u32)) -> Made<Level> {
        let mut levels = self.levels.lock().expect("no thread panicked");
        levels.clock += 1;
        let clock = levels.clock;
        let entry = levels.entries.entry(name).or_insert_with(|| Entry { made: Made::default(), bytes: 0, used: 0 });
        entry.used = clock;
        entry.made.clone()
    }

    fn make(&self, texture: &Texture, level: u32) -> Result<Level> {
        if level < 2 {
            self.decoded.fetch_add(1, Ordering::Relaxed);
        }
        match level {
            0 => {
                let image = texture.file.level_0()?;
                if self.has_first(texture) {
                    return Ok(Level::from_raster(image));
                }
                let (level_0, level_1) = Level::first_two(image);
                self.keep_first(texture, level_1);
                Ok(level_0)
            }
            1 => Ok(Level::first_two(texture.file.level_0()?).1),
            _ => Ok(Level::from_raster(texture.file.stored_level(level)?)),
        }
    }

    /// Is level 1 there, or none to be had?
    fn has_first(&self, texture: &Texture) -> bool {
        texture.file.levels == 1 || self.slot((texture.key, 1)).get().is_some()
    }

    /// Level 1 comes with level 0: most views need both, and the source is decoded only once.
    fn keep_first(&self, texture: &Texture, level_1: Level) {
        let name = (texture.key, 1);
        let first = Arc::new(level_1);
        let bytes = first.bytes();
        if self.slot(name).set(Ok(first)).is_ok() {
            self.account(name, bytes);
        }
    }

    /// Books a new level and drops the least recently used ones while over the cap.
    fn account(&self, name: (TextureKey, u32), bytes: u64) {
        let mut levels = self.levels.lock().expect("no thread panicked");
        if let Some(entry) = levels.entries.get_mut(&name) {
            entry.bytes = bytes;
            levels.bytes += bytes;
        }
        if levels.bytes > self.cap_bytes {
            self.evict(&mut levels, name);
        }
    }

    /// Down to nine tenths of the cap, so that a full cache does not sort at every miss.
    fn evict(&self, levels: &mut Levels, keep: (TextureKey, u32)) {
        let mut order: Vec<(u64, (TextureKey, u32))> =
            levels.entries.iter().filter(|(name, e)| e.bytes > 0 && **name != keep).map(|(name, e)| (e.used, *name)).collect();
        order.sort_unstable();
        for (_, name) in order {
            if levels.bytes <= self.cap_bytes / 10 * 9 {
                break;
            }
            let entry = levels.entries.remove(&name).expect("listed above");
            levels.bytes -= entry.bytes;
            self.evicted.fetch_add(1, Ordering::Relaxed);
        }
    }
}
