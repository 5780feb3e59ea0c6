//! Layers that ray packets from the visible points of a sub-tile compute: sun, sun16, ambient occlusion, the second surface, and the lit picture
//! (spec/pyramid.md §10).

mod ao_points;
mod average;
mod fragment_origins;
mod quad_planes;
mod ray_origins;
mod subtile;
mod unprojection;

use map3d_base::layers::{AO, DEPTH, DEPTH2, Reduction, SUN, SUN16};
use map3d_base::{DEPTH_NOTHING, DEPTH_UNITS_PER_M, Isa, LayerKind, LayerSpec, Projection, RAY_LIFT_M, Result, Vec3};
use map3d_image::GBuffer;
use map3d_scene::SceneStore;
use map3d_trace::{AmbientOcclusion, Cutout, DepthPlane, PACKET_SIZE, SceneRegion, VisBuf};

use crate::shade::Shader;
use ao_points::AoPoints;
use average::{LightValues, PictureLight, average, light_picture};
use fragment_origins::{FragmentOrigins, collect_centers};
use ray_origins::{RayOrigins, pixel_index, pixel_of_index};
use subtile::ShadedSubtile;
pub use unprojection::SubtilePosition;
use unprojection::Unprojection;

/// Directions of ambient occlusion over the whole sphere; half of them are above a surface.
const AO_DIRECTIONS: usize = 64;
/// The least depth of the second surface behind the first; anything nearer belongs to the first.
const SECOND_SURFACE_UNITS: u32 = 64;

/// Traces the light layers of a view's sub-tiles. Keep one per thread to reuse its buffers.
pub struct LightTracer<'s> {
    scene: &'s SceneStore,
    layers: Vec<LayerSpec>,
    view: Projection,
    /// Side of a pixel, at the depths of the current sub-tile.
    pixel_m: f64,
    isa: Isa,
    ao_directions: Vec<Vec3>,
    fragments: FragmentOrigins,
    ao_points: AoPoints,
    /// For the layers of the pixels' centres.
    centers: RayOrigins,
}

impl<'s> LightTracer<'s> {
    /// Returns `None` if no layer needs rays.
    pub fn new(scene: &'s SceneStore, layers: &[LayerSpec], view: Projection, isa: Isa) -> Option<Self> {
        layers.iter().any(|l| l.kind.row().traced).then(|| Self {
            scene,
            layers: layers.to_vec(),
            view,
            pixel_m: view.pixel_m(0.0),
            isa,
            ao_directions: even_directions(AO_DIRECTIONS),
            fragments: FragmentOrigins::default(),
            ao_points: AoPoints::default(),
            centers: RayOrigins::default(),
        })
    }

    /// Fills the light arrays of a sub-tile that has just been shaded.
    pub fn trace_subtile(&mut self, vis: &VisBuf, shader: &Shader, g: &mut GBuffer, position: SubtilePosition, cutout: &dyn Cutout) -> Result<()> {
        let layers = std::mem::take(&mut self.layers);
        let unprojection = Unprojection::new(&self.view, position);
        let (buffer, surfaces) = (shader.fragments(), shader.surfaces());
        let subtile = ShadedSubtile { vis, shader, buffer, surfaces, position, unprojection, cutout };
        if let Some(depth) = subtile.first_depth() {
            self.pixel_m = self.view.pixel_m(depth);
        }
        let done = self.trace_layers(&layers, &subtile, g);
        self.layers = layers;
        done
    }

    fn trace_layers(&mut self, layers: &[LayerSpec], subtile: &ShadedSubtile, g: &mut GBuffer) -> Result<()> {
        // Collect the points that layers share.
        if layers.iter().any(|l| !l.suns.is_empty() && is_averaged(l.kind)) {
            self.fragments.collect(subtile);
        }
        if layers.iter().any(|l| l.radius_m > 0.0) {
            self.ao_points.collect(subtile);
        }

        // Trace each sun and each radius once.
        let (mut suns, mut radii) = (Memo::default(), Memo::default());
        for layer in layers {
            match layer.kind {
                LayerKind::Sun => {
                    let lit = suns.get(layer.suns[0], || self.trace_sun(&self.fragments.origins, layer.suns[0], subtile.cutout))?;
                    self.fill_sun(subtile, lit, g);
                }
                LayerKind::Ao => {
                    let ambient = radii.get(layer.radius_m, || self.trace_ao(layer.radius_m, subtile.cutout))?;
                    self.fill_ao(subtile, ambient, g);
                }
                LayerKind::Picture => {
                    let lit = suns.get(layer.suns[0], || self.trace_sun(&self.fragments.origins, layer.suns[0], subtile.cutout))?;
                    let ambient = radii.get(layer.radius_m, || self.trace_ao(layer.radius_m, subtile.cutout))?;
                    self.fill_picture(subtile, layer.suns[0], lit, ambient, g);
                }
                LayerKind::Sun16 => self.fill_sun16(subtile, &layer.suns, g)?,
                LayerKind::Depth2 => self.fill_second_surface(subtile, g)?,
                LayerKind::Color | LayerKind::Normal | LayerKind::Id | LayerKind::Depth | LayerKind::Data => {}
            }
        }
        Ok(())
    }

