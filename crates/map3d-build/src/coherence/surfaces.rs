//! The surfaces of the ground, and their heights below points.

use std::path::PathBuf;

use map3d_base::asset::AssetMesh;
use map3d_base::{Error, Result, Vec3};

use super::plan_index::{PlanIndex, Rectangle};

/// Triangles between two releases of resident pages.
const PIECE: usize = 1 << 20;
/// Triangles whose area in plan is smaller, in square metres, are walls.
const LEAST_AREA_M2: f64 = 1e-9;
/// How far outside a triangle, as a share of it, a point may be.
const TOLERANCE: f64 = 1e-9;

/// A surface of the ground: terrain of an asset, or a mesh.
#[derive(Clone, Debug)]
pub enum Surface {
    /// The triangles of the objects of an asset's folder for which `objects` is true; prototypes are none. `is_adjusted`: as drawn, else as imported.
    Asset {
        folder: PathBuf,
        objects: Vec<bool>,
        is_adjusted: bool,
    },
    Mesh {
        positions: Vec<Vec3>,
        triangles: Vec<[u32; 3]>,
    },
}

impl Surface {
    /// Passes on the corners of all triangles.
    pub(super) fn visit(&self, found: &mut dyn FnMut([Vec3; 3])) -> Result<()> {
        match self {
            Self::Mesh { positions, triangles } => {
                for t in triangles {
                    let corner = |v: u32| positions.get(v as usize).copied().ok_or_else(|| Error::argument("surface: a vertex is out of range"));
                    found([corner(t[0])?, corner(t[1])?, corner(t[2])?]);
                }
            }
            Self::Asset { folder, objects, is_adjusted } => {
                let mesh = AssetMesh::open(&folder.join("mesh.m3a"))?;
                let positions = mesh.positions();
                for (t, corners) in mesh.triangles().iter().enumerate() {
                    if t % PIECE == PIECE - 1 {
                        mesh.release();
                    }
                    if mesh.prototypes()[t] > 0 || objects.get(mesh.objects()[t] as usize) != Some(&true) {
                        continue;
                    }
                    match is_adjusted {
                        true => mesh.corners(t).into_iter().for_each(&mut *found),
                        false => found(corners.map(|v| positions[v as usize])),
                    }
                }
                mesh.release();
            }
        }
        Ok(())
    }
}

/// Returns the height of the highest surface at each point, NaN where there is none.
pub fn surface_heights(surfaces: &[Surface], points: &[[f64; 2]]) -> Result<Vec<f64>> {
    let index = PlanIndex::new(&points.iter().map(|p| [*p, *p]).collect::<Vec<Rectangle>>());
    let mut heights = vec![f64::NAN; points.len()];
    for surface in surfaces {
        surface.visit(&mut |corners| {
            let Some(triangle) = PlanTriangle::new(corners) else { return };
            index.visit(&triangle.rectangle(), &mut |n| {
                if let Some(z) = triangle.height(points[n]) {
                    heights[n] = heights[n].max(z);
                }
            });
        })?;
    }
    Ok(heights)
}

/// A triangle seen from above; its corners are counter-clockwise.
pub(super) struct PlanTriangle {
    pub corners: [Vec3; 3],
    /// The corners are in another order than the given ones: 0, 2, 1.
    pub is_turned: bool,
    twice_area: f64,
}

impl PlanTriangle {
    /// Returns `None` for a triangle without area in plan.
    pub fn new(corners: [Vec3; 3]) -> Option<Self> {
        let [a, b, c] = corners;
        let twice_area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let corners = if twice_area < 0.0 { [a, c, b] } else { corners };
        (twice_area.abs() > 2.0 * LEAST_AREA_M2).then_some(Self { corners, is_turned: twice_area < 0.0, twice_area: twice_area.abs() })
    }

    pub fn area_m2(&self) -> f64 {
        self.twice_area / 2.0
    }

    pub fn rectangle(&self) -> Rectangle {
        let end = |k: usize, best: fn(f64, f64) -> f64| best(best(self.corners[0][k], self.corners[1][k]), self.corners[2][k]);
        [[end(0, f64::min), end(1, f64::min)], [end(0, f64::max), end(1, f64::max)]]
    }

    /// Returns the weights of the corners at a point, which may be outside.
    pub fn weights(&self, p: [f64; 2]) -> [f64; 3] {
        let of_edge = |from: Vec3, to: Vec3| ((to[0] - from[0]) * (p[1] - from[1]) - (to[1] - from[1]) * (p[0] - from[0])) / self.twice_area;
        let [a, b, c] = self.corners;
        [of_edge(b, c), of_edge(c, a), of_edge(a, b)]
    }

    pub fn height_of(&self, weights: [f64; 3]) -> f64 {
        (0..3).map(|k| weights[k] * self.corners[k][2]).sum()
    }

    fn height(&self, p: [f64; 2]) -> Option<f64> {
        let weights = self.weights(p);
        weights.iter().all(|w| *w >= -TOLERANCE).then(|| self.height_of(weights))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hill() -> Surface {
        let at = |i: usize, j: usize| [690_000.0 + 10.0 * i as f64, 5_336_000.0 + 10.0 * j as f64, 500.0 + 3.0 * i as f64 - j as f64];
        let positions = (0..9).flat_map(|j| (0..9).map(move |i| at(i, j))).collect();
        let triangles = (0..8_u32).flat_map(|j| (0..8).map(move |i| 9 * j + i)).flat_map(|k| [[k, k + 1, k + 10], [k, k + 10, k + 9]]).collect();
        Surface::Mesh { positions, triangles }
    }

    #[test]
    fn heights_below_points_are_those_of_the_plane() {
        let points: Vec<[f64; 2]> = (0..50).map(|k| [690_000.0 + 1.6 * f64::from(k), 5_336_000.0 + 79.0 - 1.5 * f64::from(k)]).collect();
        let heights = surface_heights(&[hill()], &points).expect("heights");
        for (p, z) in points.iter().zip(heights) {
            assert!((z - (500.0 + 0.3 * (p[0] - 690_000.0) - 0.1 * (p[1] - 5_336_000.0))).abs() < 1e-6, "{p:?} {z}");
        }
    }

    #[test]
    fn there_is_no_height_beside_the_surface_and_the_highest_counts() {
        let flat = Surface::Mesh {
            positions: vec![[690_000.0, 5_336_000.0, 600.0], [690_010.0, 5_336_000.0, 600.0], [690_000.0, 5_336_010.0, 600.0]],
            triangles: vec![[0, 2, 1]],
        };
        let found =
            surface_heights(&[hill(), flat], &[[690_001.0, 5_336_001.0], [690_050.0, 5_336_050.0], [689_000.0, 5_336_000.0]]).expect("heights");
        assert_eq!((found[0], (found[1] - 510.0).abs() < 1e-6, found[2].is_nan()), (600.0, true, true));
    }

    #[test]
    fn a_vertex_out_of_range_is_refused() {
        let broken = Surface::Mesh { positions: vec![[0.0; 3]], triangles: vec![[0, 1, 2]] };
        assert!(surface_heights(&[broken], &[[0.0; 2]]).is_err());
    }
}
