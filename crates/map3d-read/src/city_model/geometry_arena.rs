//! The geometry of one city object: polygons and the groups that contain them, as a tree in one arena.

use map3d_base::Vec3;

use super::appearance::SurfaceDataKind;
use super::crs_table::{CrsNumber, DOCUMENT_CRS};
use super::ids::{self, Id, IdMap};

pub type NodeId = u32;
pub const NO_NODE: NodeId = NodeId::MAX;
/// Largest depth of geometry in geometry, and of the elements of a document.
pub const MAX_DEPTH: usize = 256;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NodeKind {
    /// The exterior ring, then the interior rings.
    Polygon { first_ring: u32, rings: u32 },
    /// A composite or aggregate: MultiSurface, Solid, …
    Group,
    /// A reference to a node by its id.
    XLink(Id),
}

#[derive(Clone, Copy, Debug)]
pub struct GeometryNode {
    pub id: Id,
    pub parent: NodeId,
    pub first_child: NodeId,
    pub last_child: NodeId,
    pub next_sibling: NodeId,
    pub kind: NodeKind,
    /// An OrientableSurface with orientation `-`: the back of its base surface is its front.
    pub reversed: bool,
    /// Coordinate system of a polygon.
    pub crs: CrsNumber,
    /// Positions of a polygon have no heights.
    pub is_flat: bool,
}

/// A ring as written: range of `points`; the first and last points are usually equal.
#[derive(Clone, Copy, Debug)]
pub struct Ring {
    pub id: Id,
    pub start: u32,
    pub end: u32,
}

/// The appearance inside a textured surface.
pub struct OwnAppearance {
    /// The textured surface.
    pub node: NodeId,
    pub is_front: bool,
    pub kind: SurfaceDataKind,
    /// One pair per point of the rings, in their order.
    pub uvs: Vec<f64>,
}

#[derive(Default)]
pub struct GeometryArena {
    pub nodes: Vec<GeometryNode>,
    pub rings: Vec<Ring>,
    pub points: Vec<Vec3>,
    pub by_id: IdMap<NodeId>,
    /// Appearances of textured surfaces.
    pub own_appearances: Vec<OwnAppearance>,
}

impl GeometryArena {
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.rings.clear();
        self.points.clear();
        self.by_id.clear();
        self.own_appearances.clear();
    }

    /// Returns the memory in use.
    pub fn byte_count(&self) -> u64 {
        (size_of_val(&*self.nodes) + size_of_val(&*self.rings) + size_of_val(&*self.points) + self.by_id.len() * 16) as u64
    }

    /// Adds a node. A duplicate id keeps referring to its first node.
    pub fn add(&mut self, id: Id, parent: NodeId, kind: NodeKind) -> NodeId {
        let number = self.nodes.len() as NodeId;
        let (first_child, last_child, next_sibling) = (NO_NODE, NO_NODE, NO_NODE);
        self.nodes.push(GeometryNode { id, parent, first_child, last_child, next_sibling, kind, reversed: false, crs: DOCUMENT_CRS, is_flat: false });
        if id != ids::NONE {
            self.by_id.entry(id).or_insert(number);
        }
        if parent != NO_NODE {
            let last = self.nodes[parent as usize].last_child;
            match last {
                NO_NODE => self.nodes[parent as usize].first_child = number,
                last => self.nodes[last as usize].next_sibling = number,
            }
            self.nodes[parent as usize].last_child = number;
        }
        number
    }

    pub fn node(&self, number: NodeId) -> &GeometryNode {
        &self.nodes[number as usize]
    }

    /// Returns the node that an XLink refers to (`None` if it is not in this arena); any other node itself.
    pub fn resolve_xlink(&self, number: NodeId) -> Option<NodeId> {
        match self.node(number).kind {
            NodeKind::XLink(id) => self.by_id.get(&id).copied(),
            NodeKind::Polygon { .. } | NodeKind::Group => Some(number),
        }
    }

    /// Returns the rings of a polygon; other nodes have none.
    pub fn polygon_rings(&self, kind: NodeKind) -> &[Ring] {
        match kind {
            NodeKind::Polygon { first_ring, rings } => &self.rings[first_ring as usize..(first_ring + rings) as usize],
            NodeKind::Group | NodeKind::XLink(_) => &[],
        }
    }

    pub fn ring_points(&self, ring: &Ring) -> &[Vec3] {
        &self.points[ring.start as usize..ring.end as usize]
    }
}
