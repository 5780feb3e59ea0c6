//! Measures an asset, and stores the result beside its mesh so that a build need not read the mesh again.

use std::collections::BTreeMap;
use std::path::Path;

use map3d_base::asset::{ADJUSTMENTS_FILE, AssetMesh, DRAPED_FILE, Instance, Materials};
use map3d_base::{Box3, Error, Result, Vec3};
use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_128;

use super::cells::{CellKey, CellsDocument, ContentCells};

pub const CELLS_FILE: &str = "cells.json";
const VERSION: u32 = 1;
/// Triangles between two releases of resident pages.
const PIECE: usize = 1 << 20;

#[derive(Serialize, Deserialize)]
struct File {
    version: u32,
    /// Digest of the measured files.
    digest: String,
    #[serde(flatten)]
    cells: CellsDocument,
}

/// Returns the cells of an asset's folder; measures them unless the folder has them.
pub fn read_or_measure(folder: &Path) -> Result<ContentCells> {
    let path = folder.join(CELLS_FILE);
    let digest = digest(folder)?;
    let known = std::fs::read(&path).ok().and_then(|text| serde_json::from_slice::<File>(&text).ok());
    if let Some(file) = known.filter(|f| f.version == VERSION && f.digest == digest) {
        return Ok(ContentCells::from_document(file.cells));
    }
    let cells = measure_asset(folder)?;
    let text = serde_json::to_vec(&File { version: VERSION, digest, cells: cells.to_document() }).expect("cells are plain data");
    let part = path.with_extension("part");
    std::fs::write(&part, text).and_then(|()| std::fs::rename(&part, &path)).map_err(|e| Error::storage(&path, e))?;
    Ok(cells)
}

/// Measures the triangles of an asset and the boxes of its placed prototypes.
pub fn measure_asset(folder: &Path) -> Result<ContentCells> {
    let mesh = AssetMesh::open(&folder.join("mesh.m3a"))?;
    let mut measure = Measure::default();
    let mut bounds: BTreeMap<u32, Box3> = BTreeMap::new();
    for mesh in mesh.drawn() {
        let (objects, prototypes) = (mesh.objects(), mesh.prototypes());
        for t in 0..mesh.triangles().len() {
            if t % PIECE == PIECE - 1 {
                mesh.release();
            }
            let Some(corners) = mesh.corners(t) else { continue };
            match prototypes[t] {
                0 => measure.add(objects[t], corners),
                k => corners.iter().for_each(|p| bounds.entry(k).or_insert(Box3::EMPTY).add_point(*p)),
            }
        }
        mesh.release();
    }
    for instance in read_instances(folder)? {
        let Some(transform) = mesh.placed(instance.object, &instance.transform) else { continue };
        if let Some(placed) = bounds.get(&instance.prototype) {
            measure.add(instance.object, placed_diagonal(placed, &transform));
        }
    }
    Ok(measure.finish())
}

/// Returns three points that span about the box of a placed prototype.
fn placed_diagonal(bounds: &Box3, transform: &[f64; 12]) -> [Vec3; 3] {
    let moved = |p: Vec3| [0, 1, 2].map(|k| (0..3).map(|i| transform[4 * k + i] * p[i]).sum::<f64>() + transform[4 * k + 3]);
    [moved(bounds.lo), moved(bounds.center()), moved(bounds.hi)]
}

/// The cells, and for each object the cell of the majority of its triangles, by voting.
#[derive(Default)]
struct Measure {
    cells: ContentCells,
    votes: BTreeMap<u32, (CellKey, u64)>,
}

impl Measure {
    fn add(&mut self, object: u32, corners: [Vec3; 3]) {
        let key = self.cells.add(corners);
        let vote = self.votes.entry(object).or_insert((key, 0));
        match (vote.0 == key, vote.1) {
            (true, _) => vote.1 += 1,
            (false, 0) => *vote = (key, 1),
            (false, _) => vote.1 -= 1,
        }
    }

    fn finish(mut self) -> ContentCells {
        for (key, _) in self.votes.values() {
            self.cells.add_object(*key);
        }
        self.cells
    }
}

fn read_instances(folder: &Path) -> Result<Vec<Instance>> {
    let path = folder.join("materials.json");
    let text = std::fs::read_to_string(&path).map_err(|e| Error::storage(&path, e))?;
    let Materials { instances, .. } = serde_json::from_str(&text).map_err(|e| Error::format(&path, e.to_string()))?;
    Ok(instances)
}

/// Hashes the headers of the mesh and of its adjustments, which have their checksums, and the materials, which have the instances.
fn digest(folder: &Path) -> Result<String> {
    let mesh = folder.join("mesh.m3a");
    let mut head = [0; 64];
    let mut file = std::fs::File::open(&mesh).map_err(|e| Error::storage(&mesh, e))?;
    std::io::Read::read_exact(&mut file, &mut head).map_err(|_| Error::format(&mesh, "truncated"))?;
    let materials = folder.join("materials.json");
    let mut hash = XxHash3_128::with_seed(u64::from(VERSION));
    hash.write(&head);
    hash.write(&std::fs::read(&materials).map_err(|e| Error::storage(&materials, e))?);
    adjusted_heads(folder)?.iter().for_each(|head| hash.write(head));
    Ok(format!("{:032x}", hash.finish_128()))
}

/// Returns the headers of the files that adjust an asset, with their checksums; none for an asset that is drawn as imported.
pub fn adjusted_heads(folder: &Path) -> Result<Vec<[u8; 64]>> {
    let mut heads = Vec::new();
    for path in [ADJUSTMENTS_FILE, DRAPED_FILE].map(|name| folder.join(name)) {
        let mut head = [0; 64];
        match std::fs::File::open(&path) {
            Ok(mut file) => std::io::Read::read_exact(&mut file, &mut head).map_err(|_| Error::format(&path, "truncated"))?,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => continue,
            Err(error) => return Err(Error::storage(&path, error)),
        }
        heads.push(head);
    }
    Ok(heads)
}
