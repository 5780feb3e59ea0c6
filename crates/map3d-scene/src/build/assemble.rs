//! Faces of a cell to a chunk's bytes: tree, leaves, tables.

use std::collections::BTreeMap;
use std::path::Path;

use bytemuck::{Zeroable, bytes_of, cast_slice};
use map3d_base::file::{HEADER_BYTES, aligned, checksum, header_start};
use map3d_base::{Error, Result};
use twox_hash::XxHash3_128;

use super::files;
use super::grid::{chunk_origin, extent_m};
use super::spill::Face;
use crate::bvh::{self, Aabb, Tree};
use crate::index::{Cell, ChunkEntry};
use crate::lattice::{EXACT_REACH_M, Point, STEPS_PER_M, metres};
use crate::records::{CHUNK_MAGIC, ChunkHeader, ChunkObject, CornerNormals, EMPTY, FLAG_CUTOUT, FLAG_NORMALS, Leaf, MaterialRecord, TriangleRecord, VERSION};

/// Writes the chunk of a cell; without faces there is no file and the entry has no triangles.
pub fn write_chunk(scene: &Path, file: &str, cell: Option<Cell>, faces: &[Face], materials: &[MaterialRecord]) -> Result<ChunkEntry> {
    let Some((bytes, entry)) = encode(faces, materials)? else {
        return Ok(ChunkEntry { file: file.into(), cell, origin: [0.0; 3], bounds: [[0.0; 3]; 2], triangles: 0, bytes: 0, hash: String::new() });
    };
    files::replace(&scene.join(file), &bytes)?;
    Ok(ChunkEntry { file: file.into(), cell, ..entry })
}

/// The bytes of a chunk and its entry in the index (file and cell are the caller's); `None` without faces.
pub fn encode(faces: &[Face], materials: &[MaterialRecord]) -> Result<Option<(Vec<u8>, ChunkEntry)>> {
    if faces.is_empty() {
        return Ok(None);
    }
    let draft = Draft::new(faces, materials)?;
    let bytes = draft.bytes();
    let stored = u64::from_le_bytes(bytes[8..16].try_into().expect("8 bytes"));
    let entry = ChunkEntry {
        file: String::new(),
        cell: None,
        origin: metres(draft.origin),
        bounds: [metres(draft.lo), metres(draft.hi)],
        triangles: faces.len() as u64,
        bytes: bytes.len() as u64,
        hash: format!("{stored:016x}"),
    };
    Ok(Some((bytes, entry)))
}

/// Everything of a chunk, relative to its origin, triangles in the order of the tree's leaves.
struct Draft<'a> {
    faces: &'a [Face],
    origin: Point,
    lo: Point,
    hi: Point,
    tree: Tree,
    /// Numbers in the chunk's own table, by the scene's.
    material: BTreeMap<u32, u32>,
    materials: Vec<MaterialRecord>,
    /// By id.
    object: BTreeMap<u32, u32>,
    objects: Vec<ChunkObject>,
}

impl<'a> Draft<'a> {
    fn new(faces: &'a [Face], palette: &[MaterialRecord]) -> Result<Self> {
        let (lo, hi) = extent(faces);
        let origin = chunk_origin(lo, hi);
        if extent_m(lo, hi) / 2.0 >= EXACT_REACH_M {
            let what = format!("geometry spans {:.0} m in one cell, expected at most {:.0} m", extent_m(lo, hi), 2.0 * EXACT_REACH_M);
            return Err(Error::Argument(what));
        }
        let boxes: Vec<Aabb> = faces.iter().map(|f| Aabb::of_points(&f.corners.map(|c| relative(c, origin)))).collect();
        let used: BTreeMap<u32, u32> = numbered(faces.iter().map(|f| f.material));
        let objects = numbered(faces.iter().map(|f| f.object));
        let mut draft = Self {
            faces,
            origin,
            lo,
            hi,
            tree: bvh::build(&boxes),
            materials: used.keys().map(|m| palette[*m as usize]).collect(),
            material: used,
            objects: Vec::new(),
            object: objects,
        };
        draft.objects = draft.object_records();
        Ok(draft)
    }

