//! Triangles on their way into a batch; vertices are renumbered to those that the batch uses.

use map3d_base::Vec3;
use map3d_base::asset::{Batch, Rank};

const UNUSED: u32 = u32::MAX;
type Uvs = [[f32; 2]; 3];
type Normals = [[f32; 3]; 3];

#[derive(Default)]
pub struct Pending {
    batch: Batch,
    /// Number in the batch of each vertex of the document.
    number: Vec<u32>,
    used: Vec<u32>,
    any_uvs: bool,
    any_normals: bool,
}

impl Pending {
    pub fn triangle_count(&self) -> usize {
        self.batch.triangles.len()
    }

    pub fn push(&mut self, positions: &[Vec3], corners: [u32; 3], material: u32, object: u32, uvs: Option<Uvs>, normals: Option<Normals>) {
        if self.number.len() < positions.len() {
            self.number.resize(positions.len(), UNUSED);
        }
        let triangle = corners.map(|v| self.vertex(positions, v));
        self.any_uvs |= uvs.is_some();
        self.any_normals |= normals.is_some();
        let b = &mut self.batch;
        b.triangles.push(triangle);
        b.uvs.push(uvs.unwrap_or_default());
        b.normals.push(normals.unwrap_or_default());
        b.materials.push(material);
        b.objects.push(object);
        b.ranks.push(Rank::Other);
    }

    fn vertex(&mut self, positions: &[Vec3], v: u32) -> u32 {
        let slot = &mut self.number[v as usize];
        if *slot == UNUSED {
            *slot = self.used.len() as u32;
            self.used.push(v);
            self.batch.positions.push(positions[v as usize]);
        }
        *slot
    }

    /// The batch so far; begins a new one.
    pub fn take(&mut self) -> Batch {
        self.used.drain(..).for_each(|v| self.number[v as usize] = UNUSED);
        let mut batch = std::mem::take(&mut self.batch);
        batch.uvs_shifted = true;
        if !std::mem::take(&mut self.any_uvs) {
            batch.uvs.clear();
        }
        if !std::mem::take(&mut self.any_normals) {
            batch.normals.clear();
        }
        batch
    }
}
