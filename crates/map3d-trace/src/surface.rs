//! Shading attributes of a visible triangle, as affine functions of the pixel coordinates of a sub-tile.

use map3d_base::vec3::{normalized, triangle_normal};
use map3d_base::{DEPTH_UNITS_PER_M, PerspectiveProjection, Vec3, vec3};
use map3d_scene::{Chunk, TriangleRecord};

use crate::beam::SUBTILE_PX;
use crate::part::LoadedPart;
use crate::perspective::{PerspectiveMap, homogeneous};
use crate::projection::ProjectedTriangle;

/// `x·dx + y·dy + at0`: x and y in pixels right and down from the sub-tile's top left corner; pixel centres are at +½.
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

    /// Returns the function with a gradient per pixel and the value `value0` at `corner`.
    fn new(gradient: [f64; 2], corner: &Vec3, value0: f64) -> Self {
        let [x0, y0, _] = *corner;
        Self { dx: gradient[0] as f32, dy: gradient[1] as f32, at0: (value0 - gradient[0] * x0 - gradient[1] * y0) as f32 }
    }
}

/// One triangle of one part with the attributes that shading needs. In perspective, `uv` and `weights` are near enough only at the centre of the pixels that
/// the triangle may cover; `CurvedSurface::map` is exact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceAttributes {
    /// Argument of `VisBuf::chunk`.
    pub chunk: u32,
    /// Index into `Chunk::triangles`.
    pub triangle: u32,
    /// Index into `SceneStore::instances`.
    pub instance: Option<u32>,
    pub object_id: u32,
    /// Class rank.
    pub rank: u8,
    /// Index into `Chunk::materials`.
    pub material: u32,
    /// Geometric unit normal of the visible side, local axes.
    pub normal: [f32; 3],
    /// u (right) and v (up).
    pub uv: [Affine; 2],
    /// Barycentric weights of corners 1 and 2; the three weights sum to 1.
    pub weights: [Affine; 2],
    /// Shading normals of the corners × 32767 in local axes; `None` if the source has none.
    pub corner_normals: Option<[[f32; 3]; 3]>,
}

impl SurfaceAttributes {
    /// `chunk`: the number that `VisBuf::chunk` takes.
    pub(crate) fn new(part: &LoadedPart, chunk: u32, triangle: u32, projected: &ProjectedTriangle) -> Self {
        let record = &part.chunk.triangles()[triangle as usize];
        let gradients = weight_gradients(&projected.pixel);
        let corner = &projected.pixel[0];
        let uv = [0, 1].map(|k| texture_coordinate(record, k, gradients, corner));
        Self::with_maps(part, chunk, triangle, projected, uv, gradients.map(|g| Affine::new(g, corner, 0.0)))
    }

    /// As `new`, in perspective.
    pub(crate) fn in_perspective(part: &LoadedPart, chunk: u32, triangle: u32, projected: &ProjectedTriangle, map: Option<&PerspectiveMap>) -> Self {
        let record = &part.chunk.triangles()[triangle as usize];
        let (uv, weights) = match map {
            Some(map) => {
                let weights = map.affine_weights(map.center());
                (texture_of(&weights, &record.uv), weights)
            }
            None => ([0, 1].map(|k| Affine { dx: 0.0, dy: 0.0, at0: record.uv[0][k] }), [Affine::default(); 2]),
        };
        Self::with_maps(part, chunk, triangle, projected, uv, weights)
    }

    #[inline(always)]
    fn with_maps(part: &LoadedPart, chunk: u32, triangle: u32, projected: &ProjectedTriangle, uv: [Affine; 2], weights: [Affine; 2]) -> Self {
        let record = &part.chunk.triangles()[triangle as usize];
        let normal = visible_normal(&projected.local, projected.forward);
        Self {
            chunk,
            triangle,
            instance: part.instance.as_ref().map(|i| i.number),
            object_id: part.object_id(record),
            rank: record.rank,
            material: record.material,
            normal: normal.map(|v| v as f32),
            uv,
            weights,
            corner_normals: corner_normals(&part.chunk, triangle, part.transform(), normal),
        }
    }

    /// Returns the unit normal of the visible side at pixel coordinates (x, y) of the sub-tile: the shading normal if the source has one.
    pub fn normal_at(&self, x: f32, y: f32) -> [f32; 3] {
        self.normal_of_weights([self.weights[0].at(x, y), self.weights[1].at(x, y)])
    }

