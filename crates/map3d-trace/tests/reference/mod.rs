//! The rules of spec/pyramid.md §4 by brute force: each sample against all triangles of a built scene, in plain loops, float64 and i128.
#![allow(dead_code)]

pub mod comparison;

use map3d_base::samples::SAMPLES;
use map3d_base::vec3::{cross, dot, length, sub, triangle_normal};
use map3d_base::{Frame, Vec3, ViewAxes};
use map3d_scene::instances::place;
use map3d_scene::records::EMPTY;
use map3d_scene::{Chunk, InstanceRecord, MaterialRecord, SceneStore};

/// A triangle in a view.
pub struct ReferenceTriangle {
    /// Snapped, in steps of 1/256 pixel from the square's corner.
    pub steps: [[i128; 2]; 3],
    /// Local corners.
    pub corners: [Vec3; 3],
    /// Least and greatest depth in units.
    pub range: (f64, f64),
    /// Geometric unit normal of the visible side.
    pub normal: Vec3,
    pub bias: i64,
    pub rank: u8,
    pub object_id: u32,
    /// Number in the asset.
    pub source: u32,
    pub material: MaterialRecord,
    pub uv: [[f64; 2]; 3],
    /// Placement of the prototype; `None` for a triangle of a chunk.
    pub transform: Option<[f64; 12]>,
}

/// Texture coordinates at a point of a triangle.
#[derive(Clone, Copy, Debug)]
pub struct TexturePoint {
    pub uv: [f64; 2],
    /// Change of (u, v) over one pixel to the right and one pixel down.
    pub footprint: [[f64; 2]; 2],
    /// Bound of the error of float32 texture coordinates.
    pub tolerance: [f64; 2],
}

/// A view and its axes.
pub struct ReferenceView<'a> {
    pub frame: &'a Frame,
    pub axes: ViewAxes,
}

impl<'a> ReferenceView<'a> {
    pub fn new(frame: &'a Frame) -> Self {
        Self { frame, axes: frame.axes() }
    }

    /// Returns the position of sample k of a pixel of level zmax in lattice steps.
    pub fn sample([i, j]: [usize; 2], k: usize) -> [i128; 2] {
        let (sx, sy) = SAMPLES[k];
        [(i * 256 + usize::from(sx) * 16) as i128, (j * 256 + usize::from(sy) * 16) as i128]
    }

    /// Returns the local point on the plane D = D0 of a lattice point.
    fn origin(&self, at: [i128; 2]) -> Vec3 {
        let pixel = self.frame.pixel_m(self.frame.zmax) / 256.0;
        self.axes.local_from_uvd([self.frame.u0_m + at[0] as f64 * pixel, self.frame.v0_m - at[1] as f64 * pixel, self.frame.d0_m])
    }

    /// Returns all triangles of a scene.
    pub fn triangles(&self, store: &SceneStore) -> Vec<ReferenceTriangle> {
        let mut out = Vec::new();
        for part in store.parts() {
            let chunk = store.chunk(part.chunk).expect("chunk");
            let instance = part.instance.map(|k| store.instances()[k as usize]);
            for leaf in chunk.leaves() {
                for lane in (0..8).filter(|l| leaf.triangle[*l] != EMPTY) {
                    let corners = [0, 3, 6].map(|c| {
                        let p = [0, 1, 2].map(|k| chunk.origin()[k] + f64::from(leaf.corners[c + k][lane]));
                        instance.map_or(p, |i| place(&i.transform, p))
                    });
                    out.push(self.triangle(&chunk, leaf.triangle[lane], instance, corners));
                }
            }
        }
        out
    }

    fn triangle(&self, chunk: &Chunk, triangle: u32, instance: Option<InstanceRecord>, corners: [Vec3; 3]) -> ReferenceTriangle {
        let record = chunk.triangles()[triangle as usize];
        let pixel = corners.map(|p| self.frame.pixel_from_local(&self.axes, p));
        let d = pixel.map(|p| p[2]);
        let n = triangle_normal(corners);
        let cosine = dot(n, self.axes.forward) / length(n);
        ReferenceTriangle {
            steps: pixel.map(|p| [p[0], p[1]].map(|v| (256.0 * v + 0.5).floor() as i128)),
            corners,
            range: (d[0].min(d[1]).min(d[2]), d[0].max(d[1]).max(d[2])),
            normal: n.map(|c| if cosine > 0.0 { -c } else { c } / length(n)),
            bias: ((f64::from(record.rank) - 3.0) * 2.0 / cosine.abs().max(1.0 / 16.0)).round() as i64,
            rank: record.rank,
            object_id: instance.map_or(chunk.objects()[record.object as usize].id, |i| i.object_id),
            source: record.source,
            material: chunk.materials()[record.material as usize],
            uv: record.uv.map(|c| c.map(f64::from)),
            transform: instance.map(|i| i.transform),
        }
    }

