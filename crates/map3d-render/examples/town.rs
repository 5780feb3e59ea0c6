//! Builds a synthetic town for the example `tiles`: 1.8 × 1.8 km of houses with windows, trees and a terrain, 64 textures of 1024² px
//! (5 cm texels), about a million triangles or ten.
//!
//! `cargo run --release -p map3d-render --example town -- <folder> [windows per wall, default 6]`

use std::path::Path;

use map3d_base::Vec3;
use map3d_base::asset::{AssetReport, AssetWriter, Batch, Material, Materials, Object, Rank};
use map3d_base::vec3::{add, cross, normalized, scale, sub};
use map3d_build::{BuildOptions, BuildRequest, GroundPlane, build_scene};
use map3d_image::Raster;
use map3d_image::encode::encode_jpeg;

const SIDE_M: f64 = 1800.0;
const TEXEL_M: f64 = 0.05;
const TEXTURES: u32 = 64;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let folder = Path::new(&args[0]);
    let windows = args.get(1).map_or(6, |v| v.parse().expect("windows per wall"));
    let asset = folder.join("assets/town");
    let mut writer = AssetWriter::create(&asset).expect("asset");
    let materials = textures(&mut writer);
    let mut town = Town { batch: Batch::default(), object: 0, random: 1 };
    town.terrain();
    for k in 0..5750u32 {
        town.house(k, windows);
    }
    (0..5000).for_each(|_| town.tree());
    writer.append(&town.batch).expect("append");
    let tables = Materials { materials, instances: vec![] };
    let report = writer.finish(&tables, &vec![Object::default(); town.object as usize + 1], AssetReport::default()).expect("finish");
    std::fs::write(asset.join("ids.u32"), (1..=town.object + 1).flat_map(u32::to_le_bytes).collect::<Vec<u8>>()).expect("ids");
    let options = BuildOptions { ground_plane: GroundPlane::Off, ..BuildOptions::default() };
    let request = BuildRequest { assets: vec!["town".into()], origin: [0.0; 3], options, ground_id: 0, threads: 0, max_memory_bytes: 0 };
    build_scene(folder, &request, &mut |_, _, _| true).expect("builds");
    println!("{} triangles, {} objects", report.triangles, town.object + 1);
}

/// Creates textures of bricks or grass with noise of several sizes.
fn textures(writer: &mut AssetWriter) -> Vec<Material> {
    let hash = |x: u32, y: u32, k: u32| {
        let h = (x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77) ^ k.wrapping_mul(0xC2B2_AE3D)).wrapping_mul(0x2C1B_3C6D);
        f64::from((h ^ h >> 15).wrapping_mul(0x297A_2D39) >> 24) / 128.0 - 1.0
    };
    let image = |k: u32| {
        let (bw, bh) = (12 + hash(k, 1, 0).abs() as u32 + k % 60, 7 + k % 30);
        let pixel = |i: u32| {
            let (x, y) = (i % 1024, i / 1024);
            let noise: f64 = [(0, 5.0), (2, 8.0), (4, 10.0), (7, 14.0)].iter().map(|(s, a)| a * hash(x >> s, y >> s, k + s)).sum();
            let mortar = y % bh < 2 || (x + y / bh % 2 * bw / 2) % bw < 2;
            let window = (16..44).contains(&(y % 64)) && (14..40).contains(&(x % 56));
            let dim = if k >= TEXTURES - 8 { 1.0 } else { (if mortar { 0.75 } else { 1.0 }) * (if window { 0.55 } else { 1.0 }) };
            let base = [0, 1, 2].map(|c| 130.0 + 60.0 * hash(k, c, 77));
            let [r, g, b] = base.map(|v| ((v + noise) * dim).clamp(0.0, 255.0) as u8);
            [r, g, b, 255]
        };
        Raster::new(1024, 1024, (0..1 << 20).map(pixel).collect())
    };
    let material = |k| {
        let key = writer.add_texture(&encode_jpeg(&image(k), 90).expect("jpeg"), "jpg").expect("stored");
        Material { name: format!("{k}"), texture: Some(key), diffuse: [1.0; 4], ..Material::default() }
    };
    (0..TEXTURES).map(material).collect()
}

struct Town {
    batch: Batch,
    object: u32,
    random: u64,
}

impl Town {
    /// Returns a random number in [lo, hi).
    fn between(&mut self, lo: f64, hi: f64) -> f64 {
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        lo + (hi - lo) * ((self.random >> 33) as f64 / f64::from(1u32 << 31))
    }

