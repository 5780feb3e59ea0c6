//! The steps of a build, in order. What did not change is neither read nor written again.

use std::collections::HashSet;
use std::path::Path;

use map3d_base::{Error, Result};
use map3d_texture::{TextureKeys, prune_textures};

use super::assets::{Asset, Assets, BUILD_FORMAT};
use super::cells::{Quadtree, Square};
use super::chunks::{Sorted, Writer, Written};
use super::files::{prune, write_if_changed};
use super::ground::GroundLevel;
use super::materials::BuildMaterials;
use super::shelf::{CHUNKS, on_shelf};
use super::source::Source;
use super::survey::{CellSum, CellSums, Facts, KnownTexture, Survey, record_hash};
use super::triangle::BuildTriangle;
use super::vertices::duplicate_vertices;
use super::{BuildReport, BuildRequest, GroundPlane, Progress, prototypes, textures};
use crate::index::{Cell, ChunkEntry, FILE, InstancesEntry, SceneIndex};
use crate::instances;
use crate::lattice::metres;
use crate::records::InstanceRecord;

const INSTANCES_FILE: &str = "instances.m3i";

/// Builds `chunks/`, `textures/`, `instances.m3i` and `scene.json` of a scene's folder from `assets/<name>/`. Assets that did not change are not read
/// but where a chunk holds them together with one that did; files that would not change stay as they are. When `progress` says stop,
/// `Error::Interrupted` comes back; what is finished stays, and the next build goes on from it.
pub fn build_scene(folder: &Path, request: &BuildRequest, progress: Progress) -> Result<BuildReport> {
    request.validate()?;
    let mut assets = Assets::load(folder, request)?;
    let mut report = BuildReport::default();
    let textures = textures::settle(folder, &mut assets, request, &mut report, progress)?;
    let previous = SceneIndex::read(folder).ok().filter(|index| index.origin == request.origin);
    let mut build = Build { folder, request, textures: &textures, assets, report, progress };
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
    textures: &'a TextureKeys,
    assets: Assets,
    report: BuildReport,
    progress: Progress<'a>,
}

