//! Triangles of the assets as faces: on the lattice, without the degenerate, long edges split, sorted into cells.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use map3d_base::vec3::sub;
use map3d_base::{Error, Result, Vec3};

use super::grid::{Census, Grid};
use super::source::SourceAsset;
use super::spill::{Face, Spill, Spiller};
use super::{Ask, BuildReport, BuildRequest, GroundPlane, ground};
use crate::index::{self, Cell, SceneIndex};
use crate::lattice::{Point, has_no_area, is_long, midpoint, snap};
use crate::records::MaterialRecord;

const DEFAULT_MEMORY_BYTES: u64 = 1 << 30;
/// Triangles between two looks at the progress.
const STRIDE: usize = 1 << 16;

pub struct Gathering<'a> {
    pub folder: &'a Path,
    pub request: &'a BuildRequest,
    pub assets: &'a [SourceAsset],
    /// Materials of each asset.
    pub tables: &'a [Vec<MaterialRecord>],
    pub ask: Ask<'a>,
}

/// What stands where it is, by cell.
pub struct Placed {
    pub grid: Grid,
    pub spills: Vec<(Cell, Spill)>,
}

/// Extent of the placed faces on the lattice, and whether there is terrain among them.
pub struct Extent {
    pub lo: Point,
    pub hi: Point,
    pub has_terrain: bool,
}

impl Extent {
    fn add(&mut self, face: &Face) {
        for corner in &face.corners {
            for k in 0..3 {
                self.lo[k] = self.lo[k].min(corner[k]);
                self.hi[k] = self.hi[k].max(corner[k]);
            }
        }
        self.has_terrain |= face.rank == 0;
    }

    pub fn is_empty(&self) -> bool {
        self.lo[0] > self.hi[0]
    }
}

/// All materials of a scene, and where those of each asset are among them.
pub struct Palette {
    pub records: Arc<[MaterialRecord]>,
    pub number: Vec<Vec<u32>>,
    pub ground: u32,
}

