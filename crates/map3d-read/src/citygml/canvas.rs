//! From parsed city objects to batches, objects and instances.

use std::collections::{HashMap, VecDeque};

use map3d_base::Result;
use map3d_base::asset::{Batch, Instance, Object, Rank};

use super::appearance::Appearances;
use super::draw::{Aliases, Drawer, Gatherer, Leaf, Paints, Surface, Tree, aliases};
use super::feature::{Form, Member};
use super::geometry::NodeId;
use super::ids::{self, Id, IdSet};
use super::kinds::class_of;
use super::lod::{choose, drawn_at};
use super::paint::Painter;
use super::shared::{Borrowed, Shared};
use crate::report::Log;

const BATCH_TRIANGLES: usize = 1 << 14;

/// All that grows while city objects are drawn.
pub struct Canvas {
    pub painter: Painter,
    pub drawer: Drawer,
    /// Appearances that stand outside of city objects.
    pub appearances: Appearances,
    pub wanted: IdSet,
    pub lod: Option<u8>,
    pub shared: Shared,
    pub objects: Vec<Object>,
    /// Placements with the key of their prototype, whose number is known at the end.
    pub placements: Vec<(Id, Instance)>,
    pub prototypes: HashMap<Id, u32>,
    pub queue: VecDeque<Batch>,
}

/// A city object being drawn.
pub struct Sitting<'a> {
    pub member: &'a mut Member,
    pub aliases: Aliases,
    pub seen: Vec<u8>,
    /// Number of the asset's object of each feature that is one.
    pub object_numbers: Vec<u32>,
}

impl Canvas {
    /// Draws a parsed city object at its chosen level of detail: surfaces, openings and installations first, then what is left of the bodies,
    /// so that a face both refer to has the class of its surface.
    pub fn draw(&mut self, member: &mut Member, log: &mut Log) -> Result<()> {
        if member.features.is_empty() {
            return Ok(());
        }
        member.appearances.resolve_links();
        pull_out_of_interiors(member);
        let levels = choose(member, self.lod);
        let object_numbers = self.add_objects(member, &levels);
        let (aliases, seen) = (aliases(&member.geometry), vec![0; member.geometry.nodes.len()]);
        let mut sitting = Sitting { member, aliases, seen, object_numbers };
        for bodies in [false, true] {
            for (f, level) in levels.iter().enumerate() {
                let feature = &sitting.member.features[f];
                if feature.is_object() != bodies || feature.placed.is_empty() {
                    continue;
                }
                match *level {
                    Some(_) if feature.interior => log.report.skip("surfaces inside of a building", 1),
                    Some(lod) => self.feature(&mut sitting, f as u32, lod, log)?,
                    None => {}
                }
            }
        }
        self.shared.keep(&sitting.member.geometry, &sitting.seen, &self.wanted);
        self.flush(BATCH_TRIANGLES);
        Ok(())
    }

    /// Queues the batch at hand when it is at least this large.
    pub fn flush(&mut self, triangles: usize) {
        if self.drawer.batch.triangles.len() >= triangles.max(1) {
            self.queue.push_back(self.drawer.take());
        }
    }

    /// Numbers of the features' objects in the asset, by feature.
    fn add_objects(&mut self, member: &mut Member, levels: &[Option<u8>]) -> Vec<u32> {
        let mut numbers = vec![u32::MAX; member.features.len()];
        for f in 0..member.features.len() {
            let feature = &member.features[f];
            let above = feature.parent.map(|p| numbers[member.object_of(p) as usize]);
            if !feature.is_object() {
                continue;
            }
            numbers[f] = self.objects.len() as u32;
            let lod = object_level(member, levels, f as u32);
            let feature = &mut member.features[f];
            let name = match feature.name.is_empty() {
                true => format!("{}-{}", class_of(&feature.local), numbers[f] + 1),
                false => std::mem::take(&mut feature.name),
            };
            let attributes = std::mem::take(&mut feature.attributes);
            self.objects.push(Object { name, class: class_of(&feature.local), parent: above, lod, attributes });
        }
        numbers
    }

    fn feature(&mut self, sitting: &mut Sitting, f: u32, lod: u8, log: &mut Log) -> Result<()> {
        let forms: Vec<Form> = drawn_at(&sitting.member.features[f as usize].placed, lod).collect();
        for form in forms {
            match form {
                Form::Surfaces(node) | Form::RoofEdge(node) => {
                    let (leaves, outside) = gather(sitting, node, log)?;
                    self.leaves(sitting, f, &leaves, log)?;
                    self.borrow(sitting, f, &outside);
                }
                Form::Implicit(index) => self.place(sitting, f, index, log)?,
            }
        }
        Ok(())
    }

