//! The top-level tree over the parts of a scene: chunks in place, and prototypes where instances place them.

use map3d_base::Box3;

use crate::bvh::{self, Aabb, Tree};
use crate::records::{EMPTY, LEAF_BIT};

/// A small tree over boxes in local coordinates; its float32 boxes are rounded outwards.
#[derive(Debug, Default)]
pub struct TopLevel {
    tree: Tree,
}

impl TopLevel {
    pub fn build(boxes: &[Box3]) -> Self {
        Self { tree: bvh::build(&boxes.iter().map(outward).collect::<Vec<_>>()) }
    }

    /// Writes to `out` the numbers of the boxes in leaves that `meets` accepts, in tree order: a superset of the boxes that it accepts.
    pub fn candidates(&self, mut meets: impl FnMut(&Box3) -> bool, out: &mut Vec<u32>) {
        out.clear();
        let mut stack = if self.tree.nodes.is_empty() { vec![] } else { vec![0u32] };
        while let Some(child) = stack.pop() {
            if child & LEAF_BIT != 0 {
                let (a, b) = self.tree.leaves[(child & !LEAF_BIT) as usize];
                out.extend_from_slice(&self.tree.order[a as usize..b as usize]);
                continue;
            }
            let node = &self.tree.nodes[child as usize];
            for k in (0..8).rev().filter(|k| node.child[*k] != EMPTY) {
                let b = [0, 1, 2, 3, 4, 5].map(|a| f64::from(node.bounds[a][k]));
                if meets(&Box3 { lo: [b[0], b[1], b[2]], hi: [b[3], b[4], b[5]] }) {
                    stack.push(node.child[k]);
                }
            }
        }
    }
}

fn outward(b: &Box3) -> Aabb {
    let down = |v: f64| if f64::from(v as f32) > v { (v as f32).next_down() } else { v as f32 };
    let up = |v: f64| if f64::from(v as f32) < v { (v as f32).next_up() } else { v as f32 };
    Aabb { lo: [down(b.lo[0]), down(b.lo[1]), down(b.lo[2]), 0.0], hi: [up(b.hi[0]), up(b.hi[1]), up(b.hi[2]), 0.0] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn candidates_never_miss_a_box_that_meets() {
        let boxes: Vec<Box3> = (0..500)
            .map(|i| {
                let x = f64::from(i % 25) * 10.1 + 1e6;
                let y = f64::from(i / 25) * 9.7 - 1e6;
                Box3 { lo: [x, y, 0.0], hi: [x + 3.3, y + 3.3, 5.0] }
            })
            .collect();
        let top = TopLevel::build(&boxes);
        let probe = Box3 { lo: [1e6 + 55.0, -1e6 + 30.0, 1.0], hi: [1e6 + 77.0, -1e6 + 44.0, 2.0] };
        let meets = |b: &Box3| (0..3).all(|k| b.lo[k] <= probe.hi[k] && b.hi[k] >= probe.lo[k]);
        let mut found = Vec::new();
        top.candidates(meets, &mut found);
        for (i, b) in boxes.iter().enumerate().filter(|(_, b)| meets(b)) {
            assert!(found.contains(&(i as u32)), "{b:?}");
        }
        assert!(found.len() < 100, "{} candidates", found.len());
    }

    #[test]
    fn no_boxes_no_candidates() {
        let mut found = vec![1];
        TopLevel::build(&[]).candidates(|_| true, &mut found);
        assert!(found.is_empty());
    }
}