impl Gathering<'_> {
    /// Everything that stands where it is, and the ground plane.
    pub fn placed(&self, report: &mut BuildReport) -> Result<Placed> {
        let palette = self.palette(report);
        let mut extent = Extent { lo: [i64::MAX; 3], hi: [i64::MIN; 3], has_terrain: false };
        let mut census = Census::default();
        self.each_placed("survey", &palette, &mut BuildReport::default(), &mut |face| {
            extent.add(&face);
            census.add(face.corners);
            Ok(())
        })?;
        let plane = self.ground(&extent, &palette)?;
        plane.iter().for_each(|face| census.add(face.corners));
        let grid = Grid::plan(&census, self.pinned()?.as_ref().map(|i| (i.square, i.cells.as_slice())));
        let memory = if self.request.max_memory_bytes == 0 { DEFAULT_MEMORY_BYTES } else { self.request.max_memory_bytes };
        let mut spiller = Spiller::create(self.folder, memory / 4)?;
        self.each_placed("gather", &palette, report, &mut |face| spiller.push(grid.cell_of(face.corners), face))?;
        report.add("ground plane triangles", plane.len() as u64);
        plane.into_iter().try_for_each(|face| spiller.push(grid.cell_of(face.corners), face))?;
        let spills = spiller.finish(&palette.records)?;
        Ok(Placed { grid, spills })
    }

    /// Faces of each prototype of an asset, in its own frame.
    pub fn prototype_faces(&self, number: usize, palette: &Palette, report: &mut BuildReport) -> Result<BTreeMap<u32, Vec<Face>>> {
        let mut found: BTreeMap<u32, Vec<Face>> = BTreeMap::new();
        let prototypes = self.assets[number].mesh.prototypes();
        for (t, prototype) in prototypes.iter().enumerate().filter(|(_, p)| **p > 0) {
            let into = found.entry(*prototype).or_default();
            self.faces_of(number, t, [0.0; 3], palette, report, &mut |face| {
                into.push(face);
                Ok(())
            })?;
        }
        Ok(found)
    }

    /// Equal materials are one, unless they are to stay apart.
    pub fn palette(&self, report: &mut BuildReport) -> Palette {
        let merge = self.request.options.merge_materials;
        let mut known: BTreeMap<MaterialRecord, u32> = BTreeMap::new();
        let mut records = Vec::new();
        let mut put = |record: MaterialRecord, merge: bool| {
            let fresh = records.len() as u32;
            let number = if merge { *known.entry(record).or_insert(fresh) } else { fresh };
            if number == fresh {
                records.push(record);
            }
            number
        };
        let number: Vec<Vec<u32>> = self.tables.iter().map(|table| table.iter().map(|r| put(*r, merge)).collect()).collect();
        let ground = put(ground::material(), false);
        let total: usize = self.tables.iter().map(Vec::len).sum();
        report.add("materials merged", (total + 1 - records.len()) as u64);
        Palette { records: records.into(), number, ground }
    }

    fn pinned(&self) -> Result<Option<SceneIndex>> {
        match self.folder.join(index::FILE).exists() {
            true => SceneIndex::read(self.folder).map(|i| (i.origin == self.request.origin).then_some(i)),
            false => Ok(None),
        }
    }

    fn ground(&self, extent: &Extent, palette: &Palette) -> Result<Vec<Face>> {
        let wanted = match self.request.options.ground_plane {
            GroundPlane::On => true,
            GroundPlane::Off => false,
            GroundPlane::Auto => !extent.has_terrain,
        };
        if !wanted || extent.is_empty() {
            return Ok(Vec::new());
        }
        match self.request.ground_id {
            0 => Err(Error::argument("request: ground_id is 0, but a ground plane is to be made")),
            id => Ok(ground::plane(extent, palette.ground, id)),
        }
    }

    fn each_placed(&self, stage: &str, palette: &Palette, report: &mut BuildReport, emit: &mut dyn FnMut(Face) -> Result<()>) -> Result<()> {
        let total: u64 = self.assets.iter().map(|a| a.mesh.triangles().len() as u64).sum();
        let mut done = 0;
        for (number, asset) in self.assets.iter().enumerate() {
            if self.request.options.merge_vertices {
                report.add("duplicate vertices merged", duplicate_vertices(asset.mesh.positions(), self.request.origin));
            }
            for (t, prototype) in asset.mesh.prototypes().iter().enumerate() {
                if *prototype == 0 {
                    self.faces_of(number, t, self.request.origin, palette, report, emit)?;
                }
                done += 1;
                if done % STRIDE as u64 == 0 && !(self.ask)(stage, done, total) {
                    return Err(Error::Interrupted);
                }
            }
        }
        if (self.ask)(stage, total, total) { Ok(()) } else { Err(Error::Interrupted) }
    }

    /// One triangle: dropped, kept, or split into several.
    fn faces_of(
        &self,
        number: usize,
        t: usize,
        origin: Vec3,
        palette: &Palette,
        report: &mut BuildReport,
        emit: &mut dyn FnMut(Face) -> Result<()>,
    ) -> Result<()> {
        let mesh = &self.assets[number].mesh;
        let material = palette.number[number][mesh.materials()[t] as usize];
        if self.request.options.drop_untextured && !palette.records[material as usize].is_textured() {
            report.add("untextured faces removed", 1);
            return Ok(());
        }
        let corners = mesh.triangles()[t].map(|v| snap(sub(mesh.positions()[v as usize], origin)));
        if self.request.options.drop_degenerate && has_no_area(corners) {
            report.add("degenerate triangles removed", 1);
            return Ok(());
        }
        let normals = mesh.normals().get(t).filter(|n| n.as_flattened().iter().any(|v| *v != 0.0));
        let face = Face {
            corners,
            uv: mesh.uvs()[t],
            material,
            object: self.assets[number].ids[mesh.objects()[t] as usize],
            source: t as u32,
            rank: mesh.ranks()[t],
            has_normals: u8::from(normals.is_some()),
            padding: [0; 2],
            normals: normals.map_or([[0; 3]; 3], |n| n.map(|c| c.map(|v| (v.clamp(-1.0, 1.0) * 32767.0).round() as i16))),
            padding_2: [0; 6],
        };
        split(face, report, emit)
    }
}

/// Splits edges that are too long at their midpoints, the longest first; a neighbour splits a shared edge alike.
fn split(face: Face, report: &mut BuildReport, emit: &mut dyn FnMut(Face) -> Result<()>) -> Result<()> {
    let length = |k: usize| -> i128 { (0..3).map(|a| i128::from(face.corners[k][a] - face.corners[(k + 1) % 3][a]).pow(2)).sum() };
    let longest = (0..3).max_by_key(|k| length(*k)).expect("three edges");
    let (a, b) = (longest, (longest + 1) % 3);
    if !is_long(face.corners[a], face.corners[b]) {
        return emit(face);
    }
    report.add("long edges split", 1);
    let (mut first, mut second) = (face, face);
    let middle = midpoint(face.corners[a], face.corners[b]);
    let uv = [0, 1].map(|k| (face.uv[a][k] + face.uv[b][k]) / 2.0);
    let normal = [0, 1, 2].map(|k| ((i32::from(face.normals[a][k]) + i32::from(face.normals[b][k])) / 2) as i16);
    for (half, corner) in [(&mut first, b), (&mut second, a)] {
        half.corners[corner] = middle;
        half.uv[corner] = uv;
        half.normals[corner] = normal;
    }
    split(first, report, emit)?;
    split(second, report, emit)
}

/// Vertices that lie where another one of the same window of four million lies; windows keep the memory bounded.
fn duplicate_vertices(positions: &[Vec3], origin: Vec3) -> u64 {
    let duplicates = |window: &[Vec3]| {
        let mut points: Vec<Point> = window.iter().map(|p| snap(sub(*p, origin))).collect();
        points.sort_unstable();
        let before = points.len();
        points.dedup();
        (before - points.len()) as u64
    };
    positions.chunks(1 << 22).map(duplicates).sum()
}
