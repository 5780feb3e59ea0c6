//! Collects the polygons of a geometry, and finds the groups that refer to them.

use super::geometry_arena::{GeometryArena, NO_NODE, NodeId, NodeKind};
use super::ids::{self, Id};

/// A polygon to convert; `reversed`: its back is the front of the surface.
#[derive(Clone, Copy, Debug)]
pub struct OrientedPolygon {
    pub node: NodeId,
    pub reversed: bool,
}

/// An XLink to geometry that is not in the arena.
#[derive(Clone, Copy, Debug)]
pub struct UnresolvedXLink {
    pub target: Id,
    pub reversed: bool,
}

/// State of a node during collection. Each polygon is collected once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VisitState {
    Unvisited,
    /// Being visited: an ancestor of the current node. Reaching it again is a cycle.
    Open,
    Done,
}

/// The polygons below a node, in document order.
#[derive(Default)]
pub struct CollectedPolygons {
    pub polygons: Vec<OrientedPolygon>,
    pub unresolved: Vec<UnresolvedXLink>,
    /// Number of references that closed a cycle or exceeded the depth limit.
    pub cycles: u64,
}

/// Collects the polygons at and below a node that were not collected before. `visits`: one state per node, kept between calls.
pub fn collect_polygons(geometry: &GeometryArena, visits: &mut [VisitState], node: NodeId, reversed: bool) -> CollectedPolygons {
    let mut collector = PolygonCollector { geometry, visits, collected: CollectedPolygons::default() };
    collector.visit(node, reversed, 0);
    collector.collected
}

struct PolygonCollector<'a> {
    geometry: &'a GeometryArena,
    visits: &'a mut [VisitState],
    collected: CollectedPolygons,
}

const MAX_DEPTH: usize = 1024;

impl PolygonCollector<'_> {
    fn visit(&mut self, number: NodeId, reversed: bool, depth: usize) {
        let state = self.visits[number as usize];
        if state == VisitState::Open || depth > MAX_DEPTH {
            self.collected.cycles += 1;
        }
        if state != VisitState::Unvisited || depth > MAX_DEPTH {
            return;
        }
        let node = *self.geometry.node(number);
        let reversed = reversed != node.reversed;
        self.visits[number as usize] = VisitState::Open;
        match node.kind {
            NodeKind::Polygon { .. } => self.collected.polygons.push(OrientedPolygon { node: number, reversed }),
            NodeKind::XLink(target) => match self.geometry.by_id.get(&target) {
                Some(node) => self.visit(*node, reversed, depth + 1),
                None => self.collected.unresolved.push(UnresolvedXLink { target, reversed }),
            },
            NodeKind::Group => {
                let mut child = node.first_child;
                while child != NO_NODE {
                    self.visit(child, reversed, depth + 1);
                    child = self.geometry.node(child).next_sibling;
                }
            }
        }
        self.visits[number as usize] = VisitState::Done;
    }
}

/// An XLink inside an arena: the node that it refers to, and the group that contains the reference.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct XLink {
    target: NodeId,
    group: NodeId,
}

/// All XLinks inside one arena, sorted by target.
#[derive(Default)]
pub struct XLinkIndex(Vec<XLink>);

impl XLinkIndex {
    pub fn build(geometry: &GeometryArena) -> Self {
        let links = geometry.nodes.iter().filter_map(|node| match node.kind {
            NodeKind::XLink(id) if node.parent != NO_NODE => Some(XLink { target: *geometry.by_id.get(&id)?, group: node.parent }),
            _ => None,
        });
        let mut links: Vec<XLink> = links.collect();
        links.sort_unstable();
        Self(links)
    }

    /// Iterates over the groups that refer to a node.
    fn groups_referring_to(&self, node: NodeId) -> impl Iterator<Item = NodeId> + '_ {
        let first = self.0.partition_point(|l| l.target < node);
        self.0[first..].iter().take_while(move |l| l.target == node).map(|l| l.group)
    }
}

/// An arena and the XLinks inside it.
#[derive(Clone, Copy)]
pub struct LinkedGeometry<'a> {
    pub geometry: &'a GeometryArena,
    pub xlinks: &'a XLinkIndex,
}

impl LinkedGeometry<'_> {
    /// Appends the ids through which an appearance can target a node: its own and its ancestors', then those of groups that refer to one of these,
    /// and of their ancestors.
    pub fn append_target_ids(self, node: NodeId, out: &mut Vec<Id>) {
        const MAX_GROUPS: usize = 8;
        let Self { geometry, xlinks } = self;
        let with_ancestors = |from: NodeId| {
            let parent = move |n: &NodeId| Some(geometry.node(*n).parent).filter(|p| *p != NO_NODE);
            std::iter::successors(Some(from), parent)
        };
        let ids_from = |from: NodeId| with_ancestors(from).map(|n| geometry.node(n).id).filter(|id| *id != ids::NONE);
        out.extend(ids_from(node));
        if xlinks.0.is_empty() {
            return;
        }
        for ancestor in with_ancestors(node) {
            for group in xlinks.groups_referring_to(ancestor).take(MAX_GROUPS) {
                out.extend(ids_from(group));
            }
        }
    }
}
