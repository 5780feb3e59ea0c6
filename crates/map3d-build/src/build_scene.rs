//! The steps of a build, in order. A build neither reads nor writes what did not change.

use std::collections::HashSet;
use std::path::Path;

use map3d_base::{Box3, Error, KeptSpace, Result, vec3};
use map3d_scene::index::{Cell, ChunkEntry, FILE, InstancesEntry, SceneIndex};
use map3d_scene::instances;
use map3d_scene::lattice::{MAX_EDGE_M, metres};
use map3d_scene::records::InstanceRecord;
use map3d_texture::{TextureKeys, prune_textures};

use crate::asset_summary::{AssetSummary, CellSum, CellSums, record_hash};
use crate::assets::{Asset, Assets, BUILD_FORMAT};
use crate::cells::{PinnedSquare, Quadtree};
use crate::chunk_cache::{CHUNKS, read_cached_chunk};
use crate::chunks::{CellChunks, CellContent, ChunkWriter};
use crate::content::Content;
use crate::files::{prune, write_if_changed};
use crate::ground::GroundLevel;
use crate::materials::BuildMaterials;
use crate::summarize::summarize_asset;
use crate::triangle::BuildTriangle;
use crate::triangle_source::TriangleSource;
use crate::{BuildReport, BuildRequest, GroundPlane, Progress, prototypes, textures};

const INSTANCES_FILE: &str = "instances.m3i";
/// Triangles that result from splitting long edges, at most.
const MAX_SPLIT_TRIANGLES: u64 = 64_000_000;

/// Builds `chunks/`, `textures/`, `instances.m3i` and `scene.json` of a scene's folder from `assets/<name>/`. Reads an unchanged asset only if it shares
/// a chunk with a changed one; leaves files alone that would not change. Returns `Error::Interrupted` when `progress` returns false; finished files
/// stay, and the next build continues from them.
pub fn build_scene(folder: &Path, request: &BuildRequest, progress: Progress) -> Result<BuildReport> {
    request.validate()?;
    let content = Content::of_assets(request.asset_folders(folder).iter().map(AsRef::as_ref))?;
    let extent = content.extent(request.options.choice(), request.origin)?;
    check_triangle_count(folder, &content, extent.as_ref())?;
    let mut assets = Assets::load(folder, request, extent.as_ref())?;
    let mut report = BuildReport::default();
    let textures = textures::build_changed(folder, &mut assets, request, &mut report, progress)?;
    let previous = SceneIndex::read(folder).ok().filter(|index| index.origin == request.origin);
    let mut build = Build { folder, request, content: &content, extent: extent.as_ref(), textures: &textures, assets, report, progress };
    let index = build.run(previous)?;
    prune_textures(&folder.join("textures"), &textures)?;
    let text = serde_json::to_string_pretty(&index).expect("the index is plain data") + "\n";
    write_if_changed(&folder.join(FILE), text.as_bytes())?;
    build.assets.prune()?;
    Ok(build.report)
}

struct Build<'a> {
    folder: &'a Path,
    request: &'a BuildRequest,
    content: &'a Content,
    extent: Option<&'a KeptSpace>,
    textures: &'a TextureKeys,
    assets: Assets,
    report: BuildReport,
    progress: Progress<'a>,
}

