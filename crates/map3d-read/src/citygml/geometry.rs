//! The geometry of one city object: polygons and what groups them, as a tree in one arena.

use map3d_base::Vec3;

use super::ids::{self, Id, IdMap};

pub type NodeId = u32;
pub const NO_NODE: NodeId = NodeId::MAX;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Exterior ring, then interior ones.
    Polygon {
        first_ring: u32,
        rings: u32,
    },
    Group,
    /// A reference to a node by its id.
    Link(Id),
}

#[derive(Clone, Copy, Debug)]
pub struct Node {
    pub id: Id,
    pub parent: NodeId,
    pub first_child: NodeId,
    pub last_child: NodeId,
    pub next: NodeId,
    pub shape: Shape,
    /// The other side is its front.
    pub flip: bool,
}

/// Points of a ring as written, first and last usually equal.
#[derive(Clone, Copy, Debug)]
pub struct Ring {
    pub id: Id,
    pub start: u32,
    pub end: u32,
}

#[derive(Default)]
pub struct Geometry {
    pub nodes: Vec<Node>,
    pub rings: Vec<Ring>,
    pub points: Vec<Vec3>,
    pub by_id: IdMap<NodeId>,
}

impl Geometry {
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.rings.clear();
        self.points.clear();
        self.by_id.clear();
    }

    pub fn bytes(&self) -> u64 {
        (size_of_val(&*self.nodes) + size_of_val(&*self.rings) + size_of_val(&*self.points) + self.by_id.len() * 16) as u64
    }

    /// Adds a node; an id that is there already keeps its first bearer.
    pub fn add(&mut self, id: Id, parent: NodeId, shape: Shape) -> NodeId {
        let number = self.nodes.len() as NodeId;
        self.nodes.push(Node { id, parent, first_child: NO_NODE, last_child: NO_NODE, next: NO_NODE, shape, flip: false });
        if id != ids::NONE {
            self.by_id.entry(id).or_insert(number);
        }
        if parent != NO_NODE {
            let last = self.nodes[parent as usize].last_child;
            match last {
                NO_NODE => self.nodes[parent as usize].first_child = number,
                last => self.nodes[last as usize].next = number,
            }
            self.nodes[parent as usize].last_child = number;
        }
        number
    }

    pub fn node(&self, number: NodeId) -> &Node {
        &self.nodes[number as usize]
    }

    pub fn rings_of(&self, shape: Shape) -> &[Ring] {
        match shape {
            Shape::Polygon { first_ring, rings } => &self.rings[first_ring as usize..(first_ring + rings) as usize],
            Shape::Group | Shape::Link(_) => &[],
        }
    }
}
