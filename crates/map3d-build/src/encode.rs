//! Encodes the triangles of a cell or prototype as a chunk file.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use bytemuck::Zeroable;
use map3d_base::file::{self, HEADER_BYTES, aligned};
use map3d_base::{Error, Result, Vec3};
use map3d_scene::bvh::{self, Aabb, Tree};
use map3d_scene::lattice::{Point, STEPS_PER_M, metres};
use map3d_scene::records::{CHUNK_MAGIC, ChunkHeader, ChunkObject, EMPTY, FLAG_CUTOUT, FLAG_NORMALS, Leaf, MaterialRecord, TriangleRecord, VERSION};
use twox_hash::XxHash3_128;

use crate::triangle::BuildTriangle;

/// The bytes of a chunk file and its values in the scene index.
#[derive(Clone, Debug)]
pub struct ChunkFile {
    pub bytes: Vec<u8>,
    pub origin: Vec3,
    /// In the frame of `origin`'s coordinates (local; a prototype's: its own).
    pub bounds: [Vec3; 2],
    pub triangles: u64,
    pub hash: u64,
}

/// The input of a chunk, as its header states it: a hash, and the number of chunks built from the same input.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChunkInput {
    pub hash: [u64; 2],
    pub parts: u32,
}

/// Encodes at least one triangle; `origin` is a lattice point at most 4,096 m from all corners, `materials` are the build's.
/// The bytes depend neither on the order of the triangles nor on the build's numbers of materials and assets.
pub fn encode_chunk(
    mut triangles: Vec<BuildTriangle>,
    origin: Point,
    materials: &[MaterialRecord],
    merge_faces: bool,
    input: ChunkInput,
) -> Result<ChunkFile> {
    triangles.sort_by_key(|t| (t.object_id, t.asset, t.source, t.corners));
    if merge_faces {
        drop_duplicates(&mut triangles);
    }
    let positions = positions(&triangles, origin)?;
    let boxes: Vec<Aabb> = positions.iter().map(|p| Aabb::of_points(p)).collect();
    let tree = bvh::build(&boxes);
    let objects = Objects::of_triangles(&triangles, &boxes, materials);
    let used = used_materials(&triangles, materials);
    let mut body = Body { header: header(origin, &tree, &boxes), bytes: Vec::new() };
    (body.header.input, body.header.parts) = (input.hash, input.parts);
    body.geometry(&tree, &positions);
    body.records(&tree, &triangles, &objects, &used);
    body.normals(&tree, &triangles);
    body.tables(&objects, &used);
    Ok(body.finish())
}

/// Keeps the first of the faces with the same object, material and corners.
fn drop_duplicates(triangles: &mut Vec<BuildTriangle>) {
    let mut seen = HashSet::with_capacity(triangles.len());
    triangles.retain(|t| {
        let mut corners = t.corners;
        corners.sort_unstable();
        seen.insert((t.object_id, t.material, corners))
    });
}

/// Corners relative to the origin, exact in float32.
fn positions(triangles: &[BuildTriangle], origin: Point) -> Result<Vec<[[f32; 3]; 3]>> {
    const REACH: u64 = 1 << 24;
    let relative = |p: Point| [0, 1, 2].map(|k| p[k] - origin[k]);
    if let Some(t) = triangles.iter().find(|t| t.corners.iter().any(|c| relative(*c).iter().any(|v| v.unsigned_abs() > REACH))) {
        let what = format!("triangle {} of asset {} lies more than 4,096 m from its chunk's origin", t.source, t.asset);
        return Err(Error::argument(what));
    }
    let place = |c: Point| relative(c).map(|v| v as f32 / STEPS_PER_M as f32);
    Ok(triangles.iter().map(|t| t.corners.map(place)).collect())
}

/// Materials of the build that the chunk uses, in the order of their records, and their numbers in the chunk.
struct UsedMaterials {
    records: Vec<MaterialRecord>,
    numbers: HashMap<u32, u32>,
}

fn used_materials(triangles: &[BuildTriangle], materials: &[MaterialRecord]) -> UsedMaterials {
    let used: BTreeSet<u32> = triangles.iter().map(|t| t.material).collect();
    let mut used: Vec<u32> = used.into_iter().collect();
    used.sort_by_key(|number| materials[*number as usize]);
    UsedMaterials { records: used.iter().map(|n| materials[*n as usize]).collect(), numbers: used.into_iter().zip(0..).collect() }
}

fn header(origin: Point, tree: &Tree, boxes: &[Aabb]) -> ChunkHeader {
    let mut bounds = Aabb::EMPTY;
    boxes.iter().for_each(|b| bounds.add(b));
    ChunkHeader {
        magic: *CHUNK_MAGIC,
        version: VERSION,
        origin: metres(origin),
        bounds: bounds.to_array(),
        nodes: tree.nodes.len() as u32,
        leaves: tree.leaves.len() as u32,
        triangles: tree.order.len() as u32,
        ..ChunkHeader::zeroed()
    }
}

