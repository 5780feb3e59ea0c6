//! The quadtree of cells over the pinned square (spec/scene.md). Pinned cells remain; a cell with too many triangles is split.

use std::collections::BTreeSet;

use map3d_base::Box3;
use map3d_base::tile::morton;
use map3d_scene::index::Cell;

use crate::triangle::BuildTriangle;

pub(crate) const CELL_TRIANGLES: u64 = 262_144;
/// A cell's triangles must lie within float32's exact reach of its centre.
const MAX_SIDE_M: f64 = 4096.0;
/// Height of the slabs that a cell is cut into, for the same reason; slab 0 is centred on the local origin.
const SLAB_M: f64 = 6144.0;
/// The outer cells of the square also take content up to this distance outside it.
const OUTSIDE_MARGIN_M: f64 = 1024.0;
/// Cells of this level are counted before triangles are sorted into them.
const COUNT_LEVEL: u32 = 10;
const MAX_LEVEL: u32 = 24;

/// x0, y0 and side in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PinnedSquare(pub [f64; 3]);

impl PinnedSquare {
    /// Returns the square of a new scene: a corner in whole metres, a power of two as side, and a margin.
    pub fn around(bounds: &Box3) -> Self {
        if bounds.is_empty() {
            return Self([-32.0, -32.0, 64.0]);
        }
        let extent = (bounds.hi[0] - bounds.lo[0]).max(bounds.hi[1] - bounds.lo[1]) * 1.05 + 2.0;
        let side = f64::exp2(extent.log2().ceil()).max(64.0);
        let c = bounds.center();
        Self([(c[0] - side / 2.0).floor(), (c[1] - side / 2.0).floor(), side])
    }

    /// Doubles the square until it contains the content, with a margin; returns it and its cells as cells of the larger square.
    pub fn grown(self, bounds: &Box3, cells: &[Cell]) -> (Self, Vec<Cell>) {
        let (mut square, mut cells) = (self, cells.to_vec());
        while !bounds.is_empty() && square.is_exceeded_by(bounds) {
            let Self([x0, y0, side]) = square;
            let (west, south) = (bounds.lo[0] < x0, bounds.lo[1] < y0);
            cells.iter_mut().for_each(|[level, x, y]| {
                (*x, *y) = (*x + (u32::from(west) << *level), *y + (u32::from(south) << *level));
                *level += 1;
            });
            square = Self([if west { x0 - side } else { x0 }, if south { y0 - side } else { y0 }, side * 2.0]);
            cells.retain(|c| c[0] <= MAX_LEVEL);
        }
        (square, cells)
    }

    /// Whether content reaches further outside the square than its outer cells take it.
    fn is_exceeded_by(&self, bounds: &Box3) -> bool {
        let Self([x0, y0, side]) = *self;
        let room = (side / 4.0).min(OUTSIDE_MARGIN_M);
        bounds.lo[0] < x0 - room || bounds.lo[1] < y0 - room || bounds.hi[0] > x0 + side + room || bounds.hi[1] > y0 + side + room
    }

    /// Returns the number of the counting level's cell that contains a triangle's centroid.
    pub fn number(&self, t: &BuildTriangle) -> u32 {
        let [_, x, y] = self.cell(COUNT_LEVEL, t.centroid_m());
        y << COUNT_LEVEL | x
    }

    /// Returns the cell of a level that contains a point; the nearest one for a point outside the square.
    fn cell(&self, level: u32, p: [f64; 3]) -> Cell {
        let count = f64::from(1u32 << level);
        let at = |k: usize| ((p[k] - self.0[k]) / self.0[2] * count).floor().clamp(0.0, count - 1.0) as u32;
        [level, at(0), at(1)]
    }

    fn side(&self, level: u32) -> f64 {
        self.0[2] / f64::from(1u32 << level)
    }

    /// Returns local x, y of a cell's centre.
    pub fn center(&self, [level, x, y]: Cell) -> [f64; 2] {
        let side = self.side(level);
        [self.0[0] + (f64::from(x) + 0.5) * side, self.0[1] + (f64::from(y) + 0.5) * side]
    }
}

/// Counts triangles per cell of `COUNT_LEVEL` and assigns these cells to sorting cells.
pub(crate) struct Quadtree {
    pub square: PinnedSquare,
    counts: Vec<u64>,
    pinned: BTreeSet<Cell>,
    /// Ancestors of pinned cells.
    above_pinned: BTreeSet<Cell>,
    sorting_cells: Vec<Cell>,
    /// For each cell of `COUNT_LEVEL` an index into `sorting_cells`.
    homes: Vec<u32>,
}

impl Quadtree {
    pub fn new(square: PinnedSquare, pinned: &[Cell]) -> Self {
        let mut above_pinned = BTreeSet::new();
        for [level, x, y] in pinned {
            above_pinned.extend((0..*level).map(|l| [l, x >> (level - l), y >> (level - l)]));
        }
        let counts = vec![0; 1 << (2 * COUNT_LEVEL)];
        Self { square, counts, pinned: pinned.iter().copied().collect(), above_pinned, sorting_cells: Vec::new(), homes: Vec::new() }
    }

