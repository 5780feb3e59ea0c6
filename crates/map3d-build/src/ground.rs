//! The ground plane of scenes without terrain: slightly larger than the content, at the height of its ground surfaces. Where content is scattered over
//! a very large area, the plane is only near it.

use std::collections::BTreeSet;

use bytemuck::Zeroable;
use map3d_base::asset::Rank;
use map3d_base::{Box3, Error, Result};
use map3d_scene::lattice::{Point, metres, snap};

use crate::lows::Lows;
use crate::triangle::BuildTriangle;

/// The diagonal of a square of the plane's grid stays below the length at which edges are split.
const GRID_M: f64 = 700.0;
const MARGIN: f64 = 0.05;
const MIN_MARGIN_M: f64 = 10.0;
/// Content smaller than some houses, such as a find, has a margin of this share of its longer side instead of the least one.
const SMALL_MARGIN: f64 = 0.25;
/// Squares of a plane under the whole box; with more, only those near content remain.
const MAX_SQUARES: f64 = 65_536.0;
/// Squares of all planes.
pub(crate) const MAX_ALL_SQUARES: usize = 500_000;

/// Extent and ground height of content.
#[derive(Clone, Debug)]
pub(crate) struct GroundLevel {
    pub bounds: Box3,
    pub has_terrain: bool,
    /// Those of ground surfaces.
    pub grounds: Lows,
    /// Those of all surfaces.
    pub lows: Lows,
}

impl GroundLevel {
    pub fn new() -> Self {
        Self { bounds: Box3::EMPTY, has_terrain: false, grounds: Lows::default(), lows: Lows::default() }
    }

    pub fn add_triangle(&mut self, t: &BuildTriangle) {
        t.corners.iter().for_each(|c| self.bounds.add_point(metres(*c)));
        self.add(t.rank, metres(t.corners.map(|c| c[2])).into_iter().fold(f64::INFINITY, f64::min));
    }

    fn add(&mut self, rank: u8, lowest_m: f64) {
        self.has_terrain |= rank == Rank::Terrain as u8;
        self.lows.add(lowest_m);
        if rank == Rank::Ground as u8 {
            self.grounds.add(lowest_m);
        }
    }

    /// Adds other content.
    pub fn merge(&mut self, other: &Self) {
        self.bounds.add_box(&other.bounds);
        self.has_terrain |= other.has_terrain;
        self.grounds.merge(&other.grounds);
        self.lows.merge(&other.lows);
    }

    /// Appends the triangles of the plane; `asset` is a number that no asset has, `content` the local boxes of everything that the scene has. Returns
    /// false, and appends nothing, when the plane would be too large.
    pub fn plane(&self, asset: u32, object_id: u32, content: &mut dyn Iterator<Item = Box3>, out: &mut Vec<BuildTriangle>) -> Result<bool> {
        if object_id == 0 {
            return Err(Error::argument("build request: ground_id is 0, but the scene needs a ground plane; register an object for it"));
        }
        let height = self.grounds.lowest_m().or_else(|| self.lows.lowest_m()).unwrap_or(self.bounds.lo[2]);
        let grid = [0, 1].map(|k| self.grid(k));
        let Some(squares) = squares(&grid, content, MAX_ALL_SQUARES - (out.len() / 2).min(MAX_ALL_SQUARES)) else { return Ok(false) };
        let corner = |i: usize, j: usize| -> Point { snap([grid[0].line(i), grid[1].line(j), height]) };
        for [j, i] in squares {
            let (a, b, c, d) = (corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1));
            for corners in [[a, b, c], [a, c, d]] {
                let source = out.len() as u32;
                out.push(BuildTriangle {
                    corners,
                    rank: Rank::Terrain as u8,
                    material: u32::MAX,
                    object_id,
                    source,
                    asset,
                    ..BuildTriangle::zeroed()
                });
            }
        }
        Ok(true)
    }

    fn grid(&self, axis: usize) -> GridAxis {
        let (lo, hi) = (self.bounds.lo[axis], self.bounds.hi[axis]);
        let longer = (0..3).map(|k| self.bounds.hi[k] - self.bounds.lo[k]).fold(0.0, f64::max);
        let margin = ((hi - lo) * MARGIN).max((longer * SMALL_MARGIN).min(MIN_MARGIN_M));
        let (lo, hi) = (lo - margin, hi + margin);
        GridAxis { lo, hi, count: ((hi - lo) / GRID_M).ceil() }
    }
}

