//! The steps of a build, in order.

use std::path::Path;
use std::sync::mpsc;

use map3d_base::{Box3, Error, Result};
use map3d_image::texture::{TextureAsset, TextureKeys, build_textures, prune_textures};
use rayon::prelude::*;

use super::assets::Asset;
use super::cells::{Quadtree, Square, morton_key, slab, slab_center};
use super::encode::{ChunkFile, encode_chunk};
use super::files::{prune, write_if_changed};
use super::ground::GroundLevel;
use super::materials::BuildMaterials;
use super::source::Source;
use super::spill::Spill;
use super::triangle::BuildTriangle;
use super::vertices::duplicate_vertices;
use super::{BuildReport, BuildRequest, GroundPlane, Progress, prototypes};
use crate::index::{Cell, ChunkEntry, FILE, InstancesEntry, SceneIndex};
use crate::instances;
use crate::lattice::{metres, snap};

const INSTANCES_FILE: &str = "instances.m3i";
/// What encoding one cell takes at most, generously.
const CELL_MEMORY_BYTES: u64 = 160 << 20;

/// Builds `chunks/`, `textures/`, `instances.m3i` and `scene.json` of a scene's folder from `assets/<name>/`. Files that would not change stay as they
/// are. When `progress` says stop, `Error::Interrupted` comes back; what is finished stays, and the next build goes on from it.
pub fn build_scene(folder: &Path, request: &BuildRequest, progress: Progress) -> Result<BuildReport> {
    request.validate()?;
    let assets = request.assets.iter().map(|name| Asset::open(folder.join("assets").join(name))).collect::<Result<Vec<_>>>()?;
    let mut report = BuildReport::default();
    let textures = textures(folder, &assets, request, &mut report, progress)?;
    let mut materials = BuildMaterials::new(&assets, &textures, request.options.merge_materials);
    report.merged_materials = materials.merged;
    report.materials_without_their_texture = materials.without_their_texture;
    let ground_material = materials.ground();
    let source = Source { assets: &assets, materials: &materials, options: &request.options, origin: request.origin };
    let previous = SceneIndex::read(folder).ok().filter(|index| index.origin == request.origin);
    let mut build = Build { work: Work { folder, request, source }, report, progress };
    let index = build.run(previous, ground_material)?;
    prune_textures(&folder.join("textures"), &textures)?;
    let text = serde_json::to_string_pretty(&index).expect("the index is plain data") + "\n";
    write_if_changed(&folder.join(FILE), text.as_bytes())?;
    Ok(build.report)
}

/// Runs the texture build on threads of its own, its progress handed on by this one.
fn textures(folder: &Path, assets: &[Asset], request: &BuildRequest, report: &mut BuildReport, progress: Progress) -> Result<TextureKeys> {
    let list: Vec<TextureAsset> = assets.iter().map(|a| TextureAsset { folder: &a.folder, mesh: &a.mesh, materials: &a.materials }).collect();
    let (send, receive) = mpsc::sync_channel::<(String, u64, u64, mpsc::Sender<bool>)>(64);
    let result = std::thread::scope(|scope| {
        let list = &list;
        let worker = scope.spawn(move || {
            let ask = |stage: &str, done: u64, total: u64| {
                let (answer, answered) = mpsc::channel();
                send.send((stage.to_owned(), done, total, answer)).is_ok() && answered.recv().unwrap_or(false)
            };
            build_textures(list, &folder.join("textures"), request.threads, &ask)
        });
        for (stage, done, total, answer) in receive {
            // The worker waits for the answer, so it is there to take it.
            let _ = answer.send(progress(&stage, done, total));
        }
        worker.join().map_err(|_| Error::argument("the texture build panicked"))?
    })?;
    report.textures = result.by_source.len() as u64;
    report.textures_kept = result.kept;
    report.texture_warnings =
        result.missing.iter().map(|(reason, (count, example))| (reason.clone(), format!("{count}, first: {example}"))).collect();
    Ok(result)
}

struct Build<'a> {
    work: Work<'a>,
    report: BuildReport,
    progress: Progress<'a>,
}

/// What all threads share.
struct Work<'a> {
    folder: &'a Path,
    request: &'a BuildRequest,
    source: Source<'a>,
}

