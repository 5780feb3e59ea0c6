//! How far the tiles of a pass depend on what lies outside their beams (spec/pyramid.md §10).

use map3d_base::vec3::dot;
use map3d_base::{Box3, Frame, LayerKind, RAY_LIFT_M};

use super::{Rect, TileView};

/// A long shadow is followed in steps, so that its rectangles stay small.
const STEPS_MAX: f64 = 64.0;

/// What the layers of a pass reach for beyond a beam.
pub(super) struct Reach {
    /// In tiles.
    radius: f64,
    /// Of each sun above the horizon: where a shadow goes for each metre of height, in tiles.
    shadows: Vec<[f64; 2]>,
    /// The scene's lowest point, local: no shadow falls deeper.
    floor_m: f64,
}

impl Reach {
    pub fn new(frame: &Frame, view: &TileView, bounds: &Box3) -> Self {
        let radius_m = frame.layers.iter().map(|l| l.radius_m).fold(0.0, f64::max);
        let lift_m = if radius_m > 0.0 || frame.layers.iter().any(|l| !l.suns.is_empty()) { RAY_LIFT_M } else { 0.0 };
        let suns = frame.layers.iter().filter(|l| l.kind != LayerKind::Ao).flat_map(|l| &l.suns);
        let shadow = |sun: &[f64; 3]| {
            let away = sun.map(|v| -v / sun[2]);
            [dot(view.axes.right, away) / view.tile_m, -dot(view.axes.up, away) / view.tile_m]
        };
        Self { radius: (radius_m + lift_m) / view.tile_m, shadows: suns.filter(|s| s[2] > 0.0).map(shadow).collect(), floor_m: bounds.lo[2] }
    }

    /// Calls `take` with rectangles that together hold all that a box can be seen in, darken or close in; `rect`: where it is seen.
    pub fn each(&self, bounds: &Box3, rect: Rect, mut take: impl FnMut(&Rect)) {
        let rect = Rect { lo: rect.lo.map(|v| v - self.radius), hi: rect.hi.map(|v| v + self.radius) };
        take(&rect);
        let height = (bounds.hi[2] - self.floor_m).max(0.0);
        for shadow in &self.shadows {
            let way = shadow.map(|v| v * height);
            let size = [0, 1].map(|k| (rect.hi[k] - rect.lo[k]).max(0.25));
            let steps = (way[0].abs() / size[0]).max(way[1].abs() / size[1]).ceil().clamp(1.0, STEPS_MAX);
            for n in 0..steps as u32 {
                let (from, to) = (f64::from(n) / steps, f64::from(n + 1) / steps);
                let lo = [0, 1].map(|k| rect.lo[k] + (way[k] * from).min(way[k] * to));
                let hi = [0, 1].map(|k| rect.hi[k] + (way[k] * from).max(way[k] * to));
                take(&Rect { lo, hi });
            }
        }
    }
}
