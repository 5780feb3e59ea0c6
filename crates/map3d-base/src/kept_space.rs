//! The part of space whose content belongs to a scene: everything else is an outlier (spec/scene.md, Extent).

use serde::{Deserialize, Serialize};

use crate::vec3::{Box3, Vec3};

/// Content farther from the scene's origin than this, along any axis, is an outlier whatever else is there.
pub const MAX_FROM_ORIGIN_M: f64 = 1e8;

/// One group of content that stays: its box, and how far beyond it a large triangle may reach, horizontally and in height.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Region {
    pub bounds: Box3,
    pub reach_m: [f64; 2],
}

impl Region {
    fn holds(&self, p: Vec3, reach_m: [f64; 2]) -> bool {
        let reach = [reach_m[0], reach_m[0], reach_m[1]];
        (0..3).all(|k| p[k] >= self.bounds.lo[k] - reach[k] && p[k] <= self.bounds.hi[k] + reach[k])
    }
}

/// World coordinates. Small triangles stay if they lie in the box of a region; larger ones, such as those of terrain, may reach beyond it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeptSpace {
    pub regions: Vec<Region>,
    /// Triangles whose box has a shorter diagonal are small.
    pub large_m: f64,
    /// Everything within `MAX_FROM_ORIGIN_M` of this point stays; `None`: only the content of the regions does.
    pub all_around: Option<Vec3>,
}

impl KeptSpace {
    pub fn keeps(&self, corners: [Vec3; 3]) -> bool {
        if let Some(origin) = self.all_around {
            return corners.iter().all(|p| is_near(*p, origin));
        }
        let bounds = bounds_of(corners);
        if diagonal_m(&bounds) < self.large_m {
            return self.regions.iter().any(|r| corners.iter().all(|p| r.holds(*p, [0.0; 2])));
        }
        let is_missing = |p: &Vec3| *p == [0.0; 3] && !self.regions.iter().any(|r| r.holds(*p, [0.0; 2]));
        self.regions.iter().any(|r| corners.iter().all(|p| r.holds(*p, r.reach_m))) && !corners.iter().any(is_missing)
    }

    pub fn keeps_point(&self, p: Vec3) -> bool {
        self.keeps([p; 3])
    }

    /// Returns the number of the region that a triangle belongs to: the nearest one.
    pub fn region_of(&self, corners: [Vec3; 3]) -> usize {
        let center = bounds_of(corners).center();
        let at = Box3 { lo: center, hi: center };
        let gap = |r: &Region| gap_m(&r.bounds, &at).0;
        (0..self.regions.len()).min_by(|a, b| gap(&self.regions[*a]).total_cmp(&gap(&self.regions[*b]))).unwrap_or(0)
    }
}

pub fn bounds_of(corners: [Vec3; 3]) -> Box3 {
    let mut out = Box3::EMPTY;
    corners.iter().for_each(|p| out.add_point(*p));
    out
}

pub fn diagonal_m(bounds: &Box3) -> f64 {
    (0..3).map(|k| (bounds.hi[k] - bounds.lo[k]).powi(2)).sum::<f64>().sqrt()
}

/// Returns the horizontal and the vertical distance between two boxes, 0 where they overlap.
pub fn gap_m(a: &Box3, b: &Box3) -> (f64, f64) {
    let [x, y, z] = [0, 1, 2].map(|k| (a.lo[k] - b.hi[k]).max(b.lo[k] - a.hi[k]).max(0.0));
    (x.hypot(y), z)
}

fn is_near(p: Vec3, origin: Vec3) -> bool {
    (0..3).all(|k| (p[k] - origin[k]).abs() <= MAX_FROM_ORIGIN_M)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extent() -> KeptSpace {
        let bounds = Box3 { lo: [5000.0, 5000.0, 0.0], hi: [6000.0, 6000.0, 50.0] };
        KeptSpace { regions: vec![Region { bounds, reach_m: [10_000.0, 3000.0] }], large_m: 2048.0, all_around: None }
    }

    fn triangle(a: Vec3, size_m: f64) -> [Vec3; 3] {
        [a, [a[0] + size_m, a[1], a[2]], [a[0], a[1] + size_m, a[2]]]
    }

    #[test]
    fn small_triangles_stay_within_the_box_and_large_ones_within_reach() {
        let extent = extent();
        assert!(extent.keeps(triangle([5100.0, 5100.0, 10.0], 20.0)));
        assert!(!extent.keeps(triangle([8000.0, 5100.0, 10.0], 20.0)));
        assert!(!extent.keeps(triangle([5100.0, 5100.0, 900.0], 20.0)));
        assert!(extent.keeps(triangle([-1000.0, -1000.0, -5.0], 9000.0)));
        assert!(!extent.keeps(triangle([5100.0, 5100.0, 0.0], 90_000.0)));
    }

    #[test]
    fn a_large_triangle_with_a_corner_at_0_0_0_is_an_outlier_unless_content_is_there() {
        let mut extent = extent();
        let corners = [[0.0; 3], [5100.0, 5100.0, 1.0], [5110.0, 5100.0, 1.0]];
        assert!(!extent.keeps(corners));
        extent.regions[0].bounds.lo = [-1.0; 3];
        assert!(extent.keeps(corners));
    }

    #[test]
    fn everything_stays_up_to_the_limit_around_a_point() {
        let extent = KeptSpace { all_around: Some([4e6, 0.0, 0.0]), ..extent() };
        assert!(extent.keeps_point([1.04e8, 0.0, 0.0]));
        assert!(!extent.keeps_point([1.0401e8, 0.0, 0.0]));
        assert!(!extent.keeps_point([0.0, 0.0, 1e300]));
    }
}
