//! Geometry that other city objects refer to, kept until the end of the document.

use map3d_base::Reason;
use map3d_base::asset::Rank;

use super::geometry_arena::{GeometryArena, MAX_DEPTH, NO_NODE, NodeId, NodeKind, Ring};
use super::ids::{self, Id, IdMap, IdSet};
use super::polygons::VisitState;

/// An XLink to geometry of another city object, resolved at the end of the document. Applies only if the owner did not convert that geometry.
#[derive(Clone, Copy, Debug)]
pub struct DeferredXLink {
    pub target: Id,
    pub reversed: bool,
    pub object: u32,
    pub rank: Rank,
}

/// Geometry that a reference names and that was not found: the reason, and the reference as written.
pub type MissingGeometry = IdMap<(Reason, String)>;

#[derive(Default)]
pub struct SharedGeometry {
    pub geometry: GeometryArena,
    /// One state per node; polygons that their owner converted are done.
    pub visits: Vec<VisitState>,
    pub deferred: Vec<DeferredXLink>,
}

impl SharedGeometry {
    /// Copies the nodes of a city object that other city objects refer to.
    pub fn copy_referenced(&mut self, geometry: &GeometryArena, visits: &[VisitState], referenced_ids: &IdSet) {
        if referenced_ids.is_empty() {
            return;
        }
        for (number, node) in geometry.nodes.iter().enumerate() {
            if node.id != ids::NONE && referenced_ids.contains(&node.id) && !self.geometry.by_id.contains_key(&node.id) {
                self.copy_node(geometry, visits, number as NodeId, NO_NODE, 0);
            }
        }
    }

    /// Gives each new node a state.
    pub fn add_unvisited(&mut self) {
        self.visits.resize(self.geometry.nodes.len(), VisitState::Unvisited);
    }

    /// Copies a node, its descendants and the targets of their XLinks.
    fn copy_node(&mut self, from: &GeometryArena, visits: &[VisitState], number: NodeId, parent: NodeId, depth: usize) {
        let node = from.node(number);
        let kind = match node.kind {
            NodeKind::Polygon { rings, .. } => {
                let first_ring = self.geometry.rings.len() as u32;
                for ring in from.polygon_rings(node.kind) {
                    let start = self.geometry.points.len() as u32;
                    self.geometry.points.extend_from_slice(from.ring_points(ring));
                    self.geometry.rings.push(Ring { id: ring.id, start, end: self.geometry.points.len() as u32 });
                }
                NodeKind::Polygon { first_ring, rings }
            }
            other => other,
        };
        let copy = self.geometry.add(node.id, parent, kind);
        let copied = &mut self.geometry.nodes[copy as usize];
        (copied.reversed, copied.crs) = (node.reversed, node.crs);
        let is_converted = matches!(kind, NodeKind::Polygon { .. }) && visits.get(number as usize) == Some(&VisitState::Done);
        self.visits.push(if is_converted { VisitState::Done } else { VisitState::Unvisited });
        if depth > MAX_DEPTH {
            return;
        }
        if let NodeKind::XLink(id) = kind
            && let Some(target) = from.by_id.get(&id).filter(|_| !self.geometry.by_id.contains_key(&id))
        {
            self.copy_node(from, visits, *target, NO_NODE, depth + 1);
        }
        let mut child = node.first_child;
        while child != NO_NODE {
            self.copy_node(from, visits, child, copy, depth + 1);
            child = from.node(child).next_sibling;
        }
    }
}
