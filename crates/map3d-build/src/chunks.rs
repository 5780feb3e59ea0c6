//! Sorts triangles into the cells to build, and writes their chunks.

use std::collections::{BTreeMap, HashSet};
use std::path::Path;

use map3d_base::{Error, Result};
use map3d_scene::index::{Cell, ChunkEntry};
use map3d_scene::lattice::snap;
use map3d_scene::records::MaterialRecord;
use rayon::prelude::*;
use twox_hash::XxHash3_128;

use crate::asset_summary::halves;
use crate::buckets::TriangleBuckets;
use crate::cells::{CELL_TRIANGLES, Quadtree, slab, slab_center};
use crate::chunk_cache::{CHUNKS, CachedChunk, ChunkCache};
use crate::encode::{ChunkInput, encode_chunk};
use crate::files::write_if_changed;
use crate::triangle::BuildTriangle;
use crate::triangle_source::TriangleSource;
use crate::unpack::{MaterialNumbers, unpack_chunk};
use crate::{BuildReport, BuildRequest, Progress};

/// Upper bound of the memory that encoding one cell takes.
const CELL_MEMORY_BYTES: u64 = 160 << 20;
/// A sorting cell with more triangles is dense: they are sorted into smaller cells in files, so that they are never in memory together.
const DENSE_TRIANGLES: u64 = 2 * CELL_TRIANGLES;
/// Memory for sorting the triangles of a dense cell.
const DENSE_BYTES: u64 = 16 << 20;

/// Folder of triangles that do not fit into memory.
const SPILL: &str = "spill";

/// The content of a sorting cell.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CellContent {
    triangles: u64,
    /// Sum of the triangles' hashes modulo 2^128.
    sum: u128,
    /// Hash of everything that the chunks of the cell depend on.
    input: [u64; 2],
}

impl CellContent {
    pub fn add(&mut self, count: u64, sum: u128) {
        self.triangles += count;
        self.sum = self.sum.wrapping_add(sum);
    }

    pub fn compute_input(&mut self, format: u32, merge_faces: bool, cell: Cell, square: [f64; 3]) {
        let mut hash = XxHash3_128::with_seed(u64::from(format));
        hash.write(env!("CARGO_PKG_VERSION").as_bytes());
        hash.write(&[u8::from(merge_faces)]);
        hash.write(bytemuck::bytes_of(&cell));
        hash.write(bytemuck::bytes_of(&square));
        hash.write(&self.triangles.to_le_bytes());
        hash.write(&self.sum.to_le_bytes());
        self.input = halves(hash.finish_128());
    }
}

/// The way to get the chunks of a sorting cell.
enum CellPlan {
    Reuse(Vec<CachedChunk>),
    /// Build it from its earlier chunks, with the objects of changed assets replaced.
    Patch(Vec<CachedChunk>),
    /// Build it from all assets that have triangles in it.
    Build,
}

/// The chunks of a sorting cell.
#[derive(Default)]
pub(crate) struct CellChunks {
    pub entries: Vec<ChunkEntry>,
    pub kept: u64,
    pub duplicate_faces: u64,
}

/// Builds the cells whose chunks the cache does not have.
pub(crate) struct ChunkWriter<'a> {
    folder: &'a Path,
    request: &'a BuildRequest,
    tree: &'a Quadtree,
    contents: &'a [CellContent],
    plans: Vec<CellPlan>,
    buckets: TriangleBuckets,
}

impl<'a> ChunkWriter<'a> {
    /// `before`: the contents when the cached chunks were built.
    pub fn new(folder: &'a Path, request: &'a BuildRequest, tree: &'a Quadtree, contents: &'a [CellContent], before: &[CellContent]) -> Result<Self> {
        let cache = ChunkCache::scan(folder)?;
        let plan = |((cell, now), before): ((&Cell, &CellContent), &CellContent)| {
            let can_patch = request.options.merge_materials && now.triangles <= DENSE_TRIANGLES;
            let patched = || cache.find(*cell, before.input).filter(|_| can_patch).map_or(CellPlan::Build, CellPlan::Patch);
            cache.find(*cell, now.input).map_or_else(patched, CellPlan::Reuse)
        };
        let plans = tree.sorting_cells().iter().zip(contents).zip(before).map(plan).collect();
        let buckets = TriangleBuckets::new(&folder.join(SPILL), request.memory_bytes() / 4)?;
        Ok(Self { folder, request, tree, contents, plans, buckets })
    }

