//! Prototypes of implicit geometry, each drawn once, and their placements.

use map3d_base::asset::{Batch, Instance, Rank};
use map3d_base::{Error, Result};

use super::canvas::{Canvas, Sitting};
use super::draw::{Gatherer, Leaf};
use super::geometry::{NodeId, Shape};
use super::ids::{self, Id, id_of};
use super::implicit::Implicit;
use crate::detect::{Format, detect_format};
use crate::document::DocumentReader;
use crate::obj::ObjReader;
use crate::report::Log;

impl Canvas {
    /// Places implicit geometry of a feature; draws its prototype when it is here and new.
    pub fn place(&mut self, sitting: &mut Sitting, f: u32, index: u32, log: &mut Log) -> Result<()> {
        let implicit = sitting.member.implicits[index as usize].clone();
        let object = sitting.object_numbers[sitting.member.object_of(f) as usize];
        let Some((key, node)) = self.key_of(sitting, &implicit) else { return Ok(()) };
        self.placements.push((key, Instance { prototype: 0, object, transform: implicit.transform }));
        let (got, value) = (self.placements.len() as u64, self.painter.options.max_instances);
        if got > value {
            return Err(Error::Limit { path: log.path().to_path_buf(), what: "number of instances", got, limit: "max_instances", value });
        }
        if self.prototypes.contains_key(&key) {
            return Ok(());
        }
        match (node, &implicit.library_object) {
            (Some(node), _) => self.prototype_here(sitting, f, key, node, log),
            (None, Some(name)) if implicit.node.is_none() => self.prototype_from_library(name, object, key, log),
            _ => Ok(()),
        }
    }

    /// What tells prototypes apart, and the node if it is in this city object.
    fn key_of(&self, sitting: &Sitting, implicit: &Implicit) -> Option<(Id, Option<NodeId>)> {
        let geometry = &sitting.member.geometry;
        let Some(node) = implicit.node else {
            return implicit.library_object.as_ref().map(|name| (id_of(&format!("library {name}")), None));
        };
        match geometry.node(node).shape {
            Shape::Link(id) => Some((id, geometry.by_id.get(&id).copied())),
            _ if geometry.node(node).id != ids::NONE => Some((geometry.node(node).id, Some(node))),
            _ => Some((id_of(&format!("placement {}", self.placements.len())), Some(node))),
        }
    }

    fn prototype_here(&mut self, sitting: &mut Sitting, f: u32, key: Id, node: NodeId, log: &mut Log) -> Result<()> {
        let mut seen = vec![0; sitting.member.geometry.nodes.len()];
        let geometry = &sitting.member.geometry;
        let mut gatherer = Gatherer { geometry, seen: &mut seen, leaves: Vec::new(), outside: Vec::new(), cycles: 0 };
        gatherer.gather(node, false, 0);
        let leaves: Vec<Leaf> = gatherer.leaves;
        self.flush(1);
        self.leaves(sitting, f, &leaves, log)?;
        self.finish_prototype(key);
        Ok(())
    }

    /// What was drawn since the last flush is a prototype.
    fn finish_prototype(&mut self, key: Id) {
        let number = self.prototypes.len() as u32 + 1;
        let batch = self.drawer.take();
        if !batch.triangles.is_empty() {
            self.prototypes.insert(key, number);
            self.queue.push_back(Batch { prototype: number, ..batch });
        }
    }

    /// A prototype in a file of its own: OBJ inside of the asset's folder.
    fn prototype_from_library(&mut self, name: &str, object: u32, key: Id, log: &mut Log) -> Result<()> {
        let found = match self.painter.folder.find(name) {
            Ok(found) => found,
            Err(refusal) => return log.warn(&format!("library object: {}", refusal.reason()), name),
        };
        if !matches!(detect_format(&found.path), Ok(Format::Obj)) {
            return log.warn("library object of a format that is not read", name);
        }
        let mut reader = ObjReader::open(&found.path, &self.painter.options)?;
        let number = self.prototypes.len() as u32 + 1;
        let mut batches = Vec::new();
        while let Some(batch) = reader.next_batch()? {
            batches.push(batch);
        }
        reader.textures().iter().for_each(|t| self.painter.textures.adopt(t));
        let materials: Vec<u32> = reader.materials().iter().map(|m| self.painter.table.index_of(m.clone())).collect();
        for batch in &mut batches {
            batch.prototype = number;
            batch.objects.fill(object);
            batch.ranks.fill(Rank::Other);
            batch.materials.iter_mut().for_each(|m| *m = materials[*m as usize]);
        }
        if !batches.is_empty() {
            self.prototypes.insert(key, number);
            self.queue.extend(batches);
        }
        Ok(())
    }

    /// After the last city object: prototypes that stood elsewhere than their placements; then the instances, numbered.
    pub fn finish_instances(&mut self, log: &mut Log) -> Result<Vec<Instance>> {
        let placements = std::mem::take(&mut self.placements);
        for (key, instance) in &placements {
            let node = self.shared.geometry.by_id.get(key).copied();
            if let (Some(node), false) = (node, self.prototypes.contains_key(key)) {
                self.prototype_shared(*key, node, instance.object, log)?;
            }
        }
        let mut instances = Vec::with_capacity(placements.len());
        for (key, instance) in placements {
            match self.prototypes.get(&key) {
                Some(prototype) => instances.push(Instance { prototype: *prototype, ..instance }),
                None => {
                    let name = self.objects[instance.object as usize].name.clone();
                    log.skip("implicit geometry without a prototype", || name)?;
                }
            }
        }
        Ok(instances)
    }

    fn prototype_shared(&mut self, key: Id, node: NodeId, object: u32, log: &mut Log) -> Result<()> {
        let mut seen = vec![0; self.shared.geometry.nodes.len()];
        let geometry = &self.shared.geometry;
        let mut gatherer = Gatherer { geometry, seen: &mut seen, leaves: Vec::new(), outside: Vec::new(), cycles: 0 };
        gatherer.gather(node, false, 0);
        let leaves = gatherer.leaves;
        self.flush(1);
        self.draw_shared(&leaves, object, Rank::Other, log)?;
        self.finish_prototype(key);
        Ok(())
    }
}
