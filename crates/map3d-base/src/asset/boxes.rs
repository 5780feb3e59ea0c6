//! Boxes of the objects of an asset.

use std::collections::BTreeMap;

use super::AssetMesh;
use crate::error::{Error, Result};
use crate::kept_space::KeptSpace;
use crate::vec3::Box3;

/// Triangles between two releases of resident pages.
const PIECE: usize = 1 << 20;

/// Boxes of an asset's geometry; empty without geometry.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshBoxes {
    /// Boxes of the objects as drawn, in world coordinates, without placed prototypes.
    pub objects: Vec<Box3>,
    /// Boxes of the prototypes by number, each in its own frame.
    pub prototypes: BTreeMap<u32, Box3>,
    /// Triangles of each object that are outside the extent, without placed prototypes.
    pub outside: Vec<u32>,
}

impl AssetMesh {
    /// Computes the boxes of `count` objects, of their triangles in `extent` if there is one, and of all prototypes in one pass, in bounded memory.
    /// Fails for a triangle of an object ≥ `count`.
    pub fn boxes(&self, count: usize, extent: Option<&KeptSpace>) -> Result<MeshBoxes> {
        let mut boxes = MeshBoxes { objects: vec![Box3::EMPTY; count], prototypes: BTreeMap::new(), outside: vec![0; count] };
        self.drawn().try_for_each(|mesh| mesh.add_boxes(extent, &mut boxes))?;
        Ok(boxes)
    }

    fn add_boxes(&self, extent: Option<&KeptSpace>, boxes: &mut MeshBoxes) -> Result<()> {
        let (objects, prototypes, count) = (self.objects(), self.prototypes(), boxes.objects.len());
        for t in 0..self.triangles().len() {
            if t % PIECE == PIECE - 1 {
                self.release();
            }
            let bounds = match prototypes[t] {
                0 => boxes.objects.get_mut(objects[t] as usize),
                k => Some(boxes.prototypes.entry(k).or_insert(Box3::EMPTY)),
            };
            let Some(bounds) = bounds else {
                return Err(Error::format(self.path(), format!("triangle {t} belongs to object {}, of {count}", objects[t])));
            };
            let Some(corners) = self.corners(t) else { continue };
            if prototypes[t] == 0 && extent.is_some_and(|e| !e.keeps(corners)) {
                boxes.outside[objects[t] as usize] += 1;
            } else {
                corners.iter().for_each(|p| bounds.add_point(*p));
            }
        }
        self.release();
        Ok(())
    }
}