    /// Returns the barycentric weights at the intersection of the triangle's plane with the line of sight through a lattice point; not finite for a
    /// triangle seen edge-on.
    pub fn weights(&self, t: &ReferenceTriangle, at: [i128; 2]) -> [f64; 3] {
        let [a, b, c] = t.corners;
        let n = cross(sub(b, a), sub(c, a));
        let from = self.origin(at);
        let along = dot(n, sub(a, from)) / dot(n, self.axes.forward);
        let p = [0, 1, 2].map(|k| from[k] + along * self.axes.forward[k]);
        let weight = |q: Vec3, r: Vec3| dot(cross(sub(q, p), sub(r, p)), n) / dot(n, n);
        [weight(b, c), weight(c, a), weight(a, b)]
    }

    /// Returns the depth in units, not rounded.
    pub fn depth(&self, t: &ReferenceTriangle, at: [i128; 2]) -> f64 {
        let from = self.origin(at);
        let n = cross(sub(t.corners[1], t.corners[0]), sub(t.corners[2], t.corners[0]));
        let along = dot(n, sub(t.corners[0], from)) / dot(n, self.axes.forward);
        if along.is_finite() { (along * 1024.0).clamp(t.range.0, t.range.1) } else { t.range.0 }
    }

    /// Returns `None` for a triangle seen edge-on.
    pub fn texture_point(&self, t: &ReferenceTriangle, at: [i128; 2]) -> Option<TexturePoint> {
        let uv_at = |at: [i128; 2]| {
            let w = self.weights(t, at);
            [0, 1].map(|k| t.uv[0][k] + w[1] * (t.uv[1][k] - t.uv[0][k]) + w[2] * (t.uv[2][k] - t.uv[0][k]))
        };
        let (uv, right, down) = (uv_at(at), uv_at([at[0] + 256, at[1]]), uv_at([at[0], at[1] + 256]));
        let footprint = [right, down].map(|p| [p[0] - uv[0], p[1] - uv[1]]);
        // Affine functions of 24 bits, evaluated up to 64 pixels from the corner of the sub-tile.
        let tolerance = [0, 1].map(|k| (uv[k].abs() + 128.0 * (footprint[0][k].abs() + footprint[1][k].abs())) / f64::from(1 << 21));
        uv.iter().chain(footprint.as_flattened()).all(|v| v.is_finite()).then_some(TexturePoint { uv, footprint, tolerance })
    }
}

impl ReferenceTriangle {
    /// Returns whether a lattice point is strictly inside, or on an edge that belongs to this triangle by the top-left rule.
    pub fn covers(&self, [x, y]: [i128; 2]) -> bool {
        let s = &self.steps;
        let area = (s[1][0] - s[0][0]) * (s[2][1] - s[0][1]) - (s[1][1] - s[0][1]) * (s[2][0] - s[0][0]);
        if area == 0 {
            return false;
        }
        (0..3).all(|k| {
            let (a, b) = if area > 0 { (s[k], s[(k + 1) % 3]) } else { (s[(k + 1) % 3], s[k]) };
            let side = (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
            let is_top_left = b[1] < a[1] || (b[1] == a[1] && b[0] > a[0]);
            side > 0 || (side == 0 && is_top_left)
        })
    }

    /// Returns whether its box overlaps the square of `side` pixels with the top left pixel `at`.
    pub fn overlaps(&self, at: [usize; 2], side: usize) -> bool {
        (0..2).all(|k| {
            let (from, to) = ((at[k] * 256) as i128, ((at[k] + side) * 256) as i128);
            self.steps.iter().any(|s| s[k] >= from) && self.steps.iter().any(|s| s[k] <= to)
        })
    }

    /// Orders equal depth keys in the visibility rule; the least wins.
    pub fn tie_break(&self) -> (u8, u32, u32) {
        (255 - self.rank, self.object_id, self.source)
    }

    /// Returns the depth key (depth − bias) of a depth in units.
    pub fn depth_key(&self, depth: f64) -> i64 {
        (depth + 0.5).floor() as i64 - self.bias
    }
}
