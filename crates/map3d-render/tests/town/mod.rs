//! Small scenes with materials and textures, built like real ones, and a plain float64 renderer to compare with.
#![allow(dead_code)]

pub mod plain;

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use map3d_base::asset::{AssetReport, AssetWriter, Batch, Material, Materials, Object, Rank, Wrap};
use map3d_base::{Frame, LayerFormat, LayerKind, LayerSpec, Vec3};
use map3d_image::Raster;
use map3d_image::encode::{Deflate, Filter, encode_png};
use map3d_render::RenderScene;
use map3d_scene::build::{BuildOptions, BuildRequest, GroundPlane, build_scene};

#[derive(Clone, Debug)]
pub struct Face {
    pub corners: [Vec3; 3],
    pub uv: [[f32; 2]; 3],
    pub normals: Option<[[f32; 3]; 3]>,
    pub material: u32,
    /// Object k has the id k + 1.
    pub object: u32,
    pub rank: Rank,
}

/// One asset.
#[derive(Default)]
pub struct Town {
    pub faces: Vec<Face>,
    pub materials: Vec<Material>,
    /// Image of each material.
    pub images: Vec<Option<Raster>>,
}

impl Town {
    pub fn flat(&mut self, rgb: [f32; 3]) -> u32 {
        self.materials.push(Material { diffuse: [rgb[0], rgb[1], rgb[2], 1.0], ..Material::default() });
        self.images.push(None);
        self.materials.len() as u32 - 1
    }

    pub fn textured(&mut self, image: Raster, wrap: Wrap) -> u32 {
        let cutout = image.has_alpha();
        self.materials.push(Material { diffuse: [1.0; 4], wrap, cutout, ..Material::default() });
        self.images.push(Some(image));
        self.materials.len() as u32 - 1
    }

    pub fn face(&mut self, corners: [Vec3; 3], material: u32, object: u32) {
        self.faces.push(Face { corners, uv: [[0.0; 2]; 3], normals: None, material, object, rank: Rank::Other });
    }

    /// A four-cornered face with texture coordinates.
    pub fn quad(&mut self, c: [Vec3; 4], uv: [[f32; 2]; 4], material: u32, object: u32) {
        for k in [[0, 1, 2], [0, 2, 3]] {
            let (corners, uv) = (k.map(|i| c[i]), k.map(|i| uv[i]));
            self.faces.push(Face { corners, uv, normals: None, material, object, rank: Rank::Other });
        }
    }

    /// A box on the ground, each side its own object.
    pub fn house(&mut self, [x, y]: [f64; 2], [w, d, h]: [f64; 3], material: u32, object: u32) {
        let (x1, y1) = (x + w, y + d);
        let uv = |w: f64, h: f64| [[0.0, 0.0], [w as f32 / 4.0, 0.0], [w as f32 / 4.0, h as f32 / 4.0], [0.0, h as f32 / 4.0]];
        self.quad([[x, y, 0.0], [x1, y, 0.0], [x1, y, h], [x, y, h]], uv(w, h), material, object);
        self.quad([[x1, y, 0.0], [x1, y1, 0.0], [x1, y1, h], [x1, y, h]], uv(d, h), material, object + 1);
        self.quad([[x1, y1, 0.0], [x, y1, 0.0], [x, y1, h], [x1, y1, h]], uv(w, h), material, object + 2);
        self.quad([[x, y1, 0.0], [x, y, 0.0], [x, y, h], [x, y1, h]], uv(d, h), material, object + 3);
        self.quad([[x, y, h], [x1, y, h], [x1, y1, h], [x, y1, h]], uv(w, d), material, object + 4);
    }

    pub fn ground(&mut self, half: f64, repeats: f32, material: u32, object: u32) {
        let c = [[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]];
        self.quad(c, [[0.0, 0.0], [repeats, 0.0], [repeats, repeats], [0.0, repeats]], material, object);
    }