impl Build<'_> {
    fn run(&mut self, previous: Option<SceneIndex>) -> Result<SceneIndex> {
        let fresh = self.assets.without_summary();
        let mut summaries = self.summarize(&fresh)?;
        let level = self.ground_level(summaries.iter());
        let ground = self.ground_planes(&level, &summaries)?;
        let mut bounds = level.bounds;
        ground.iter().flat_map(|t| t.corners).for_each(|c| bounds.add_point(metres(c)));
        let (square, pinned) =
            previous.map_or_else(|| (PinnedSquare::around(&bounds), Vec::new()), |p| PinnedSquare(p.square).grown(&bounds, &p.cells));
        let moved: Vec<usize> =
            (0..self.assets.len()).filter(|k| self.assets.summary(*k).is_some_and(|s| s.details.square != bits(square))).collect();
        summaries.extend(moved.iter().filter_map(|k| self.assets.summary(*k).cloned()));
        let numbers: Vec<usize> = fresh.into_iter().chain(moved).collect();
        self.sum_cells(&numbers, summaries, square)?;
        let tree = self.build_tree(square, &pinned, &ground);
        let now = self.cell_contents(self.assets.summaries(), &tree, &ground);
        let before = self.cell_contents(self.assets.of_last_build(), &tree, &ground);
        let (chunks, cells) = self.build_chunks(&tree, &now, &before, &ground)?;
        self.build_index(square, cells, chunks)
    }

    /// First pass over the assets without a summary: computes counts, boxes and prototypes.
    fn summarize(&mut self, fresh: &[usize]) -> Result<Vec<AssetSummary>> {
        let opened: Vec<&Asset> = open_all(&mut self.assets, fresh)?;
        let materials = BuildMaterials::new(&opened, self.textures, &self.request.options)?;
        let source = triangle_source(self.request, self.extent, &opened, &materials);
        let total = triangle_count(&opened);
        let (mut out, mut before) = (Vec::new(), 0);
        for number in 0..opened.len() {
            out.push(summarize_asset(self.folder, self.request, &source, number, self.textures, &mut |n| {
                (self.progress)("measure", before + n, total)
            })?);
            before += opened[number].mesh.triangles().len() as u64;
            opened[number].mesh.release();
        }
        Ok(out)
    }

    fn ground_level<'s>(&'s self, fresh: impl Iterator<Item = &'s AssetSummary>) -> GroundLevel {
        let mut out = GroundLevel::new();
        self.assets.summaries().chain(fresh).for_each(|s| out.merge(&GroundLevel::from_document(&s.details.level)));
        out
    }

    /// Returns the level in each region of the extent, of the whole scene if there is only one.
    fn ground_levels(&self, whole: GroundLevel, fresh: &[AssetSummary]) -> Vec<GroundLevel> {
        let regions = self.extent.map_or(1, |e| e.regions.len());
        if regions < 2 {
            return vec![whole];
        }
        let mut out = vec![GroundLevel::new(); regions];
        for summary in self.assets.summaries().chain(fresh) {
            out.iter_mut().zip(&summary.details.levels).for_each(|(level, document)| level.merge(&GroundLevel::from_document(document)));
        }
        out
    }

    fn ground_planes(&mut self, whole: &GroundLevel, fresh: &[AssetSummary]) -> Result<Vec<BuildTriangle>> {
        let mut planes = Vec::new();
        for level in self.ground_levels(whole.clone(), fresh) {
            let wanted = match self.request.options.ground_plane {
                GroundPlane::Off => false,
                GroundPlane::On => true,
                GroundPlane::Auto => !level.has_terrain,
            };
            if wanted && !level.bounds.is_empty() {
                let origin = self.request.origin;
                let mut content = self.content.boxes(self.extent).map(|b| Box3 { lo: vec3::sub(b.lo, origin), hi: vec3::sub(b.hi, origin) });
                level.plane(u32::MAX, self.request.ground_id, &mut content, &mut planes)?;
            }
        }
        self.report.ground_plane_triangles = planes.len() as u64;
        Ok(planes)
    }

    /// Second pass: sums the triangles of each asset by cell. Afterwards every asset has a summary.
    fn sum_cells(&mut self, numbers: &[usize], mut summaries: Vec<AssetSummary>, square: PinnedSquare) -> Result<()> {
        let opened = open_all(&mut self.assets, numbers)?;
        let materials = BuildMaterials::new(&opened, self.textures, &self.request.options)?;
        let source = triangle_source(self.request, self.extent, &opened, &materials);
        let (total, mut before) = (triangle_count(&opened), 0);
        for (number, summary) in summaries.iter_mut().enumerate() {
            let mut sums = CellSums::default();
            let mut put = |_: u32, t: &BuildTriangle| sums.add(square.number(t), t, materials.hash(t.material));
            let mut ignored = BuildReport::default();
            if !source.stream(number, |p| p == 0, &mut ignored, &mut put, &mut |n| (self.progress)("count", before + n, total)) {
                return Err(Error::Interrupted);
            }
            before += opened[number].mesh.triangles().len() as u64;
            opened[number].mesh.release();
            (summary.cells, summary.details.square) = (sums.finish(), bits(square));
        }
        numbers.iter().zip(summaries).try_for_each(|(k, summary)| self.assets.store(*k, summary))
    }

    fn build_tree(&self, square: PinnedSquare, pinned: &[Cell], ground: &[BuildTriangle]) -> Quadtree {
        let mut tree = Quadtree::new(square, pinned);
        self.assets.summaries().flat_map(|s| &s.cells).for_each(|c| tree.add(c.cell, u64::from(c.count)));
        ground.iter().for_each(|t| tree.add(square.number(t), 1));
        tree.choose_sorting_cells();
        tree
    }

    /// Returns the content of each sorting cell.
    fn cell_contents<'s>(&self, summaries: impl Iterator<Item = &'s AssetSummary>, tree: &Quadtree, ground: &[BuildTriangle]) -> Vec<CellContent> {
        let mut out = vec![CellContent::default(); tree.sorting_cells().len()];
        let mut add = |c: &CellSum| {
            if let Some(home) = tree.home(c.cell) {
                out[home].add(u64::from(c.count), c.value());
            }
        };
        summaries.filter(|s| s.details.square == bits(tree.square)).flat_map(|s| &s.cells).for_each(&mut add);
        let mut sums = CellSums::default();
        let material = record_hash(&BuildMaterials::ground_record());
        ground.iter().for_each(|t| sums.add(tree.square.number(t), t, material));
        sums.finish().iter().for_each(&mut add);
        out.iter_mut()
            .zip(tree.sorting_cells())
            .for_each(|(s, cell)| s.compute_input(BUILD_FORMAT, self.request.options.merge_faces, *cell, tree.square.0));
        out
    }

    /// Returns the chunks of all cells, from the cache or newly built, and the cells to pin.
    fn build_chunks(
        &mut self,
        tree: &Quadtree,
        now: &[CellContent],
        before: &[CellContent],
        ground: &[BuildTriangle],
    ) -> Result<(Vec<ChunkEntry>, Vec<Cell>)> {
        let mut writer = ChunkWriter::new(self.folder, self.request, tree, now, before)?;
        let is_needed = |k: &usize| self.assets.summary(*k).is_some_and(|s| s.cells.iter().any(|c| writer.needs(c.cell, self.assets.is_new(*k))));
        let numbers: Vec<usize> = (0..self.assets.len()).filter(is_needed).collect();
        let changed: Vec<bool> = numbers.iter().map(|k| self.assets.is_new(*k)).collect();
        let changed_objects = self.changed_objects();
        let opened = open_all(&mut self.assets, &numbers)?;
        let mut materials = BuildMaterials::new(&opened, self.textures, &self.request.options)?;
        let ground_material = materials.ground();
        writer.sort(&triangle_source(self.request, self.extent, &opened, &materials), &changed, &mut *self.progress)?;
        let mut plane = ground.iter().map(|t| BuildTriangle { material: ground_material, ..*t });
        plane.try_for_each(|t| writer.push(&t, true))?;
        let written = writer.write(&materials.records, &changed_objects, &mut *self.progress)?;
        self.assets.close_all();
        written.iter().for_each(|w| add_counts(&mut self.report, w));
        let mut entries: Vec<ChunkEntry> = written.into_iter().flat_map(|w| w.entries).collect();
        entries.sort_by_key(|e: &ChunkEntry| (e.cell.map(crate::cells::morton_key), e.file.clone()));
        let cells: Vec<Cell> = entries.iter().filter_map(|e| e.cell).collect();
        Ok((entries, tree.pin(&cells)))
    }

    /// Returns the objects of assets that were changed, added or removed, and the ground plane.
    fn changed_objects(&self) -> HashSet<u32> {
        let new = (0..self.assets.len()).filter(|k| self.assets.is_new(*k)).filter_map(|k| self.assets.summary(k));
        new.chain(self.assets.previous()).flat_map(|s| s.ids.iter().copied()).chain([self.request.ground_id]).collect()
    }

    /// Writes the instances and returns the index of the scene.
    fn build_index(&mut self, square: PinnedSquare, cells: Vec<Cell>, chunks: Vec<ChunkEntry>) -> Result<SceneIndex> {
        let (entries, records) = self.prototypes()?;
        write_if_changed(&self.folder.join(INSTANCES_FILE), &instances::encode(&records))?;
        let mut bounds = prototypes::placed_bounds(&records, &entries);
        chunks.iter().for_each(|c| bounds.add_box(&c.box3()));
        let files: HashSet<&str> = chunks.iter().chain(&entries).filter_map(|e| e.file.strip_prefix(CHUNKS)?.strip_prefix('/')).collect();
        prune(&self.folder.join(CHUNKS), |name| files.contains(name))?;
        self.complete_report(&records);
        Ok(SceneIndex {
            map3d: "scene".into(),
            version: 1,
            origin: self.request.origin,
            bounds: (!bounds.is_empty()).then_some([bounds.lo, bounds.hi]),
            square: square.0,
            cells,
            chunks,
            prototypes: entries,
            instances: InstancesEntry { file: INSTANCES_FILE.into(), count: records.len() as u64 },
            options: serde_json::to_value(&self.request.options).expect("options are plain data"),
            report: self.stable_counts(),
        })
    }

    /// Returns the entries of all prototypes by file, equal ones once, and the instances of all assets by object id, then by order in the asset.
    fn prototypes(&mut self) -> Result<(Vec<ChunkEntry>, Vec<InstanceRecord>)> {
        let mut files: Vec<&String> = self.assets.summaries().flat_map(|s| &s.details.prototypes).collect();
        files.sort_unstable();
        files.dedup();
        let mut entries = Vec::new();
        for file in &files {
            let found = read_cached_chunk(self.folder, file, None)
                .ok_or_else(|| Error::format(self.folder.join(file), "the file of a prototype disappeared during the build"))?;
            add_counts(&mut self.report, &CellChunks { entries: vec![found.entry.clone()], kept: 1, duplicate_faces: 0 });
            entries.push(found.entry);
        }
        let mut records = Vec::new();
        for summary in self.assets.summaries() {
            let numbers: Vec<u32> = summary.details.prototypes.iter().map(|p| files.binary_search(&p).unwrap_or_default() as u32).collect();
            records.extend(summary.instances.iter().map(|r| InstanceRecord { prototype: numbers[r.prototype as usize], ..*r }));
        }
        records.sort_by_key(|r| r.object_id);
        self.report.prototypes = entries.len() as u64;
        Ok((entries, records))
    }

    fn complete_report(&mut self, records: &[InstanceRecord]) {
        self.report.instances = records.len() as u64;
        self.assets.summaries().for_each(|s| self.report.add(&s.details.counts));
        if self.request.options.merge_materials {
            let all = || self.assets.summaries().flat_map(|s| &s.details.materials);
            self.report.merged_materials = (all().count() - all().collect::<HashSet<_>>().len()) as u64;
        }
    }

    /// Returns the counts that are equal in every build of the same assets: not those of files kept from an earlier build.
    fn stable_counts(&self) -> std::collections::BTreeMap<String, u64> {
        let mut counts = self.report.counts();
        counts.retain(|name, _| !name.ends_with("_kept"));
        counts
    }
}