impl Build<'_> {
    fn run(&mut self, previous: Option<SceneIndex>, ground_material: u32) -> Result<SceneIndex> {
        let level = self.measure()?;
        let ground = self.ground(&level, ground_material)?;
        let bounds = with_plane(&level, &ground);
        let (square, pinned) = previous.map_or_else(|| (Square::around(&bounds), Vec::new()), |p| Square(p.square).grown(&bounds, &p.cells));
        let mut tree = Quadtree::new(square, &pinned);
        self.stream("count", &mut |t| {
            tree.count(t);
            Ok(())
        })?;
        ground.iter().for_each(|t| tree.count(t));
        tree.settle();
        let mut spill = Spill::new(&self.work.folder.join("spill"), self.work.request.memory_bytes() / 4)?;
        self.stream("sort", &mut |t| spill.push(tree.sorting_cell(t), t))?;
        ground.iter().try_for_each(|t| spill.push(tree.sorting_cell(t), t))?;
        let (chunks, cells) = self.chunks(&tree, &spill)?;
        drop(spill);
        self.index(square, cells, chunks)
    }

    /// Streams all triangles that are placed as they are.
    fn stream(&mut self, stage: &str, out: &mut dyn FnMut(&BuildTriangle) -> Result<()>) -> Result<()> {
        let mut uncounted = BuildReport::default();
        stream_all(&self.work.source, stage, &mut uncounted, &mut *self.progress, out)
    }

    /// The first pass: the counts of the report, the box, and where the ground is.
    fn measure(&mut self) -> Result<GroundLevel> {
        let mut level = GroundLevel::new();
        stream_all(&self.work.source, "measure", &mut self.report, &mut *self.progress, &mut |t| {
            t.corners.iter().for_each(|c| level.bounds.add_point(metres(*c)));
            level.add(t.rank, metres(t.corners.map(|c| c[2]))[..].iter().copied().fold(f64::INFINITY, f64::min));
            Ok(())
        })?;
        if self.work.request.options.merge_vertices {
            let memory = self.work.request.memory_bytes() / 4;
            self.report.duplicate_vertices =
                self.work.source.assets.iter().map(|a| duplicate_vertices(&a.mesh, self.work.request.origin, memory)).sum();
        }
        Ok(level)
    }

    fn ground(&mut self, level: &GroundLevel, material: u32) -> Result<Vec<BuildTriangle>> {
        let wanted = match self.work.request.options.ground_plane {
            GroundPlane::Off => false,
            GroundPlane::On => true,
            GroundPlane::Auto => !level.has_terrain,
        };
        if !wanted || level.bounds.is_empty() {
            return Ok(Vec::new());
        }
        let plane = level.plane(self.work.source.assets.len() as u32, self.work.request.ground_id, material)?;
        self.report.ground_plane_triangles = plane.len() as u64;
        Ok(plane)
    }

    /// Encodes and writes the chunks of all cells, a few at a time.
    fn chunks(&mut self, tree: &Quadtree, spill: &Spill) -> Result<(Vec<ChunkEntry>, Vec<Cell>)> {
        let fitting = (self.work.request.memory_bytes() / 2 / CELL_MEMORY_BYTES).max(1) as usize;
        let threads = self.work.request.thread_count().min(fitting);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| Error::argument(format!("threads: {e}")))?;
        let sorting = tree.sorting_cells();
        let (mut entries, mut cells) = (Vec::new(), Vec::new());
        let work = &self.work;
        for (k, batch) in sorting.chunks(threads).enumerate() {
            if !(self.progress)("chunks", (k * threads) as u64, sorting.len() as u64) {
                return Err(Error::Interrupted);
            }
            let done: Vec<Vec<Written>> = pool.install(|| batch.par_iter().map(|cell| work.one(tree, spill, *cell)).collect::<Result<_>>())?;
            for written in done.into_iter().flatten() {
                cells.push(written.cell);
                count(&mut self.report, &written);
                entries.push(written.entry);
            }
        }
        entries.sort_by_key(|e: &ChunkEntry| (e.cell.map(morton_key), e.file.clone()));
        Ok((entries, tree.pin(&cells)))
    }

    /// Prototypes and instances, then the index over all.
    fn index(&mut self, square: Square, cells: Vec<Cell>, chunks: Vec<ChunkEntry>) -> Result<SceneIndex> {
        let progress = &mut *self.progress;
        let collected = prototypes::collect(&self.work.source, &mut self.report, &mut |n| progress("prototypes", n, 0));
        let collected = collected.ok_or(Error::Interrupted)?;
        let mut entries = Vec::new();
        for (k, triangles) in collected.values().enumerate() {
            let written = self.work.write(format!("chunks/p{k}.m3c"), None, &prototypes::encode(triangles, &self.work.source)?)?;
            count(&mut self.report, &written);
            entries.push(written.entry);
        }
        let records = prototypes::instances(&self.work.source, &collected, &mut self.report);
        self.report.prototypes = entries.len() as u64;
        self.report.instances = records.len() as u64;
        write_if_changed(&self.work.folder.join(INSTANCES_FILE), &instances::encode(&records))?;
        let mut bounds = prototypes::placed_bounds(&records, &entries.iter().map(ChunkEntry::box3).collect::<Vec<_>>());
        chunks.iter().for_each(|c| bounds.add_box(&c.box3()));
        let files: std::collections::BTreeSet<&str> = chunks.iter().chain(&entries).filter_map(|e| e.file.strip_prefix("chunks/")).collect();
        prune(&self.work.folder.join("chunks"), |name| files.contains(name))?;
        Ok(SceneIndex {
            map3d: "scene".into(),
            version: 1,
            origin: self.work.request.origin,
            bounds: (!bounds.is_empty()).then_some([bounds.lo, bounds.hi]),
            square: square.0,
            cells,
            chunks,
            prototypes: entries,
            instances: InstancesEntry { file: INSTANCES_FILE.into(), count: records.len() as u64 },
            options: serde_json::to_value(self.work.request.options).expect("options are plain data"),
            report: self.stable_counts(),
        })
    }

    /// What is the same in every build of the same assets: not what was kept from an earlier one.
    fn stable_counts(&self) -> std::collections::BTreeMap<String, u64> {
        let mut counts = self.report.counts();
        counts.retain(|name, _| !name.ends_with("_kept"));
        counts
    }
}

