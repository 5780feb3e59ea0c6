//! What rays from the visible points of a sub-tile tell: sun, sun16, ambient occlusion, the second surface, and the lit picture (spec/pyramid.md §10).

mod planes;
mod points;

use map3d_base::{DEPTH_NOTHING, DEPTH_UNITS_PER_M, Frame, Isa, LayerKind, LayerSpec, RAY_LIFT_M, Result, Vec3, ViewAxes};
use map3d_image::GBuffer;
use map3d_scene::SceneStore;
use map3d_trace::{Cutout, DepthPlane, Openness, SUBTILE_PX, Surroundings, VisBuf};

use crate::paint::Shaded;
use crate::shade::{Shader, SurfacePoint};
use planes::Planes;
use points::{Points, Stand};

/// Directions of ambient occlusion, over the whole sphere: half of them count at a point.
const DIRECTIONS: usize = 64;
/// What lies nearer behind a surface belongs to it.
const BEHIND_UNITS: u32 = 64;
/// Linear light of a picture, in 1/65536.
const AMBIENT: u64 = 27_525;
const DIFFUSE: u64 = 49_807;

/// Traces the further layers of a view's sub-tiles; one per thread.
pub struct Lights<'s> {
    scene: &'s SceneStore,
    frame: Frame,
    axes: ViewAxes,
    /// Side of a pixel of level zmax.
    pixel_m: f64,
    isa: Isa,
    directions: Vec<Vec3>,
    /// Every surface in every pixel, for what is averaged over a pixel.
    surfaces: Points,
    /// Where ambient occlusion is found: once for each plane that two by two pixels show. And of each surface in a pixel, which it is.
    quads: Points,
    quad_of: Vec<u32>,
    /// The pixels' centres, for what is that of a pixel's centre.
    centers: Points,
}

/// A sub-tile's place in its tile and in the view.
#[derive(Clone, Copy)]
pub struct Place {
    /// First pixel in the G-buffer: left, top.
    pub corner: (usize, usize),
    /// The same pixel of level zmax, from the square's top left corner.
    pub corner_px: [u64; 2],
}

impl Place {
    /// Index of pixel (i, j) of the sub-tile in the G-buffer.
    fn index(&self, width: u32, i: usize, j: usize) -> usize {
        (self.corner.1 + j) * width as usize + self.corner.0 + i
    }
}

impl<'s> Lights<'s> {
    /// `None`: no layer of the frame needs rays.
    pub fn new(scene: &'s SceneStore, frame: &Frame, isa: Isa) -> Option<Self> {
        let asks = |l: &LayerSpec| is_averaged(l.kind) || matches!(l.kind, LayerKind::Sun16 | LayerKind::Depth2);
        frame.layers.iter().any(asks).then(|| Self {
            scene,
            frame: frame.clone(),
            axes: frame.axes(),
            pixel_m: frame.pixel_m(frame.zmax),
            isa,
            directions: even_directions(DIRECTIONS),
            surfaces: Points::default(),
            quads: Points::default(),
            quad_of: Vec::new(),
            centers: Points::default(),
        })
    }

    /// Fills the arrays of a sub-tile that has just been shaded.
    pub fn subtile(&mut self, vis: &VisBuf, shader: &Shader, g: &mut GBuffer, place: Place, cutout: &dyn Cutout) -> Result<()> {
        let layers = std::mem::take(&mut self.frame.layers);
        let done = self.layers(&layers, vis, shader, g, place, cutout);
        self.frame.layers = layers;
        done
    }