/// The grid lines along an axis; `count` is that of the gaps between them.
struct GridAxis {
    lo: f64,
    hi: f64,
    count: f64,
}

impl GridAxis {
    fn line(&self, number: usize) -> f64 {
        self.lo + (self.hi - self.lo) * number as f64 / self.count
    }

    /// Returns the gaps that a range meets, one more on each side.
    fn near(&self, lo: f64, hi: f64) -> std::ops::Range<usize> {
        let at = |v: f64| (v - self.lo) / (self.hi - self.lo) * self.count;
        let (first, last) = ((at(lo).floor() - 1.0).max(0.0), (at(hi).floor() + 2.0).min(self.count));
        first as usize..last.max(0.0) as usize
    }
}

/// Returns row and column of the squares of a plane, in order; `None` when there are more than `limit`.
fn squares([x, y]: &[GridAxis; 2], content: &mut dyn Iterator<Item = Box3>, limit: usize) -> Option<BTreeSet<[usize; 2]>> {
    let mut out = BTreeSet::new();
    let mut add = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
        let fits = rows.len().saturating_mul(columns.len()) <= limit;
        if fits {
            out.extend(rows.flat_map(|j| columns.clone().map(move |i| [j, i])));
        }
        fits && out.len() <= limit
    };
    let fits = if x.count * y.count <= MAX_SQUARES {
        add(0..y.count as usize, 0..x.count as usize)
    } else {
        let mut content = content;
        Iterator::all(&mut content, |b| add(y.near(b.lo[1], b.hi[1]), x.near(b.lo[0], b.hi[0])))
    };
    fits.then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use map3d_scene::lattice::is_long;

    #[test]
    fn the_plane_extends_beyond_the_box_and_has_short_edges() {
        let bounds = Box3 { lo: [0.0, -50.0, 3.0], hi: [4000.0, 50.0, 90.0] };
        let mut level = GroundLevel { bounds, ..GroundLevel::new() };
        level.add(Rank::Ground as u8, 5.0);
        let plane = plane(&level, &[bounds]);
        let all = || plane.iter().flat_map(|t| t.corners);
        assert_eq!(all().map(|c| c[0]).min(), Some(-200 * 4096));
        assert_eq!(all().map(|c| c[1]).max(), Some(60 * 4096));
        assert!(all().all(|c| c[2] == 5 * 4096));
        assert!(plane.iter().all(|t| (0..3).all(|k| !is_long(t.corners[k], t.corners[(k + 1) % 3]))));
    }

    #[test]
    fn a_plane_needs_an_object() {
        let level = GroundLevel { bounds: Box3 { lo: [0.0; 3], hi: [1.0; 3] }, ..GroundLevel::new() };
        assert!(level.plane(1, 0, &mut std::iter::empty(), &mut Vec::new()).is_err());
    }

    #[test]
    fn a_very_large_plane_is_only_near_content() {
        let at = |x: f64| Box3 { lo: [x, x, 0.0], hi: [x + 500.0, x + 500.0, 9.0] };
        let bounds = Box3 { lo: [0.0; 3], hi: [9e6, 9e6, 9.0] };
        let level = GroundLevel { bounds, ..GroundLevel::new() };
        let plane = plane(&level, &[at(0.0), at(4e6), at(9e6 - 500.0)]);
        assert!((30..200).contains(&plane.len()), "{}", plane.len());
        let is_under = |x: i64| plane.iter().any(|t| t.corners.iter().all(|c| (c[0] - x * 4096).abs() < 3000 * 4096));
        assert!(is_under(250) && is_under(4_000_250) && !is_under(2_000_000));
    }

    #[test]
    fn a_plane_under_content_everywhere_in_a_very_large_box_is_left_out() {
        let bounds = Box3 { lo: [0.0; 3], hi: [9e6, 9e6, 9.0] };
        let level = GroundLevel { bounds, ..GroundLevel::new() };
        let mut out = Vec::new();
        assert!(!level.plane(1, 9, &mut [bounds].into_iter(), &mut out).expect("an id is given") && out.is_empty());
    }

    fn plane(level: &GroundLevel, content: &[Box3]) -> Vec<BuildTriangle> {
        let mut out = Vec::new();
        assert!(level.plane(1, 9, &mut content.iter().copied(), &mut out).expect("an id is given"));
        out
    }
}