    fn fill_sun(&self, subtile: &ShadedSubtile, lit: &[u64], g: &mut GBuffer) {
        let value = |origin: usize| if is_lit(lit, origin) { 1.0 } else { 0.0 };
        let values =
            LightValues { pixel: |i, j| value(pixel_index([i, j])), fragment: |k: usize| value(self.fragments.origin_of_fragment[k] as usize) };
        let width = g.width;
        average(subtile.buffer, values, &mut g[SUN], width, subtile.position);
    }

    fn fill_ao(&self, subtile: &ShadedSubtile, ambient: &[f32], g: &mut GBuffer) {
        let points = &self.ao_points;
        let values = LightValues { pixel: |i, j| ambient[points.plane_of_pixel(i, j)], fragment: |k| ambient[points.plane_of_fragment(k)] };
        let width = g.width;
        average(subtile.buffer, values, &mut g[AO], width, subtile.position);
    }

    fn fill_picture(&self, subtile: &ShadedSubtile, sun: Vec3, lit: &[u64], ambient: &[f32], g: &mut GBuffer) {
        let light = |origin: usize, plane: usize| PictureLight { is_lit: is_lit(lit, origin), ambient: ambient[plane] };
        let values = LightValues {
            pixel: |i, j| light(pixel_index([i, j]), self.ao_points.plane_of_pixel(i, j)),
            fragment: |k: usize| light(self.fragments.origin_of_fragment[k] as usize, self.ao_points.plane_of_fragment(k)),
        };
        light_picture(subtile.buffer, subtile.surfaces, sun, values, g, subtile.position);
    }

    fn fill_sun16(&mut self, subtile: &ShadedSubtile, suns: &[Vec3], g: &mut GBuffer) -> Result<()> {
        collect_centers(&mut self.centers, subtile, RAY_LIFT_M);
        for (bit, sun) in suns.iter().enumerate() {
            let lit = self.trace_sun(&self.centers, *sun, subtile.cutout)?;
            for origin in set_bits(&lit) {
                let [i, j] = pixel_of_index(origin);
                let at = subtile.position.index(g.width, i, j);
                g[SUN16][at] |= 1 << bit;
            }
        }
        Ok(())
    }

    fn fill_second_surface(&mut self, subtile: &ShadedSubtile, g: &mut GBuffer) -> Result<()> {
        // Continue the lines of sight behind the first surface.
        collect_centers(&mut self.centers, subtile, 0.0);
        let origins = &self.centers;
        if origins.is_empty() {
            return Ok(());
        }
        let forward = self.view.axes().forward;
        let region = SceneRegion::open_ahead(self.scene, origins.center, &origins.bounds, forward)?;
        let mut packets = region.packets_along(forward, self.pixel_m, self.isa)?;
        let near_m = (f64::from(SECOND_SURFACE_UNITS) - 0.5) / DEPTH_UNITS_PER_M;
        for (number, packet) in origins.packets().iter().enumerate().filter(|(_, packet)| !packet.is_empty()) {
            let closest = packets.closest_hits(packet, near_m, subtile.cutout);
            let plane = |t: &[Vec3; 3]| DepthPlane::of_corners(&self.view, t, subtile.position.in_view);
            let planes: Vec<DepthPlane> = closest.triangles.iter().map(plane).collect();

            // Store the depths at the pixels' centres.
            for (k, triangle) in closest.triangle_of_ray.iter().enumerate() {
                let Some(triangle) = triangle else { continue };
                let [i, j] = pixel_of_index(number * PACKET_SIZE + k);
                let at = subtile.position.index(g.width, i, j);
                let least = g[DEPTH][at].saturating_add(SECOND_SURFACE_UNITS).min(DEPTH_NOTHING - 1);
                g[DEPTH2][at] = planes[*triangle as usize].units(i, j).max(least);
            }
        }
        Ok(())
    }