fn open_all<'a>(assets: &'a mut Assets, numbers: &[usize]) -> Result<Vec<&'a Asset>> {
    numbers.iter().try_for_each(|k| assets.open(*k).map(|_| ()))?;
    Ok(numbers.iter().map(|k| assets.get(*k)).collect())
}

fn triangle_source<'a>(
    request: &'a BuildRequest,
    extent: Option<&'a KeptSpace>,
    assets: &'a [&'a Asset],
    materials: &'a BuildMaterials,
) -> TriangleSource<'a> {
    TriangleSource { assets, materials, options: &request.options, origin: request.origin, extent }
}

/// Refuses scenes whose large triangles would become more small ones than any city has.
fn check_triangle_count(folder: &Path, content: &Content, extent: Option<&KeptSpace>) -> Result<()> {
    let got = content.added_by_splitting(extent, MAX_EDGE_M) as u64;
    let limit = || Error::Limit {
        path: folder.into(),
        what: "the number of triangles after splitting large ones",
        got,
        limit: "split_triangles",
        value: MAX_SPLIT_TRIANGLES,
    };
    if got > MAX_SPLIT_TRIANGLES { Err(limit()) } else { Ok(()) }
}

fn triangle_count(assets: &[&Asset]) -> u64 {
    assets.iter().map(|a| a.mesh.triangles().len() as u64).sum()
}

fn bits(square: PinnedSquare) -> [u64; 3] {
    square.0.map(f64::to_bits)
}

fn add_counts(report: &mut BuildReport, written: &CellChunks) {
    report.chunks += written.entries.len() as u64;
    report.chunks_kept += written.kept;
    report.triangles += written.entries.iter().map(|e| e.triangles).sum::<u64>();
    report.duplicate_faces += written.duplicate_faces;
}
