//! The fixed grid of a scene: a quadtree over a pinned square, whose leaf cells are pinned too, so that a local edit rewrites one chunk.

use std::collections::{BTreeMap, BTreeSet};

use map3d_base::tile::morton;

use crate::index::Cell;
use crate::lattice::{Point, STEPS_PER_M, metres};

/// A cell is split while it holds more triangles.
pub const MAX_CELL_TRIANGLES: u64 = 262_144;
/// Larger cells are split whatever they hold, so that float32 is exact within a chunk.
const MAX_CELL_M: f64 = 2048.0;
/// Cells are not split below this side.
const MIN_CELL_M: f64 = 8.0;

/// South-west corner and side in metres; the side is a power of two, the corner a multiple of `MIN_CELL_M`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Square {
    x0: f64,
    y0: f64,
    side: f64,
}

#[derive(Clone, Debug)]
pub struct Grid {
    square: Square,
    leaves: BTreeSet<Cell>,
}

/// Triangles per finest cell, for planning.
#[derive(Default)]
pub struct Census {
    counts: BTreeMap<(i64, i64), u64>,
    /// Least and greatest x, y in metres.
    extent: Option<[f64; 4]>,
}

impl Census {
    pub fn add(&mut self, corners: [Point; 3]) {
        let [x, y] = centroid(corners);
        let fine = ((x / MIN_CELL_M).floor() as i64, (y / MIN_CELL_M).floor() as i64);
        *self.counts.entry(fine).or_default() += 1;
        let e = self.extent.get_or_insert([x, y, x, y]);
        *e = [e[0].min(x), e[1].min(y), e[2].max(x), e[3].max(y)];
    }
}

/// Centroid in local metres, the same for every order of the corners.
pub fn centroid(corners: [Point; 3]) -> [f64; 2] {
    [0, 1].map(|k| (corners[0][k] + corners[1][k] + corners[2][k]) as f64 / (3.0 * STEPS_PER_M))
}

impl Grid {
    /// Pins a grid for what the census counted; `pinned` (square and leaf cells of an earlier build) is kept where it can be.
    pub fn plan(census: &Census, pinned: Option<([f64; 3], &[Cell])>) -> Self {
        let extent = census.extent.unwrap_or([0.0; 4]);
        let mut grid = match pinned {
            Some(([x0, y0, side], cells)) => Self { square: Square { x0, y0, side }, leaves: cells.iter().copied().collect() },
            None => Self { square: first_square(extent), leaves: BTreeSet::from([[0, 0, 0]]) },
        };
        while !grid.square.holds(extent) {
            grid.grow(extent);
        }
        grid.split(census, if pinned.is_some() { 2 } else { 1 });
        grid
    }

    pub fn square(&self) -> [f64; 3] {
        [self.square.x0, self.square.y0, self.square.side]
    }

    /// Leaf cells in Morton order of their south-west corners.
    pub fn cells(&self) -> Vec<Cell> {
        let deepest = self.leaves.iter().map(|c| c[0]).max().unwrap_or(0);
        let mut cells: Vec<Cell> = self.leaves.iter().copied().collect();
        cells.sort_by_key(|c| (morton(c[1] << (deepest - c[0]), c[2] << (deepest - c[0])), c[0]));
        cells
    }

    /// The leaf cell that holds a triangle's centroid.
    pub fn cell_of(&self, corners: [Point; 3]) -> Cell {
        let [x, y] = centroid(corners);
        let mut cell = [0, 0, 0];
        while !self.leaves.contains(&cell) {
            cell = self.square.cell_at(cell[0] + 1, x, y);
        }
        cell
    }

    /// Doubles the square towards the extent; its cells become cells of a quadrant.
    fn grow(&mut self, extent: [f64; 4]) {
        let s = self.square;
        let west = extent[0] < s.x0;
        let south = extent[1] < s.y0;
        self.square = Square { x0: s.x0 - if west { s.side } else { 0.0 }, y0: s.y0 - if south { s.side } else { 0.0 }, side: s.side * 2.0 };
        let (qx, qy) = (u32::from(west), u32::from(south));
        let moved: BTreeSet<Cell> = self.leaves.iter().map(|c| [c[0] + 1, c[1] + (qx << c[0]), c[2] + (qy << c[0])]).collect();
        let others = [[1, 0, 0], [1, 1, 0], [1, 0, 1], [1, 1, 1]].into_iter().filter(|c| *c != [1, qx, qy]);
        self.leaves = moved.into_iter().chain(others).collect();
    }

