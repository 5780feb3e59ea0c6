//! The ground plane of scenes without terrain: slightly larger than the content, at the height of its ground surfaces.

use bytemuck::Zeroable;
use map3d_base::asset::Rank;
use map3d_base::{Box3, Error, Result};

use super::triangle::BuildTriangle;
use crate::lattice::{Point, snap};

/// The diagonal of a square of the plane's grid stays below the length at which edges are split.
const GRID_M: f64 = 700.0;
const MARGIN: f64 = 0.05;
const MIN_MARGIN_M: f64 = 10.0;

/// Extent and ground height of content.
#[derive(Clone, Copy, Debug)]
pub(super) struct GroundLevel {
    pub bounds: Box3,
    pub has_terrain: bool,
    /// Lowest point of ground surfaces, if there are any.
    pub ground_m: f64,
}

impl GroundLevel {
    pub fn new() -> Self {
        Self { bounds: Box3::EMPTY, has_terrain: false, ground_m: f64::INFINITY }
    }

    pub fn add(&mut self, rank: u8, lowest_m: f64) {
        self.has_terrain |= rank == Rank::Terrain as u8;
        if rank == Rank::Ground as u8 {
            self.ground_m = self.ground_m.min(lowest_m);
        }
    }

    /// Adds other content.
    pub fn merge(&mut self, other: &Self) {
        self.bounds.add_box(&other.bounds);
        self.has_terrain |= other.has_terrain;
        self.ground_m = self.ground_m.min(other.ground_m);
    }

    /// Returns the triangles of the plane; `asset` is a number that no asset has.
    pub fn plane(&self, asset: u32, object_id: u32, material: u32) -> Result<Vec<BuildTriangle>> {
        if object_id == 0 {
            return Err(Error::argument("build request: ground_id is 0, but the scene needs a ground plane; register an object for it"));
        }
        let height = if self.ground_m.is_finite() { self.ground_m } else { self.bounds.lo[2] };
        let lines = [0, 1].map(|k| self.lines(k));
        let corner = |i: usize, j: usize| -> Point { snap([lines[0][i], lines[1][j], height]) };
        let mut out = Vec::new();
        for j in 1..lines[1].len() {
            for i in 1..lines[0].len() {
                let (a, b, c, d) = (corner(i - 1, j - 1), corner(i, j - 1), corner(i, j), corner(i - 1, j));
                for corners in [[a, b, c], [a, c, d]] {
                    let source = out.len() as u32;
                    out.push(BuildTriangle { corners, rank: Rank::Terrain as u8, material, object_id, source, asset, ..BuildTriangle::zeroed() });
                }
            }
        }
        Ok(out)
    }

    /// Returns the grid lines along an axis.
    fn lines(&self, axis: usize) -> Vec<f64> {
        let (lo, hi) = (self.bounds.lo[axis], self.bounds.hi[axis]);
        let margin = ((hi - lo) * MARGIN).max(MIN_MARGIN_M);
        let (lo, hi) = (lo - margin, hi + margin);
        let count = ((hi - lo) / GRID_M).ceil();
        (0..=count as u32).map(|k| lo + (hi - lo) * f64::from(k) / count).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::is_long;

    #[test]
    fn the_plane_extends_beyond_the_box_and_has_short_edges() {
        let bounds = Box3 { lo: [0.0, -50.0, 3.0], hi: [4000.0, 50.0, 90.0] };
        let level = GroundLevel { bounds, has_terrain: false, ground_m: 5.0 };
        let plane = level.plane(1, 9, 0).expect("an id is given");
        let all = || plane.iter().flat_map(|t| t.corners);
        assert_eq!(all().map(|c| c[0]).min(), Some(-200 * 4096));
        assert_eq!(all().map(|c| c[1]).max(), Some(60 * 4096));
        assert!(all().all(|c| c[2] == 5 * 4096));
        assert!(plane.iter().all(|t| (0..3).all(|k| !is_long(t.corners[k], t.corners[(k + 1) % 3]))));
    }

    #[test]
    fn a_plane_needs_an_object() {
        let level = GroundLevel { bounds: Box3 { lo: [0.0; 3], hi: [1.0; 3] }, has_terrain: false, ground_m: 0.0 };
        assert!(level.plane(1, 0, 0).is_err());
    }
}
