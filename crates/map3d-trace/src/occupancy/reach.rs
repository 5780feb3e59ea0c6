//! How far the tiles of a pass depend on content outside their beams (spec/pyramid.md §10).

use map3d_base::vec3::dot;
use map3d_base::{Box3, Frame, LayerKind, RAY_LIFT_M};

use super::{TileRect, TileView};

/// A long shadow is split into at most this number of rectangles.
const STEPS_MAX: f64 = 64.0;

/// The reach of a pass's layers beyond a beam.
pub(super) struct Reach {
    /// Radius of ambient occlusion, in tiles.
    radius: f64,
    /// For each sun above the horizon, the shift of a shadow per metre of height, in tiles.
    shadows: Vec<[f64; 2]>,
    /// Height of the scene's lowest point, local: no shadow falls below.
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

    /// Calls `take` with rectangles that together cover the tiles in which a box is visible, casts a shadow or occludes ambient light. `rect`: where it is
    /// visible.
    pub fn each(&self, bounds: &Box3, rect: TileRect, mut take: impl FnMut(&TileRect)) {
        let rect = TileRect { lo: rect.lo.map(|v| v - self.radius), hi: rect.hi.map(|v| v + self.radius) };
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
                take(&TileRect { lo, hi });
            }
        }
    }
}
