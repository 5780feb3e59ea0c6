//! Polygons with holes to triangles, in the plane that fits them best.

use earcut::Earcut;
use map3d_base::Vec3;

use crate::mend::mend;

/// Why a polygon yields no triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    NoArea,
    NotFinite,
}

impl Fault {
    /// As reports name it.
    pub fn reason(self) -> &'static str {
        match self {
            Self::NoArea => "polygon without area",
            Self::NotFinite => "coordinate is not a finite number",
        }
    }
}

/// Triangles of a polygon cover its area to this share, or its rings cross one another.
const AREA_TOLERANCE: f64 = 1e-6;

/// Triangulates polygon after polygon with the same buffers.
pub struct Triangulator {
    earcut: Earcut<f64>,
    /// Metres per unit of each axis, so that a plane can be fitted to degrees and metres.
    scale: Vec3,
    flat: Vec<[f64; 2]>,
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
        Self { earcut: Earcut::new(), scale, flat: Vec::new(), holes: Vec::new(), triangles: Vec::new() }
    }

    /// Corners of the triangles of the last polygon, three by three, wound as its exterior ring.
    pub fn triangles(&self) -> &[u32] {
        &self.triangles
    }

    /// Triangulates `points`: the exterior ring, then the interior ones, each open (last point ≠ first) and ending before `ends[k]`.
    /// `Ok(false)`: the triangles do not cover the polygon's area exactly, its rings cross one another.
    pub fn polygon(&mut self, points: &[Vec3], ends: &[usize]) -> Result<bool, Fault> {
        self.triangles.clear();
        if !points.as_flattened().iter().all(|v| v.is_finite()) {
            return Err(Fault::NotFinite);
        }
        let exterior = *ends.first().ok_or(Fault::NoArea)?;
        let normal = newell(&points[..exterior], self.scale);
        if !normal.iter().any(|v| v.abs() > 0.0) || !normal.iter().all(|v| v.is_finite()) {
            return Err(Fault::NoArea);
        }
        if points.len() == 3 {
            self.triangles.extend([0, 1, 2]);
            return Ok(true);
        }
        self.flatten(points, normal);
        if points.len() == 4 && ends.len() == 1 && self.convex_quad() {
            return Ok(true);
        }
        self.holes.clear();
        self.holes.extend(ends[..ends.len() - 1].iter().map(|e| *e as u32));
        self.earcut.earcut_slice(&self.flat, &self.holes, &mut self.triangles);
        mend(&self.flat, &mut self.triangles);
        self.wind();
        if self.triangles.is_empty() { Err(Fault::NoArea) } else { Ok(self.covers(ends)) }
    }

    /// Drops the axis nearest to the normal; the exterior ring is counter-clockwise afterwards.
    fn flatten(&mut self, points: &[Vec3], normal: Vec3) {
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
        self.flat.clear();
        self.flat.extend(points.iter().map(|p| [(p[a] - first[a]) * scale[a], (p[b] - first[b]) * scale[b]]));
    }

    /// Splits a convex quadrilateral along its shorter diagonal.
    fn convex_quad(&mut self) -> bool {
        let p = &self.flat;
        if !(0..4).all(|k| twice_area(p[k], p[(k + 1) % 4], p[(k + 2) % 4]) > 0.0) {
            return false;
        }
        let square = |a: usize, b: usize| (p[a][0] - p[b][0]).powi(2) + (p[a][1] - p[b][1]).powi(2);
        self.triangles.extend(if square(0, 2) <= square(1, 3) { [0, 1, 2, 0, 2, 3] } else { [0, 1, 3, 1, 2, 3] });
        true
    }

    fn wind(&mut self) {
        for t in self.triangles.as_chunks_mut::<3>().0 {
            let [a, b, c] = t.map(|i| self.flat[i as usize]);
            if twice_area(a, b, c) < 0.0 {
                t.swap(1, 2);
            }
        }
    }

    fn covers(&self, ends: &[usize]) -> bool {
        let mut start = 0;
        let mut expected = 0.0;
        for (k, end) in ends.iter().enumerate() {
            let area = ring_area(&self.flat[start..*end]).abs();
            expected += if k == 0 { area } else { -area };
            start = *end;
        }
        let triangles = self.triangles.as_chunks::<3>().0.iter();
        let got: f64 = triangles.map(|t| twice_area(self.flat[t[0] as usize], self.flat[t[1] as usize], self.flat[t[2] as usize])).sum::<f64>() * 0.5;
        (got - expected).abs() <= AREA_TOLERANCE * expected.abs()
    }
}

fn twice_area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn ring_area(ring: &[[f64; 2]]) -> f64 {
    let next = ring.iter().cycle().skip(1);
    ring.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>() * 0.5
}

/// Newell's normal of a ring: twice its area long; computed from the first point, so that large coordinates lose nothing.
fn newell(ring: &[Vec3], scale: Vec3) -> Vec3 {
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
