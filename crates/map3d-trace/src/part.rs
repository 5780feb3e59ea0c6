//! Parts of a scene whose chunks are open.

use std::sync::Arc;

use map3d_base::{Result, Vec3};
use map3d_scene::instances::place;
use map3d_scene::{Chunk, InstanceRecord, Leaf, SceneStore, TriangleRecord};

/// A part of the scene with its chunk and, for an instance, its placement.
#[derive(Clone, Debug)]
pub(crate) struct LoadedPart {
    /// Index into `SceneStore::parts`.
    pub number: u32,
    pub chunk: Arc<Chunk>,
    pub instance: Option<PlacedInstance>,
}

/// An instance and its index into `SceneStore::instances`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlacedInstance {
    pub number: u32,
    pub record: InstanceRecord,
}

impl LoadedPart {
    /// Opens the chunk of a part. Fails for a chunk that cannot be read.
    pub fn load(scene: &SceneStore, number: u32) -> Result<Self> {
        let part = &scene.parts()[number as usize];
        let instance = part.instance.map(|k| PlacedInstance { number: k, record: scene.instances()[k as usize] });
        Ok(Self { number, chunk: scene.chunk(part.chunk)?, instance })
    }

    /// From the prototype's frame to local axes; `None` for a chunk with local positions.
    #[inline(always)]
    pub fn transform(&self) -> Option<&[f64; 12]> {
        self.instance.as_ref().map(|i| &i.record.transform)
    }

    #[inline(always)]
    pub fn object_id(&self, triangle: &TriangleRecord) -> u32 {
        self.instance.as_ref().map_or_else(|| self.chunk.objects()[triangle.object as usize].id, |i| i.record.object_id)
    }

    /// Returns the local corners of a leaf's triangle. The sum of a chunk's origin and a position is exact.
    #[inline(always)]
    pub fn triangle_corners(&self, leaf: &Leaf, lane: usize) -> [Vec3; 3] {
        let origin = self.chunk.origin();
        let mut out = [[0.0; 3]; 3];
        for (c, corner) in out.iter_mut().enumerate() {
            for k in 0..3 {
                corner[k] = origin[k] + f64::from(leaf.corners[3 * c + k][lane]);
            }
        }
        if let Some(t) = self.transform() {
            out.iter_mut().for_each(|p| *p = place(t, *p));
        }
        out
    }
}