    /// Counts `n` triangles of a cell of the counting level.
    pub fn add(&mut self, number: u32, n: u64) {
        if let Some(count) = self.counts.get_mut(number as usize) {
            *count += n;
        }
    }

    /// Chooses the sorting cells from the counts.
    pub fn choose_sorting_cells(&mut self) {
        let mut pyramid = vec![std::mem::take(&mut self.counts)];
        for level in (0..COUNT_LEVEL).rev() {
            let below = pyramid.last().expect("one level at least");
            let side = 1usize << level;
            let sum = |k: usize| {
                let (x, y) = (k % side * 2, k / side * 2);
                [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].iter().map(|(x, y)| below[y * side * 2 + x]).sum()
            };
            pyramid.push((0..side * side).map(sum).collect());
        }
        pyramid.reverse();
        let mut stack: Vec<Cell> = vec![[0, 0, 0]];
        while let Some(cell) = stack.pop() {
            let [level, x, y] = cell;
            let count = pyramid[level as usize][(y as usize) << level | x as usize];
            if count > 0 && level < COUNT_LEVEL && self.must_split(cell, count) {
                stack.extend(children(cell));
            } else if count > 0 {
                self.sorting_cells.push(cell);
            }
        }
        self.sorting_cells.sort_unstable();
        self.assign_homes();
    }

    fn assign_homes(&mut self) {
        self.homes = vec![u32::MAX; 1 << (2 * COUNT_LEVEL)];
        for ([level, x, y], number) in self.sorting_cells.iter().zip(0..) {
            let side = 1usize << (COUNT_LEVEL - level);
            let first = ((*y as usize * side) << COUNT_LEVEL) + *x as usize * side;
            (0..side).for_each(|row| self.homes[first + (row << COUNT_LEVEL)..][..side].fill(number));
        }
    }

    fn must_split(&self, cell: Cell, count: u64) -> bool {
        if self.above_pinned.contains(&cell) || count > CELL_TRIANGLES {
            return true;
        }
        !self.pinned.contains(&cell) && self.square.side(cell[0]) > MAX_SIDE_M
    }

    /// Returns the cells into which triangles are sorted first; `leaves` splits a few of them further.
    pub fn sorting_cells(&self) -> &[Cell] {
        &self.sorting_cells
    }

    /// Returns the number of the sorting cell that contains a cell of the counting level; `None` when that cell is empty.
    pub fn home(&self, number: u32) -> Option<usize> {
        self.homes.get(number as usize).filter(|home| **home != u32::MAX).map(|home| *home as usize)
    }

    /// Whether a cell with this number of triangles is not a leaf.
    pub fn is_split(&self, cell: Cell, count: u64) -> bool {
        cell[0] < MAX_LEVEL && self.must_split(cell, count)
    }

    /// Returns the child of a cell that contains a triangle.
    pub fn child(&self, cell: Cell, t: &BuildTriangle) -> Cell {
        let home = self.square.cell(cell[0] + 1, t.centroid_m());
        children(cell)[(home[1] & 1 | (home[2] & 1) << 1) as usize]
    }

    /// Splits a sorting cell's triangles into leaf cells; keeps their order.
    pub fn leaves(&self, cell: Cell, triangles: Vec<BuildTriangle>) -> Vec<(Cell, Vec<BuildTriangle>)> {
        let mut out = Vec::new();
        let mut stack = vec![(cell, triangles)];
        while let Some((cell, triangles)) = stack.pop() {
            if self.is_split(cell, triangles.len() as u64) {
                let mut parts = children(cell).map(|c| (c, Vec::new()));
                for t in triangles {
                    let home = self.square.cell(cell[0] + 1, t.centroid_m());
                    let k = (home[1] & 1 | (home[2] & 1) << 1) as usize;
                    parts[k].1.push(t);
                }
                stack.extend(parts.into_iter().filter(|p| !p.1.is_empty()));
            } else {
                out.push((cell, triangles));
            }
        }
        out
    }

    /// Returns the leaf cells to pin: those with triangles, and pinned ones that were not split.
    pub fn pin(&self, with_triangles: &[Cell]) -> Vec<Cell> {
        let used: BTreeSet<Cell> = with_triangles.iter().copied().collect();
        let is_split = |c: &Cell| used.iter().any(|u| u[0] > c[0] && u[1] >> (u[0] - c[0]) == c[1] && u[2] >> (u[0] - c[0]) == c[2]);
        let kept = self.pinned.iter().filter(|c| !is_split(c)).copied();
        let mut cells: Vec<Cell> = used.iter().copied().chain(kept).collect();
        cells.sort_unstable_by_key(|c| morton_key(*c));
        cells.dedup();
        cells
    }
}

/// Returns a key that sorts cells of all levels in Morton order of their first corner, larger cells first.
pub(crate) fn morton_key([level, x, y]: Cell) -> (u64, u32) {
    let shift = MAX_LEVEL - level;
    (morton(x << shift, y << shift), level)
}

