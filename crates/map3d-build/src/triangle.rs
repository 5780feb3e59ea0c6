//! A triangle before it becomes part of a chunk: snapped, with short edges.

use bytemuck::{Pod, Zeroable};
use map3d_scene::lattice::{Point, STEPS_PER_M, has_no_area, is_long, midpoint};

/// Plain data, so that it can be written to a file as it is.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct BuildTriangle {
    /// Lattice steps from the local origin (a prototype's: from its own).
    pub corners: [Point; 3],
    pub uv: [[f32; 2]; 3],
    /// × 32767; zeros when there are none.
    pub normals: [[i16; 3]; 3],
    pub rank: u8,
    pub padding: u8,
    /// Index into the build's materials.
    pub material: u32,
    pub object_id: u32,
    /// Number among its object's triangles in the asset; a prototype's: among the prototype's.
    pub source: u32,
    /// Index of its asset among the open ones.
    pub asset: u32,
    pub padding2: u32,
}

const _: () = assert!(size_of::<BuildTriangle>() == 136);

/// More than any valid coordinates need.
const MAX_SPLITS: u32 = 40;

impl BuildTriangle {
    /// Returns the centroid in metres; the sum before the division is exact for all valid coordinates.
    pub fn centroid_m(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| self.corners.iter().map(|c| c[k]).sum::<i64>() as f64 / (3.0 * STEPS_PER_M))
    }

    pub fn has_no_area(&self) -> bool {
        has_no_area(self.corners)
    }

    pub fn has_normals(&self) -> bool {
        self.normals != [[0; 3]; 3]
    }

    /// Passes on the triangle in pieces without long edges; returns their number. Splits each long edge at its midpoint, so that neighbours match.
    pub fn split(&self, out: &mut dyn FnMut(&Self)) -> u64 {
        self.split_to_depth(MAX_SPLITS, out)
    }

    fn split_to_depth(&self, depth: u32, out: &mut dyn FnMut(&Self)) -> u64 {
        let long = [0, 1, 2].map(|k| is_long(self.corners[k], self.corners[(k + 1) % 3]));
        let Some(first) = long.iter().position(|l| *l).filter(|_| depth > 0) else {
            out(self);
            return 1;
        };
        // With one or two long edges, start so that corner 0 → 1 is long and, of two, 2 → 0 is the short one.
        let start = if long[first] && long[(first + 2) % 3] && !long[(first + 1) % 3] { (first + 2) % 3 } else { first };
        let t = self.rotated(start);
        let corners = [0, 1, 2].map(|k| t.corner(k));
        let m = [0, 1, 2].map(|k| t.middle(k));
        let count = long.iter().filter(|l| **l).count();
        let pieces: &[[TriangleCorner; 3]] = match count {
            1 => &[[corners[0], m[0], corners[2]], [m[0], corners[1], corners[2]]],
            2 => &[[corners[0], m[0], m[1]], [m[0], corners[1], m[1]], [corners[0], m[1], corners[2]]],
            _ => &[[corners[0], m[0], m[2]], [m[0], corners[1], m[1]], [m[2], m[1], corners[2]], [m[0], m[1], m[2]]],
        };
        pieces.iter().map(|p| t.with(p).split_to_depth(depth - 1, out)).sum()
    }

    fn rotated(&self, start: usize) -> Self {
        self.with(&[0, 1, 2].map(|k| self.corner((start + k) % 3)))
    }

    fn corner(&self, k: usize) -> TriangleCorner {
        TriangleCorner { point: self.corners[k], uv: self.uv[k], normal: self.normals[k] }
    }

    /// Returns the middle of the edge from corner k.
    fn middle(&self, k: usize) -> TriangleCorner {
        let (a, b) = (self.corner(k), self.corner((k + 1) % 3));
        let normal = [0, 1, 2].map(|i| ((i32::from(a.normal[i]) + i32::from(b.normal[i])) / 2) as i16);
        TriangleCorner { point: midpoint(a.point, b.point), uv: [0, 1].map(|i| (a.uv[i] + b.uv[i]) * 0.5), normal }
    }

    fn with(&self, c: &[TriangleCorner; 3]) -> Self {
        Self { corners: c.map(|c| c.point), uv: c.map(|c| c.uv), normals: c.map(|c| c.normal), ..*self }
    }
}

#[derive(Clone, Copy)]
struct TriangleCorner {
    point: Point,
    uv: [f32; 2],
    normal: [i16; 3],
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(m: [[i64; 3]; 3]) -> BuildTriangle {
        let corners = m.map(|p| p.map(|v| v * 4096));
        BuildTriangle { corners, uv: [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], ..BuildTriangle::zeroed() }
    }

    fn pieces(t: &BuildTriangle) -> Vec<BuildTriangle> {
        let mut out = Vec::new();
        t.split(&mut |p| out.push(*p));
        out
    }

    #[test]
    fn pieces_have_short_edges_and_the_same_area() {
        let area = |t: &BuildTriangle| {
            let e = |k: usize, i: usize| (t.corners[k][i] - t.corners[0][i]) as f64 / 4096.0;
            (e(1, 0) * e(2, 1) - e(1, 1) * e(2, 0)) / 2.0
        };
        for t in [[[0, 0, 0], [3000, 0, 0], [0, 20, 0]], [[0, 0, 0], [5000, 100, 0], [200, 7000, 0]], [[0, 0, 0], [2000, 0, 0], [1000, 900, 0]]] {
            let t = triangle(t);
            let parts = pieces(&t);
            assert!(parts.len() > 1);
            assert!(parts.iter().all(|p| (0..3).all(|k| !is_long(p.corners[k], p.corners[(k + 1) % 3]))));
            let sum: f64 = parts.iter().map(area).sum();
            assert!((sum - area(&t)).abs() < 1.0, "{sum} {}", area(&t));
        }
    }

    #[test]
    fn a_shared_long_edge_gets_the_same_points_on_both_sides() {
        let on_edge = |t: &BuildTriangle| {
            let mut points: Vec<_> = pieces(t).iter().flat_map(|p| p.corners).filter(|c| c[1] == 0).collect();
            points.sort_unstable();
            points.dedup();
            points
        };
        let above = triangle([[0, 0, 0], [5001, 0, 77], [100, 900, 0]]);
        let below = triangle([[5001, 0, 77], [0, 0, 0], [4000, -3000, 5]]);
        assert_eq!(on_edge(&above), on_edge(&below));
        assert!(on_edge(&above).len() >= 6);
    }

    #[test]
    fn a_short_triangle_is_not_split() {
        let t = triangle([[0, 0, 0], [1024, 0, 0], [512, 700, 0]]);
        assert_eq!(pieces(&t), vec![t]);
    }
}