impl Build<'_> {
    fn run(&mut self, previous: Option<SceneIndex>) -> Result<SceneIndex> {
        let fresh = self.assets.without_survey();
        let mut surveys = self.measure(&fresh)?;
        let level = self.level(surveys.iter());
        let ground = self.ground(&level)?;
        let mut bounds = level.bounds;
        ground.iter().flat_map(|t| t.corners).for_each(|c| bounds.add_point(metres(c)));
        let (square, pinned) = previous.map_or_else(|| (Square::around(&bounds), Vec::new()), |p| Square(p.square).grown(&bounds, &p.cells));
        let moved: Vec<usize> = (0..self.assets.len()).filter(|k| self.assets.survey(*k).is_some_and(|s| s.facts.square != bits(square))).collect();
        surveys.extend(moved.iter().filter_map(|k| self.assets.survey(*k).cloned()));
        let numbers: Vec<usize> = fresh.into_iter().chain(moved).collect();
        self.sum_cells(&numbers, surveys, square)?;
        let tree = self.tree(square, &pinned, &ground);
        let now = self.sorted(self.assets.surveys(), &tree, &ground);
        let before = self.sorted(self.assets.before(), &tree, &ground);
        let (chunks, cells) = self.chunks(&tree, &now, &before, &ground)?;
        self.index(square, cells, chunks)
    }

    /// The first pass over assets without a survey: their share of the report, their boxes, their prototypes.
    fn measure(&mut self, fresh: &[usize]) -> Result<Vec<Survey>> {
        let opened: Vec<&Asset> = open_all(&mut self.assets, fresh)?;
        let materials = BuildMaterials::new(&opened, self.textures, self.request.options.merge_materials);
        let source = source(self.request, &opened, &materials);
        let total = triangles(&opened);
        let (mut out, mut before) = (Vec::new(), 0);
        for number in 0..opened.len() {
            out.push(survey(self.folder, self.request, &source, number, self.textures, &mut |n| (self.progress)("measure", before + n, total))?);
            before += opened[number].mesh.triangles().len() as u64;
            opened[number].mesh.release();
        }
        Ok(out)
    }

    fn level<'s>(&'s self, fresh: impl Iterator<Item = &'s Survey>) -> GroundLevel {
        let mut out = GroundLevel::new();
        self.assets.surveys().chain(fresh).for_each(|s| out.merge(&GroundLevel::from_bits(s.facts.level)));
        out
    }

    fn ground(&mut self, level: &GroundLevel) -> Result<Vec<BuildTriangle>> {
        let wanted = match self.request.options.ground_plane {
            GroundPlane::Off => false,
            GroundPlane::On => true,
            GroundPlane::Auto => !level.has_terrain,
        };
        if !wanted || level.bounds.is_empty() {
            return Ok(Vec::new());
        }
        let plane = level.plane(u32::MAX, self.request.ground_id, u32::MAX)?;
        self.report.ground_plane_triangles = plane.len() as u64;
        Ok(plane)
    }

    /// The second pass: what each asset puts into which cell. From then on every asset has a survey.
    fn sum_cells(&mut self, numbers: &[usize], mut surveys: Vec<Survey>, square: Square) -> Result<()> {
        let opened = open_all(&mut self.assets, numbers)?;
        let materials = BuildMaterials::new(&opened, self.textures, self.request.options.merge_materials);
        let source = source(self.request, &opened, &materials);
        let (total, mut before) = (triangles(&opened), 0);
        for (number, survey) in surveys.iter_mut().enumerate() {
            let mut sums = CellSums::default();
            let mut put = |_: u32, t: &BuildTriangle| sums.add(square.number(t), t, materials.hash(t.material));
            let mut uncounted = BuildReport::default();
            if !source.stream(number, |p| p == 0, &mut uncounted, &mut put, &mut |n| (self.progress)("count", before + n, total)) {
                return Err(Error::Interrupted);
            }
            before += opened[number].mesh.triangles().len() as u64;
            opened[number].mesh.release();
            (survey.cells, survey.facts.square) = (sums.finish(), bits(square));
        }
        numbers.iter().zip(surveys).try_for_each(|(k, survey)| self.assets.keep(*k, survey))
    }

    fn tree(&self, square: Square, pinned: &[Cell], ground: &[BuildTriangle]) -> Quadtree {
        let mut tree = Quadtree::new(square, pinned);
        self.assets.surveys().flat_map(|s| &s.cells).for_each(|c| tree.add(c.cell, u64::from(c.count)));
        ground.iter().for_each(|t| tree.add(square.number(t), 1));
        tree.settle();
        tree
    }

    /// How much goes into each sorting cell, and the hash of it.
    fn sorted<'s>(&self, surveys: impl Iterator<Item = &'s Survey>, tree: &Quadtree, ground: &[BuildTriangle]) -> Vec<Sorted> {
        let mut out = vec![Sorted::default(); tree.sorting_cells().len()];
        let mut add = |c: &CellSum| {
            if let Some(home) = tree.home(c.cell) {
                out[home].add(u64::from(c.count), c.value());
            }
        };
        surveys.filter(|s| s.facts.square == bits(tree.square)).flat_map(|s| &s.cells).for_each(&mut add);
        let mut sums = CellSums::default();
        let material = record_hash(&BuildMaterials::ground_record());
        ground.iter().for_each(|t| sums.add(tree.square.number(t), t, material));
        sums.finish().iter().for_each(&mut add);
        out.iter_mut().zip(tree.sorting_cells()).for_each(|(s, cell)| s.settle(BUILD_FORMAT, self.request.options.merge_faces, *cell, tree.square.0));
        out
    }

    /// Chunks of all cells: those on the shelf, and those that are built now.
    fn chunks(&mut self, tree: &Quadtree, now: &[Sorted], before: &[Sorted], ground: &[BuildTriangle]) -> Result<(Vec<ChunkEntry>, Vec<Cell>)> {
        let mut writer = Writer::new(self.folder, self.request, tree, now, before)?;
        let is_needed = |k: &usize| self.assets.survey(*k).is_some_and(|s| s.cells.iter().any(|c| writer.needs(c.cell, self.assets.is_new(*k))));
        let numbers: Vec<usize> = (0..self.assets.len()).filter(is_needed).collect();
        let changed: Vec<bool> = numbers.iter().map(|k| self.assets.is_new(*k)).collect();
        let exchanged = self.exchanged();
        let opened = open_all(&mut self.assets, &numbers)?;
        let mut materials = BuildMaterials::new(&opened, self.textures, self.request.options.merge_materials);
        let ground_material = materials.ground();
        writer.sort(&source(self.request, &opened, &materials), &changed, &mut *self.progress)?;
        let mut plane = ground.iter().map(|t| BuildTriangle { material: ground_material, ..*t });
        plane.try_for_each(|t| writer.push(&t, true))?;
        let written = writer.write(&materials.records, &exchanged, &mut *self.progress)?;
        self.assets.close_all();
        written.iter().for_each(|w| count(&mut self.report, w));
        let mut entries: Vec<ChunkEntry> = written.into_iter().flat_map(|w| w.entries).collect();
        entries.sort_by_key(|e: &ChunkEntry| (e.cell.map(super::cells::morton_key), e.file.clone()));
        let cells: Vec<Cell> = entries.iter().filter_map(|e| e.cell).collect();
        Ok((entries, tree.pin(&cells)))
    }

    /// Objects of assets that changed, came or went, and the ground plane.
    fn exchanged(&self) -> HashSet<u32> {
        let new = (0..self.assets.len()).filter(|k| self.assets.is_new(*k)).filter_map(|k| self.assets.survey(k));
        new.chain(self.assets.former()).flat_map(|s| s.ids.iter().copied()).chain([self.request.ground_id]).collect()
    }

    /// Prototypes and instances, then the index over all.
    fn index(&mut self, square: Square, cells: Vec<Cell>, chunks: Vec<ChunkEntry>) -> Result<SceneIndex> {
        let (entries, records) = self.prototypes()?;
        write_if_changed(&self.folder.join(INSTANCES_FILE), &instances::encode(&records))?;
        let mut bounds = prototypes::placed_bounds(&records, &entries);
        chunks.iter().for_each(|c| bounds.add_box(&c.box3()));
        let files: HashSet<&str> = chunks.iter().chain(&entries).filter_map(|e| e.file.strip_prefix(CHUNKS)?.strip_prefix('/')).collect();
        prune(&self.folder.join(CHUNKS), |name| files.contains(name))?;
        self.sum_up(&records);
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
            options: serde_json::to_value(self.request.options).expect("options are plain data"),
            report: self.stable_counts(),
        })
    }

    /// Entries of all prototypes by file, equal ones once; instances of all assets by object id, then order in the asset.
    fn prototypes(&mut self) -> Result<(Vec<ChunkEntry>, Vec<InstanceRecord>)> {
        let mut files: Vec<&String> = self.assets.surveys().flat_map(|s| &s.facts.prototypes).collect();
        files.sort_unstable();
        files.dedup();
        let mut entries = Vec::new();
        for file in &files {
            let found =
                on_shelf(self.folder, file, None).ok_or_else(|| Error::format(self.folder.join(file), "a chunk that was just there is not"))?;
            count(&mut self.report, &Written { entries: vec![found.entry.clone()], kept: 1, duplicate_faces: 0 });
            entries.push(found.entry);
        }
        let mut records = Vec::new();
        for survey in self.assets.surveys() {
            let numbers: Vec<u32> = survey.facts.prototypes.iter().map(|p| files.binary_search(&p).unwrap_or_default() as u32).collect();
            records.extend(survey.instances.iter().map(|r| InstanceRecord { prototype: numbers[r.prototype as usize], ..*r }));
        }
        records.sort_by_key(|r| r.object_id);
        self.report.prototypes = entries.len() as u64;
        Ok((entries, records))
    }

    fn sum_up(&mut self, records: &[InstanceRecord]) {
        self.report.instances = records.len() as u64;
        self.assets.surveys().for_each(|s| self.report.add(&s.facts.counts));
        if self.request.options.merge_materials {
            let all = || self.assets.surveys().flat_map(|s| &s.facts.materials);
            self.report.merged_materials = (all().count() - all().collect::<HashSet<_>>().len()) as u64;
        }
    }

    /// What is the same in every build of the same assets: not what was kept from an earlier one.
    fn stable_counts(&self) -> std::collections::BTreeMap<String, u64> {
        let mut counts = self.report.counts();
        counts.retain(|name, _| !name.ends_with("_kept"));
        counts
    }
}