    /// Splits leaves that are too large, or hold more than `slack` times the limit.
    fn split(&mut self, census: &Census, slack: u64) {
        let mut counts: BTreeMap<Cell, Vec<((i64, i64), u64)>> = self.leaves.iter().map(|c| (*c, Vec::new())).collect();
        for (fine, n) in &census.counts {
            let cell = self.cell_of_fine(*fine);
            counts.entry(cell).or_default().push((*fine, *n));
        }
        let mut todo: Vec<(Cell, Vec<((i64, i64), u64)>)> = counts.into_iter().collect();
        while let Some((cell, fines)) = todo.pop() {
            let side = self.square.side / f64::from(1u32 << cell[0]);
            let total: u64 = fines.iter().map(|f| f.1).sum();
            let crowded = total > MAX_CELL_TRIANGLES * slack && side > MIN_CELL_M;
            if !crowded && side <= MAX_CELL_M {
                continue;
            }
            self.leaves.remove(&cell);
            let mut parts: BTreeMap<Cell, Vec<((i64, i64), u64)>> = BTreeMap::new();
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let child = [cell[0] + 1, 2 * cell[1] + dx, 2 * cell[2] + dy];
                self.leaves.insert(child);
                parts.insert(child, Vec::new());
            }
            for (fine, n) in fines {
                let at = fine_centre(fine);
                parts.entry(self.square.cell_at(cell[0] + 1, at[0], at[1])).or_default().push((fine, n));
            }
            todo.extend(parts);
        }
    }

    fn cell_of_fine(&self, fine: (i64, i64)) -> Cell {
        let at = fine_centre(fine);
        let mut cell = [0, 0, 0];
        while !self.leaves.contains(&cell) {
            cell = self.square.cell_at(cell[0] + 1, at[0], at[1]);
        }
        cell
    }
}

impl Square {
    fn holds(&self, e: [f64; 4]) -> bool {
        e[0] >= self.x0 && e[1] >= self.y0 && e[2] < self.x0 + self.side && e[3] < self.y0 + self.side
    }

    fn cell_at(&self, level: u32, x: f64, y: f64) -> Cell {
        let n = f64::from(1u32 << level);
        let index = |v: f64, v0: f64| (((v - v0) / self.side * n).floor().clamp(0.0, n - 1.0)) as u32;
        [level, index(x, self.x0), index(y, self.y0)]
    }
}

fn fine_centre(fine: (i64, i64)) -> [f64; 2] {
    [(fine.0 as f64 + 0.5) * MIN_CELL_M, (fine.1 as f64 + 0.5) * MIN_CELL_M]
}

/// A square around the extent with room for growth.
fn first_square(e: [f64; 4]) -> Square {
    let need = ((e[2] - e[0]).max(e[3] - e[1]) * 1.25).max(64.0);
    let side = need.log2().ceil().exp2();
    let corner = |lo: f64, hi: f64| (((lo + hi) / 2.0 - side / 2.0) / MIN_CELL_M).floor() * MIN_CELL_M;
    Square { x0: corner(e[0], e[2]), y0: corner(e[1], e[3]), side }
}

/// Origin of a chunk: the lattice point in the middle of its content.
pub fn chunk_origin(lo: Point, hi: Point) -> Point {
    [0, 1, 2].map(|k| (lo[k] + hi[k]).div_euclid(2))
}

/// In metres, for messages.
pub fn extent_m(lo: Point, hi: Point) -> f64 {
    let (a, b) = (metres(lo), metres(hi));
    (0..3).map(|k| b[k] - a[k]).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::snap;

    fn triangle(x: f64, y: f64) -> [Point; 3] {
        [snap([x, y, 0.0]), snap([x + 0.5, y, 0.0]), snap([x, y + 0.5, 0.0])]
    }

    fn census(points: &[(f64, f64)], n: u64) -> Census {
        let mut census = Census::default();
        for (x, y) in points {
            census.add(triangle(*x, *y));
        }
        census.counts.values_mut().for_each(|c| *c *= n);
        census
    }

    #[test]
    fn leaves_tile_the_square() {
        let grid = Grid::plan(&census(&[(0.0, 0.0), (100.0, 30.0), (3000.0, 4000.0)], 200_000), None);
        let area: f64 = grid.leaves.iter().map(|c| 0.25f64.powi(c[0] as i32)).sum();
        assert_eq!(area, 1.0);
    }

    #[test]
    fn crowded_cells_are_split_and_a_triangle_has_one_cell() {
        let points = [(0.0, 0.0), (20.0, 0.0), (40.0, 50.0)];
        let grid = Grid::plan(&census(&points, 200_000), None);
        let cells: BTreeSet<Cell> = points.iter().map(|(x, y)| grid.cell_of(triangle(*x, *y))).collect();
        assert_eq!(cells.len(), 3);
    }

    #[test]
    fn a_pinned_grid_keeps_its_cells_when_content_is_added_outside() {
        let first = Grid::plan(&census(&[(0.0, 0.0), (500.0, 500.0)], 200_000), None);
        let more = census(&[(0.0, 0.0), (500.0, 500.0), (-900.0, 200.0)], 200_000);
        let second = Grid::plan(&more, Some((first.square(), &first.cells())));
        let bounds = |g: &Grid, c: Cell| {
            let side = g.square.side / f64::from(1u32 << c[0]);
            (g.square.x0 + f64::from(c[1]) * side, g.square.y0 + f64::from(c[2]) * side, side)
        };
        let t = triangle(500.0, 500.0);
        assert_eq!(bounds(&first, first.cell_of(t)), bounds(&second, second.cell_of(t)));
    }
}
