//! Sorts triangles into the cells that have to be built, and writes their chunks.

use std::collections::HashSet;
use std::path::Path;

use map3d_base::{Error, Result};
use rayon::prelude::*;
use twox_hash::XxHash3_128;

use super::cells::{Quadtree, slab, slab_center};
use super::encode::{Input, encode_chunk};
use super::files::write_if_changed;
use super::shelf::{CHUNKS, OnShelf, Shelf};
use super::source::Source;
use super::spill::Spill;
use super::survey::halves;
use super::triangle::BuildTriangle;
use super::unpack::{MoreMaterials, unpack};
use super::{BuildReport, BuildRequest, Progress};
use crate::index::{Cell, ChunkEntry};
use crate::lattice::snap;
use crate::records::MaterialRecord;

/// What encoding one cell takes at most, generously.
const CELL_MEMORY_BYTES: u64 = 160 << 20;

/// What goes into a sorting cell: triangles, the sum of their hashes, then the hash of all that its chunks depend on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sorted {
    count: u64,
    sum: u128,
    input: [u64; 2],
}

impl Sorted {
    pub fn add(&mut self, count: u64, sum: u128) {
        self.count += count;
        self.sum = self.sum.wrapping_add(sum);
    }

    pub fn settle(&mut self, format: u32, merge_faces: bool, cell: Cell, square: [f64; 3]) {
        let mut hash = XxHash3_128::with_seed(u64::from(format));
        hash.write(env!("CARGO_PKG_VERSION").as_bytes());
        hash.write(&[u8::from(merge_faces)]);
        hash.write(bytemuck::bytes_of(&cell));
        hash.write(bytemuck::bytes_of(&square));
        hash.write(&self.count.to_le_bytes());
        hash.write(&self.sum.to_le_bytes());
        self.input = halves(hash.finish_128());
    }
}

/// What is done about a sorting cell.
enum Plan {
    Keep(Vec<OnShelf>),
    /// Built from the chunks that it had, with the objects of changed assets exchanged.
    Patch(Vec<OnShelf>),
    /// Built from all assets that meet it.
    Build,
}

/// A sorting cell with its chunks.
#[derive(Default)]
pub(super) struct Written {
    pub entries: Vec<ChunkEntry>,
    pub kept: u64,
    pub duplicate_faces: u64,
}

/// Builds the cells that are not on the shelf.
pub(super) struct Writer<'a> {
    folder: &'a Path,
    request: &'a BuildRequest,
    tree: &'a Quadtree,
    sorted: &'a [Sorted],
    plans: Vec<Plan>,
    spill: Spill,
}

impl<'a> Writer<'a> {
    /// `before`: what went into the cells when their chunks were made.
    pub fn new(folder: &'a Path, request: &'a BuildRequest, tree: &'a Quadtree, sorted: &'a [Sorted], before: &[Sorted]) -> Result<Self> {
        let shelf = Shelf::look(folder)?;
        let plan = |((cell, now), before): ((&Cell, &Sorted), &Sorted)| {
            let patched = || shelf.find(*cell, before.input).filter(|_| request.options.merge_materials).map_or(Plan::Build, Plan::Patch);
            shelf.find(*cell, now.input).map_or_else(patched, Plan::Keep)
        };
        let plans = tree.sorting_cells().iter().zip(sorted).zip(before).map(plan).collect();
        let spill = Spill::new(&folder.join("spill"), request.memory_bytes() / 4)?;
        Ok(Self { folder, request, tree, sorted, plans, spill })
    }

    /// Whether a cell of the counting level needs the triangles of an asset.
    pub fn needs(&self, number: u32, is_changed: bool) -> bool {
        self.home(number, is_changed).is_some()
    }

    fn home(&self, number: u32, is_changed: bool) -> Option<usize> {
        self.tree.home(number).filter(|home| match self.plans[*home] {
            Plan::Keep(_) => false,
            Plan::Patch(_) => is_changed,
            Plan::Build => true,
        })
    }