    fn write(&self, folder: &Folder) {
        let asset = folder.0.join("assets/town");
        let mut writer = AssetWriter::create(&asset).expect("asset");
        let mut materials = self.materials.clone();
        for (material, image) in materials.iter_mut().zip(&self.images) {
            if let Some(image) = image {
                let png = encode_png((image.width, image.height), 4, image.pixels.as_flattened(), Filter::Up, Deflate::Fast);
                material.texture = Some(writer.add_texture(&png, "png").expect("stored"));
            }
        }
        let any_normals = self.faces.iter().any(|f| f.normals.is_some());
        let mut b = Batch::default();
        for f in &self.faces {
            let first = b.positions.len() as u32;
            b.positions.extend_from_slice(&f.corners);
            b.triangles.push([first, first + 1, first + 2]);
            b.uvs.push(f.uv);
            if any_normals {
                b.normals.push(f.normals.unwrap_or_default());
            }
            b.materials.push(f.material);
            b.objects.push(f.object);
            b.ranks.push(f.rank);
        }
        writer.append(&b).expect("append");
        let objects = self.faces.iter().map(|f| f.object + 1).max().unwrap_or(1);
        let tables = Materials { materials, instances: vec![] };
        let report = writer.finish(&tables, &vec![Object::default(); objects as usize], AssetReport::default()).expect("finish");
        assert_eq!(report.triangles, self.faces.len() as u64, "{:?}", report.skipped);
        std::fs::write(asset.join("ids.u32"), (1..=objects).flat_map(u32::to_le_bytes).collect::<Vec<u8>>()).expect("ids");
    }

    /// Writes, builds and opens the scene.
    pub fn open(&self, folder: &Folder) -> RenderScene {
        self.write(folder);
        let options = BuildOptions { ground_plane: GroundPlane::Off, merge_faces: false, ..BuildOptions::default() };
        let request = BuildRequest { assets: vec!["town".into()], origin: [0.0; 3], options, ground_id: 0, threads: 1, max_memory_bytes: 0 };
        build_scene(&folder.0, &request, &mut |_, _, _| true).expect("build");
        RenderScene::open(&folder.0, 64 << 20).expect("open")
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
    let path = std::env::temp_dir().join(format!("map3d-render-{name}-{}-{number}", std::process::id()));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("temporary folder");
    Folder(path)
}

pub fn all_layers(color: LayerFormat) -> Vec<LayerSpec> {
    let png = |kind| LayerSpec { kind, format: LayerFormat::Png, quality: 80 };
    vec![LayerSpec { kind: LayerKind::Color, format: color, quality: 80 }, png(LayerKind::Normal), png(LayerKind::Id), png(LayerKind::Depth)]
}

/// A square of `size_m` centred on the origin.
pub fn frame(look_at_deg: f64, pitch_deg: f64, size_m: f64, zmax: u8) -> Frame {
    let (u0_m, v0_m) = (-size_m / 2.0, size_m / 2.0);
    Frame { look_at_deg, pitch_deg, u0_m, v0_m, d0_m: -2000.0, size_m, tile_px: 256, zmax, layers: all_layers(LayerFormat::Png) }
}

/// Bricks of several colours with mortar, `side` texels square.
pub fn bricks(side: u32) -> Raster {
    let pixel = |i: u32| {
        let (x, y) = (i % side, i / side);
        let row = y / 8;
        let shifted = x + row % 2 * 8;
        if y % 8 == 0 || shifted.is_multiple_of(16) {
            return [190, 185, 175, 255];
        }
        let shade = (shifted / 16 * 37 + row * 71) % 60;
        [110 + shade as u8, 60 + shade as u8 / 2, 50, 255]
    };
    Raster::new(side, side, (0..side * side).map(pixel).collect())
}

/// A picture without sharp edges.
pub fn waves(side: u32) -> Raster {
    let tau = std::f64::consts::TAU / f64::from(side);
    let pixel = |i: u32| {
        let (x, y) = (f64::from(i % side) * tau, f64::from(i / side) * tau);
        let byte = |v: f64| (128.0 + 90.0 * v) as u8;
        [byte((2.0 * x).sin()), byte((3.0 * y).cos()), byte((x + 2.0 * y).sin()), 255]
    };
    Raster::new(side, side, (0..side * side).map(pixel).collect())
}
