//! Converts a chunk back to the triangles that it was built from, without the duplicates that were dropped.

use std::collections::HashMap;
use std::path::Path;

use bytemuck::Zeroable;
use map3d_base::Result;
use map3d_scene::chunk::Chunk;
use map3d_scene::lattice::{Point, snap};
use map3d_scene::records::MaterialRecord;

use crate::triangle::BuildTriangle;

/// Material records by number; equal records have one number.
pub(crate) struct MaterialNumbers {
    pub records: Vec<MaterialRecord>,
    numbers: HashMap<MaterialRecord, u32>,
}

impl MaterialNumbers {
    pub fn new(records: &[MaterialRecord]) -> Self {
        Self { records: records.to_vec(), numbers: records.iter().copied().zip(0..).collect() }
    }

    fn number(&mut self, record: &MaterialRecord) -> u32 {
        *self.numbers.entry(*record).or_insert_with(|| {
            self.records.push(*record);
            self.records.len() as u32 - 1
        })
    }
}

/// Appends the triangles of the objects that `wanted` accepts.
pub(crate) fn unpack_chunk(path: &Path, materials: &mut MaterialNumbers, wanted: impl Fn(u32) -> bool, out: &mut Vec<BuildTriangle>) -> Result<()> {
    let chunk = Chunk::open(path, true)?;
    let numbers: Vec<u32> = chunk.materials().iter().map(|m| materials.number(m)).collect();
    let objects: Vec<Option<u32>> = chunk.objects().iter().map(|o| Some(o.id).filter(|id| wanted(*id))).collect();
    let origin = snap(chunk.origin());
    for leaf in chunk.leaves() {
        for lane in (0..8).take_while(|lane| (leaf.triangle[*lane] as usize) < chunk.triangles().len()) {
            let number = leaf.triangle[lane] as usize;
            let record = &chunk.triangles()[number];
            let Some(object_id) = objects[record.object as usize] else { continue };
            let corner = |c: usize| -> Point {
                let p = snap([0, 1, 2].map(|k| f64::from(leaf.corners[3 * c + k][lane])));
                [0, 1, 2].map(|k| origin[k] + p[k])
            };
            out.push(BuildTriangle {
                corners: [corner(0), corner(1), corner(2)],
                uv: record.uv,
                normals: chunk.normals().get(number).copied().unwrap_or_default(),
                rank: record.rank,
                material: numbers[record.material as usize],
                object_id,
                source: record.source,
                ..BuildTriangle::zeroed()
            });
        }
    }
    Ok(())
}
