//! A surface that samples of a sub-tile meet: one triangle of one part, with all that shading needs as affine functions of pixel coordinates.

use map3d_base::vec3::{normalized, triangle_normal};
use map3d_base::{Vec3, ViewAxes, vec3};
use map3d_scene::{Chunk, InstanceRecord, TriangleRecord};

/// `x·dx + y·dy + at0`: x and y in pixels right and down from the sub-tile's top left corner (pixel centres lie at +½).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Affine {
    pub dx: f32,
    pub dy: f32,
    pub at0: f32,
}

impl Affine {
    #[inline(always)]
    pub fn at(&self, x: f32, y: f32) -> f32 {
        x * self.dx + y * self.dy + self.at0
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Number for `VisBuf::chunk`.
    pub chunk: u32,
    /// Index into `Chunk::triangles`.
    pub triangle: u32,
    /// Index into `SceneStore::instances`.
    pub instance: Option<u32>,
    pub object_id: u32,
    pub rank: u8,
    /// Index into `Chunk::materials`.
    pub material: u32,
    /// Geometric unit normal of the side that is seen, local axes.
    pub normal: [f32; 3],
    /// u (right) and v (up).
    pub uv: [Affine; 2],
    /// Weights of corners 1 and 2; that of corner 0 is what is left to 1.
    pub weights: [Affine; 2],
    /// Shading normals of the corners × 32767 in local axes, when the source gave them.
    pub corner_normals: Option<[[f32; 3]; 3]>,
}

impl Surface {
    /// Unit normal at pixel coordinates (x, y) of the sub-tile, of the side that is seen: the shading normal where the source gives one.
    pub fn normal_at(&self, x: f32, y: f32) -> [f32; 3] {
        let Some(corners) = self.corner_normals else { return self.normal };
        let (b, c) = (self.weights[0].at(x, y).clamp(0.0, 1.0), self.weights[1].at(x, y).clamp(0.0, 1.0));
        let a = (1.0 - b - c).max(0.0);
        let mixed = [0, 1, 2].map(|k| f64::from(a * corners[0][k] + b * corners[1][k] + c * corners[2][k]));
        normalized(mixed).map_or(self.normal, |n| n.map(|v| v as f32))
    }
}

/// Geometry of a triangle in a view: local corners, and pixel coordinates and depth units of each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed<'a> {
    pub local: [Vec3; 3],
    /// x, y in pixels from the sub-tile's top left corner, depth in units; unsnapped.
    pub pixel: [Vec3; 3],
    pub axes: &'a ViewAxes,
}

/// Gradients of the weights of corners 1 and 2 over pixels: `[[d1/dx, d1/dy], [d2/dx, d2/dy]]`; zeros for a triangle seen edge-on.
pub(crate) fn weight_gradients(p: &[Vec3; 3]) -> [[f64; 2]; 2] {
    let (ax, ay) = (p[1][0] - p[0][0], p[1][1] - p[0][1]);
    let (bx, by) = (p[2][0] - p[0][0], p[2][1] - p[0][1]);
    let inverse = 1.0 / (ax * by - ay * bx);
    if !inverse.is_finite() {
        return [[0.0; 2]; 2];
    }
    [[by * inverse, -bx * inverse], [-ay * inverse, ax * inverse]]
}

impl Surface {
    pub(crate) fn new(chunk_number: u32, chunk: &Chunk, triangle: u32, instance: Option<(u32, &InstanceRecord)>, placed: &Placed) -> Self {
        let record = &chunk.triangles()[triangle as usize];
        let gradients = weight_gradients(&placed.pixel);
        let [x0, y0, _] = placed.pixel[0];
        let weights = gradients.map(|g| affine(g, x0, y0, 0.0));
        let seen = seen_normal(&placed.local, placed.axes);
        Self {
            chunk: chunk_number,
            triangle,
            instance: instance.map(|i| i.0),
            object_id: instance.map_or_else(|| chunk.objects()[record.object as usize].id, |i| i.1.object_id),
            rank: record.rank,
            material: record.material,
            normal: seen.map(|v| v as f32),
            uv: [0, 1].map(|k| uv_plane(record, k, gradients, x0, y0)),
            weights,
            corner_normals: corner_normals(chunk, triangle, instance.map(|i| &i.1.transform), seen),
        }
    }
}

fn affine(gradient: [f64; 2], x0: f64, y0: f64, value0: f64) -> Affine {
    Affine { dx: gradient[0] as f32, dy: gradient[1] as f32, at0: (value0 - gradient[0] * x0 - gradient[1] * y0) as f32 }
}

fn uv_plane(record: &TriangleRecord, k: usize, gradients: [[f64; 2]; 2], x0: f64, y0: f64) -> Affine {
    let value = |corner: usize| f64::from(record.uv[corner][k]);
    let (d1, d2) = (value(1) - value(0), value(2) - value(0));
    let gradient = [0, 1].map(|axis| d1 * gradients[0][axis] + d2 * gradients[1][axis]);
    affine(gradient, x0, y0, value(0))
}

/// Unit normal of the side that is seen (n·d ≤ 0); towards the viewer for a triangle without area.
pub(crate) fn seen_normal(local: &[Vec3; 3], axes: &ViewAxes) -> Vec3 {
    let Some(n) = normalized(triangle_normal(*local)) else { return vec3::scale(axes.forward, -1.0) };
    if vec3::dot(n, axes.forward) > 0.0 { vec3::scale(n, -1.0) } else { n }
}

/// Shading normals turned to the seen side; a corner without one takes the geometric normal.
fn corner_normals(chunk: &Chunk, triangle: u32, transform: Option<&[f64; 12]>, seen: Vec3) -> Option<[[f32; 3]; 3]> {
    let stored = chunk.normals().get(triangle as usize)?;
    if *stored == [[0; 3]; 3] {
        return None;
    }
    Some(stored.map(|n| {
        let n = n.map(|v| f64::from(v) / 32767.0);
        let local = normalized(transform.map_or(n, |t| turn_normal(t, n))).unwrap_or(seen);
        let side = if vec3::dot(local, seen) < 0.0 { -1.0 } else { 1.0 };
        local.map(|v| (v * side) as f32)
    }))
}

/// Normals turn with the cofactors of the transform's 3 × 3 part.
fn turn_normal(t: &[f64; 12], n: Vec3) -> Vec3 {
    let columns = [0, 1, 2].map(|k| [t[k], t[k + 4], t[k + 8]]);
    let cofactors = [vec3::cross(columns[1], columns[2]), vec3::cross(columns[2], columns[0]), vec3::cross(columns[0], columns[1])];
    let terms = [0, 1, 2].map(|k| vec3::scale(cofactors[k], n[k]));
    vec3::add(vec3::add(terms[0], terms[1]), terms[2])
}
