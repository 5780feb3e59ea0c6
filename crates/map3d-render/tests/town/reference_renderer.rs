//! Renders pixels by brute force: the winner of a sample, its texture without mip levels, and means over many samples.

use map3d_base::{DEPTH_NOTHING, Frame, Vec3};
use map3d_image::srgb::LINEAR16;
use map3d_render::RenderScene;

use super::Town;
use super::reference::{ReferenceTriangle, ReferenceView};

/// The surface at a sample.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleHit {
    /// Index into the faces of the town.
    pub face: usize,
    pub id: u32,
    pub depth: u32,
    /// Unit normal of the visible side.
    pub normal: Vec3,
    pub uv: [f64; 2],
}

pub struct ReferenceRenderer<'a> {
    view: ReferenceView<'a>,
    triangles: Vec<ReferenceTriangle>,
    town: &'a Town,
}

impl<'a> ReferenceRenderer<'a> {
    /// `scene` is built from `town`, whose faces must not be long enough to be split.
    pub fn new(scene: &RenderScene, town: &'a Town, frame: &'a Frame) -> Self {
        let view = ReferenceView::new(frame);
        Self { triangles: view.triangles(scene.store()), view, town }
    }

    /// Returns the surface at a lattice point in 1/256 px of level zmax.
    pub fn sample(&self, at: [i128; 2]) -> Option<SampleHit> {
        let covering = self.triangles.iter().filter(|t| t.covers(at));
        let best = covering.min_by_key(|t| (t.depth_key(self.view.depth(t, at)), t.tie_break()))?;
        let depth = (self.view.depth(best, at) + 0.5).floor().clamp(0.0, f64::from(DEPTH_NOTHING - 1)) as u32;
        let w = self.view.weights(best, at);
        let uv = [0, 1].map(|k| (0..3).map(|c| w[c] * best.uv[c][k]).sum());
        Some(SampleHit {
            face: self.town.face_number(best.object_id, best.source, best.transform.is_some()),
            id: best.object_id,
            depth,
            normal: best.normal,
            uv,
        })
    }

    /// Returns the surface at sample k of pixel (i, j).
    pub fn pixel_sample(&self, i: u32, j: u32, k: usize) -> Option<SampleHit> {
        self.sample(ReferenceView::sample([i as usize, j as usize], k))
    }

    /// Returns the linear light 0..65535 of a surface: its constant colour, or the texture interpolated bilinearly (wrapping).
    pub fn color(&self, hit: &SampleHit) -> [f64; 3] {
        let material = &self.town.materials[self.town.faces[hit.face].material as usize];
        let Some(image) = &self.town.images[self.town.faces[hit.face].material as usize] else {
            return [0, 1, 2].map(|c| f64::from(LINEAR16[(material.diffuse[c] * 255.0).round() as usize]));
        };
        let (x, y) = (hit.uv[0] * f64::from(image.width) - 0.5, (1.0 - hit.uv[1]) * f64::from(image.height) - 0.5);
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

    /// Returns the mean colour and coverage over n × n points of pixel (i, j).
    pub fn mean(&self, i: u32, j: u32, n: i128) -> ([f64; 3], f64) {
        let (mut sum, mut hits) = ([0.0; 3], 0.0);
        for k in 0..n * n {
            let at = |p: u32, q: i128| i128::from(p) * 256 + (2 * q + 1) * 128 / n;
            if let Some(hit) = self.sample([at(i, k % n), at(j, k / n)]) {
                let color = self.color(&hit);
                (0..3).for_each(|c| sum[c] += color[c]);
                hits += 1.0;
            }
        }
        let total = (n * n) as f64;
        (sum.map(|s| s / total), hits / total)
    }
}