/// Surveys an asset but for its cells; its prototypes are written.
fn survey(
    folder: &Path,
    request: &BuildRequest,
    source: &Source,
    number: usize,
    textures: &TextureKeys,
    go_on: &mut dyn FnMut(u64) -> bool,
) -> Result<Survey> {
    let asset = source.assets[number];
    let (mut counts, mut level) = (BuildReport::default(), GroundLevel::new());
    let mut put = |_: u32, t: &BuildTriangle| {
        t.corners.iter().for_each(|c| level.bounds.add_point(metres(*c)));
        level.add(t.rank, metres(t.corners.map(|c| c[2])).into_iter().fold(f64::INFINITY, f64::min));
    };
    if !source.stream(number, |p| p == 0, &mut counts, &mut put, go_on) {
        return Err(Error::Interrupted);
    }
    let collected = prototypes::collect(source, number, &mut counts, go_on).ok_or(Error::Interrupted)?;
    let instances = prototypes::instances(source, number, &collected, &mut counts);
    let mut files = Vec::new();
    for triangles in collected.values() {
        let chunk = prototypes::encode(triangles, source)?;
        let file = format!("{CHUNKS}/p_{:016x}.m3c", chunk.hash);
        write_if_changed(&folder.join(&file), &chunk.bytes)?;
        counts.duplicate_faces += triangles.len() as u64 - chunk.triangles;
        files.push(file);
    }
    if request.options.merge_vertices {
        counts.duplicate_vertices = duplicate_vertices(&asset.mesh, request.origin, request.memory_bytes() / 4);
    }
    counts.materials_without_their_texture = source.materials.without_their_texture[number];
    let known = textures::used_sources(asset).into_iter().map(|s| KnownTexture::new(s.clone(), textures.by_source.get(&s)));
    let (textures, materials) = (known.collect(), source.materials.hashes_of(number));
    let facts = Facts { level: level.to_bits(), counts, textures, materials, prototypes: files, ..Facts::default() };
    Ok(Survey { facts, cells: Vec::new(), instances, ids: asset.ids.clone() })
}

fn open_all<'a>(assets: &'a mut Assets, numbers: &[usize]) -> Result<Vec<&'a Asset>> {
    numbers.iter().try_for_each(|k| assets.open(*k).map(|_| ()))?;
    Ok(numbers.iter().map(|k| assets.get(*k)).collect())
}

fn source<'a>(request: &'a BuildRequest, assets: &'a [&'a Asset], materials: &'a BuildMaterials) -> Source<'a> {
    Source { assets, materials, options: &request.options, origin: request.origin }
}

fn triangles(assets: &[&Asset]) -> u64 {
    assets.iter().map(|a| a.mesh.triangles().len() as u64).sum()
}

fn bits(square: Square) -> [u64; 3] {
    square.0.map(f64::to_bits)
}

fn count(report: &mut BuildReport, written: &Written) {
    report.chunks += written.entries.len() as u64;
    report.chunks_kept += written.kept;
    report.triangles += written.entries.iter().map(|e| e.triangles).sum::<u64>();
    report.duplicate_faces += written.duplicate_faces;
}
