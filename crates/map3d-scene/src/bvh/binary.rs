//! The binary tree before it is collapsed: binned splits high up, exact sweeps near the leaves. A leaf of up to eight items costs as much as a leaf
//! of one, so counts are rounded up to whole leaves; that fills them well.

use super::{Aabb, LEAF_ITEMS};

const BINS: usize = 16;
/// Fewer items than this are sorted and swept exactly.
const SWEEP_ITEMS: usize = 32;

#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// Range of `BinaryTree::order`.
    Leaf {
        start: u32,
        end: u32,
    },
    Inner {
        children: [u32; 2],
    },
}

pub(super) struct BinaryNode {
    pub bounds: Aabb,
    pub kind: Kind,
}

pub(super) struct BinaryTree {
    /// Node 0 is the root.
    pub nodes: Vec<BinaryNode>,
    pub order: Vec<u32>,
}

/// A box with its number; moved about while splitting.
#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    number: u32,
}

impl Item {
    /// Twice the box's centre.
    #[inline(always)]
    fn center2(&self, axis: usize) -> f32 {
        self.bounds.lo[axis] + self.bounds.hi[axis]
    }
}

impl BinaryTree {
    pub fn build(boxes: &[Aabb]) -> Self {
        let mut items: Vec<Item> = boxes.iter().zip(0..).map(|(bounds, number)| Item { bounds: *bounds, number }).collect();
        let mut nodes = vec![BinaryNode { bounds: Aabb::EMPTY, kind: Kind::Leaf { start: 0, end: 0 } }];
        let mut stack = vec![(0usize, 0usize, items.len())];
        while let Some((node, start, end)) = stack.pop() {
            let slice = &mut items[start..end];
            nodes[node].bounds = bounds_of(slice);
            if slice.len() <= LEAF_ITEMS {
                nodes[node].kind = Kind::Leaf { start: start as u32, end: end as u32 };
                continue;
            }
            let middle = start + split(slice, &nodes[node].bounds);
            let first = nodes.len();
            nodes[node].kind = Kind::Inner { children: [first as u32, first as u32 + 1] };
            for (k, (a, b)) in [(start, middle), (middle, end)].into_iter().enumerate() {
                nodes.push(BinaryNode { bounds: Aabb::EMPTY, kind: Kind::Leaf { start: 0, end: 0 } });
                stack.push((first + k, a, b));
            }
        }
        Self { nodes, order: items.iter().map(|i| i.number).collect() }
    }
}

fn bounds_of(items: &[Item]) -> Aabb {
    let mut out = Aabb::EMPTY;
    items.iter().for_each(|i| out.add(&i.bounds));
    out
}

fn leaf_cost(bounds: &Aabb, count: usize) -> f32 {
    bounds.half_area() * count.div_ceil(LEAF_ITEMS) as f32
}

/// Reorders the items and returns how many go to the first side: at least one on each.
fn split(items: &mut [Item], bounds: &Aabb) -> usize {
    if items.len() <= SWEEP_ITEMS {
        return split_swept(items);
    }
    split_binned(items, bounds).unwrap_or_else(|| split_at_middle(items))
}

/// Whole leaves on the first side.
fn split_at_middle(items: &mut [Item]) -> usize {
    (items.len() / 2).next_multiple_of(LEAF_ITEMS).min(items.len() - 1)
}

struct Bins {
    origin: [f32; 3],
    scale: [f32; 3],
    bounds: [[Aabb; BINS]; 3],
    counts: [[usize; BINS]; 3],
}

impl Bins {
    fn new(items: &[Item]) -> Self {
        let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for item in items {
            for k in 0..3 {
                let c = item.center2(k);
                lo[k] = if c < lo[k] { c } else { lo[k] };
                hi[k] = if c > hi[k] { c } else { hi[k] };
            }
        }
        let scale = [0, 1, 2].map(|k| if hi[k] > lo[k] { BINS as f32 * 0.9999 / (hi[k] - lo[k]) } else { 0.0 });
        let mut bins = Self { origin: lo, scale, bounds: [[Aabb::EMPTY; BINS]; 3], counts: [[0; BINS]; 3] };
        for item in items {
            for axis in 0..3 {
                let k = bins.index(item, axis);
                bins.bounds[axis][k].add(&item.bounds);
                bins.counts[axis][k] += 1;
            }
        }
        bins
    }

    #[inline(always)]
    fn index(&self, item: &Item, axis: usize) -> usize {
        (((item.center2(axis) - self.origin[axis]) * self.scale[axis]) as usize).min(BINS - 1)
    }

    /// (cost, axis, first bin of the second side) of the cheapest split that leaves neither side empty.
    fn best(&self, total: usize) -> Option<(f32, usize, usize)> {
        let mut best: Option<(f32, usize, usize)> = None;
        for axis in (0..3).filter(|a| self.scale[*a] > 0.0) {
            let mut right = [Aabb::EMPTY; BINS];
            let mut acc = Aabb::EMPTY;
            for k in (1..BINS).rev() {
                acc.add(&self.bounds[axis][k]);
                right[k] = acc;
            }
            let (mut left, mut count) = (Aabb::EMPTY, 0);
            for k in 1..BINS {
                left.add(&self.bounds[axis][k - 1]);
                count += self.counts[axis][k - 1];
                if count == 0 || count == total {
                    continue;
                }
                let cost = leaf_cost(&left, count) + leaf_cost(&right[k], total - count);
                if best.is_none_or(|b| cost < b.0) {
                    best = Some((cost, axis, k));
                }
            }
        }
        best
    }
}

fn split_binned(items: &mut [Item], _bounds: &Aabb) -> Option<usize> {
    let bins = Bins::new(items);
    let (_, axis, border) = bins.best(items.len())?;
    let (mut a, mut b) = (0, items.len());
    while a < b {
        if bins.index(&items[a], axis) < border {
            a += 1;
        } else {
            b -= 1;
            items.swap(a, b);
        }
    }
    Some(a)
}

/// The best of all splits along the three axes, each sorted by centre.
fn split_swept(items: &mut [Item]) -> usize {
    let n = items.len();
    let mut best = (f32::INFINITY, 0, split_at_middle(items));
    for axis in 0..3 {
        sort_by_center(items, axis);
        let mut right = [0f32; SWEEP_ITEMS + 1];
        let mut acc = Aabb::EMPTY;
        for k in (1..n).rev() {
            acc.add(&items[k].bounds);
            right[k] = leaf_cost(&acc, n - k);
        }
        let mut left = Aabb::EMPTY;
        for k in 1..n {
            left.add(&items[k - 1].bounds);
            let cost = leaf_cost(&left, k) + right[k];
            let more_even = (2 * k).abs_diff(n) < (2 * best.2).abs_diff(n);
            if cost < best.0 || (cost == best.0 && more_even) {
                best = (cost, axis, k);
            }
        }
    }
    if best.1 != 2 {
        sort_by_center(items, best.1);
    }
    best.2
}

fn sort_by_center(items: &mut [Item], axis: usize) {
    items.sort_unstable_by(|a, b| a.center2(axis).total_cmp(&b.center2(axis)).then(a.number.cmp(&b.number)));
}