    /// Whether a cell of the counting level needs the triangles of an asset.
    pub fn needs(&self, number: u32, is_changed: bool) -> bool {
        self.home(number, is_changed).is_some()
    }

    fn home(&self, number: u32, is_changed: bool) -> Option<usize> {
        self.tree.home(number).filter(|home| match self.plans[*home] {
            CellPlan::Reuse(_) => false,
            CellPlan::Patch(_) => is_changed,
            CellPlan::Build => true,
        })
    }

    /// Sorts the triangles of some assets into their cells; `changed`: whether each asset changed.
    pub fn sort(&mut self, source: &TriangleSource, changed: &[bool], progress: Progress) -> Result<()> {
        let total: u64 = source.assets.iter().map(|a| a.mesh.triangles().len() as u64).sum();
        let mut before = 0;
        for (number, asset) in source.assets.iter().enumerate() {
            let (mut failure, mut ignored) = (None, BuildReport::default());
            let mut put = |_: u32, t: &BuildTriangle| {
                if failure.is_none() {
                    failure = self.push(t, changed[number]).err();
                }
            };
            let completed = source.stream(number, |p| p == 0, &mut ignored, &mut put, &mut |n| progress("sort", before + n, total));
            failure.map_or(Ok(()), Err)?;
            if !completed {
                return Err(Error::Interrupted);
            }
            before += asset.mesh.triangles().len() as u64;
            asset.mesh.release();
        }
        Ok(())
    }

    /// Adds a triangle if its cell needs it.
    pub fn push(&mut self, t: &BuildTriangle, is_changed: bool) -> Result<()> {
        match self.home(self.tree.square.number(t), is_changed) {
            Some(home) => self.buckets.push(self.tree.sorting_cells()[home], t),
            None => Ok(()),
        }
    }

