//! Triangulates polygons with holes in the coordinate plane that faces them most.

use earcut::Earcut;
use map3d_base::Vec3;

use super::constrained_delaunay;
use super::polygon_error::PolygonError;
use super::t_junctions::repair_t_junctions;

/// Whether the triangles cover the polygon's area.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coverage {
    Exact,
    /// The areas differ: the polygon's rings cross each other or themselves.
    Inexact,
}

/// Largest relative difference between the area of a polygon and that of its triangles.
const AREA_TOLERANCE: f64 = 1e-6;

/// Polygons with more vertices are not triangulated by ear clipping, whose time grows with the square of their number and faster.
const MAX_EAR_CLIPPED_VERTICES: usize = 1_000;

/// Triangulates polygons one after another; reuses its buffers.
pub struct Triangulator {
    earcut: Earcut<f64>,
    /// Metres per unit of each axis; makes degrees and metres comparable when the plane is chosen.
    scale: Vec3,
    /// The polygon's points in the plane.
    projected: Vec<[f64; 2]>,
    holes: Vec<u32>,
    triangles: Vec<u32>,
}

impl Default for Triangulator {
    fn default() -> Self {
        Self::new([1.0; 3])
    }
}

impl Triangulator {
    /// `scale`: metres per unit of each axis (1 unless horizontal coordinates are degrees).
    pub fn new(scale: Vec3) -> Self {
        Self { earcut: Earcut::new(), scale, projected: Vec::new(), holes: Vec::new(), triangles: Vec::new() }
    }

    /// Sets the metres per unit of each axis for the next polygons.
    pub fn set_scale(&mut self, scale: Vec3) {
        self.scale = scale;
    }

    /// Returns the triangles of the last polygon, three indices each, oriented like its exterior ring.
    pub fn triangles(&self) -> &[u32] {
        &self.triangles
    }

    /// Triangulates the polygon `points`: the exterior ring, then the interior rings. Each ring is open (last point ≠ first); ring `k` ends
    /// before `ends[k]`.
    pub fn triangulate(&mut self, points: &[Vec3], ends: &[usize]) -> Result<Coverage, PolygonError> {
        self.triangles.clear();
        if !points.as_flattened().iter().all(|v| v.is_finite()) {
            return Err(PolygonError::NotFinite);
        }
        let exterior = *ends.first().ok_or(PolygonError::NoArea)?;
        let normal = compute_newell_normal(&points[..exterior], self.scale);
        if !normal.iter().any(|v| v.abs() > 0.0) || !normal.iter().all(|v| v.is_finite()) {
            return Err(PolygonError::NoArea);
        }
        if points.len() == 3 {
            self.triangles.extend([0, 1, 2]);
            return Ok(Coverage::Exact);
        }
        self.project(points, normal);
        if points.len() == 4 && ends.len() == 1 && self.split_convex_quad() {
            return Ok(Coverage::Exact);
        }
        if points.len() > MAX_EAR_CLIPPED_VERTICES {
            constrained_delaunay::triangulate(&self.projected, ends, &mut self.triangles)?;
        } else {
            self.clip_ears(ends);
        }
        if self.triangles.is_empty() { Err(PolygonError::NoArea) } else { Ok(self.compute_coverage(ends)) }
    }

    /// Projects the points by dropping the axis nearest to the normal, so that the exterior ring is counter-clockwise.
    fn project(&mut self, points: &[Vec3], normal: Vec3) {
        let size = normal.map(f64::abs);
        let axis = if size[2] >= size[0] && size[2] >= size[1] {
            2
        } else if size[0] >= size[1] {
            0
        } else {
            1
        };
        let (mut a, mut b) = ((axis + 1) % 3, (axis + 2) % 3);
        if normal[axis] < 0.0 {
            (a, b) = (b, a);
        }
        let (first, scale) = (points[0], self.scale);
        self.projected.clear();
        self.projected.extend(points.iter().map(|p| [(p[a] - first[a]) * scale[a], (p[b] - first[b]) * scale[b]]));
    }

    fn clip_ears(&mut self, ends: &[usize]) {
        self.holes.clear();
        self.holes.extend(ends[..ends.len() - 1].iter().map(|e| *e as u32));
        self.earcut.earcut_slice(&self.projected, &self.holes, &mut self.triangles);
        repair_t_junctions(&self.projected, &mut self.triangles);
        self.orient();
    }

    /// Splits a convex quadrilateral along its shorter diagonal. Returns false if it is not convex.
    fn split_convex_quad(&mut self) -> bool {
        let p = &self.projected;
        if !(0..4).all(|k| compute_twice_area(p[k], p[(k + 1) % 4], p[(k + 2) % 4]) > 0.0) {
            return false;
        }
        let distance2 = |a: usize, b: usize| (p[a][0] - p[b][0]).powi(2) + (p[a][1] - p[b][1]).powi(2);
        self.triangles.extend(if distance2(0, 2) <= distance2(1, 3) { [0, 1, 2, 0, 2, 3] } else { [0, 1, 3, 1, 2, 3] });
        true
    }

    /// Makes all triangles counter-clockwise.
    fn orient(&mut self) {
        for t in self.triangles.as_chunks_mut::<3>().0 {
            let [a, b, c] = t.map(|i| self.projected[i as usize]);
            if compute_twice_area(a, b, c) < 0.0 {
                t.swap(1, 2);
            }
        }
    }

    fn compute_coverage(&self, ends: &[usize]) -> Coverage {
        let mut start = 0;
        let mut expected = 0.0;
        for (k, end) in ends.iter().enumerate() {
            let area = compute_ring_area(&self.projected[start..*end]).abs();
            expected += if k == 0 { area } else { -area };
            start = *end;
        }
        let triangles = self.triangles.as_chunks::<3>().0.iter();
        let got: f64 = triangles
            .map(|t| compute_twice_area(self.projected[t[0] as usize], self.projected[t[1] as usize], self.projected[t[2] as usize]))
            .sum::<f64>()
            * 0.5;
        if (got - expected).abs() <= AREA_TOLERANCE * expected.abs() { Coverage::Exact } else { Coverage::Inexact }
    }
}

fn compute_twice_area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn compute_ring_area(ring: &[[f64; 2]]) -> f64 {
    let next = ring.iter().cycle().skip(1);
    ring.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>() * 0.5
}

/// Computes Newell's normal of a ring; its length is twice the ring's area. Coordinates are relative to the first point, to keep precision.
fn compute_newell_normal(ring: &[Vec3], scale: Vec3) -> Vec3 {
    let Some(first) = ring.first() else { return [0.0; 3] };
    let local = |p: &Vec3| [(p[0] - first[0]) * scale[0], (p[1] - first[1]) * scale[1], (p[2] - first[2]) * scale[2]];
    let mut normal = [0.0; 3];
    let mut a = local(first);
    for p in ring[1..].iter().chain([first]) {
        let b = local(p);
        normal[0] += (a[1] - b[1]) * (a[2] + b[2]);
        normal[1] += (a[2] - b[2]) * (a[0] + b[0]);
        normal[2] += (a[0] - b[0]) * (a[1] + b[1]);
        a = b;
    }
    normal
}