    fn layers(&mut self, layers: &[LayerSpec], vis: &VisBuf, shader: &Shader, g: &mut GBuffer, place: Place, cutout: &dyn Cutout) -> Result<()> {
        let (seen, shaded) = shader.points();
        if layers.iter().any(|l| !l.suns.is_empty() && is_averaged(l.kind)) {
            self.take_surfaces(seen, shaded, place);
        }
        if layers.iter().any(|l| l.radius_m > 0.0) {
            self.take_quads(seen, shaded, place);
        }
        if layers.iter().any(|l| matches!(l.kind, LayerKind::Sun16 | LayerKind::Depth2)) {
            self.take_centers(vis, shader, place);
        }
        // Layers of one pass may share a sun or a radius.
        let (mut suns, mut radii) = (Found::default(), Found::default());
        for layer in layers {
            match layer.kind {
                LayerKind::Sun => {
                    let lit = suns.get(layer.suns[0], || self.lit(&self.surfaces, layer.suns[0], cutout))?;
                    let shares: Vec<f32> = lit.iter().map(|lit| if *lit { 1.0 } else { 0.0 }).collect();
                    average(seen, &shares, &mut g.sun, g.width, place);
                }
                LayerKind::Ao => {
                    let open = radii.get(layer.radius_m, || self.open(layer.radius_m, cutout))?;
                    average(seen, open, &mut g.ao, g.width, place);
                }
                LayerKind::Picture => {
                    let lit = suns.get(layer.suns[0], || self.lit(&self.surfaces, layer.suns[0], cutout))?;
                    let open = radii.get(layer.radius_m, || self.open(layer.radius_m, cutout))?;
                    let light = |k: usize, p: &SurfacePoint| {
                        let cosine = if lit[k] {
                            u64::from(shaded[p.surface as usize].cosine(p.pixel[0].into(), p.pixel[1].into(), layer.suns[0]))
                        } else {
                            0
                        };
                        AMBIENT * (f64::from(open[k]) * 65_536.0) as u64 + DIFFUSE * cosine
                    };
                    picture(seen, light, g, place);
                }
                LayerKind::Sun16 => {
                    for (bit, sun) in layer.suns.iter().enumerate() {
                        let lit = self.lit(&self.centers, *sun, cutout)?;
                        let lit = self.centers.pixels.iter().zip(lit);
                        lit.for_each(|(&[i, j], lit)| g.sun16[place.index(g.width, i.into(), j.into())] |= u16::from(lit) << bit);
                    }
                }
                LayerKind::Depth2 => self.behind(g, place, cutout)?,
                LayerKind::Color | LayerKind::Normal | LayerKind::Id | LayerKind::Depth => {}
            }
        }
        Ok(())
    }

    fn take_surfaces(&mut self, seen: &[SurfacePoint], shaded: &[Shaded], place: Place) {
        self.surfaces.clear();
        for p in seen {
            let surface = &shaded[p.surface as usize];
            let [x, y] = [0, 1].map(|k| f64::from(p.pixel[k]) + f64::from(p.at[k]) / 256.0);
            let at = self.local(place, x, y, &surface.depth);
            let stand = if p.samples == 16 { Stand::Pixel } else { Stand::Share };
            self.surfaces.push(p.pixel, stand, at, surface.geometric_normal());
        }
        self.surfaces.finish();
    }

    fn take_quads(&mut self, seen: &[SurfacePoint], shaded: &[Shaded], place: Place) {
        self.quad_of.clear();
        let mut planes = Planes::default();
        for p in seen {
            let surface = &shaded[p.surface as usize];
            let [x, y] = [0, 1].map(|k| f64::from(p.pixel[k]) + f64::from(p.at[k]) / 256.0);
            let at = self.local(place, x, y, &surface.depth);
            self.quad_of.push(planes.add(p.pixel, at, surface.geometric_normal(), p.samples));
        }
        self.quads.clear();
        for plane in &planes.all {
            self.quads.push(plane.quad, Stand::Quad, plane.at, plane.normal);
        }
        self.quads.finish();
    }

    fn take_centers(&mut self, vis: &VisBuf, shader: &Shader, place: Place) {
        self.centers.clear();
        for (i, j) in (0..SUBTILE_PX).flat_map(|j| (0..SUBTILE_PX).map(move |i| (i, j))) {
            if let Some(slot) = vis.center_slot(i, j) {
                let surface = shader.surface_of(slot);
                let (x, y) = (i as f64 + 0.5, j as f64 + 0.5);
                let at = self.local(place, x, y, &surface.depth);
                self.centers.push([i as u8, j as u8], Stand::Pixel, at, surface.geometric_normal());
            }
        }
        self.centers.finish();
    }

