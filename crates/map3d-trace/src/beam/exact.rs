//! The slow path, exact for every triangle: corners very far away, or seen so nearly edge-on that its depth does not fit fixed point.

use map3d_base::DEPTH_NOTHING;
use map3d_base::samples::SAMPLES;

use super::buffer::FAR;
use super::canvas::{Candidate, Canvas};
use super::project::depth_of_plane;
use super::shape::{Edge, PixelBox, area2};
use crate::lanes::Lanes;
use crate::visbuf::SUBTILE_PX;

/// Whether a point in steps lies inside the snapped triangle, by the top-left rule.
pub(crate) fn covers(s: &[[i64; 2]; 3], point: [i64; 2]) -> bool {
    let area = area2(s);
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

impl Canvas<'_> {
    /// Draws a triangle sample by sample. `edges`: those of a triangle whose corners are near, to tell its samples at once.
    #[cold]
    #[inline(never)]
    pub fn draw_exact<L: Lanes>(&mut self, candidate: &Candidate, b: &PixelBox, exact: &Exact, edges: Option<&[Edge<L>; 3]>) {
        for j in b.y0..=b.y1 {
            for i in b.x0..=b.x1 {
                let covered = match edges {
                    Some([e, f, g]) => !e.samples(i, j).or(f.samples(i, j)).or(g.samples(i, j)).negative() & 0xFFFF,
                    None => exact.covered(i, j),
                };
                if covered == 0 {
                    continue;
                }
                let mut keys = [FAR; 16];
                let mut rest = covered;
                while rest != 0 {
                    let k = rest.trailing_zeros() as usize;
                    rest &= rest - 1;
                    keys[k] = exact_key(exact.pixel, sample(i, j, k), exact.bias);
                }
                let near = keys.into_iter().fold(FAR, i32::min);
                self.merge(candidate, j as usize * SUBTILE_PX + i as usize, covered, L::load(&keys), (near, FAR));
            }
        }
    }
}

/// What the slow path needs of a triangle.
pub(crate) struct Exact<'a> {
    pub snapped: &'a [[i64; 2]; 3],
    pub pixel: &'a [[f64; 3]; 3],
    pub bias: i64,
}

impl Exact<'_> {
    /// Samples of pixel (i, j) inside, however far the corners are.
    fn covered(&self, i: i32, j: i32) -> u32 {
        (0..16).filter(|k| covers(self.snapped, sample(i, j, *k))).fold(0, |mask, k| mask | 1 << k)
    }
}

/// In steps.
fn sample(i: i32, j: i32, k: usize) -> [i64; 2] {
    let (x, y) = SAMPLES[k];
    [i64::from(i) * 256 + i64::from(x) * 16, i64::from(j) * 256 + i64::from(y) * 16]
}

fn exact_key(pixel: &[[f64; 3]; 3], point: [i64; 2], bias: i64) -> i32 {
    let depth = depth_of_plane(pixel, point[0] as f64 / 256.0, point[1] as f64 / 256.0);
    let units = (depth + 0.5).floor().clamp(0.0, f64::from(DEPTH_NOTHING - 1)) as i64;
    (units - bias - (1 << 31)).clamp(i64::from(i32::MIN), i64::from(FAR) - 1) as i32
}
