//! Boxes of the objects of an asset.

use std::collections::BTreeMap;

use super::AssetMesh;
use crate::error::{Error, Result};
use crate::vec3::Box3;

/// Triangles between two releases of resident pages.
const PIECE: usize = 1 << 20;

/// Boxes of an asset's geometry; empty without geometry.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshBoxes {
    /// Boxes of the objects, in world coordinates, without placed prototypes.
    pub objects: Vec<Box3>,
    /// Boxes of the prototypes by number, each in its own frame.
    pub prototypes: BTreeMap<u32, Box3>,
}

impl AssetMesh {
    /// Computes the boxes of `count` objects and of all prototypes in one pass, in bounded memory. Fails for a triangle of an object ≥ `count`.
    pub fn boxes(&self, count: usize) -> Result<MeshBoxes> {
        let mut boxes = MeshBoxes { objects: vec![Box3::EMPTY; count], prototypes: BTreeMap::new() };
        let (triangles, objects, prototypes, positions) = (self.triangles(), self.objects(), self.prototypes(), self.positions());
        for (t, corners) in triangles.iter().enumerate() {
            let bounds = match prototypes[t] {
                0 => boxes.objects.get_mut(objects[t] as usize),
                k => Some(boxes.prototypes.entry(k).or_insert(Box3::EMPTY)),
            };
            let Some(bounds) = bounds else {
                return Err(Error::format(self.path(), format!("triangle {t} belongs to object {}, of {count}", objects[t])));
            };
            corners.iter().for_each(|v| bounds.add_point(positions[*v as usize]));
            if t % PIECE == PIECE - 1 {
                self.release();
            }
        }
        self.release();
        Ok(boxes)
    }
}
