//! The rules of spec/pyramid.md §4 once more, plainly, in float64 and i128: every sample against every triangle.

use map3d_base::samples::SAMPLES;
use map3d_base::vec3::{dot, length, triangle_normal};
use map3d_base::{DEPTH_NOTHING, Frame, Vec3};
use map3d_image::srgb::LINEAR16;

use super::{Face, Town};

/// Scene coordinates lie on the lattice of 2^-12 m.
fn snapped(p: Vec3) -> Vec3 {
    p.map(|c| (c * 4096.0 + 0.5).floor() / 4096.0)
}

struct Projected<'a> {
    face: &'a Face,
    number: usize,
    /// Pixels of level zmax and depth units, unsnapped.
    pixel: [Vec3; 3],
    /// 1/256 px.
    snapped: [[i128; 2]; 3],
    normal: Vec3,
    bias: f64,
}

/// What a sample meets.
#[derive(Clone, Debug, PartialEq)]
pub struct Met {
    pub face: usize,
    pub id: u32,
    pub depth: u32,
    /// Unit normal of the seen side.
    pub normal: Vec3,
    pub uv: [f64; 2],
}

pub struct Plain<'a> {
    faces: Vec<Projected<'a>>,
    town: &'a Town,
}

impl<'a> Plain<'a> {
    pub fn new(town: &'a Town, frame: &Frame) -> Self {
        let axes = frame.axes();
        let project = |(number, face): (usize, &'a Face)| {
            let local = face.corners.map(snapped);
            let pixel = local.map(|p| frame.pixel_from_local(&axes, p));
            let n = triangle_normal(local);
            let n = n.map(|c| c / length(n));
            let along = dot(n, axes.forward);
            let normal = if along > 0.0 { n.map(|c| -c) } else { n };
            let bias = (f64::from(face.rank as u8) * 2.0 / along.abs().max(1.0 / 16.0)).round();
            let snapped = pixel.map(|p| [0, 1].map(|k| (p[k] * 256.0 + 0.5).floor() as i128));
            Projected { face, number, pixel, snapped, normal, bias }
        };
        Self { faces: town.faces.iter().enumerate().map(project).collect(), town }
    }

    /// The surface at a lattice point given in 1/256 px of level zmax.
    pub fn sample(&self, x: i128, y: i128) -> Option<Met> {
        let (fx, fy) = (x as f64 / 256.0, y as f64 / 256.0);
        let key = |f: &Projected| (depth(&f.pixel, fx, fy) as f64 - f.bias, -(f.face.rank as i32), f.face.object, f.number);
        let covering = self.faces.iter().filter(|f| covers(&f.snapped, x, y));
        let best = covering.min_by(|a, b| key(a).partial_cmp(&key(b)).expect("numbers"))?;
        let (b, c) = weights(&best.pixel, fx, fy);
        let uv = [0, 1].map(|k| {
            let v = best.face.uv.map(|corner| f64::from(corner[k]));
            v[0] + (v[1] - v[0]) * b + (v[2] - v[0]) * c
        });
        Some(Met { face: best.number, id: best.face.object + 1, depth: depth(&best.pixel, fx, fy), normal: best.normal, uv })
    }

    /// Sample k of pixel (i, j).
    pub fn pixel_sample(&self, i: u32, j: u32, k: usize) -> Option<Met> {
        let (sx, sy) = SAMPLES[k];
        self.sample(i128::from(i) * 256 + i128::from(sx) * 16, i128::from(j) * 256 + i128::from(sy) * 16)
    }

    /// Linear light 0..65535 of a surface at a point: flat, or the texture interpolated bilinearly (wrapping).
    pub fn color(&self, met: &Met) -> [f64; 3] {
        let material = &self.town.materials[self.town.faces[met.face].material as usize];
        let Some(image) = &self.town.images[self.town.faces[met.face].material as usize] else {
            return [0, 1, 2].map(|c| f64::from(LINEAR16[(material.diffuse[c] * 255.0).round() as usize]));
        };
        let (x, y) = (met.uv[0] * f64::from(image.width) - 0.5, (1.0 - met.uv[1]) * f64::from(image.height) - 0.5);
        let texel = |i: i64, j: i64| {
            let fold = |t: f64, k: i64, n: u32| (t.floor() as i64 + k).rem_euclid(i64::from(n)) as u32;
            image.row(fold(y, j, image.height))[fold(x, i, image.width) as usize]
        };
        let (fx, fy) = (x - x.floor(), y - y.floor());
        [0, 1, 2].map(|c| {
            let t = |i, j| f64::from(LINEAR16[texel(i, j)[c] as usize]);
            (t(0, 0) * (1.0 - fx) + t(1, 0) * fx) * (1.0 - fy) + (t(0, 1) * (1.0 - fx) + t(1, 1) * fx) * fy
        })
    }

    /// Mean colour and coverage over pixel (i, j), of n × n points.
    pub fn mean(&self, i: u32, j: u32, n: i128) -> ([f64; 3], f64) {
        let (mut sum, mut hits) = ([0.0; 3], 0.0);
        for k in 0..n * n {
            let at = |p: u32, q: i128| i128::from(p) * 256 + (2 * q + 1) * 128 / n;
            if let Some(met) = self.sample(at(i, k % n), at(j, k / n)) {
                let color = self.color(&met);
                (0..3).for_each(|c| sum[c] += color[c]);
                hits += 1.0;
            }
        }
        let total = (n * n) as f64;
        (sum.map(|s| s / total), hits / total)
    }
}

fn covers(s: &[[i128; 2]; 3], x: i128, y: i128) -> bool {
    let edge = |a: [i128; 2], b: [i128; 2], p: [i128; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    let area = edge(s[0], s[1], s[2]);
    if area == 0 {
        return false;
    }
    let t = if area > 0 { *s } else { [s[0], s[2], s[1]] };
    (0..3).all(|k| {
        let (a, b) = (t[k], t[(k + 1) % 3]);
        let value = edge(a, b, [x, y]);
        let top_left = b[1] < a[1] || (b[1] == a[1] && b[0] > a[0]);
        value > 0 || (value == 0 && top_left)
    })
}

fn weights(p: &[Vec3; 3], x: f64, y: f64) -> (f64, f64) {
    let (ax, ay, bx, by) = (p[1][0] - p[0][0], p[1][1] - p[0][1], p[2][0] - p[0][0], p[2][1] - p[0][1]);
    let det = ax * by - ay * bx;
    let (dx, dy) = (x - p[0][0], y - p[0][1]);
    ((dx * by - dy * bx) / det, (dy * ax - dx * ay) / det)
}

fn depth(p: &[Vec3; 3], x: f64, y: f64) -> u32 {
    let (b, c) = weights(p, x, y);
    let d = p.map(|c| c[2]);
    let plane = d[0] + (d[1] - d[0]) * b + (d[2] - d[0]) * c;
    let (lo, hi) = (d[0].min(d[1]).min(d[2]), d[0].max(d[1]).max(d[2]));
    (plane.clamp(lo, hi) + 0.5).floor().clamp(0.0, f64::from(DEPTH_NOTHING - 1)) as u32
}
