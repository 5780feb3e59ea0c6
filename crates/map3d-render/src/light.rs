//! What rays from the visible points of a sub-tile tell: sun, sun16, ambient occlusion, the second surface, and the lit picture (spec/pyramid.md §10).

mod average;
mod place;
mod planes;
mod points;
mod quads;
mod subtile;
mod surfaces;

use map3d_base::{DEPTH_NOTHING, DEPTH_UNITS_PER_M, Frame, Isa, LayerKind, LayerSpec, RAY_LIFT_M, Result, Vec3, ViewAxes};
use map3d_image::GBuffer;
use map3d_scene::SceneStore;
use map3d_trace::{Cutout, DepthPlane, Openness, RAYS, Surroundings, VisBuf};

use crate::shade::Shader;
use average::{Known, average, picture};
use place::Locator;
pub use place::Place;
use points::{Points, pixel_of, place_of};
use quads::Quads;
use subtile::Subtile;
use surfaces::{Surfaces, take_centers};

/// Directions of ambient occlusion, over the whole sphere: half of them count at a point.
const DIRECTIONS: usize = 64;
/// What lies nearer behind a surface belongs to it.
const BEHIND_UNITS: u32 = 64;

/// Traces the further layers of a view's sub-tiles; one per thread.
pub struct Lights<'s> {
    scene: &'s SceneStore,
    frame: Frame,
    axes: ViewAxes,
    /// Side of a pixel of level zmax.
    pixel_m: f64,
    isa: Isa,
    directions: Vec<Vec3>,
    surfaces: Surfaces,
    quads: Quads,
    /// The pixels' centres, for what is that of a pixel's centre.
    centers: Points,
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
            surfaces: Surfaces::default(),
            quads: Quads::default(),
            centers: Points::default(),
        })
    }

    /// Fills the arrays of a sub-tile that has just been shaded.
    pub fn subtile(&mut self, vis: &VisBuf, shader: &Shader, g: &mut GBuffer, place: Place, cutout: &dyn Cutout) -> Result<()> {
        let layers = std::mem::take(&mut self.frame.layers);
        let (seen, shaded) = shader.seen();
        let locator = Locator::new(&self.frame, self.axes, place);
        let done = self.layers(&layers, &Subtile { vis, shader, seen, shaded, place, locator, cutout }, g);
        self.frame.layers = layers;
        done
    }

    fn layers(&mut self, layers: &[LayerSpec], sub: &Subtile, g: &mut GBuffer) -> Result<()> {
        if layers.iter().any(|l| !l.suns.is_empty() && is_averaged(l.kind)) {
            self.surfaces.take(sub);
        }
        if layers.iter().any(|l| l.radius_m > 0.0) {
            self.quads.take(sub);
        }
        // Layers of one pass may share a sun or a radius.
        let (mut suns, mut radii) = (Found::default(), Found::default());
        for layer in layers {
            match layer.kind {
                LayerKind::Sun => {
                    let lit = suns.get(layer.suns[0], || self.lit(&self.surfaces.points, layer.suns[0], sub.cutout))?;
                    self.sun(sub, lit, g);
                }
                LayerKind::Ao => {
                    let open = radii.get(layer.radius_m, || self.open(layer.radius_m, sub.cutout))?;
                    let known = Known { pixel: |i, j| open[self.quads.of_pixel(i, j)], share: |k| open[self.quads.of_share(k)] };
                    average(sub.seen, known, &mut g.ao, g.width, sub.place);
                }
                LayerKind::Picture => {
                    let lit = suns.get(layer.suns[0], || self.lit(&self.surfaces.points, layer.suns[0], sub.cutout))?;
                    let open = radii.get(layer.radius_m, || self.open(layer.radius_m, sub.cutout))?;
                    self.picture(sub, layer.suns[0], lit, open, g);
                }
                LayerKind::Sun16 => self.sun16(sub, &layer.suns, g)?,
                LayerKind::Depth2 => self.behind(sub, g)?,
                LayerKind::Color | LayerKind::Normal | LayerKind::Id | LayerKind::Depth => {}
            }
        }
        Ok(())
    }

    fn sun(&self, sub: &Subtile, lit: &[u64], g: &mut GBuffer) {
        let share = |place: usize| if is_lit(lit, place) { 1.0 } else { 0.0 };
        let known = Known { pixel: |i, j| share(place_of([i, j])), share: |k: usize| share(self.surfaces.share_places[k] as usize) };
        average(sub.seen, known, &mut g.sun, g.width, sub.place);
    }

    fn picture(&self, sub: &Subtile, sun: Vec3, lit: &[u64], open: &[f32], g: &mut GBuffer) {
        let known = Known {
            pixel: |i, j| (is_lit(lit, place_of([i, j])), open[self.quads.of_pixel(i, j)]),
            share: |k: usize| (is_lit(lit, self.surfaces.share_places[k] as usize), open[self.quads.of_share(k)]),
        };
        picture(sub.seen, sub.shaded, sun, known, g, sub.place);
    }

    fn sun16(&mut self, sub: &Subtile, suns: &[Vec3], g: &mut GBuffer) -> Result<()> {
        take_centers(&mut self.centers, sub, RAY_LIFT_M);
        for (bit, sun) in suns.iter().enumerate() {
            let lit = self.lit(&self.centers, *sun, sub.cutout)?;
            for place in places(&lit) {
                let [i, j] = pixel_of(place);
                g.sun16[sub.place.index(g.width, i, j)] |= 1 << bit;
            }
        }
        Ok(())
    }

    /// Of each patch, the points that a sun lights, a bit each.
    fn lit(&self, points: &Points, sun: Vec3, cutout: &dyn Cutout) -> Result<Vec<u64>> {
        let mut out = vec![0; points.patches().len()];
        if sun[2] <= 0.0 || points.is_empty() {
            return Ok(out);
        }
        let around = Surroundings::ahead(self.scene, points.center, &points.bounds, sun)?;
        let mut bundles = around.along(sun, self.pixel_m, self.isa)?;
        for (patch, lit) in points.patches().iter().zip(&mut out) {
            if !patch.is_empty() {
                let shadow = bundles.any_hit(patch, f64::INFINITY, cutout);
                *lit = shadow.sent & !shadow.hit;
            }
        }
        Ok(out)
    }

    /// How open the hemisphere above each plane is.
    fn open(&self, radius_m: f64, cutout: &dyn Cutout) -> Result<Vec<f32>> {
        let points = &self.quads.points;
        if points.is_empty() {
            return Ok(Vec::new());
        }
        let around = Surroundings::within(self.scene, points.center, &points.bounds, radius_m + RAY_LIFT_M)?;
        let patches = points.patches();
        let mut openness = vec![Openness::default(); patches.len()];
        for direction in &self.directions {
            let mut bundles = around.along(*direction, self.pixel_m, self.isa)?;
            for (patch, openness) in patches.iter().zip(&mut openness).filter(|(patch, _)| !patch.is_empty()) {
                bundles.add_open(patch, radius_m, cutout, openness);
            }
        }
        let share = |place: &u32| openness[*place as usize / RAYS].share(*place as usize % RAYS);
        Ok(self.quads.places.iter().map(share).collect())
    }

    fn behind(&mut self, sub: &Subtile, g: &mut GBuffer) -> Result<()> {
        take_centers(&mut self.centers, sub, 0.0);
        let points = &self.centers;
        if points.is_empty() {
            return Ok(());
        }
        let forward = self.axes.forward;
        let around = Surroundings::ahead(self.scene, points.center, &points.bounds, forward)?;
        let mut bundles = around.along(forward, self.pixel_m, self.isa)?;
        let near_m = (f64::from(BEHIND_UNITS) - 0.5) / DEPTH_UNITS_PER_M;
        for (number, patch) in points.patches().iter().enumerate().filter(|(_, patch)| !patch.is_empty()) {
            let nearest = bundles.nearest(patch, near_m, sub.cutout);
            let plane = |t: &[Vec3; 3]| DepthPlane::of_corners(&self.frame, &self.axes, t, sub.place.corner_px);
            let planes: Vec<DepthPlane> = nearest.triangles.iter().map(plane).collect();
            for (k, triangle) in nearest.of_point.iter().enumerate() {
                let Some(triangle) = triangle else { continue };
                let [i, j] = pixel_of(number * RAYS + k);
                let at = sub.place.index(g.width, i, j);
                let least = g.depth[at].saturating_add(BEHIND_UNITS).min(DEPTH_NOTHING - 1);
                g.depth2[at] = planes[*triangle as usize].units(i, j).max(least);
            }
        }
        Ok(())
    }
}

/// Whether the point at a place is lit, by what `Lights::lit` tells.
fn is_lit(lit: &[u64], place: usize) -> bool {
    lit[place / RAYS] >> (place % RAYS) & 1 == 1
}

/// The places of the bits that are set.
fn places(lit: &[u64]) -> impl Iterator<Item = usize> {
    let words = lit.iter().enumerate();
    words.flat_map(|(patch, word)| (0..RAYS).filter(move |k| word >> k & 1 == 1).map(move |k| patch * RAYS + k))
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
}