    /// Local point of a surface at (x, y) in pixels from the sub-tile's corner.
    fn local(&self, place: Place, x: f64, y: f64, depth: &DepthPlane) -> Vec3 {
        let u = self.frame.u0_m + (place.corner_px[0] as f64 + x) * self.pixel_m;
        let v = self.frame.v0_m - (place.corner_px[1] as f64 + y) * self.pixel_m;
        let d = self.frame.d0_m + depth.at(x, y) / DEPTH_UNITS_PER_M;
        let (r, up, f) = (self.axes.right, self.axes.up, self.axes.forward);
        [r[0] * u + up[0] * v + f[0] * d, r[1] * u + up[1] * v + f[1] * d, r[2] * u + up[2] * v + f[2] * d]
    }

    /// Of each point, whether a sun lights it.
    fn lit(&self, points: &Points, sun: Vec3, cutout: &dyn Cutout) -> Result<Vec<bool>> {
        let mut out = vec![false; points.len()];
        if sun[2] <= 0.0 || points.len() == 0 {
            return Ok(out);
        }
        let around = Surroundings::ahead(self.scene, points.center, &points.bounds, sun)?;
        let mut bundles = around.along(sun, self.pixel_m, self.isa)?;
        for (patch, numbers) in points.patches(RAY_LIFT_M) {
            let shadow = bundles.any_hit(&patch, f64::INFINITY, cutout);
            let lit = shadow.sent & !shadow.hit;
            numbers.iter().enumerate().for_each(|(k, number)| out[*number as usize] = lit >> k & 1 == 1);
        }
        Ok(out)
    }

    /// How open the hemisphere above each surface in a pixel is.
    fn open(&self, radius_m: f64, cutout: &dyn Cutout) -> Result<Vec<f32>> {
        let points = &self.quads;
        let mut out = vec![1.0; points.len()];
        if points.len() == 0 {
            return Ok(out);
        }
        let around = Surroundings::within(self.scene, points.center, &points.bounds, radius_m + RAY_LIFT_M)?;
        let patches: Vec<_> = points.patches(RAY_LIFT_M).collect();
        let mut openness = vec![Openness::default(); patches.len()];
        for direction in &self.directions {
            let mut bundles = around.along(*direction, self.pixel_m, self.isa)?;
            for ((patch, _), openness) in patches.iter().zip(&mut openness) {
                bundles.add_open(patch, radius_m, cutout, openness);
            }
        }
        for ((_, numbers), openness) in patches.iter().zip(&openness) {
            numbers.iter().enumerate().for_each(|(k, number)| out[*number as usize] = openness.share(k));
        }
        Ok(self.quad_of.iter().map(|q| out[*q as usize]).collect())
    }

    fn behind(&self, g: &mut GBuffer, place: Place, cutout: &dyn Cutout) -> Result<()> {
        let points = &self.centers;
        if points.len() == 0 {
            return Ok(());
        }
        let forward = self.axes.forward;
        let around = Surroundings::ahead(self.scene, points.center, &points.bounds, forward)?;
        let mut bundles = around.along(forward, self.pixel_m, self.isa)?;
        let near_m = (f64::from(BEHIND_UNITS) - 0.5) / DEPTH_UNITS_PER_M;
        for (patch, numbers) in points.patches(0.0) {
            let nearest = bundles.nearest(&patch, near_m, cutout);
            let plane = |t: &[Vec3; 3]| DepthPlane::of_corners(&self.frame, &self.axes, t, place.corner_px);
            let planes: Vec<DepthPlane> = nearest.triangles.iter().map(plane).collect();
            for (k, number) in numbers.iter().enumerate() {
                let Some(triangle) = nearest.of_point[k] else { continue };
                let [i, j] = points.pixels[*number as usize].map(usize::from);
                let at = place.index(g.width, i, j);
                let least = g.depth[at].saturating_add(BEHIND_UNITS).min(DEPTH_NOTHING - 1);
                g.depth2[at] = planes[triangle as usize].units(i, j).max(least);
            }
        }
        Ok(())
    }
}

/// What was found of each point, by what it was found for.
struct Found<K, T>(Vec<(K, Vec<T>)>);

