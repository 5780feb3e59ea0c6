//! The slow path, exact for every triangle: corners very far away, or seen so nearly edge-on that its depth does not fit fixed point.

use map3d_base::DEPTH_NOTHING;
use map3d_base::samples::SAMPLES;

use super::buffer::FAR;
use super::canvas::{Candidate, Canvas};
use super::project::depth_of_plane;
use super::shape::{PixelBox, area2};
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
    /// Draws a triangle sample by sample.
    #[cold]
    #[inline(never)]
    pub fn draw_exact<L: Lanes>(&mut self, candidate: &Candidate, b: &PixelBox, s: &[[i64; 2]; 3], pixel: &[[f64; 3]; 3], bias: i64) {
        for j in b.y0..=b.y1 {
            for i in b.x0..=b.x1 {
                let mut keys = [FAR; 16];
                let mut covered = 0;
                for (k, (sx, sy)) in SAMPLES.iter().enumerate() {
                    let point = [i64::from(i) * 256 + i64::from(*sx) * 16, i64::from(j) * 256 + i64::from(*sy) * 16];
                    if covers(s, point) {
                        covered |= 1 << k;
                        keys[k] = exact_key(pixel, point, bias);
                    }
                }
                if covered != 0 {
                    let near = keys.into_iter().fold(FAR, i32::min);
                    self.merge(candidate, j as usize * SUBTILE_PX + i as usize, covered, L::load(&keys), (near, FAR));
                }
            }
        }
    }
}

fn exact_key(pixel: &[[f64; 3]; 3], point: [i64; 2], bias: i64) -> i32 {
    let depth = depth_of_plane(pixel, point[0] as f64 / 256.0, point[1] as f64 / 256.0);
    let units = (depth + 0.5).floor().clamp(0.0, f64::from(DEPTH_NOTHING - 1)) as i64;
    (units - bias - (1 << 31)).clamp(i64::from(i32::MIN), i64::from(FAR) - 1) as i32
}