impl Work<'_> {
    /// The chunks of one sorting cell.
    fn one(&self, tree: &Quadtree, spill: &Spill, sorting_cell: Cell) -> Result<Vec<Written>> {
        let mut out = Vec::new();
        for (cell, mut triangles) in tree.leaves(sorting_cell, spill.load(sorting_cell)?) {
            triangles.sort_by_key(slab);
            for group in triangles.chunk_by(|a, b| slab(a) == slab(b)) {
                out.push(self.write_cell(tree, cell, group)?);
            }
        }
        Ok(out)
    }

    fn write_cell(&self, tree: &Quadtree, cell: Cell, triangles: &[BuildTriangle]) -> Result<Written> {
        let slab = slab(&triangles[0]);
        let [x, y] = tree.square.center(cell);
        let origin = snap([x, y, slab_center(slab)]);
        let chunk = encode_chunk(triangles.to_vec(), origin, &self.source.materials.records, self.request.options.merge_faces)?;
        let suffix = if slab == 0 { String::new() } else { format!("_{slab}") };
        let file = format!("chunks/{}_{}_{}{suffix}.m3c", cell[0], cell[1], cell[2]);
        self.write(file, Some(cell), &chunk)
    }

    fn write(&self, file: String, cell: Option<Cell>, chunk: &ChunkFile) -> Result<Written> {
        let kept = !write_if_changed(&self.folder.join(&file), &chunk.bytes)?;
        let entry = ChunkEntry {
            file,
            cell,
            origin: chunk.origin,
            bounds: chunk.bounds,
            triangles: chunk.triangles,
            bytes: chunk.bytes.len() as u64,
            hash: format!("{:016x}", chunk.hash),
        };
        Ok(Written { entry, cell: cell.unwrap_or_default(), kept, duplicate_faces: chunk.duplicate_faces })
    }
}

fn count(report: &mut BuildReport, written: &Written) {
    report.chunks += 1;
    report.chunks_kept += u64::from(written.kept);
    report.triangles += written.entry.triangles;
    report.duplicate_faces += written.duplicate_faces;
}

struct Written {
    entry: ChunkEntry,
    cell: Cell,
    kept: bool,
    duplicate_faces: u64,
}

fn with_plane(level: &GroundLevel, plane: &[BuildTriangle]) -> Box3 {
    let mut bounds = level.bounds;
    plane.iter().flat_map(|t| t.corners).for_each(|c| bounds.add_point(metres(c)));
    bounds
}

/// Hands on all placed triangles, asset by asset.
fn stream_all(
    source: &Source,
    stage: &str,
    report: &mut BuildReport,
    progress: Progress,
    out: &mut dyn FnMut(&BuildTriangle) -> Result<()>,
) -> Result<()> {
    let total: u64 = source.assets.iter().map(|a| a.mesh.triangles().len() as u64).sum();
    let mut before = 0;
    for number in 0..source.assets.len() {
        let mut failure = None;
        let mut put = |_: u32, t: &BuildTriangle| {
            if failure.is_none() {
                failure = out(t).err();
            }
        };
        let went_on = source.stream(number, |p| p == 0, report, &mut put, &mut |n| progress(stage, before + n, total));
        if let Some(error) = failure {
            return Err(error);
        }
        if !went_on {
            return Err(Error::Interrupted);
        }
        before += source.assets[number].mesh.triangles().len() as u64;
    }
    Ok(())
}