    /// Adds a counter-clockwise quadrilateral, textured in its own plane.
    fn quad(&mut self, c: [Vec3; 4], material: u32, rank: Rank) {
        let across = normalized(sub(c[1], c[0])).expect("has a length");
        let normal = normalized(cross(across, sub(c[3], c[0]))).expect("has an area");
        let up = cross(normal, across);
        let size = 1024.0 * TEXEL_M;
        let dot = |a: Vec3, b: Vec3| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let uv = c.map(|p| [(dot(p, across) / size) as f32, (dot(p, up) / size) as f32]);
        let b = &mut self.batch;
        let first = b.positions.len() as u32;
        b.positions.extend_from_slice(&c);
        for k in [[0, 1, 2], [0, 2, 3]] {
            b.triangles.push(k.map(|i| first + i));
            b.uvs.push(k.map(|i| uv[i as usize]));
            b.materials.push(material);
            b.objects.push(self.object);
            b.ranks.push(rank);
        }
    }

    fn terrain(&mut self) {
        let n = 180;
        let step = SIDE_M / f64::from(n);
        let at = |i: i32, j: i32| {
            let (x, y) = (f64::from(i) * step - SIDE_M / 2.0, f64::from(j) * step - SIDE_M / 2.0);
            [x, y, 2.0 * (x / 130.0).sin() + 2.0 * (y / 170.0).cos() - 4.0]
        };
        for k in 0..n * n {
            let (i, j) = (k % n, k / n);
            self.object = (j / 30 * 6 + i / 30) as u32;
            self.quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], TEXTURES - 8 + self.object % 4, Rank::Terrain);
        }
    }

    /// Adds walls with `windows`² recessed windows each, and a gabled roof.
    fn house(&mut self, k: u32, windows: u32) {
        self.object += 1;
        let (w, d) = (self.between(6.0, 9.3), self.between(6.0, 9.3));
        let h = if self.between(0.0, 1.0) < 0.12 { self.between(20.0, 55.0) } else { self.between(6.0, 18.0) };
        let (x, y) = (f64::from(k % 76) * 23.5 - 888.0, f64::from(k / 76) * 23.5 - 888.0);
        let material = k % (TEXTURES - 8);
        let corners = [[x - w, y - d], [x + w, y - d], [x + w, y + d], [x - w, y + d]];
        for side in 0..4 {
            let (a, b) = (corners[side], corners[(side + 1) % 4]);
            self.wall([a[0], a[1], -6.0], [b[0], b[1], -6.0], h + 6.0, material, windows);
        }
        let ridge = self.between(2.0, 5.0);
        let top = |p: [f64; 2]| [p[0], p[1], h];
        let (r0, r1) = ([x, y - d, h + ridge], [x, y + d, h + ridge]);
        self.quad([top(corners[1]), top(corners[2]), r1, r0], material, Rank::Other);
        self.quad([top(corners[3]), top(corners[0]), r0, r1], material, Rank::Other);
    }

    fn wall(&mut self, a: Vec3, b: Vec3, height: f64, material: u32, n: u32) {
        let (along, up) = (sub(b, a), [0.0, 0.0, height]);
        let inward = scale(normalized(cross(up, along)).expect("upright"), 0.25);
        let at = |s: f64, t: f64| add(a, add(scale(along, s), scale(up, t)));
        self.quad([at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)], material, Rank::Other);
        for k in 0..n * n {
            let (s, t) = (f64::from(k % n) / f64::from(n), f64::from(k / n) / f64::from(n));
            let (w, e) = (0.55 / f64::from(n), 0.2 / f64::from(n));
            let c = [at(s + e, t + e), at(s + e + w, t + e), at(s + e + w, t + e + w), at(s + e, t + e + w)].map(|p| sub(p, inward));
            self.quad(c, (material + 9) % (TEXTURES - 8), Rank::Opening);
            if k % 3 == 0 {
                self.quad([add(c[3], inward), add(c[2], inward), c[2], c[3]], material, Rank::Installation);
            }
        }
    }

    /// Adds a round crown of 48 faces.
    fn tree(&mut self) {
        self.object += 1;
        let (x, y, r) = (self.between(-890.0, 890.0), self.between(-890.0, 890.0), self.between(1.5, 3.5));
        let at = |i: u32, j: u32| {
            let (a, b) = (f64::from(i) * std::f64::consts::TAU / 8.0, (f64::from(j) + 0.4) * std::f64::consts::PI / 6.8);
            [x + r * a.cos() * b.sin(), y + r * a.sin() * b.sin(), 3.0 + r - r * b.cos()]
        };
        for k in 0..48 {
            let (i, j) = (k % 8, k / 8);
            self.quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], TEXTURES - 2, Rank::Other);
        }
    }
}
