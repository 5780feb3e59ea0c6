//! Small synthetic scenes, built by the same code as real ones. The tests of map3d-render use them too.
#![allow(dead_code)]

pub mod closed;

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use map3d_base::asset::{AssetReport, AssetWriter, Batch, Instance, Material, Materials, Object, Rank};
use map3d_base::{Frame, Vec3};
use map3d_build::{BuildOptions, BuildRequest, GroundPlane, build_scene};
use map3d_image::Raster;
use map3d_image::encode::{Deflate, Filter, encode_png};
use map3d_scene::SceneStore;

pub const RANKS: [Rank; 6] = [Rank::Terrain, Rank::Road, Rank::Ground, Rank::Other, Rank::Installation, Rank::Opening];

/// A linear congruential generator: repeatable pseudo-random numbers.
pub struct Lcg(pub u64);

impl Lcg {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = self.0 ^ (self.0 >> 33);
        x.wrapping_mul(0xff51_afd7_ed55_8ccd) >> 16
    }

    /// Returns a number in [lo, hi).
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

#[derive(Clone, Copy, Debug)]
pub struct SoupFace {
    pub corners: [Vec3; 3],
    pub uv: [[f32; 2]; 3],
    pub normals: Option<[[f32; 3]; 3]>,
    pub material: u32,
    /// Object k has the id k + 1.
    pub object: u32,
    pub rank: Rank,
}

impl SoupFace {
    pub fn new(corners: [Vec3; 3]) -> Self {
        Self { corners, uv: [[0.0; 2]; 3], normals: None, material: 0, object: 0, rank: Rank::Other }
    }
}

/// One asset as a triangle soup. Without materials, all faces are grey.
#[derive(Default)]
pub struct Soup {
    pub faces: Vec<SoupFace>,
    /// Element k is prototype k + 1.
    pub prototypes: Vec<Vec<SoupFace>>,
    pub instances: Vec<Instance>,
    pub materials: Vec<Material>,
    /// The texture of each material.
    pub images: Vec<Option<Raster>>,
}

impl Soup {
    pub fn add(&mut self, corners: [Vec3; 3], object: u32, rank: Rank) {
        self.faces.push(SoupFace { object, rank, ..SoupFace::new(corners) });
    }

    /// Adds a quadrilateral.
    pub fn quad(&mut self, c: [Vec3; 4], object: u32, rank: Rank) {
        self.add([c[0], c[1], c[2]], object, rank);
        self.add([c[0], c[2], c[3]], object, rank);
    }

    /// Returns the faces in the order of the asset.
    pub fn all_faces(&self) -> impl Iterator<Item = &SoupFace> {
        self.faces.iter().chain(self.prototypes.iter().flatten())
    }

    /// Returns the index in `all_faces` of triangle `source` of an object or, with `is_placed`, of the prototype that the object places.
    pub fn face_number(&self, object_id: u32, source: u32, is_placed: bool) -> usize {
        let object = object_id - 1;
        if !is_placed {
            let mine = self.faces.iter().enumerate().filter(|(_, f)| f.object == object);
            return mine.map(|(k, _)| k).nth(source as usize).expect("a face of the object");
        }
        let prototype = self.instances.iter().find(|i| i.object == object).expect("an instance").prototype as usize;
        self.faces.len() + self.prototypes[..prototype - 1].iter().map(Vec::len).sum::<usize>() + source as usize
    }

    /// Writes the asset `soup`.
    pub fn write(&self, folder: &TempFolder) {
        let asset = folder.0.join("assets/soup");
        let mut writer = AssetWriter::create(&asset).expect("asset");
        let materials = self.write_materials(&mut writer);
        let any_normals = self.all_faces().any(|f| f.normals.is_some());
        writer.append(&batch(&self.faces, 0, any_normals)).expect("append");
        for (k, faces) in self.prototypes.iter().enumerate() {
            writer.append(&batch(faces, k as u32 + 1, any_normals)).expect("append");
        }
        let objects = self.all_faces().map(|f| f.object).chain(self.instances.iter().map(|i| i.object)).max().map_or(1, |k| k + 1);
        let tables = Materials { materials, instances: self.instances.clone() };
        let report = writer.finish(&tables, &vec![Object::default(); objects as usize], AssetReport::default()).expect("finish");
        assert_eq!(report.triangles, self.all_faces().count() as u64, "{:?}", report.findings);
        let ids: Vec<u8> = (1..=objects).flat_map(u32::to_le_bytes).collect();
        std::fs::write(asset.join("ids.u32"), ids).expect("ids");
    }

