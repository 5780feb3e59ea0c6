//! Prototypes of implicit geometry, each converted once, and their placements.

use std::collections::HashMap;

use map3d_base::Result;
use map3d_base::asset::{Batch, Instance, Rank};

use super::crs_table::CrsNumber;
use super::geometry_arena::{GeometryArena, NodeKind};
use super::ids::{self, Id, hash_id};
use super::implicit_geometry::{ImplicitGeometry, PrototypeSource};
use super::material_resolver::MaterialResolver;
use crate::document::DocumentReader;

/// A placement and the key of its prototype. The prototype's number is known at the end of the document.
pub struct PrototypePlacement {
    pub key: Id,
    pub instance: Instance,
    pub crs: CrsNumber,
}

#[derive(Default)]
pub struct PrototypeTable {
    pub placements: Vec<PrototypePlacement>,
    /// Numbers of the converted prototypes, from 1, by key.
    numbers: HashMap<Id, u32>,
}

impl PrototypeTable {
    /// Returns the number of a converted prototype.
    pub fn find(&self, key: Id) -> Option<u32> {
        self.numbers.get(&key).copied()
    }

    /// Assigns the batches of a prototype its number. A prototype without triangles gets no number.
    pub fn register(&mut self, key: Id, batches: &mut [Batch]) {
        if batches.iter().all(|b| b.triangles.is_empty()) {
            return;
        }
        let number = self.numbers.len() as u32 + 1;
        self.numbers.insert(key, number);
        batches.iter_mut().for_each(|b| b.prototype = number);
    }

    /// Returns the key that identifies the prototype of an implicit geometry in the document. A prototype without id has a key of its own.
    pub fn build_key(&self, implicit: &ImplicitGeometry, geometry: &GeometryArena) -> Id {
        let node = match &implicit.prototype {
            PrototypeSource::Library(name) => return hash_id(&format!("library {name}")),
            PrototypeSource::Geometry(node) => geometry.node(*node),
        };
        match node.kind {
            NodeKind::XLink(id) => id,
            _ if node.id != ids::NONE => node.id,
            _ => hash_id(&format!("placement {}", self.placements.len())),
        }
    }
}

/// Reads a prototype from a document of its own. Its materials and images move into the resolver's tables.
pub fn read_library_object(reader: &mut dyn DocumentReader, object: u32, resolver: &mut MaterialResolver) -> Result<Vec<Batch>> {
    let mut batches = Vec::new();
    while let Some(batch) = reader.next_batch()? {
        batches.push(batch);
    }
    for image in reader.textures() {
        resolver.images.add(image.clone());
    }
    let materials: Vec<u32> = reader.materials().iter().map(|m| resolver.table.add(m.clone())).collect();
    for batch in &mut batches {
        batch.objects.fill(object);
        batch.ranks.fill(Rank::Other);
        batch.materials.iter_mut().for_each(|m| *m = materials[*m as usize]);
    }
    Ok(batches)
}
