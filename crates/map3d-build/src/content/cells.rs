//! Content by cell of a grid that becomes coarser as more cells are occupied.

use std::collections::BTreeMap;

use map3d_base::kept_space::{bounds_of, diagonal_m};
use map3d_base::{Box3, Vec3};
use serde::{Deserialize, Serialize};

/// Side of the finest cells.
const CELL_M: f64 = 1024.0;
/// Above this number of cells the grid becomes coarser.
const MAX_CELLS: usize = 4096;
/// Diagonals below two to this power are one class: such triangles are small in every scene.
const SMALL_CLASS: u8 = 11;
const CLASSES: usize = 64;

/// Size class, then the number of the cell along x, y and z.
pub type CellKey = (u8, [i64; 3]);

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContentCell {
    pub triangles: u64,
    /// Objects with more triangles here than elsewhere.
    pub objects: u64,
    /// Large triangles with a corner at 0, 0, 0.
    pub zeros: u64,
    pub bounds: Box3,
}

impl ContentCell {
    const EMPTY: Self = Self { triangles: 0, objects: 0, zeros: 0, bounds: Box3::EMPTY };

    pub fn merge(&mut self, other: &Self) {
        self.triangles += other.triangles;
        self.objects += other.objects;
        self.zeros += other.zeros;
        self.bounds.add_box(&other.bounds);
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContentCells {
    /// Cells have `CELL_M` times two to this power as side.
    pub scale: u32,
    pub cells: BTreeMap<CellKey, ContentCell>,
    /// Triangles by the binary logarithm of their box's diagonal.
    pub sizes: BTreeMap<u8, u64>,
}

/// The JSON form of a cell: its key, triangles, objects, zeros, and the corners of its box.
type CellRow = (u8, [i64; 3], u64, u64, u64, [f64; 6]);

/// The JSON form of `ContentCells`.
#[derive(Serialize, Deserialize)]
pub(super) struct CellsDocument {
    scale: u32,
    sizes: Vec<(u8, u64)>,
    cells: Vec<CellRow>,
}

impl ContentCells {
    /// Adds a triangle.
    pub fn add(&mut self, corners: [Vec3; 3]) -> CellKey {
        let key = Self::finest_key(corners);
        let bounds = bounds_of(corners);
        let zeros = u64::from(key.0 > 0 && corners.contains(&[0.0; 3]));
        *self.sizes.entry(size_class(&bounds)).or_default() += 1;
        self.merge_cell(key, &ContentCell { triangles: 1, zeros, bounds, ..ContentCell::EMPTY });
        key
    }

    /// Counts an object; `key` is that of `add`.
    pub fn add_object(&mut self, key: CellKey) {
        self.merge_cell(key, &ContentCell { objects: 1, ..ContentCell::EMPTY });
    }

    pub fn merge(&mut self, other: &Self) {
        self.coarsen_to(self.scale.max(other.scale));
        for (class, count) in &other.sizes {
            *self.sizes.entry(*class).or_default() += count;
        }
        for ((class, at), cell) in &other.cells {
            let key = (*class, at.map(|v| v >> (self.scale - other.scale).min(63)));
            self.cells.entry(key).or_insert(ContentCell::EMPTY).merge(cell);
        }
        self.limit();
    }

    /// Doubles the side of the cells.
    pub fn coarsen(&mut self) {
        self.coarsen_to(self.scale + 1);
    }

    pub fn triangles(&self) -> u64 {
        self.sizes.values().sum()
    }

    /// Returns a power of two in metres that three of four triangles do not exceed.
    pub fn usual_size_m(&self) -> f64 {
        let (mut seen, enough) = (0, (self.triangles() * 3).div_ceil(4));
        let class = self.sizes.iter().find_map(|(class, count)| {
            seen += count;
            (seen >= enough).then_some(*class)
        });
        f64::exp2(f64::from(class.unwrap_or(0)) + 1.0)
    }

    fn merge_cell(&mut self, (class, at): CellKey, cell: &ContentCell) {
        let key = (class, at.map(|v| v >> self.scale.min(63)));
        self.cells.entry(key).or_insert(ContentCell::EMPTY).merge(cell);
        self.limit();
    }

    fn limit(&mut self) {
        while self.cells.len() > MAX_CELLS && self.scale < 63 {
            self.coarsen();
        }
    }

    fn coarsen_to(&mut self, scale: u32) {
        let by = scale - self.scale;
        if by == 0 {
            return;
        }
        for ((class, at), cell) in std::mem::take(&mut self.cells) {
            let key = (class, at.map(|v| v >> by.min(63)));
            self.cells.entry(key).or_insert(ContentCell::EMPTY).merge(&cell);
        }
        self.scale = scale;
    }

    /// Returns the key of a triangle in the finest grid.
    fn finest_key(corners: [Vec3; 3]) -> CellKey {
        let bounds = bounds_of(corners);
        let class = size_class(&bounds);
        // The conversion of huge numbers saturates.
        let at = bounds.center().map(|v| (v / CELL_M).floor() as i64);
        (if class < SMALL_CLASS { 0 } else { class }, at)
    }

    pub(super) fn to_document(&self) -> CellsDocument {
        let row = |((class, at), c): (&CellKey, &ContentCell)| {
            let (lo, hi) = (c.bounds.lo, c.bounds.hi);
            (*class, *at, c.triangles, c.objects, c.zeros, [lo[0], lo[1], lo[2], hi[0], hi[1], hi[2]])
        };
        let sizes = self.sizes.iter().map(|(k, n)| (*k, *n)).collect();
        CellsDocument { scale: self.scale, sizes, cells: self.cells.iter().map(row).collect() }
    }

    pub(super) fn from_document(document: CellsDocument) -> Self {
        let cell = |(class, at, triangles, objects, zeros, b): CellRow| {
            let bounds = Box3 { lo: [b[0], b[1], b[2]], hi: [b[3], b[4], b[5]] };
            ((class, at), ContentCell { triangles, objects, zeros, bounds })
        };
        let cells = document.cells.into_iter().map(cell).collect();
        Self { scale: document.scale, cells, sizes: document.sizes.into_iter().collect() }
    }
}

/// Returns the binary logarithm of a box's diagonal, rounded down; 0 up to 2 m.
fn size_class(bounds: &Box3) -> u8 {
    (diagonal_m(bounds).log2().floor().max(0.0) as u8).min(CLASSES as u8 - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64) -> [Vec3; 3] {
        [[x, y, 0.0], [x + 10.0, y, 0.0], [x, y + 10.0, 0.0]]
    }

    #[test]
    fn cells_depend_neither_on_the_order_nor_on_how_content_is_divided() {
        let all: Vec<[Vec3; 3]> = (0..20_000).map(|k| at(f64::from(k % 141) * 1500.0, f64::from(k / 141) * 1500.0 - 1e6)).collect();
        let measured = |triangles: &mut dyn Iterator<Item = &[Vec3; 3]>| {
            let mut cells = ContentCells::default();
            triangles.for_each(|t| {
                cells.add(*t);
            });
            cells
        };
        let whole = measured(&mut all.iter());
        assert!(whole.cells.len() <= MAX_CELLS && whole.scale > 0);
        assert_eq!(measured(&mut all.iter().rev()), whole);
        let mut halves = measured(&mut all[..700].iter());
        halves.merge(&measured(&mut all[700..].iter()));
        assert_eq!(halves, whole);
        assert_eq!(ContentCells::from_document(whole.to_document()), whole);
    }

    #[test]
    fn the_usual_size_ignores_a_quarter_of_the_triangles() {
        let mut cells = ContentCells::default();
        (0..3).for_each(|k| {
            cells.add(at(f64::from(k), 0.0));
        });
        cells.add([[0.0; 3], [1e12, 0.0, 0.0], [0.0, 1e12, 0.0]]);
        assert_eq!(cells.usual_size_m(), 16.0);
    }

    #[test]
    fn huge_coordinates_are_cells_too() {
        let mut cells = ContentCells::default();
        cells.add([[1e300; 3], [-1e300; 3], [f64::MAX, 0.0, 0.0]]);
        cells.add(at(-f64::MAX, f64::MAX));
        (0..70).for_each(|_| cells.coarsen());
        assert_eq!(cells.triangles(), 2);
    }
}