    /// Returns the unit normal at the weights of corners 1 and 2.
    pub fn normal_of_weights(&self, weights: [f32; 2]) -> [f32; 3] {
        let Some(corners) = self.corner_normals else { return self.normal };
        let [b, c] = weights.map(|w| w.clamp(0.0, 1.0));
        let a = (1.0 - b - c).max(0.0);
        let interpolated = [0, 1, 2].map(|k| f64::from(a * corners[0][k] + b * corners[1][k] + c * corners[2][k]));
        normalized(interpolated).map_or(self.normal, |n| n.map(|v| v as f32))
    }
}

/// Returns the map of a triangle with local corners over a sub-tile; `None` for one seen edge-on.
pub(crate) fn perspective_map(view: &PerspectiveProjection, corner_px: [u64; 2], local: &[Vec3; 3]) -> Option<PerspectiveMap> {
    PerspectiveMap::new(&local.map(|p| homogeneous(view, corner_px, p)), view.near_m * DEPTH_UNITS_PER_M, SUBTILE_PX as f64)
}

/// Returns the affine texture coordinates (u right, v up) that equal those of a map at a pixel position, as do their derivatives.
pub fn texture_at(map: &PerspectiveMap, corners: &[[f32; 2]; 3], position: [f64; 2]) -> [Affine; 2] {
    texture_of(&map.affine_weights(position), corners)
}

/// Returns the texture coordinates of the weights of corners 1 and 2.
#[inline(always)]
fn texture_of([b, c]: &[Affine; 2], corners: &[[f32; 2]; 3]) -> [Affine; 2] {
    let coordinate = |k: usize| {
        let (d1, d2) = (corners[1][k] - corners[0][k], corners[2][k] - corners[0][k]);
        Affine { dx: d1 * b.dx + d2 * c.dx, dy: d1 * b.dy + d2 * c.dy, at0: corners[0][k] + d1 * b.at0 + d2 * c.at0 }
    };
    [coordinate(0), coordinate(1)]
}

/// Returns the gradients of the weights of corners 1 and 2 over pixels, `[[d1/dx, d1/dy], [d2/dx, d2/dy]]`; zeros for a triangle seen edge-on.
fn weight_gradients(p: &[Vec3; 3]) -> [[f64; 2]; 2] {
    let (ax, ay) = (p[1][0] - p[0][0], p[1][1] - p[0][1]);
    let (bx, by) = (p[2][0] - p[0][0], p[2][1] - p[0][1]);
    let inverse = 1.0 / (ax * by - ay * bx);
    if !inverse.is_finite() {
        return [[0.0; 2]; 2];
    }
    [[by * inverse, -bx * inverse], [-ay * inverse, ax * inverse]]
}

fn texture_coordinate(record: &TriangleRecord, k: usize, gradients: [[f64; 2]; 2], corner: &Vec3) -> Affine {
    let value = |corner: usize| f64::from(record.uv[corner][k]);
    let (d1, d2) = (value(1) - value(0), value(2) - value(0));
    let gradient = [0, 1].map(|axis| d1 * gradients[0][axis] + d2 * gradients[1][axis]);
    Affine::new(gradient, corner, value(0))
}

/// Returns the unit normal of the visible side (n·d ≤ 0). A triangle without area faces the viewer.
pub(crate) fn visible_normal(local: &[Vec3; 3], forward: Vec3) -> Vec3 {
    let Some(n) = normalized(triangle_normal(*local)) else { return vec3::scale(forward, -1.0) };
    if vec3::dot(n, forward) > 0.0 { vec3::scale(n, -1.0) } else { n }
}

/// Returns the shading normals, turned to the visible side. A corner without one gets the geometric normal.
fn corner_normals(chunk: &Chunk, triangle: u32, transform: Option<&[f64; 12]>, visible: Vec3) -> Option<[[f32; 3]; 3]> {
    let stored = chunk.normals().get(triangle as usize)?;
    if *stored == [[0; 3]; 3] {
        return None;
    }
    Some(stored.map(|n| {
        let n = n.map(|v| f64::from(v) / 32767.0);
        let local = normalized(transform.map_or(n, |t| transform_normal(t, n))).unwrap_or(visible);
        let side = if vec3::dot(local, visible) < 0.0 { -1.0 } else { 1.0 };
        local.map(|v| (v * side) as f32)
    }))
}

/// Multiplies a normal by the cofactors of the transform's 3 × 3 part.
fn transform_normal(t: &[f64; 12], n: Vec3) -> Vec3 {
    let columns = [0, 1, 2].map(|k| [t[k], t[k + 4], t[k + 8]]);
    let cofactors = [vec3::cross(columns[1], columns[2]), vec3::cross(columns[2], columns[0]), vec3::cross(columns[0], columns[1])];
    let terms = [0, 1, 2].map(|k| vec3::scale(cofactors[k], n[k]));
    vec3::add(vec3::add(terms[0], terms[1]), terms[2])
}
