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

/// A box with its number; moved around during a split.
#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    number: u32,
}

impl Item {
    /// Twice the box's centre.
    #[inline(always)]
    fn center2(&self) -> [f32; 4] {
        std::array::from_fn(|k| self.bounds.lo[k] + self.bounds.hi[k])
    }
}

impl BinaryTree {
    /// Builds the tree from the root down, without recursion.
    pub fn build(boxes: &[Aabb]) -> Self {
        let mut items: Vec<Item> = boxes.iter().zip(0..).map(|(bounds, number)| Item { bounds: *bounds, number }).collect();
        let mut nodes = vec![BinaryNode { bounds: Aabb::EMPTY, kind: Kind::Leaf { start: 0, end: 0 } }];
        let mut stack = vec![(0usize, 0usize, items.len())];
        while let Some((node, start, end)) = stack.pop() {
            let slice = &mut items[start..end];
            let around = ItemBounds::of(slice);
            nodes[node].bounds = around.bounds;

            // Make a leaf of few items
            if slice.len() <= LEAF_ITEMS {
                nodes[node].kind = Kind::Leaf { start: start as u32, end: end as u32 };
                continue;
            }

            // Split the others between two children
            let middle = start + split(slice, &around);
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

/// Box of items, and of twice their centres.
struct ItemBounds {
    bounds: Aabb,
    centers: Aabb,
}

impl ItemBounds {
    fn of(items: &[Item]) -> Self {
        let mut out = Self { bounds: Aabb::EMPTY, centers: Aabb::EMPTY };
        for item in items {
            let c = item.center2();
            out.bounds.add(&item.bounds);
            out.centers.add(&Aabb { lo: c, hi: c });
        }
        out
    }
}

/// Returns the cost of a side as if it had only leaves: its area for each of them.
fn leaf_cost(bounds: &Aabb, count: usize) -> f32 {
    bounds.half_area() * count.div_ceil(LEAF_ITEMS) as f32
}

/// Reorders the items and returns how many go to the first side: at least one on each.
fn split(items: &mut [Item], around: &ItemBounds) -> usize {
    if items.len() <= SWEEP_ITEMS {
        return split_swept(items);
    }
    split_binned(items, around).unwrap_or_else(|| split_at_middle(items.len()))
}

/// Returns half of the items, rounded up to whole leaves.
fn split_at_middle(count: usize) -> usize {
    (count / 2).next_multiple_of(LEAF_ITEMS).min(count - 1)
}

/// Boxes and counts of items in equal intervals of their centres along each axis.
struct Bins {
    origin: [f32; 4],
    scale: [f32; 4],
    bounds: [[Aabb; BINS]; 3],
    counts: [[usize; BINS]; 3],
}

impl Bins {
    fn new(items: &[Item], centers: &Aabb) -> Self {
        // Map centres to bins; a flat axis has one bin
        let (lo, hi) = (centers.lo, centers.hi);
        let scale = [0, 1, 2, 3].map(|k| if hi[k] > lo[k] { BINS as f32 * 0.9999 / (hi[k] - lo[k]) } else { 0.0 });
        let mut bins = Self { origin: lo, scale, bounds: [[Aabb::EMPTY; BINS]; 3], counts: [[0; BINS]; 3] };

        // Add each item to its bin along each axis
        for item in items {
            let k = bins.indices(item);
            for axis in 0..3 {
                bins.bounds[axis][k[axis]].add(&item.bounds);
                bins.counts[axis][k[axis]] += 1;
            }
        }
        bins
    }

    /// Returns the bin of an item along each axis; the fourth is not used.
    #[inline(always)]
    fn indices(&self, item: &Item) -> [usize; 4] {
        let c = item.center2();
        let at: [i32; 4] = std::array::from_fn(|k| ((c[k] - self.origin[k]) * self.scale[k]) as i32);
        at.map(|v| v.clamp(0, BINS as i32 - 1) as usize)
    }

    /// Returns the cheapest split by the surface area heuristic that leaves neither side empty.
    fn cheapest(&self, total: usize) -> Option<CheapestSplit> {
        let mut best: Option<CheapestSplit> = None;
        for axis in (0..3).filter(|a| self.scale[*a] > 0.0) {
            // Collect the boxes of all bins from each border to the end
            let mut right = [Aabb::EMPTY; BINS];
            let mut acc = Aabb::EMPTY;
            for k in (1..BINS).rev() {
                acc.add(&self.bounds[axis][k]);
                right[k] = acc;
            }

            // Sweep the border and keep the least cost
            let (mut left, mut count) = (Aabb::EMPTY, 0);
            for k in 1..BINS {
                left.add(&self.bounds[axis][k - 1]);
                count += self.counts[axis][k - 1];
                if count == 0 || count == total {
                    continue;
                }
                let cost = leaf_cost(&left, count) + leaf_cost(&right[k], total - count);
                if best.as_ref().is_none_or(|b| cost < b.cost) {
                    best = Some(CheapestSplit { cost, axis, border: k });
                }
            }
        }
        best
    }
}

/// A split of binned items.
struct CheapestSplit {
    cost: f32,
    axis: usize,
    /// First bin of the second side.
    border: usize,
}

/// Reorders the items by their cheapest binned split; returns how many go to the first side, `None` if all centres share a bin.
fn split_binned(items: &mut [Item], around: &ItemBounds) -> Option<usize> {
    let bins = Bins::new(items, &around.centers);
    let CheapestSplit { axis, border, .. } = bins.cheapest(items.len())?;

    // Partition the items by bin
    let (mut a, mut b) = (0, items.len());
    while a < b {
        if bins.indices(&items[a])[axis] < border {
            a += 1;
        } else {
            b -= 1;
            items.swap(a, b);
        }
    }
    Some(a)
}

/// Reorders the items by the best of all splits along the three axes, each sorted by centre; returns how many go to the first side.
fn split_swept(items: &mut [Item]) -> usize {
    // Find the best axis and place
    let n = items.len();
    let mut best = (f32::INFINITY, split_at_middle(n));
    let mut chosen = [0u64; SWEEP_ITEMS];
    for axis in 0..3 {
        let order = sorted_by_center(items, axis);
        let (cost, k) = sweep(items, &order[..n], best);
        if axis == 0 || (cost, k) != best {
            chosen = order;
        }
        best = (cost, k);
    }

    // Sort the items along this axis
    let before: [Item; SWEEP_ITEMS] = std::array::from_fn(|k| items[k.min(n - 1)]);
    items.iter_mut().zip(chosen).for_each(|(item, key)| *item = before[place(key)]);
    best.1
}

/// Returns cost and first item of the second side of the best split in an order, or `best`, if none is better: cheaper, or as cheap and more even.
fn sweep(items: &[Item], order: &[u64], mut best: (f32, usize)) -> (f32, usize) {
    // Compute the cost of every second side
    let n = items.len();
    let mut right = [0f32; SWEEP_ITEMS + 1];
    let mut acc = Aabb::EMPTY;
    for k in (1..n).rev() {
        acc.add(&items[place(order[k])].bounds);
        right[k] = leaf_cost(&acc, n - k);
    }

    // Sweep the first side and keep the best sum
    let mut left = Aabb::EMPTY;
    for k in 1..n {
        left.add(&items[place(order[k - 1])].bounds);
        let cost = leaf_cost(&left, k) + right[k];
        let more_even = (2 * k).abs_diff(n) < (2 * best.1).abs_diff(n);
        if cost < best.0 || (cost == best.0 && more_even) {
            best = (cost, k);
        }
    }
    best
}

/// Returns keys that sort like the items' centres, equal ones by place; each ends with the item's place.
fn sorted_by_center(items: &[Item], axis: usize) -> [u64; SWEEP_ITEMS] {
    let mut keys = [u64::MAX; SWEEP_ITEMS];
    for (k, (key, item)) in keys.iter_mut().zip(items).enumerate() {
        let bits = item.center2()[axis].to_bits();
        // Make the bits of a float sort as an integer
        let ordered = if bits >> 31 == 1 { !bits } else { bits | 1 << 31 };
        *key = u64::from(ordered) << 8 | k as u64;
    }
    keys[..items.len()].sort_unstable();
    keys
}

fn place(key: u64) -> usize {
    (key & 0xFF) as usize
}