impl<K, T> Default for Found<K, T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<K: Copy + PartialEq, T> Found<K, T> {
    fn get(&mut self, key: K, find: impl FnOnce() -> Result<Vec<T>>) -> Result<&[T]> {
        let at = match self.0.iter().position(|(known, _)| *known == key) {
            Some(at) => at,
            None => {
                self.0.push((key, find()?));
                self.0.len() - 1
            }
        };
        Ok(&self.0[at].1)
    }
}

/// The layer's values are means over a pixel's samples, as colours are.
fn is_averaged(kind: LayerKind) -> bool {
    matches!(kind, LayerKind::Sun | LayerKind::Ao | LayerKind::Picture)
}

/// Means over the covered samples of each pixel; 255 is 1. Points of one pixel follow each other.
fn average(seen: &[SurfacePoint], shares: &[f32], out: &mut [u8], width: u32, place: Place) {
    for (first, points) in pixels_of(seen) {
        let weight = |p: &SurfacePoint| f32::from(p.samples);
        let all: f32 = points.iter().map(weight).sum();
        let sum: f32 = points.iter().zip(&shares[first..]).map(|(p, share)| weight(p) * share).sum();
        let [i, j] = points[0].pixel.map(usize::from);
        out[place.index(width, i, j)] = (sum / all * 255.0 + 0.5) as u8;
    }
}

/// Colours times light (in 2^-32), averaged over each pixel.
fn picture(seen: &[SurfacePoint], light: impl Fn(usize, &SurfacePoint) -> u64, g: &mut GBuffer, place: Place) {
    for (first, points) in pixels_of(seen) {
        let mut sum = [0u64; 4];
        for (k, p) in points.iter().enumerate() {
            let (light, weight) = (light(first + k, p), u64::from(p.samples));
            for c in 0..3 {
                let lit = (u64::from(p.color[c]) * light + (1 << 31)) >> 32;
                sum[c] += lit.min(65_535) * weight;
            }
            sum[3] += 65_535 * weight;
        }
        let [i, j] = points[0].pixel.map(usize::from);
        g.picture[place.index(g.width, i, j)] = sum.map(|c| ((c + 8) >> 4) as u16);
    }
}

/// The points of each pixel, with the number of the first.
fn pixels_of(seen: &[SurfacePoint]) -> impl Iterator<Item = (usize, &[SurfacePoint])> {
    let mut first = 0;
    seen.chunk_by(|a, b| a.pixel == b.pixel).map(move |points| {
        first += points.len();
        (first - points.len(), points)
    })
}

/// Even over the sphere: a spiral from pole to pole that turns by the golden angle.
fn even_directions(count: usize) -> Vec<Vec3> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let at = |n: usize| {
        let z = 1.0 - (2.0 * n as f64 + 1.0) / count as f64;
        let (turn, r) = (n as f64 * golden, (1.0 - z * z).sqrt());
        [r * turn.cos(), r * turn.sin(), z]
    };
    (0..count).map(at).collect()
}

#[cfg(test)]
mod tests {
    use map3d_base::vec3::{add, dot, length};

    use super::*;

    #[test]
    fn directions_are_even() {
        let all = even_directions(DIRECTIONS);
        let sum = all.iter().fold([0.0; 3], |s, d| add(s, *d));
        assert!(length(sum) < 0.02 * DIRECTIONS as f64);
        // Of any hemisphere the mean cosine is a quarter of the sphere's.
        for n in even_directions(500) {
            let mean = all.iter().map(|d| dot(n, *d).max(0.0)).sum::<f64>() / DIRECTIONS as f64;
            assert!((mean - 0.25).abs() < 0.01, "{n:?}: {mean}");
        }
    }

    #[test]
    fn a_pixel_is_the_mean_of_its_surfaces() {
        let point = |i: u8, samples: u8| SurfacePoint { pixel: [i, 1], at: [128; 2], samples, surface: 0, color: [0; 3] };
        let seen = [point(0, 16), point(1, 4), point(1, 4), point(2, 3)];
        let mut out = vec![7; 4 * 4];
        average(&seen, &[0.5, 1.0, 0.0, 1.0], &mut out, 4, Place { corner: (1, 2), corner_px: [0; 2] });
        assert_eq!(&out[12..], &[7, 128, 128, 255]);
        assert!(out[..12].iter().all(|v| *v == 7));
    }
}