    /// Draws polygons of a feature.
    pub fn leaves(&mut self, sitting: &mut Sitting, f: u32, leaves: &[Leaf], log: &mut Log) -> Result<()> {
        let Member { features, geometry, appearances, .. } = &mut *sitting.member;
        let ancestors = || std::iter::successors(Some(f), |f| features[*f as usize].parent);
        let feature_ids: Vec<Id> = ancestors().map(|f| features[f as usize].id).collect();
        let object = ancestors().find(|f| features[*f as usize].is_object()).unwrap_or(0);
        let number = sitting.object_numbers[object as usize];
        let surface = Surface {
            object: number,
            rank: features[f as usize].rank,
            locals: [&features[f as usize].local, &features[object as usize].local],
            feature_ids: &feature_ids,
            name: &self.objects[number as usize].name,
        };
        let mut paints = Paints { painter: &mut self.painter, stores: [appearances, &mut self.appearances] };
        let tree = Tree { geometry, aliases: &sitting.aliases };
        leaves.iter().try_for_each(|leaf| self.drawer.polygon(tree, *leaf, &surface, &mut paints, log))
    }

    fn borrow(&mut self, sitting: &Sitting, f: u32, outside: &[(Id, bool)]) {
        let object = sitting.object_numbers[sitting.member.object_of(f) as usize];
        let rank = sitting.member.features[f as usize].rank;
        self.shared.borrowed.extend(outside.iter().map(|(id, flip)| Borrowed { id: *id, flip: *flip, object, rank }));
    }

    /// After the last city object: faces that were referred to and not drawn by their owners.
    pub fn draw_borrowed(&mut self, log: &mut Log) -> Result<()> {
        for face in std::mem::take(&mut self.shared.borrowed) {
            let Some(node) = self.shared.geometry.by_id.get(&face.id).copied() else {
                let name = self.objects[face.object as usize].name.clone();
                log.warn("reference that leads nowhere", name)?;
                continue;
            };
            let (geometry, seen) = (&self.shared.geometry, &mut self.shared.seen);
            let mut gatherer = Gatherer { geometry, seen, leaves: Vec::new(), outside: Vec::new(), cycles: 0 };
            gatherer.gather(node, face.flip, 0);
            let leaves = gatherer.leaves;
            self.draw_shared(&leaves, face.object, face.rank, log)?;
        }
        self.flush(1);
        Ok(())
    }

    pub fn draw_shared(&mut self, leaves: &[Leaf], object: u32, rank: Rank, log: &mut Log) -> Result<()> {
        let name = self.objects[object as usize].name.clone();
        let surface = Surface { object, rank, locals: ["", ""], feature_ids: &[ids::NONE], name: &name };
        let mut nothing = Appearances::default();
        let mut paints = Paints { painter: &mut self.painter, stores: [&mut nothing, &mut self.appearances] };
        let tree = Tree { geometry: &self.shared.geometry, aliases: &Aliases::new() };
        leaves.iter().try_for_each(|leaf| self.drawer.polygon(tree, *leaf, &surface, &mut paints, log))
    }
}

/// Polygons below a node, and references to what is not in this city object.
type Gathered = (Vec<Leaf>, Vec<(Id, bool)>);

fn gather(sitting: &mut Sitting, node: NodeId, log: &mut Log) -> Result<Gathered> {
    let geometry = &sitting.member.geometry;
    let mut gatherer = Gatherer { geometry, seen: &mut sitting.seen, leaves: Vec::new(), outside: Vec::new(), cycles: 0 };
    gatherer.gather(node, false, 0);
    let Gatherer { leaves, outside, cycles, .. } = gatherer;
    log.skip_many("geometry that refers to itself", cycles, || "a cycle of references".to_owned())?;
    Ok((leaves, outside))
}

/// What lies inside and is referred to from outside (a door between room and street) is drawn.
fn pull_out_of_interiors(member: &mut Member) {
    let mut pulled = vec![false; member.features.len()];
    for id in member.features.iter().filter(|f| !f.interior).flat_map(|f| &f.links) {
        if let Some(f) = member.by_id.get(id) {
            pulled[*f as usize] = true;
        }
    }
    for f in 0..member.features.len() {
        pulled[f] |= member.features[f].parent.is_some_and(|p| pulled[p as usize]);
        member.features[f].interior &= !pulled[f];
    }
}

/// The level of detail that an object is drawn at, as the table of objects has it.
fn object_level(member: &Member, levels: &[Option<u8>], object: u32) -> Option<String> {
    let drawn = |f: &u32| {
        let feature = &member.features[*f as usize];
        let level = levels[*f as usize].filter(|l| feature.placed.iter().any(|p| p.lod == *l));
        level.filter(|_| !feature.interior && member.object_of(*f) == object)
    };
    let level = (object..member.features.len() as u32).filter_map(|f| drawn(&f)).max();
    level.map(|l| l.to_string())
}
