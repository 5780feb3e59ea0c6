//! A scene opened for tracing: maps chunks when they are needed and unmaps the least recently used. Safe to share between threads.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use map3d_base::{Box3, Error, Result, Vec3};

use crate::chunk::{Chunk, LazyChunk};
use crate::index::{ChunkEntry, SceneIndex};
use crate::instances;
use crate::records::InstanceRecord;
use crate::top::TopLevel;

/// A chunk in its place, or a prototype placed by an instance: a leaf of the top-level tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScenePart {
    /// Number for `SceneStore::chunk`.
    pub chunk: u32,
    /// Index into `SceneStore::instances`; `None`: the chunk is local as it is.
    pub instance: Option<u32>,
    /// Local; conservative for instances.
    pub bounds: Box3,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StoreStats {
    pub chunks_mapped: u64,
    pub chunk_bytes: u64,
    pub chunk_hits: u64,
    pub chunk_misses: u64,
}

/// A mapped chunk and the time of its last use.
struct Slot {
    chunk: Option<Arc<Chunk>>,
    last_used: u64,
    validated: bool,
}

struct Slots {
    slots: Vec<Slot>,
    clock: u64,
    bytes: u64,
}

pub struct SceneStore {
    folder: PathBuf,
    index: SceneIndex,
    instances: Vec<InstanceRecord>,
    parts: Vec<ScenePart>,
    top: TopLevel,
    capacity_bytes: u64,
    slots: Mutex<Slots>,
    hits: AtomicU64,
    misses: AtomicU64,
}

impl SceneStore {
    /// Opens `scene.json` and `instances.m3i`; opens chunks when they are first needed. `capacity_bytes` limits the mapped bytes.
    pub fn open(folder: &Path, capacity_bytes: u64) -> Result<Self> {
        let index = SceneIndex::read(folder)?;
        let instances = match index.instances.count {
            0 => Vec::new(),
            _ => instances::read(&folder.join(&index.instances.file), index.prototypes.len())?,
        };
        if instances.len() as u64 != index.instances.count {
            let what = format!("{} instances, scene.json says {}", instances.len(), index.instances.count);
            return Err(Error::format(folder.join(&index.instances.file), what));
        }
        let parts = parts_of(&index, &instances);
        let top = TopLevel::build(&parts.iter().map(|p| p.bounds).collect::<Vec<_>>());
        let files = index.chunks.len() + index.prototypes.len();
        let slots = (0..files).map(|_| Slot { chunk: None, last_used: 0, validated: false }).collect();
        Ok(Self {
            folder: folder.to_path_buf(),
            index,
            instances,
            parts,
            top,
            capacity_bytes,
            slots: Mutex::new(Slots { slots, clock: 0, bytes: 0 }),
            hits: AtomicU64::new(0),
            misses: AtomicU64::new(0),
        })
    }

    pub fn folder(&self) -> &Path {
        &self.folder
    }

    pub fn index(&self) -> &SceneIndex {
        &self.index
    }

    /// World coordinates of the local origin.
    pub fn origin(&self) -> Vec3 {
        self.index.origin
    }

    /// Local box of all content; empty for an empty scene.
    pub fn bounds(&self) -> Box3 {
        self.index.bounds.map_or(Box3::EMPTY, |[lo, hi]| Box3 { lo, hi })
    }

    /// Returns the number of triangles; a prototype counts once.
    pub fn triangle_count(&self) -> u64 {
        self.index.chunks.iter().chain(&self.index.prototypes).map(|c| c.triangles).sum()
    }

    pub fn parts(&self) -> &[ScenePart] {
        &self.parts
    }

    pub fn instances(&self) -> &[InstanceRecord] {
        &self.instances
    }

    /// Writes to `out` the numbers of the parts in tree leaves that `meets` accepts: a superset of the parts whose boxes it accepts.
    pub fn candidate_parts(&self, meets: impl FnMut(&Box3) -> bool, out: &mut Vec<u32>) {
        self.top.candidates(meets, out);
    }

    /// Chunks come first (0..chunks), prototypes follow.
    fn entry(&self, number: u32) -> &ChunkEntry {
        let k = number as usize;
        self.index.chunks.get(k).unwrap_or_else(|| &self.index.prototypes[k - self.index.chunks.len()])
    }

