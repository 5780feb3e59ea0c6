//! Small synthetic scenes, built like real ones.
#![allow(dead_code)]

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use map3d_base::asset::{AssetReport, AssetWriter, Batch, Instance, Material, Materials, Object, Rank};
use map3d_base::{Frame, Vec3};
use map3d_scene::SceneStore;
use map3d_scene::build::{BuildOptions, BuildRequest, GroundPlane, build_scene};

pub const RANKS: [Rank; 6] = [Rank::Terrain, Rank::Road, Rank::Ground, Rank::Other, Rank::Installation, Rank::Opening];

/// Repeatable numbers.
pub struct Dice(pub u64);

impl Dice {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = self.0 ^ (self.0 >> 33);
        x.wrapping_mul(0xff51_afd7_ed55_8ccd) >> 16
    }

    /// In [lo, hi).
    pub fn between(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * (self.next() as f64 / (1u64 << 48) as f64)
    }

    pub fn below(&mut self, n: u64) -> u64 {
        self.next() % n
    }

    pub fn point(&mut self, half: f64) -> Vec3 {
        [self.between(-half, half), self.between(-half, half), self.between(-half, half)]
    }
}

/// Triangles by corners, with object and rank; one asset of one material.
#[derive(Default)]
pub struct Soup {
    pub placed: Vec<([Vec3; 3], u32, Rank)>,
    /// Of prototype k + 1.
    pub prototypes: Vec<Vec<[Vec3; 3]>>,
    pub instances: Vec<Instance>,
}

impl Soup {
    pub fn add(&mut self, corners: [Vec3; 3], object: u32, rank: Rank) {
        self.placed.push((corners, object, rank));
    }

    /// A four-cornered face.
    pub fn quad(&mut self, c: [Vec3; 4], object: u32, rank: Rank) {
        self.add([c[0], c[1], c[2]], object, rank);
        self.add([c[0], c[2], c[3]], object, rank);
    }
}

/// A scene's folder; removed when dropped.
pub struct Folder(pub PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

pub fn new_folder(name: &str) -> Folder {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let path = std::env::temp_dir().join(format!("map3d-trace-{name}-{}-{number}", std::process::id()));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("temporary folder");
    Folder(path)
}

/// Writes a soup as the asset `soup`; object k has the id k + 1.
pub fn write_asset(folder: &Folder, soup: &Soup) {
    let asset = folder.0.join("assets/soup");
    let mut writer = AssetWriter::create(&asset).expect("asset");
    let mut objects = soup.instances.iter().map(|i| i.object + 1).max().unwrap_or(1);
    let mut batch = Batch::default();
    for (corners, object, rank) in &soup.placed {
        push(&mut batch, corners, *object, *rank);
        objects = objects.max(object + 1);
    }
    writer.append(&batch).expect("append");
    for (k, triangles) in soup.prototypes.iter().enumerate() {
        let mut batch = Batch { prototype: k as u32 + 1, ..Batch::default() };
        triangles.iter().for_each(|t| push(&mut batch, t, 0, Rank::Other));
        writer.append(&batch).expect("append");
    }
    let materials = Materials { materials: vec![Material::default()], instances: soup.instances.clone() };
    writer.finish(&materials, &vec![Object::default(); objects as usize], AssetReport::default()).expect("finish");
    let ids: Vec<u8> = (1..=objects).flat_map(u32::to_le_bytes).collect();
    std::fs::write(asset.join("ids.u32"), ids).expect("ids");
}

fn push(batch: &mut Batch, corners: &[Vec3; 3], object: u32, rank: Rank) {
    let first = batch.positions.len() as u32;
    batch.positions.extend_from_slice(corners);
    batch.triangles.push([first, first + 1, first + 2]);
    batch.materials.push(0);
    batch.objects.push(object);
    batch.ranks.push(rank);
}

pub fn request() -> BuildRequest {
    let options = BuildOptions { ground_plane: GroundPlane::Off, merge_faces: false, ..BuildOptions::default() };
    BuildRequest { assets: vec!["soup".into()], origin: [0.0; 3], options, ground_id: 0, threads: 1, max_memory_bytes: 0 }
}

pub fn build(folder: &Folder, soup: &Soup) -> SceneStore {
    write_asset(folder, soup);
    build_scene(&folder.0, &request(), &mut |_, _, _| true).expect("build");
    open(folder)
}

pub fn open(folder: &Folder) -> SceneStore {
    SceneStore::open(&folder.0, 1 << 30).expect("open")
}

/// A square of `size_m` centred on the origin, 256 pixels wide.
pub fn frame(look_at_deg: f64, pitch_deg: f64, size_m: f64) -> Frame {
    let (u0_m, v0_m) = (-size_m / 2.0, size_m / 2.0);
    Frame { look_at_deg, pitch_deg, u0_m, v0_m, d0_m: -5000.0, size_m, tile_px: 256, zmax: 0, layers: vec![] }
}
