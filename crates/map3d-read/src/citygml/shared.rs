//! Geometry that another city object refers to: kept until the end of the document.

use map3d_base::asset::Rank;

use super::geometry::{Geometry, NO_NODE, NodeId, Shape};
use super::ids::{self, Id, IdSet};

/// A face of another city object that this one refers to; drawn at the end, if its owner has not drawn it.
#[derive(Clone, Copy, Debug)]
pub struct Borrowed {
    pub id: Id,
    pub flip: bool,
    pub object: u32,
    pub rank: Rank,
}

#[derive(Default)]
pub struct Shared {
    pub geometry: Geometry,
    /// As of `Gatherer::seen`: polygons that were drawn where they stand are done.
    pub seen: Vec<u8>,
    pub borrowed: Vec<Borrowed>,
}

impl Shared {
    /// Copies the nodes that are wanted elsewhere.
    pub fn keep(&mut self, geometry: &Geometry, seen: &[u8], wanted: &IdSet) {
        if wanted.is_empty() {
            return;
        }
        for (number, node) in geometry.nodes.iter().enumerate() {
            if node.id != ids::NONE && wanted.contains(&node.id) && !self.geometry.by_id.contains_key(&node.id) {
                self.copy(geometry, seen, number as NodeId, NO_NODE, 0);
            }
        }
    }

    fn copy(&mut self, from: &Geometry, seen: &[u8], number: NodeId, parent: NodeId, depth: usize) {
        let node = from.node(number);
        let shape = match node.shape {
            Shape::Polygon { rings, .. } => {
                let first_ring = self.geometry.rings.len() as u32;
                for ring in from.rings_of(node.shape) {
                    let start = self.geometry.points.len() as u32;
                    self.geometry.points.extend_from_slice(&from.points[ring.start as usize..ring.end as usize]);
                    self.geometry.rings.push(super::geometry::Ring { id: ring.id, start, end: self.geometry.points.len() as u32 });
                }
                Shape::Polygon { first_ring, rings }
            }
            other => other,
        };
        let copy = self.geometry.add(node.id, parent, shape);
        self.geometry.nodes[copy as usize].flip = node.flip;
        let drawn = matches!(shape, Shape::Polygon { .. }) && seen.get(number as usize) == Some(&2);
        self.seen.push(if drawn { 2 } else { 0 });
        if depth > super::xml::MAX_DEPTH {
            return;
        }
        if let Shape::Link(id) = shape
            && let Some(target) = from.by_id.get(&id).filter(|_| !self.geometry.by_id.contains_key(&id))
        {
            self.copy(from, seen, *target, NO_NODE, depth + 1);
        }
        let mut child = node.first_child;
        while child != NO_NODE {
            self.copy(from, seen, child, copy, depth + 1);
            child = from.node(child).next;
        }
    }
}