    /// Boxes and content hashes: over corners, texture coordinates, normals, ranks and materials of the object's faces, in the asset's order.
    fn object_records(&self) -> Vec<ChunkObject> {
        let mut hashes: Vec<XxHash3_128> = self.object.iter().map(|_| XxHash3_128::with_seed(0)).collect();
        let mut records: Vec<ChunkObject> = self.object.keys().map(|id| ChunkObject { id: *id, rank: u32::MAX, ..ChunkObject::zeroed() }).collect();
        let mut boxes = vec![Aabb::EMPTY; records.len()];
        for face in self.faces {
            let k = self.object[&face.object] as usize;
            let plain = Face { material: 0, object: 0, ..*face };
            hashes[k].write(bytes_of(&plain));
            hashes[k].write(bytes_of(&self.materials[self.material[&face.material] as usize]));
            boxes[k].add(&Aabb::of_points(&face.corners.map(|c| relative(c, self.origin))));
            if records[k].rank == u32::MAX {
                records[k].rank = u32::from(face.rank);
            }
        }
        for ((record, hash), bounds) in records.iter_mut().zip(hashes).zip(boxes) {
            let value = hash.finish_128();
            record.content = [value as u64, (value >> 64) as u64];
            record.bounds = bounds.six();
        }
        records
    }

    fn leaves(&self) -> Vec<Leaf> {
        let leaf = |(from, to): &(u32, u32)| {
            let mut leaf = Leaf { corners: [[f32::NAN; 8]; 9], triangle: [EMPTY; 8] };
            for (lane, place) in (*from..*to).enumerate() {
                let face = &self.faces[self.tree.order[place as usize] as usize];
                leaf.triangle[lane] = place;
                for (corner, point) in face.corners.iter().enumerate() {
                    let p = relative(*point, self.origin);
                    (0..3).for_each(|k| leaf.corners[3 * corner + k][lane] = p[k]);
                }
            }
            leaf
        };
        self.tree.leaves.iter().map(leaf).collect()
    }

    fn triangles(&self) -> Vec<TriangleRecord> {
        let record = |face: &Face| TriangleRecord {
            uv: face.uv,
            material: self.material[&face.material],
            object: self.object[&face.object],
            source: face.source,
            rank: face.rank,
            padding: [0; 3],
            reserved: [0; 2],
        };
        self.tree.order.iter().map(|k| record(&self.faces[*k as usize])).collect()
    }

    /// Empty when no face has any.
    fn normals(&self) -> Vec<CornerNormals> {
        match self.faces.iter().any(|f| f.has_normals != 0) {
            true => self.tree.order.iter().map(|k| self.faces[*k as usize].normals).collect(),
            false => Vec::new(),
        }
    }

    fn bytes(&self) -> Vec<u8> {
        let (leaves, triangles, normals) = (self.leaves(), self.triangles(), self.normals());
        let cutout = self.materials.iter().any(MaterialRecord::is_cutout);
        let bounds = Aabb::of_points(&[relative(self.lo, self.origin), relative(self.hi, self.origin)]).six();
        let mut header = ChunkHeader {
            magic: *CHUNK_MAGIC,
            version: VERSION,
            checksum: 0,
            origin: metres(self.origin),
            bounds,
            nodes: self.tree.nodes.len() as u32,
            leaves: leaves.len() as u32,
            triangles: triangles.len() as u32,
            objects: self.objects.len() as u32,
            materials: self.materials.len() as u32,
            flags: if normals.is_empty() { 0 } else { FLAG_NORMALS } | if cutout { FLAG_CUTOUT } else { 0 },
            padding: [0; 40],
        };
        let mut out = bytes_of(&header).to_vec();
        for section in [
            cast_slice::<_, u8>(&self.tree.nodes),
            cast_slice(&leaves),
            cast_slice(&triangles),
            cast_slice(&normals),
            cast_slice(&self.materials),
            cast_slice(&self.objects),
        ] {
            out.extend_from_slice(section);
            out.resize(aligned(out.len()), 0);
        }
        header.checksum = checksum(&out[HEADER_BYTES..]);
        out[..16].copy_from_slice(&header_start(CHUNK_MAGIC, VERSION, header.checksum));
        out
    }
}

fn extent(faces: &[Face]) -> (Point, Point) {
    let mut lo = [i64::MAX; 3];
    let mut hi = [i64::MIN; 3];
    for corner in faces.iter().flat_map(|f| f.corners) {
        for k in 0..3 {
            lo[k] = lo[k].min(corner[k]);
            hi[k] = hi[k].max(corner[k]);
        }
    }
    (lo, hi)
}

/// Metres from the origin; exact within the lattice's reach.
fn relative(p: Point, origin: Point) -> [f32; 3] {
    [0, 1, 2].map(|k| ((p[k] - origin[k]) as f64 / STEPS_PER_M) as f32)
}

/// Distinct values in ascending order, numbered.
fn numbered(values: impl Iterator<Item = u32>) -> BTreeMap<u32, u32> {
    let mut out: BTreeMap<u32, u32> = values.map(|v| (v, 0)).collect();
    out.values_mut().enumerate().for_each(|(k, v)| *v = k as u32);
    out
}

