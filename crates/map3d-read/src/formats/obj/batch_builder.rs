//! Collects triangles into a batch and renumbers their vertices to those that the batch uses.

use map3d_base::Vec3;
use map3d_base::asset::{Batch, Rank};

const UNUSED: u32 = u32::MAX;

/// One triangle; `vertices` are indices into the document's positions.
#[derive(Clone, Copy)]
pub struct FaceTriangle {
    pub vertices: [u32; 3],
    pub material: u32,
    pub object: u32,
    pub uvs: Option<[[f32; 2]; 3]>,
    pub normals: Option<[[f32; 3]; 3]>,
}

#[derive(Default)]
pub struct BatchBuilder {
    batch: Batch,
    /// Index in the batch of each vertex of the document.
    indices: Vec<u32>,
    /// Vertices of the document that the batch uses.
    used: Vec<u32>,
    has_uvs: bool,
    has_normals: bool,
}

impl BatchBuilder {
    pub fn triangle_count(&self) -> usize {
        self.batch.triangles.len()
    }

    /// `positions`: all positions of the document so far.
    #[inline]
    pub fn push(&mut self, positions: &[Vec3], triangle: FaceTriangle) {
        if self.indices.len() < positions.len() {
            self.indices.resize(positions.len(), UNUSED);
        }
        let vertices = triangle.vertices.map(|v| self.add_vertex(positions, v));
        self.has_uvs |= triangle.uvs.is_some();
        self.has_normals |= triangle.normals.is_some();
        let b = &mut self.batch;
        b.triangles.push(vertices);
        b.uvs.push(triangle.uvs.unwrap_or_default());
        b.normals.push(triangle.normals.unwrap_or_default());
        b.materials.push(triangle.material);
        b.objects.push(triangle.object);
        b.ranks.push(Rank::Other);
    }

    fn add_vertex(&mut self, positions: &[Vec3], v: u32) -> u32 {
        let index = &mut self.indices[v as usize];
        if *index == UNUSED {
            *index = self.used.len() as u32;
            self.used.push(v);
            self.batch.positions.push(positions[v as usize]);
        }
        *index
    }

    /// Returns the batch so far and starts a new one.
    pub fn take(&mut self) -> Batch {
        self.used.drain(..).for_each(|v| self.indices[v as usize] = UNUSED);
        let mut batch = std::mem::take(&mut self.batch);
        batch.uvs_shifted = true;
        if !std::mem::take(&mut self.has_uvs) {
            batch.uvs.clear();
        }
        if !std::mem::take(&mut self.has_normals) {
            batch.normals.clear();
        }
        batch
    }
}