/// Objects by id, and their records.
struct Objects {
    numbers: BTreeMap<u32, u32>,
    records: Vec<ChunkObject>,
}

impl Objects {
    /// `triangles` are sorted by object.
    fn of_triangles(triangles: &[BuildTriangle], boxes: &[Aabb], materials: &[MaterialRecord]) -> Self {
        let (mut numbers, mut records) = (BTreeMap::new(), Vec::new());
        let mut start = 0;
        for group in triangles.chunk_by(|a, b| a.object_id == b.object_id) {
            let mut bounds = Aabb::EMPTY;
            boxes[start..start + group.len()].iter().for_each(|b| bounds.add(b));
            start += group.len();
            numbers.insert(group[0].object_id, records.len() as u32);
            records.push(ChunkObject {
                id: group[0].object_id,
                rank: u32::from(group[0].rank),
                bounds: bounds.to_array(),
                content: content_hash(group, materials),
                reserved: [0; 2],
            });
        }
        Self { numbers, records }
    }
}

/// Hashes everything visible of the triangles; independent of chunk and file.
pub(crate) fn content_hash(triangles: &[BuildTriangle], materials: &[MaterialRecord]) -> [u64; 2] {
    let mut hash = XxHash3_128::with_seed(0);
    for t in triangles {
        hash.write(bytemuck::bytes_of(&t.corners));
        hash.write(bytemuck::bytes_of(&t.uv));
        hash.write(bytemuck::bytes_of(&t.normals));
        hash.write(&[t.rank]);
        hash.write(&t.source.to_le_bytes());
        hash.write(bytemuck::bytes_of(&materials[t.material as usize]));
    }
    let value = hash.finish_128();
    [value as u64, (value >> 64) as u64]
}

struct Body {
    header: ChunkHeader,
    bytes: Vec<u8>,
}

impl Body {
    fn geometry(&mut self, tree: &Tree, positions: &[[[f32; 3]; 3]]) {
        self.bytes.extend_from_slice(bytemuck::cast_slice(&tree.nodes));
        for (start, end) in &tree.leaves {
            let mut leaf = Leaf { corners: [[f32::NAN; 8]; 9], triangle: [EMPTY; 8] };
            for (lane, number) in (*start..*end).enumerate() {
                let corners = &positions[tree.order[number as usize] as usize];
                (0..9).for_each(|c| leaf.corners[c][lane] = corners[c / 3][c % 3]);
                leaf.triangle[lane] = number;
            }
            self.bytes.extend_from_slice(bytemuck::bytes_of(&leaf));
        }
    }

    /// Triangles in the order of the leaves.
    fn records(&mut self, tree: &Tree, triangles: &[BuildTriangle], objects: &Objects, used: &UsedMaterials) {
        for number in &tree.order {
            let t = &triangles[*number as usize];
            self.bytes.extend_from_slice(bytemuck::bytes_of(&TriangleRecord {
                uv: t.uv,
                material: used.numbers[&t.material],
                object: objects.numbers[&t.object_id],
                source: t.source,
                rank: t.rank,
                padding: [0; 3],
                reserved: [0; 2],
            }));
        }
        self.pad();
    }

    fn normals(&mut self, tree: &Tree, triangles: &[BuildTriangle]) {
        if !triangles.iter().any(BuildTriangle::has_normals) {
            return;
        }
        self.header.flags |= FLAG_NORMALS;
        for number in &tree.order {
            self.bytes.extend_from_slice(bytemuck::bytes_of(&triangles[*number as usize].normals));
        }
        self.pad();
    }

    fn tables(&mut self, objects: &Objects, used: &UsedMaterials) {
        for material in &used.records {
            self.header.flags |= if material.is_cutout() { FLAG_CUTOUT } else { 0 };
            self.bytes.extend_from_slice(bytemuck::bytes_of(material));
        }
        self.bytes.extend_from_slice(bytemuck::cast_slice(&objects.records));
        self.header.materials = used.records.len() as u32;
        self.header.objects = objects.records.len() as u32;
    }

    fn pad(&mut self) {
        self.bytes.resize(aligned(self.bytes.len()), 0);
    }

    fn finish(mut self) -> ChunkFile {
        let mut bytes = bytemuck::bytes_of(&self.header).to_vec();
        bytes.append(&mut self.bytes);
        let hash = file::checksum(&bytes[HEADER_BYTES..]);
        self.header.checksum = hash;
        bytes[8..16].copy_from_slice(&hash.to_le_bytes());
        let header = &self.header;
        ChunkFile { origin: header.origin, bounds: header.placed_bounds(), triangles: u64::from(header.triangles), hash, bytes }
    }
}
