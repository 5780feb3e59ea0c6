//! The exact path, slow but valid for every triangle: those with very distant corners, and those seen so nearly edge-on that their depth does not fit
//! fixed point.

use map3d_base::DEPTH_NOTHING;

use super::edges::{TriangleEdges, covered_samples};
use super::key_plane::DepthKeyPlane;
use super::pixels::{PixelBox, SUBTILE_PX, SnappedCorners, sample_position};
use super::rasterizer::{Candidate, Rasterizer};
use super::sample_buffer::FAR;
use crate::lanes::Lanes;
use crate::projection::depth_at;

/// A triangle on the exact path.
pub(crate) struct ExactTriangle<'a> {
    pub snapped: &'a SnappedCorners,
    /// Not snapped.
    pub pixel: &'a [[f64; 3]; 3],
    pub bias: i64,
}

impl ExactTriangle<'_> {
    /// Returns the mask of the samples of pixel (i, j) that are inside, however distant the corners are.
    fn covered(&self, i: i32, j: i32) -> u32 {
        (0..16).filter(|k| is_inside(self.snapped, sample_position(i, j, *k))).fold(0, |mask, k| mask | 1 << k)
    }

    /// Returns the depth key at a point in lattice steps.
    fn depth_key(&self, point: [i64; 2]) -> i32 {
        let depth = depth_at(self.pixel, point[0] as f64 / 256.0, point[1] as f64 / 256.0);
        let units = (depth + 0.5).floor().clamp(0.0, f64::from(DEPTH_NOTHING - 1)) as i64;
        (units - self.bias - (1 << 31)).clamp(i64::from(i32::MIN), i64::from(FAR) - 1) as i32
    }
}

/// Returns whether a point is inside the snapped triangle, by the top-left rule.
fn is_inside(s: &SnappedCorners, point: [i64; 2]) -> bool {
    // Twice the signed area, positive for corners that run clockwise on the screen.
    let e = |k: usize, axis: usize| i128::from(s[k][axis] - s[0][axis]);
    let area = e(1, 0) * e(2, 1) - e(1, 1) * e(2, 0);
    if area == 0 {
        return false;
    }
    let t = if area > 0 { *s } else { [s[0], s[2], s[1]] };
    (0..3).all(|k| {
        let (a, b) = (t[k], t[(k + 1) % 3]);
        let (dx, dy) = (i128::from(b[0] - a[0]), i128::from(b[1] - a[1]));
        let value = dx * i128::from(point[1] - a[1]) - dy * i128::from(point[0] - a[0]);
        value > 0 || (value == 0 && (dy < 0 || (dy == 0 && dx > 0)))
    })
}

impl Rasterizer<'_, DepthKeyPlane> {
    /// Draws a triangle sample by sample. `edges`: those of a triangle with near corners, for a fast coverage test.
    #[cold]
    #[inline(never)]
    pub fn draw_exact<L: Lanes>(
        &mut self,
        candidate: &Candidate<DepthKeyPlane>,
        pixels: &PixelBox,
        triangle: &ExactTriangle,
        edges: Option<&TriangleEdges<L>>,
    ) {
        for j in pixels.y0..=pixels.y1 {
            for i in pixels.x0..=pixels.x1 {
                let covered = match edges {
                    Some(edges) => covered_samples(edges, i, j),
                    None => triangle.covered(i, j),
                };
                if covered == 0 {
                    continue;
                }
                let mut keys = [FAR; 16];
                let mut rest = covered;
                while rest != 0 {
                    let k = rest.trailing_zeros() as usize;
                    rest &= rest - 1;
                    keys[k] = triangle.depth_key(sample_position(i, j, k));
                }
                let near = keys.into_iter().fold(FAR, i32::min);
                self.merge(candidate, j as usize * SUBTILE_PX + i as usize, covered, L::load(&keys), near);
            }
        }
    }
}
