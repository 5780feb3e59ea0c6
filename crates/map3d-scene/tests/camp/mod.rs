//! Small assets as an import writes them, and what builds make of them.
#![allow(dead_code)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use map3d_base::Vec3;
use map3d_base::asset::{AssetReport, AssetWriter, Batch, Material, Materials, Object, Rank};
use map3d_scene::builder::{BuildOptions, BuildReport, BuildRequest, GroundPlane, build_scene};

pub struct Folder(pub PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

pub fn new_folder() -> Folder {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let path = std::env::temp_dir().join(format!("map3d-build-{}-{}", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed)));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("folder");
    Folder(path)
}

/// (corners, object, material, rank)
pub type Face = ([Vec3; 3], u32, u32, Rank);

pub fn batch(faces: &[Face], prototype: u32) -> Batch {
    let mut batch = Batch { prototype, ..Batch::default() };
    for (corners, object, material, rank) in faces {
        let first = batch.positions.len() as u32;
        batch.positions.extend_from_slice(corners);
        batch.triangles.push([first, first + 1, first + 2]);
        batch.materials.push(*material);
        batch.objects.push(*object);
        batch.ranks.push(*rank);
    }
    batch
}

pub fn write_asset(folder: &Path, name: &str, batches: &[Batch], materials: Materials) {
    let asset = folder.join("assets").join(name);
    let mut writer = AssetWriter::create(&asset).expect("asset");
    batches.iter().for_each(|b| writer.append(b).expect("append"));
    let objects = batches.iter().flat_map(|b| &b.objects).chain(materials.instances.iter().map(|i| &i.object)).max().map_or(1, |o| o + 1);
    writer.finish(&materials, &vec![Object::default(); objects as usize], AssetReport::default()).expect("finish");
    std::fs::write(asset.join("ids.u32"), (1..=objects).flat_map(|id| (id * 10).to_le_bytes()).collect::<Vec<u8>>()).expect("ids");
}

pub fn write_faces(folder: &Path, faces: &[Face]) {
    let grey = |name: &str| Material { name: name.into(), ..Material::default() };
    let red = Material { diffuse: [1.0, 0.0, 0.0, 1.0], ..Material::default() };
    write_asset(folder, "town", &[batch(faces, 0)], Materials { materials: vec![grey("a"), grey("b"), red], instances: vec![] });
}

pub fn request() -> BuildRequest {
    let options = BuildOptions { ground_plane: GroundPlane::Off, ..BuildOptions::default() };
    BuildRequest { assets: vec!["town".into()], origin: [500_000.0, 5_000_000.0, 0.0], options, ground_id: 0, threads: 2, max_memory_bytes: 0 }
}

pub fn run(folder: &Folder, request: &BuildRequest) -> BuildReport {
    build_scene(&folder.0, request, &mut |_, _, _| true).expect("build")
}

/// World coordinates of local ones.
pub fn world(t: [Vec3; 3]) -> [Vec3; 3] {
    t.map(|p| [p[0] + 500_000.0, p[1] + 5_000_000.0, p[2]])
}

pub fn tent(x: f64, y: f64, object: u32) -> Vec<Face> {
    let p = |dx: f64, dy: f64, z: f64| [x + dx, y + dy, z];
    let (a, b, c, top) = (p(0.0, 0.0, 0.0), p(6.0, 0.0, 0.0), p(3.0, 5.0, 0.0), p(3.0, 2.0, 7.0));
    [[a, b, top], [b, c, top], [c, a, top]].map(|t| (world(t), object, object % 3, Rank::Other)).to_vec()
}

/// Tents over 20 × 20 km, so that there are many cells.
pub fn camp() -> Vec<Face> {
    (0..400).flat_map(|k| tent(f64::from(k % 20) * 1000.0, f64::from(k / 20) * 1000.0, k)).collect()
}

pub fn bytes_of(folder: &Folder) -> BTreeMap<String, Vec<u8>> {
    let mut out = BTreeMap::new();
    let mut folders = vec![folder.0.join("chunks")];
    while let Some(path) = folders.pop() {
        for entry in std::fs::read_dir(path).expect("list") {
            let path = entry.expect("entry").path();
            out.insert(path.display().to_string().replace(&folder.0.display().to_string(), ""), std::fs::read(&path).expect("read"));
        }
    }
    for name in ["scene.json", "instances.m3i"] {
        out.insert(name.into(), std::fs::read(folder.0.join(name)).expect("read"));
    }
    out
}