    /// Returns for each packet the mask of the points that a sun lights.
    fn trace_sun(&self, origins: &RayOrigins, sun: Vec3, cutout: &dyn Cutout) -> Result<Vec<u64>> {
        let mut out = vec![0; origins.packets().len()];
        if sun[2] <= 0.0 || origins.is_empty() {
            return Ok(out);
        }
        let region = SceneRegion::open_ahead(self.scene, origins.center, &origins.bounds, sun)?;
        let mut packets = region.packets_along(sun, self.pixel_m, self.isa)?;
        for (packet, lit) in origins.packets().iter().zip(&mut out) {
            if !packet.is_empty() {
                let result = packets.any_hit(packet, f64::INFINITY, cutout);
                *lit = result.sent & !result.hit;
            }
        }
        Ok(out)
    }

    /// Returns the ambient visibility of each plane of the sub-tile.
    fn trace_ao(&self, radius_m: f64, cutout: &dyn Cutout) -> Result<Vec<f32>> {
        let origins = &self.ao_points.origins;
        if origins.is_empty() {
            return Ok(Vec::new());
        }
        let region = SceneRegion::open_within(self.scene, origins.center, &origins.bounds, radius_m + RAY_LIFT_M)?;

        // Accumulate direction by direction.
        let mut occlusion = vec![AmbientOcclusion::default(); origins.packets().len()];
        for direction in &self.ao_directions {
            let mut packets = region.packets_along(*direction, self.pixel_m, self.isa)?;
            for (packet, ao) in origins.packets().iter().zip(&mut occlusion).filter(|(packet, _)| !packet.is_empty()) {
                packets.accumulate_ao(packet, radius_m, cutout, ao);
            }
        }

        let visibility = |origin: &u32| occlusion[*origin as usize / PACKET_SIZE].visibility(*origin as usize % PACKET_SIZE);
        Ok(self.ao_points.origin_of_plane.iter().map(visibility).collect())
    }
}

/// Returns whether the point with an origin index is lit, by the masks that `LightTracer::trace_sun` returns.
fn is_lit(lit: &[u64], origin: usize) -> bool {
    lit[origin / PACKET_SIZE] >> (origin % PACKET_SIZE) & 1 == 1
}

/// Returns the origin indices of the bits that are set.
fn set_bits(lit: &[u64]) -> impl Iterator<Item = usize> {
    let words = lit.iter().enumerate();
    words.flat_map(|(packet, word)| (0..PACKET_SIZE).filter(move |k| word >> k & 1 == 1).map(move |k| packet * PACKET_SIZE + k))
}

/// Results by the key that they were computed for.
struct Memo<K, T>(Vec<(K, Vec<T>)>);

impl<K, T> Default for Memo<K, T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<K: Copy + PartialEq, T> Memo<K, T> {
    /// Returns the result for a key and computes it the first time.
    fn get(&mut self, key: K, compute: impl FnOnce() -> Result<Vec<T>>) -> Result<&[T]> {
        let index = match self.0.iter().position(|(k, _)| *k == key) {
            Some(index) => index,
            None => {
                self.0.push((key, compute()?));
                self.0.len() - 1
            }
        };
        Ok(&self.0[index].1)
    }
}

/// Returns whether the layer's values are means over a pixel's samples, as colours are.
fn is_averaged(kind: LayerKind) -> bool {
    kind.row().array.is_some_and(|array| matches!(array.reduction, Reduction::Mean | Reduction::MeanOfCovered))
}

/// Returns directions that are even over the sphere: a spiral from pole to pole that turns by the golden angle.
fn even_directions(count: usize) -> Vec<Vec3> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let direction = |n: usize| {
        let z = 1.0 - (2.0 * n as f64 + 1.0) / count as f64;
        let (turn, r) = (n as f64 * golden, (1.0 - z * z).sqrt());
        [r * turn.cos(), r * turn.sin(), z]
    };
    (0..count).map(direction).collect()
}

#[cfg(test)]
mod tests {
    use map3d_base::vec3::{add, dot, length};

    use super::*;

    #[test]
    fn directions_are_even() {
        let all = even_directions(AO_DIRECTIONS);
        let sum = all.iter().fold([0.0; 3], |s, d| add(s, *d));
        assert!(length(sum) < 0.02 * AO_DIRECTIONS as f64);
        // Over any hemisphere, the mean of max(0, cosine) is a quarter.
        for n in even_directions(500) {
            let mean = all.iter().map(|d| dot(n, *d).max(0.0)).sum::<f64>() / AO_DIRECTIONS as f64;
            assert!((mean - 0.25).abs() < 0.01, "{n:?}: {mean}");
        }
    }
}