/// Returns the children in the order of `x & 1 | (y & 1) << 1`.
fn children([level, x, y]: Cell) -> [Cell; 4] {
    [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| [level + 1, 2 * x + dx, 2 * y + dy])
}

/// Returns the slab of a triangle's height; most scenes have only slab 0.
pub(crate) fn slab(t: &BuildTriangle) -> i64 {
    (t.centroid_m()[2] / SLAB_M + 0.5).floor() as i64
}

/// Returns the local height of a slab's middle.
pub(crate) fn slab_center(slab: i64) -> f64 {
    slab as f64 * SLAB_M
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn at(x: f64, y: f64) -> BuildTriangle {
        let p = map3d_scene::lattice::snap([x, y, 0.0]);
        BuildTriangle { corners: [p, [p[0] + 6, p[1], 0], [p[0], p[1] + 6, 0]], ..BuildTriangle::zeroed() }
    }

    fn grow(square: PinnedSquare, pinned: &[Cell], triangles: &[BuildTriangle]) -> (Quadtree, Vec<Cell>) {
        let mut tree = Quadtree::new(square, pinned);
        triangles.iter().for_each(|t| tree.add(square.number(t), 1));
        tree.choose_sorting_cells();
        let mut cells = Vec::new();
        for (number, cell) in tree.sorting_cells().iter().enumerate() {
            let mine = triangles.iter().filter(|t| tree.home(square.number(t)) == Some(number)).copied().collect();
            cells.extend(tree.leaves(*cell, mine).into_iter().map(|l| l.0));
        }
        let pinned = tree.pin(&cells);
        (tree, pinned)
    }

    #[test]
    fn few_triangles_are_one_cell() {
        let (_, cells) = grow(PinnedSquare([0.0, 0.0, 1024.0]), &[], &[at(3.0, 4.0), at(1000.0, 900.0)]);
        assert_eq!(cells, vec![[0, 0, 0]]);
    }

    #[test]
    fn a_wide_square_is_split_until_float32_is_exact() {
        let (tree, cells) = grow(PinnedSquare([0.0, 0.0, 65536.0]), &[], &[at(3.0, 4.0), at(60000.0, 900.0)]);
        assert_eq!(cells, vec![[4, 0, 0], [4, 14, 0]]);
        assert!(cells.iter().all(|c| tree.square.side(c[0]) <= MAX_SIDE_M));
    }

    #[test]
    fn pinned_cells_remain_when_content_changes() {
        let square = PinnedSquare([0.0, 0.0, 65536.0]);
        let pinned = vec![[4, 0, 0], [5, 28, 0]];
        let (_, cells) = grow(square, &pinned, &[at(30000.0, 30000.0), at(58000.0, 900.0)]);
        assert!(pinned.iter().all(|c| cells.contains(c)), "{cells:?}");
        assert_eq!(cells.len(), 3);
    }

    #[test]
    fn a_dense_cell_is_split_below_the_counting_level() {
        let many: Vec<_> = (0..CELL_TRIANGLES + 1).map(|k| at(0.001 + 0.04 * (k % 2) as f64, 0.001)).collect();
        let (_, cells) = grow(PinnedSquare([0.0, 0.0, 64.0]), &[], &many);
        assert!(cells.len() == 2 && cells.iter().all(|c| c[0] == 11), "{cells:?}");
    }

    #[test]
    fn a_square_grows_towards_content_and_its_cells_keep_their_places() {
        let square = PinnedSquare([-512.0, 256.0, 1024.0]);
        let cells = [[0, 0, 0], [3, 5, 2], [10, 1023, 0]];
        for (lo, hi) in [([0.0, 300.0], [400.0, 800.0]), ([-700.0, 300.0], [400.0, 800.0])] {
            let bounds = Box3 { lo: [lo[0], lo[1], 0.0], hi: [hi[0], hi[1], 9.0] };
            assert_eq!(square.grown(&bounds, &cells), (square, cells.to_vec()), "inside, or just beside");
        }
        for far in [[90_000.0, 0.0], [0.0, -70_000.0], [-60_000.0, 50_000.0], [5_000.0, 9_000.0]] {
            let mut bounds = Box3 { lo: [-500.0, 260.0, 0.0], hi: [500.0, 1000.0, 9.0] };
            bounds.add_point([far[0], far[1], 0.0]);
            let (larger, moved) = square.grown(&bounds, &cells);
            assert!(!larger.is_exceeded_by(&bounds), "{larger:?}");
            for (old, new) in cells.iter().zip(&moved) {
                assert_eq!(square.center(*old), larger.center(*new));
                assert_eq!(square.side(old[0]), larger.side(new[0]));
            }
        }
        assert_eq!(square.grown(&Box3 { lo: [0.0; 3], hi: [1e9, 1e9, 0.0] }, &[[10, 1, 1]]).1, Vec::<Cell>::new(), "too small to be pinned");
    }

    #[test]
    fn content_outside_the_square_goes_to_the_nearest_cell() {
        let (_, cells) = grow(PinnedSquare([0.0, 0.0, 8192.0]), &[], &[at(-500.0, 9000.0)]);
        assert_eq!(cells, vec![[1, 0, 1]]);
    }
}
