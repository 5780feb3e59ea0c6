//! The records of chunk and instance files as on disk (spec/scene.md): little-endian, plain data.

use bytemuck::{Pod, Zeroable};
use map3d_base::asset::Wrap;

pub const CHUNK_MAGIC: &[u8; 4] = b"M3DC";
pub const INSTANCES_MAGIC: &[u8; 4] = b"M3DI";
pub const VERSION: u32 = 1;

/// `Node::child` of a slot without a child.
pub const EMPTY: u32 = u32::MAX;
/// Set in `Node::child` when the child is a leaf; the other bits are its number.
pub const LEAF_BIT: u32 = 1 << 31;
/// Chunk header flags.
pub const FLAG_NORMALS: u32 = 1;
pub const FLAG_CUTOUT: u32 = 2;
/// `MaterialRecord::flags`.
pub const MATERIAL_TEXTURED: u8 = 1;
pub const MATERIAL_CUTOUT: u8 = 2;

/// The first 128 bytes of a chunk; the checksum covers what follows byte 64.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct ChunkHeader {
    pub magic: [u8; 4],
    pub version: u32,
    pub checksum: u64,
    /// Local to the scene (a prototype's: in its own frame); on the lattice.
    pub origin: [f64; 3],
    /// min x, y, z, max x, y, z, relative to `origin`.
    pub bounds: [f32; 6],
    pub nodes: u32,
    pub leaves: u32,
    pub triangles: u32,
    pub objects: u32,
    pub materials: u32,
    pub flags: u32,
    /// Hash of the sorting cell's content; zeros in a prototype.
    pub input: [u64; 2],
    /// Chunks of the same sorting cell.
    pub parts: u32,
    pub padding: [u8; 20],
}

impl ChunkHeader {
    /// Returns the box in the frame of `origin`'s coordinates.
    pub fn placed_bounds(&self) -> [[f64; 3]; 2] {
        let (o, b) = (self.origin, self.bounds.map(f64::from));
        let corner = |k: usize| [o[0] + b[k], o[1] + b[k + 1], o[2] + b[k + 2]];
        [corner(0), corner(3)]
    }
}

/// Eight children with their boxes, relative to the chunk's origin.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct Node {
    /// min x, y, z, max x, y, z, each of eight children; an empty child's box is inverted (+inf, -inf).
    pub bounds: [[f32; 8]; 6],
    pub child: [u32; 8],
    pub padding: [u32; 8],
}

/// One to eight triangles.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct Leaf {
    /// x, y, z of corner 0, 1, 2, each of eight triangles, relative to the chunk's origin; NaN when unused.
    pub corners: [[f32; 8]; 9],
    /// Number in `Chunk::triangles`, `EMPTY` when unused; used ones come first.
    pub triangle: [u32; 8],
}

#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TriangleRecord {
    /// u right, v up, per corner.
    pub uv: [[f32; 2]; 3],
    /// Index into `Chunk::materials`.
    pub material: u32,
    /// Index into `Chunk::objects`.
    pub object: u32,
    /// Number among its object's triangles in the asset (a prototype's: among the prototype's): settles ties.
    pub source: u32,
    pub rank: u8,
    pub padding: [u8; 3],
    pub reserved: [u32; 2],
}

/// Normals of a triangle's corners × 32767; zeros where the source gave none.
pub type CornerNormals = [[i16; 3]; 3];

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Pod, Zeroable)]
#[repr(C)]
pub struct MaterialRecord {
    /// sRGB and opacity.
    pub diffuse: [u8; 4],
    pub border: [u8; 4],
    /// Code of `WRAP_MODES`.
    pub wrap: u8,
    pub flags: u8,
    pub padding: [u8; 6],
    /// Key of the `.m3t` file; zeros when untextured.
    pub texture: [u8; 16],
    pub reserved: [u8; 32],
}

impl MaterialRecord {
    /// Returns the wrap mode; `Wrap::Wrap` for an unknown code.
    pub fn wrap_mode(&self) -> Wrap {
        Wrap::from_code(self.wrap).unwrap_or_default()
    }

    pub fn is_textured(&self) -> bool {
        self.flags & MATERIAL_TEXTURED != 0
    }

    /// Returns the key of the `.m3t` file; `None` when untextured.
    pub fn texture_key(&self) -> Option<[u8; 16]> {
        self.is_textured().then_some(self.texture)
    }

    pub fn is_cutout(&self) -> bool {
        self.flags & MATERIAL_CUTOUT != 0
    }
}

/// An object's part of a chunk.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ChunkObject {
    pub id: u32,
    /// Rank of its first triangle.
    pub rank: u32,
    /// min x, y, z, max x, y, z, relative to the chunk's origin.
    pub bounds: [f32; 6],
    /// Hash of geometry, materials and texture keys, independent of the chunk's other content.
    pub content: [u64; 2],
    pub reserved: [u64; 2],
}

#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct InstanceRecord {
    /// Index into the scene index's prototypes.
    pub prototype: u32,
    pub object_id: u32,
    /// Row-major 3 × 4, prototype → local.
    pub transform: [f64; 12],
    pub content: [u64; 2],
    pub reserved: u64,
}

const _: () = assert!(size_of::<ChunkHeader>() == 128);
const _: () = assert!(size_of::<Node>() == 256);
const _: () = assert!(size_of::<Leaf>() == 320);
const _: () = assert!(size_of::<TriangleRecord>() == 48);
const _: () = assert!(size_of::<MaterialRecord>() == 64);
const _: () = assert!(size_of::<ChunkObject>() == 64);
const _: () = assert!(size_of::<InstanceRecord>() == 128);
