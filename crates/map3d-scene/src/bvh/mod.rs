//! Bounding volume hierarchy: a binary tree by the surface area heuristic, collapsed to eight children per node.
//! The same input gives the same tree on every machine.

mod binary;

use crate::records::{EMPTY, LEAF_BIT, Node};
use binary::{BinaryTree, Kind};

/// A leaf holds at most this many items: a leaf record's lanes.
pub const LEAF_ITEMS: usize = 8;

/// A box in float32; the fourth lanes are not used.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(16))]
pub struct Aabb {
    pub lo: [f32; 4],
    pub hi: [f32; 4],
}

impl Aabb {
    pub const EMPTY: Self = Self { lo: [f32::INFINITY; 4], hi: [f32::NEG_INFINITY; 4] };

    pub fn of_points(points: &[[f32; 3]]) -> Self {
        let mut out = Self::EMPTY;
        points.iter().for_each(|p| out.add(&Self { lo: [p[0], p[1], p[2], 0.0], hi: [p[0], p[1], p[2], 0.0] }));
        out
    }

    #[inline(always)]
    pub fn add(&mut self, other: &Self) {
        for k in 0..4 {
            self.lo[k] = if other.lo[k] < self.lo[k] { other.lo[k] } else { self.lo[k] };
            self.hi[k] = if other.hi[k] > self.hi[k] { other.hi[k] } else { self.hi[k] };
        }
    }

    /// Half the surface area; 0 when empty.
    #[inline(always)]
    pub fn half_area(&self) -> f32 {
        let e = [0, 1, 2].map(|k| (self.hi[k] - self.lo[k]).max(0.0));
        e[0] * e[1] + e[1] * e[2] + e[2] * e[0]
    }

    pub fn to_array(&self) -> [f32; 6] {
        [self.lo[0], self.lo[1], self.lo[2], self.hi[0], self.hi[1], self.hi[2]]
    }
}

/// Eight-wide tree over items; leaf k holds the items `order[leaves[k].0..leaves[k].1]`, in ascending order.
#[derive(Debug, Default)]
pub struct Tree {
    pub nodes: Vec<Node>,
    pub leaves: Vec<(u32, u32)>,
    pub order: Vec<u32>,
}

/// Builds the tree; without items it has no nodes.
pub fn build(boxes: &[Aabb]) -> Tree {
    if boxes.is_empty() {
        return Tree::default();
    }

    // Build a binary tree, then begin with its root
    let binary = BinaryTree::build(boxes);
    let mut tree = Tree { order: Vec::with_capacity(boxes.len()), ..Tree::default() };
    tree.nodes.push(empty_node());

    // Collapse it depth first, so that a subtree is contiguous in the file
    let mut stack = vec![(0u32, 0u32)];
    while let Some((from, to)) = stack.pop() {
        let children = eight_children(&binary, from);
        let mut node = empty_node();
        let mut inner = Vec::new();
        for (k, child) in children.iter().enumerate() {
            let bounds = binary.nodes[*child as usize].bounds.to_array();
            (0..6).for_each(|a| node.bounds[a][k] = bounds[a]);
            node.child[k] = match binary.nodes[*child as usize].kind {
                Kind::Leaf { start, end } => LEAF_BIT | tree.push_leaf(&binary.order[start as usize..end as usize]),
                Kind::Inner { .. } => {
                    let number = tree.nodes.len() as u32;
                    tree.nodes.push(empty_node());
                    inner.push((*child, number));
                    number
                }
            };
        }
        tree.nodes[to as usize] = node;
        stack.extend(inner.into_iter().rev());
    }
    tree
}

impl Tree {
    fn push_leaf(&mut self, items: &[u32]) -> u32 {
        let start = self.order.len();
        self.order.extend_from_slice(items);
        self.order[start..].sort_unstable();
        self.leaves.push((start as u32, self.order.len() as u32));
        self.leaves.len() as u32 - 1
    }
}

fn empty_node() -> Node {
    let mut bounds = [[f32::INFINITY; 8]; 6];
    bounds[3..].fill([f32::NEG_INFINITY; 8]);
    Node { bounds, child: [EMPTY; 8], padding: [0; 8] }
}

/// Opens the child of the largest area until there are eight or only leaves.
fn eight_children(binary: &BinaryTree, root: u32) -> Vec<u32> {
    let mut set = match binary.nodes[root as usize].kind {
        Kind::Leaf { .. } => return vec![root],
        Kind::Inner { children } => children.to_vec(),
    };
    while set.len() < 8 {
        let inner = set.iter().enumerate().filter(|(_, c)| matches!(binary.nodes[**c as usize].kind, Kind::Inner { .. }));
        let area = |c: u32| binary.nodes[c as usize].bounds.half_area();
        let Some((k, _)) = inner.max_by(|a, b| area(*a.1).total_cmp(&area(*b.1)).then(b.0.cmp(&a.0))) else { break };
        let Kind::Inner { children } = binary.nodes[set[k] as usize].kind else { break };
        set[k] = children[0];
        set.insert(k + 1, children[1]);
    }
    set
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes(n: u32) -> Vec<Aabb> {
        let mut state = 7u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        (0..n)
            .map(|_| {
                let p = [next() * 100.0, next() * 100.0, next() * 10.0];
                Aabb::of_points(&[p, [p[0] + next(), p[1] + next(), p[2] + next()]])
            })
            .collect()
    }

    #[test]
    fn every_item_lies_in_one_leaf_of_one_to_eight() {
        for n in [1, 2, 7, 8, 9, 17, 100, 5000] {
            let tree = build(&boxes(n));
            let mut order = tree.order.clone();
            order.sort_unstable();
            assert_eq!(order, (0..n).collect::<Vec<_>>());
            assert!(tree.leaves.iter().all(|(a, b)| (1..=8).contains(&(b - a))));
            assert_eq!(tree.leaves.last().map(|l| l.1), Some(n));
        }
    }

    #[test]
    fn leaves_and_nodes_take_at_most_70_bytes_per_item() {
        let tree = build(&boxes(100_000));
        let bytes = (tree.nodes.len() * 256 + tree.leaves.len() * 320) as f64 / 100_000.0;
        assert!(bytes <= 70.0, "{bytes} bytes");
    }

    #[test]
    fn equal_boxes_and_flat_boxes_still_split() {
        let same = vec![Aabb::of_points(&[[1.0, 2.0, 3.0]]); 1000];
        let tree = build(&same);
        assert_eq!(tree.order.len(), 1000);
        assert!(tree.leaves.len() <= 190, "{} leaves", tree.leaves.len());
    }

    #[test]
    fn no_items_no_nodes() {
        assert!(build(&[]).nodes.is_empty());
    }
}