    fn write_materials(&self, writer: &mut AssetWriter) -> Vec<Material> {
        let mut materials = if self.materials.is_empty() { vec![Material::default()] } else { self.materials.clone() };
        for (material, image) in materials.iter_mut().zip(&self.images) {
            if let Some(image) = image {
                let png = encode_png((image.width, image.height), 4, image.pixels.as_flattened(), Filter::Up, Deflate::Fast);
                material.texture = Some(writer.add_texture(&png, "png").expect("stored"));
            }
        }
        materials
    }
}

fn batch(faces: &[SoupFace], prototype: u32, with_normals: bool) -> Batch {
    let mut batch = Batch { prototype, ..Batch::default() };
    for face in faces {
        let first = batch.positions.len() as u32;
        batch.positions.extend_from_slice(&face.corners);
        batch.triangles.push([first, first + 1, first + 2]);
        batch.uvs.push(face.uv);
        if with_normals {
            batch.normals.push(face.normals.unwrap_or_default());
        }
        batch.materials.push(face.material);
        batch.objects.push(face.object);
        batch.ranks.push(face.rank);
    }
    batch
}

/// Returns random triangles of all sizes, slivers, vertical triangles and stacks of coplanar faces.
pub fn mixed_soup(random: &mut Lcg, count: usize) -> Soup {
    let mut soup = Soup::default();
    for k in 0..count {
        let object = k as u32 / 2;
        let rank = RANKS[random.below(6) as usize];
        let at = random.point(16.0);
        let size = [0.02, 0.2, 1.0, 4.0, 20.0, 300.0][random.below(6) as usize];
        let corner = |random: &mut Lcg| {
            let e = random.point(size);
            [at[0] + e[0], at[1] + e[1], at[2] + e[2]]
        };
        let mut t = [corner(random), corner(random), corner(random)];
        match random.below(8) {
            // A sliver.
            0 => t[2] = [0, 1, 2].map(|a| (t[0][a] + t[1][a]) / 2.0 + 0.002),
            // Vertical, so that some views see it edge-on.
            1 => t = [t[0], t[1], [t[0][0], t[0][1], t[0][2] + size]],
            // Horizontal at one of few heights, so that faces are coplanar.
            2 | 3 => t.iter_mut().for_each(|c| c[2] = (at[2] / 4.0).floor() * 4.0),
            _ => {}
        }
        soup.add(t, object, rank);
    }
    soup
}

/// A scene's folder; removed when dropped.
pub struct TempFolder(pub PathBuf);

impl Drop for TempFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

pub fn new_folder(name: &str) -> TempFolder {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let path = std::env::temp_dir().join(format!("map3d-{}-{name}-{}-{number}", env!("CARGO_CRATE_NAME"), std::process::id()));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("temporary folder");
    TempFolder(path)
}

/// Writes and builds a scene; triangles far from the rest stay in it.
pub fn rebuild(folder: &TempFolder, soup: &Soup) {
    soup.write(folder);
    let options = BuildOptions { ground_plane: GroundPlane::Off, merge_faces: false, keep_outliers: true, ..BuildOptions::default() };
    let request = BuildRequest { assets: vec!["soup".into()], origin: [0.0; 3], options, ground_id: 0, threads: 1, max_memory_bytes: 0 };
    build_scene(&folder.0, &request, &mut |_, _, _| true).expect("build");
}

pub fn build(folder: &TempFolder, soup: &Soup) -> SceneStore {
    rebuild(folder, soup);
    open(folder)
}

pub fn open(folder: &TempFolder) -> SceneStore {
    SceneStore::open(&folder.0, 1 << 30).expect("open")
}

/// Returns a frame of `size_m` centred on the origin, 256 pixels wide.
pub fn frame(look_at_deg: f64, pitch_deg: f64, size_m: f64) -> Frame {
    let (u0_m, v0_m) = (-size_m / 2.0, size_m / 2.0);
    Frame { look_at_deg, pitch_deg, u0_m, v0_m, d0_m: -5000.0, size_m, tile_px: 256, zmax: 0, layers: vec![] }
}