    /// Takes the placed triangles of some assets, each with whether it changed.
    pub fn sort(&mut self, source: &Source, changed: &[bool], progress: Progress) -> Result<()> {
        let total: u64 = source.assets.iter().map(|a| a.mesh.triangles().len() as u64).sum();
        let mut before = 0;
        for (number, asset) in source.assets.iter().enumerate() {
            let (mut failure, mut uncounted) = (None, BuildReport::default());
            let mut put = |_: u32, t: &BuildTriangle| {
                if failure.is_none() {
                    failure = self.push(t, changed[number]).err();
                }
            };
            let went_on = source.stream(number, |p| p == 0, &mut uncounted, &mut put, &mut |n| progress("sort", before + n, total));
            failure.map_or(Ok(()), Err)?;
            if !went_on {
                return Err(Error::Interrupted);
            }
            before += asset.mesh.triangles().len() as u64;
            asset.mesh.release();
        }
        Ok(())
    }

    /// Takes a triangle, if its cell has to be built.
    pub fn push(&mut self, t: &BuildTriangle, is_changed: bool) -> Result<()> {
        match self.home(self.tree.square.number(t), is_changed) {
            Some(home) => self.spill.push(self.tree.sorting_cells()[home], t),
            None => Ok(()),
        }
    }

    /// Encodes and writes the chunks, a few at a time; all chunks of all cells come back. `exchanged`: objects of changed assets, now and before.
    pub fn write(self, materials: &[MaterialRecord], exchanged: &HashSet<u32>, progress: Progress) -> Result<Vec<Written>> {
        let fitting = (self.request.memory_bytes() / 2 / CELL_MEMORY_BYTES).max(1) as usize;
        let threads = self.request.thread_count().min(fitting);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| Error::argument(format!("threads: {e}")))?;
        let (kept, stale): (Vec<usize>, Vec<usize>) = (0..self.plans.len()).partition(|n| matches!(self.plans[*n], Plan::Keep(_)));
        let mut out: Vec<Written> = kept.into_iter().map(|n| self.kept(n)).collect();
        for (k, batch) in stale.chunks(threads).enumerate() {
            if !progress("chunks", (k * threads) as u64, stale.len() as u64) {
                return Err(Error::Interrupted);
            }
            let one = |n: &usize| self.one(*n, MoreMaterials::new(materials), exchanged);
            let done: Vec<Written> = pool.install(|| batch.par_iter().map(one).collect::<Result<_>>())?;
            out.extend(done);
        }
        Ok(out)
    }

    fn kept(&self, number: usize) -> Written {
        let Plan::Keep(files) = &self.plans[number] else { return Written::default() };
        let entries: Vec<ChunkEntry> = files.iter().map(|f| f.entry.clone()).collect();
        self.written(number, entries.len() as u64, entries)
    }

    fn written(&self, number: usize, kept: u64, entries: Vec<ChunkEntry>) -> Written {
        let there: u64 = entries.iter().map(|e| e.triangles).sum();
        Written { kept, duplicate_faces: self.sorted[number].count.saturating_sub(there), entries }
    }

    /// The chunks of one sorting cell.
    fn one(&self, number: usize, mut materials: MoreMaterials, exchanged: &HashSet<u32>) -> Result<Written> {
        let cell = self.tree.sorting_cells()[number];
        let mut triangles = self.spill.load(cell)?;
        if let Plan::Patch(files) = &self.plans[number] {
            for file in files {
                unpack(&self.folder.join(&file.entry.file), &mut materials, |id| !exchanged.contains(&id), &mut triangles)?;
            }
        }
        let mut groups = Vec::new();
        for (cell, mut triangles) in self.tree.leaves(cell, triangles) {
            triangles.sort_by_key(slab);
            groups.extend(triangles.chunk_by(|a, b| slab(a) == slab(b)).map(|group| (cell, group.to_vec())));
        }
        let input = Input { hash: self.sorted[number].input, parts: groups.len() as u32 };
        let (mut entries, mut kept) = (Vec::new(), 0);
        for (cell, triangles) in groups {
            let (entry, is_kept) = self.chunk(cell, triangles, input, &materials.records)?;
            kept += u64::from(is_kept);
            entries.push(entry);
        }
        self.spill.forget(cell)?;
        Ok(self.written(number, kept, entries))
    }

    /// The entry, and whether the file held these very bytes.
    fn chunk(&self, cell: Cell, triangles: Vec<BuildTriangle>, input: Input, materials: &[MaterialRecord]) -> Result<(ChunkEntry, bool)> {
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