    /// Returns a chunk, mapping it if necessary. The mapping lives as long as the caller keeps the `Arc`.
    pub fn chunk(&self, number: u32) -> Result<Arc<Chunk>> {
        let mut slots = self.lock();
        slots.clock += 1;
        let clock = slots.clock;
        let slot = &mut slots.slots[number as usize];
        slot.last_used = clock;
        if let Some(chunk) = &slot.chunk {
            self.hits.fetch_add(1, Ordering::Relaxed);
            return Ok(chunk.clone());
        }
        let validated = slot.validated;
        drop(slots);
        self.misses.fetch_add(1, Ordering::Relaxed);
        let chunk = Arc::new(self.open_chunk(number, validated)?);
        Ok(self.insert(number, chunk))
    }

    /// Opens a chunk for reading a few of its boxes; does not cache it.
    pub fn open_lazily(&self, number: u32) -> Result<LazyChunk> {
        let path = self.folder.join(&self.entry(number).file);
        let chunk = Chunk::open_lazily(&path)?;
        self.check_hash(number, path, chunk.checksum())?;
        Ok(chunk)
    }

    /// Returns the local box of an object, conservative for its instances; empty when no chunk and no instance has it.
    pub fn object_box(&self, id: u32) -> Result<Box3> {
        let mut found = Box3::EMPTY;
        for part in &self.parts {
            if let Some(k) = part.instance {
                if self.instances[k as usize].object_id == id {
                    found.add_box(&part.bounds);
                }
                continue;
            }
            let chunk = self.open_lazily(part.chunk)?;
            let o = chunk.origin();
            for object in chunk.objects().iter().filter(|object| object.id == id) {
                let b = [0, 1, 2, 3, 4, 5].map(|k| o[k % 3] + f64::from(object.bounds[k]));
                found.add_box(&Box3 { lo: [b[0], b[1], b[2]], hi: [b[3], b[4], b[5]] });
            }
        }
        Ok(found)
    }

    fn open_chunk(&self, number: u32, validated: bool) -> Result<Chunk> {
        let path = self.folder.join(&self.entry(number).file);
        let chunk = if validated { Chunk::open_trusted(&path)? } else { Chunk::open(&path, false)? };
        self.check_hash(number, path, chunk.checksum())?;
        Ok(chunk)
    }

    fn check_hash(&self, number: u32, path: PathBuf, checksum: u64) -> Result<()> {
        let (found, expected) = (format!("{checksum:016x}"), &self.entry(number).hash);
        if found != *expected {
            return Err(Error::Rebuilt { path, found, expected: expected.clone() });
        }
        Ok(())
    }

    /// Stores a chunk unless another thread did so first; unmaps the least recently used ones over the capacity.
    fn insert(&self, number: u32, chunk: Arc<Chunk>) -> Arc<Chunk> {
        let mut slots = self.lock();
        let slot = &mut slots.slots[number as usize];
        slot.validated = true;
        if let Some(earlier) = &slot.chunk {
            return earlier.clone();
        }
        slot.chunk = Some(chunk.clone());
        slots.bytes += chunk.bytes() as u64;
        while slots.bytes > self.capacity_bytes {
            let mapped = slots.slots.iter_mut().enumerate().filter(|(k, s)| s.chunk.is_some() && *k != number as usize);
            let Some((_, oldest)) = mapped.min_by_key(|(_, s)| s.last_used) else { break };
            let gone = oldest.chunk.take().map_or(0, |c| c.bytes() as u64);
            slots.bytes -= gone;
        }
        chunk
    }

    fn lock(&self) -> MutexGuard<'_, Slots> {
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn stats(&self) -> StoreStats {
        let slots = self.lock();
        StoreStats {
            chunks_mapped: slots.slots.iter().filter(|s| s.chunk.is_some()).count() as u64,
            chunk_bytes: slots.bytes,
            chunk_hits: self.hits.load(Ordering::Relaxed),
            chunk_misses: self.misses.load(Ordering::Relaxed),
        }
    }
}

fn parts_of(index: &SceneIndex, instances: &[InstanceRecord]) -> Vec<ScenePart> {
    let chunks = index.chunks.iter().zip(0..).map(|(c, k)| ScenePart { chunk: k, instance: None, bounds: c.box3() });
    let placed = instances.iter().zip(0..).map(|(i, k)| ScenePart {
        chunk: index.chunks.len() as u32 + i.prototype,
        instance: Some(k),
        bounds: instances::placed_box(&i.transform, &index.prototypes[i.prototype as usize].box3()),
    });
    chunks.chain(placed).collect()
}
