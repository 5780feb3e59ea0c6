//! Maps `mesh.m3a` (spec/scene.md), with the adjustments beside it.

use std::path::{Path, PathBuf};

use memmap2::Mmap;

use super::Adjustments;
use crate::error::{Error, Result};
use crate::file::{self, HEADER_BYTES, aligned};
use crate::vec3::Vec3;

pub const MESH_MAGIC: &[u8; 4] = b"M3DA";
pub const MESH_VERSION: u32 = 1;
pub(super) const FLAG_NORMALS: u32 = 1;
pub(super) const SECTIONS: [&str; 8] = ["positions", "triangles", "uvs", "normals", "material", "object", "rank", "prototype"];

/// The mesh of objects that are draped over the ground, beside that of their asset.
pub const DRAPED_FILE: &str = "draped.m3a";

/// A mapped asset mesh; every vertex index is in range. Its arrays are as imported, `corners` and `placed` as drawn.
pub struct AssetMesh {
    path: PathBuf,
    map: Mmap,
    vertices: usize,
    triangles: usize,
    /// Byte offset of each of `SECTIONS`; `normals` may be absent.
    offsets: [Option<usize>; 8],
    adjustments: Option<Adjustments>,
    draped: Option<Box<Self>>,
}

impl AssetMesh {
    /// Maps and validates a `mesh.m3a`, including its checksum, and reads the adjustments beside it.
    pub fn open(path: &Path) -> Result<Self> {
        let mut mesh = Self::open_alone(path)?;
        if let Some(folder) = path.parent() {
            mesh.adjustments = Adjustments::read(folder)?;
            let draped = folder.join(DRAPED_FILE);
            mesh.draped = draped.exists().then(|| Self::open_alone(&draped).map(Box::new)).transpose()?;
        }
        Ok(mesh)
    }

    fn open_alone(path: &Path) -> Result<Self> {
        let map = file::map(path)?;
        file::check_mapped(path, &map, MESH_MAGIC, MESH_VERSION)?;
        let count = |at: usize| usize::try_from(u64::from_le_bytes(map[at..at + 8].try_into().expect("8 bytes")));
        let (Ok(vertices), Ok(triangles)) = (count(16), count(24)) else {
            return Err(Error::format(path, "counts are too large"));
        };
        let flags = u32::from_le_bytes(map[32..36].try_into().expect("4 bytes"));
        let sizes = [24, 12, 24, 36, 4, 4, 1, 4];
        let mut offsets = [None; 8];
        let mut at = HEADER_BYTES;
        for (k, size) in sizes.into_iter().enumerate() {
            if k == 3 && flags & FLAG_NORMALS == 0 {
                continue;
            }
            let n = if k == 0 { vertices } else { triangles };
            let bytes = n.checked_mul(size).filter(|b| *b <= map.len()).ok_or_else(|| Error::format(path, "truncated"))?;
            offsets[k] = Some(at);
            at += aligned(bytes);
        }
        if at != map.len() {
            return Err(Error::format(path, format!("{} bytes, expected {at}", map.len())));
        }
        let mesh = Self { path: path.to_path_buf(), map, vertices, triangles, offsets, adjustments: None, draped: None };
        mesh.validate()?;
        Ok(mesh)
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn adjustments(&self) -> Option<&Adjustments> {
        self.adjustments.as_ref()
    }

    /// Returns the meshes that are drawn: this one and, if objects are draped over the ground, the one that stands for them.
    pub fn drawn(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(self.draped.as_deref())
    }

    /// Returns the corners of a triangle as drawn, those of a prototype in its own frame; `None` if its object is left out.
    pub fn corners(&self, t: usize) -> Option<[Vec3; 3]> {
        let corners = self.triangles()[t].map(|v| self.positions()[v as usize]);
        let Some(adjustments) = self.adjustments.as_ref().filter(|_| self.prototypes()[t] == 0) else { return Some(corners) };
        let object = self.objects()[t];
        let [a, b, c] = corners.map(|p| adjustments.place(object, p));
        Some([a?, b?, c?])
    }

    /// Returns the transform of an instance of an object as drawn; `None` if the object is left out.
    pub fn placed(&self, object: u32, transform: &[f64; 12]) -> Option<[f64; 12]> {
        self.adjustments.as_ref().map_or(Some(*transform), |a| a.place_instance(object, transform))
    }

    /// Returns the normals of a triangle as drawn; `None` when the asset has none.
    pub fn normals_of(&self, t: usize) -> Option<[[f32; 3]; 3]> {
        let normals = *self.normals().get(t)?;
        Some(self.adjustments.as_ref().map_or(normals, |a| normals.map(|n| a.turn_normal(n))))
    }

    /// Drops the mesh's resident pages; they are re-read on access.
    pub fn release(&self) {
        file::release(&self.map);
    }

    fn validate(&self) -> Result<()> {
        for triangles in self.pieces(self.triangles()) {
            if let Some(v) = triangles.as_flattened().iter().find(|v| **v as usize >= self.vertices) {
                return Err(Error::format(&self.path, format!("vertex {v} of {}", self.vertices)));
            }
        }
        for positions in self.pieces(self.positions()) {
            if !positions.as_flattened().iter().all(|v| v.is_finite()) {
                return Err(Error::format(&self.path, "a coordinate is not a finite number"));
            }
        }
        Ok(())
    }

    /// Iterates over one of the mesh's arrays in pieces; drops the resident pages before each.
    pub fn pieces<'a, T>(&'a self, records: &'a [T]) -> impl Iterator<Item = &'a [T]> {
        records.chunks(file::RELEASED_BYTES / size_of::<T>()).inspect(|_| self.release())
    }

    fn part<T: bytemuck::Pod>(&self, k: usize, n: usize) -> &[T] {
        match self.offsets[k] {
            Some(at) => bytemuck::cast_slice(&self.map[at..at + n * size_of::<T>()]),
            None => &[],
        }
    }

    /// World coordinates; those of a prototype are in its own frame.
    pub fn positions(&self) -> &[Vec3] {
        self.part(0, self.vertices)
    }

    pub fn triangles(&self) -> &[[u32; 3]] {
        self.part(1, self.triangles)
    }

    pub fn uvs(&self) -> &[[[f32; 2]; 3]] {
        self.part(2, self.triangles)
    }

    /// Empty when the asset has none; zeros where a triangle has none.
    pub fn normals(&self) -> &[[[f32; 3]; 3]] {
        self.part(3, if self.offsets[3].is_some() { self.triangles } else { 0 })
    }

    pub fn materials(&self) -> &[u32] {
        self.part(4, self.triangles)
    }

    pub fn objects(&self) -> &[u32] {
        self.part(5, self.triangles)
    }

    pub fn ranks(&self) -> &[u8] {
        self.part(6, self.triangles)
    }

    pub fn prototypes(&self) -> &[u32] {
        self.part(7, self.triangles)
    }
}
