//! Streams the triangles of an asset: converts them to local coordinates, snaps, filters and splits them.

use std::collections::HashMap;

use map3d_base::asset::AssetMesh;
use map3d_base::{KeptSpace, Vec3, vec3};
use map3d_scene::lattice::{Point, snap};

use crate::assets::Asset;
use crate::materials::BuildMaterials;
use crate::report::BuildReport;
use crate::request::BuildOptions;
use crate::triangle::BuildTriangle;

/// Triangles, of about 60 bytes each, after which the resident pages of an asset's mesh are dropped.
const TRIANGLES_PER_RELEASE: usize = 1 << 20;
/// Object id in a prototype's chunk; each instance has its own object.
const PROTOTYPE_ID: u32 = 1;

/// Reads the triangles of assets as those of chunks.
pub(crate) struct TriangleSource<'a> {
    pub assets: &'a [&'a Asset],
    pub materials: &'a BuildMaterials,
    pub options: &'a BuildOptions,
    pub origin: Vec3,
    /// Triangles outside it are left out.
    pub extent: Option<&'a KeptSpace>,
}

impl TriangleSource<'_> {
    /// Passes on the triangles of one asset in source order, with their prototype (0: none) if `wanted` accepts it. Calls `keep_going` every 65,536
    /// triangles with the number done; returns false as soon as it does.
    pub fn stream(
        &self,
        number: usize,
        wanted: impl Fn(u32) -> bool,
        report: &mut BuildReport,
        out: &mut dyn FnMut(u32, &BuildTriangle),
        keep_going: &mut dyn FnMut(u64) -> bool,
    ) -> bool {
        let asset = self.assets[number];
        let mut done = 0;
        for mesh in asset.mesh.drawn() {
            let mut counters = TriangleCounters::new(asset.ids.len());
            for (i, prototype) in mesh.prototypes().iter().enumerate() {
                if i % (1 << 16) == 0 && !keep_going(done + i as u64) {
                    return false;
                }
                if i % TRIANGLES_PER_RELEASE == 0 {
                    mesh.release();
                }
                let ordinal = counters.next(*prototype, mesh.objects()[i]);
                if !wanted(*prototype) {
                    continue;
                }
                report.triangles_read += 1;
                let Some(mut t) = self.triangle(number, mesh, i, report) else { continue };
                t.source = ordinal;
                report.split_triangles += t.split(&mut |piece| out(*prototype, piece)) - 1;
            }
            done += mesh.triangles().len() as u64;
        }
        true
    }

    /// Returns a triangle of the mesh of an asset; `None` for one that is left out.
    fn triangle(&self, number: usize, mesh: &AssetMesh, i: usize, report: &mut BuildReport) -> Option<BuildTriangle> {
        let (asset, prototype) = (self.assets[number], mesh.prototypes()[i]);
        let origin = if prototype == 0 { self.origin } else { [0.0; 3] };
        let Some(corners) = mesh.corners(i) else {
            report.adjusted_away += 1;
            return None;
        };
        if prototype == 0 && self.extent.is_some_and(|e| !e.keeps(corners)) {
            report.outlier_triangles += 1;
            return None;
        }
        let corners = corners.map(|p| snap(vec3::sub(p, origin)));
        let object = mesh.objects()[i];
        let material = self.materials.number(number, mesh.materials()[i], (prototype == 0).then_some(object), || unit_normal_z(corners));
        if self.options.drop_untextured && !self.materials.is_textured(material) {
            report.untextured_faces += 1;
            return None;
        }
        let t = BuildTriangle {
            corners,
            uv: mesh.uvs()[i],
            normals: mesh.normals_of(i).map_or([[0; 3]; 3], |n| n.map(|c| c.map(snorm))),
            rank: mesh.ranks()[i].min(5),
            padding: 0,
            material,
            object_id: if prototype == 0 { asset.ids[object as usize] } else { PROTOTYPE_ID },
            source: 0,
            asset: number as u32,
            padding2: 0,
        };
        if self.options.drop_degenerate && t.has_no_area() {
            report.degenerate_triangles += 1;
            return None;
        }
        Some(t)
    }
}

/// Numbers the triangles within each object and each prototype, so that numbers stay when other objects of the asset are added or removed.
struct TriangleCounters {
    objects: Vec<u32>,
    prototypes: HashMap<u32, u32>,
}

impl TriangleCounters {
    fn new(objects: usize) -> Self {
        Self { objects: vec![0; objects], prototypes: HashMap::new() }
    }

    fn next(&mut self, prototype: u32, object: u32) -> u32 {
        let slot = if prototype == 0 { &mut self.objects[object as usize] } else { self.prototypes.entry(prototype).or_default() };
        *slot += 1;
        *slot - 1
    }
}

/// Returns the z of the unit normal, 0 for a triangle without area.
fn unit_normal_z(corners: [Point; 3]) -> f64 {
    let [a, b, c] = corners.map(|p| p.map(|v| v as f64));
    let normal = vec3::cross(vec3::sub(b, a), vec3::sub(c, a));
    let length = vec3::length(normal);
    if length > 0.0 { normal[2] / length } else { 0.0 }
}

fn snorm(v: f32) -> i16 {
    (v.clamp(-1.0, 1.0) * 32767.0).round() as i16
}