    /// Encodes and writes the chunks in batches; returns the chunks of all cells. `changed_objects`: objects of changed assets, now and before.
    pub fn write(self, materials: &[MaterialRecord], changed_objects: &HashSet<u32>, progress: Progress) -> Result<Vec<CellChunks>> {
        let fitting = (self.request.memory_bytes() / 2 / CELL_MEMORY_BYTES).max(1) as usize;
        let threads = self.request.thread_count().min(fitting);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| Error::argument(format!("threads: {e}")))?;
        let (kept, stale): (Vec<usize>, Vec<usize>) = (0..self.plans.len()).partition(|n| matches!(self.plans[*n], CellPlan::Reuse(_)));
        let mut out: Vec<CellChunks> = kept.into_iter().map(|n| self.reuse(n)).collect();
        for (k, batch) in stale.chunks(threads).enumerate() {
            if !progress("chunks", (k * threads) as u64, stale.len() as u64) {
                return Err(Error::Interrupted);
            }
            let one = |n: &usize| self.build_cell(*n, MaterialNumbers::new(materials), changed_objects);
            let done: Vec<CellChunks> = pool.install(|| batch.par_iter().map(one).collect::<Result<_>>())?;
            out.extend(done);
        }
        Ok(out)
    }

    fn reuse(&self, number: usize) -> CellChunks {
        let CellPlan::Reuse(files) = &self.plans[number] else { return CellChunks::default() };
        let entries: Vec<ChunkEntry> = files.iter().map(|f| f.entry.clone()).collect();
        self.cell_chunks(number, entries.len() as u64, entries)
    }

    fn cell_chunks(&self, number: usize, kept: u64, entries: Vec<ChunkEntry>) -> CellChunks {
        let there: u64 = entries.iter().map(|e| e.triangles).sum();
        CellChunks { kept, duplicate_faces: self.contents[number].triangles.saturating_sub(there), entries }
    }

    /// Builds the chunks of one sorting cell.
    fn build_cell(&self, number: usize, mut materials: MaterialNumbers, changed_objects: &HashSet<u32>) -> Result<CellChunks> {
        let cell = self.tree.sorting_cells()[number];
        if self.contents[number].triangles > DENSE_TRIANGLES {
            return self.build_dense_cell(number, &materials.records);
        }
        let mut triangles = self.buckets.load(cell)?;
        if let CellPlan::Patch(files) = &self.plans[number] {
            for file in files {
                unpack_chunk(&self.folder.join(&file.entry.file), &mut materials, |id| !changed_objects.contains(&id), &mut triangles)?;
            }
        }
        let mut groups = Vec::new();
        for (cell, triangles) in self.tree.leaves(cell, triangles) {
            groups.extend(slabs(triangles).into_iter().map(|group| (cell, group)));
        }
        let input = ChunkInput { hash: self.contents[number].input, parts: groups.len() as u32 };
        let (mut entries, mut kept) = (Vec::new(), 0);
        for (cell, triangles) in groups {
            let (entry, is_kept) = self.write_chunk(cell, triangles, input, &materials.records)?;
            kept += u64::from(is_kept);
            entries.push(entry);
        }
        self.buckets.remove(cell)?;
        Ok(self.cell_chunks(number, kept, entries))
    }

    /// Builds the chunks of a sorting cell, one leaf cell after the other: first it counts the chunks, which each of them states, then it writes them.
    fn build_dense_cell(&self, number: usize, materials: &[MaterialRecord]) -> Result<CellChunks> {
        let (cell, content) = (self.tree.sorting_cells()[number], self.contents[number]);
        let mut parts = 0;
        self.visit_leaves(&self.buckets, cell, content.triangles, &mut |_, triangles| {
            parts += slabs(triangles).len();
            Ok(())
        })?;
        let input = ChunkInput { hash: content.input, parts: parts as u32 };
        let (mut entries, mut kept) = (Vec::new(), 0);
        self.visit_leaves(&self.buckets, cell, content.triangles, &mut |leaf, triangles| {
            for group in slabs(triangles) {
                let (entry, is_kept) = self.write_chunk(leaf, group, input, materials)?;
                kept += u64::from(is_kept);
                entries.push(entry);
            }
            Ok(())
        })?;
        self.buckets.remove(cell)?;
        Ok(self.cell_chunks(number, kept, entries))
    }

    /// Passes on the leaf cells of a cell with their triangles.
    fn visit_leaves(
        &self,
        buckets: &TriangleBuckets,
        cell: Cell,
        count: u64,
        out: &mut dyn FnMut(Cell, Vec<BuildTriangle>) -> Result<()>,
    ) -> Result<()> {
        if count <= DENSE_TRIANGLES || !self.tree.is_split(cell, count) {
            return self.tree.leaves(cell, buckets.load(cell)?).into_iter().try_for_each(|(leaf, triangles)| out(leaf, triangles));
        }
        let [level, x, y] = cell;
        let folder = self.folder.join(SPILL).join(format!("dense_{level}_{x}_{y}"));
        let (mut below, mut counts) = (TriangleBuckets::new(&folder, DENSE_BYTES)?, BTreeMap::new());
        buckets.stream(cell, &mut |t| {
            let child = self.tree.child(cell, t);
            *counts.entry(child).or_insert(0) += 1;
            below.push(child, t)
        })?;
        for (child, count) in counts {
            self.visit_leaves(&below, child, count, out)?;
            below.remove(child)?;
        }
        Ok(())
    }

    /// Writes a chunk; returns its entry and whether the file already had these bytes.
    fn write_chunk(&self, cell: Cell, triangles: Vec<BuildTriangle>, input: ChunkInput, materials: &[MaterialRecord]) -> Result<(ChunkEntry, bool)> {
        let slab = slab(&triangles[0]);
        let [x, y] = self.tree.square.center(cell);
        let origin = snap([x, y, slab_center(slab)]);
        let chunk = encode_chunk(triangles, origin, materials, self.request.options.merge_faces, input)?;
        let suffix = if slab == 0 { String::new() } else { format!("_{slab}") };
        let file = format!("{CHUNKS}/{}_{}_{}{suffix}.m3c", cell[0], cell[1], cell[2]);
        let is_kept = !write_if_changed(&self.folder.join(&file), &chunk.bytes)?;
        let entry = ChunkEntry {
            file,
            cell: Some(cell),
            origin: chunk.origin,
            bounds: chunk.bounds,
            triangles: chunk.triangles,
            bytes: chunk.bytes.len() as u64,
            hash: format!("{:016x}", chunk.hash),
        };
        Ok((entry, is_kept))
    }
}

/// Divides the triangles of a leaf cell by height.
fn slabs(mut triangles: Vec<BuildTriangle>) -> Vec<Vec<BuildTriangle>> {
    triangles.sort_by_key(slab);
    if !triangles.is_empty() && triangles.first().map(slab) == triangles.last().map(slab) {
        return vec![triangles];
    }
    triangles.chunk_by(|a, b| slab(a) == slab(b)).map(<[BuildTriangle]>::to_vec).collect()
}
