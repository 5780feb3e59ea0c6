//! Small scenes with materials and textures, built by the same code as real ones, and a brute-force renderer in float64.

#[path = "../../../map3d-trace/tests/reference/mod.rs"]
pub mod reference;
pub mod reference_renderer;
#[path = "../../../map3d-trace/tests/scenes/mod.rs"]
pub mod scenes;

use map3d_base::asset::{Material, Wrap};
use map3d_base::{Frame, LayerFormat, LayerKind, LayerSpec, Vec3};
use map3d_image::Raster;
use map3d_render::RenderScene;

pub use scenes::{Soup as Town, SoupFace, TempFolder, new_folder};

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
        self.faces.push(SoupFace { material, object, ..SoupFace::new(corners) });
    }

    /// Adds a quadrilateral with texture coordinates.
    pub fn panel(&mut self, c: [Vec3; 4], uv: [[f32; 2]; 4], material: u32, object: u32) {
        for k in [[0, 1, 2], [0, 2, 3]] {
            self.faces.push(SoupFace { uv: k.map(|i| uv[i]), material, object, ..SoupFace::new(k.map(|i| c[i])) });
        }
    }

    /// Adds a box on the ground; each side is an object.
    pub fn house(&mut self, [x, y]: [f64; 2], [w, d, h]: [f64; 3], material: u32, object: u32) {
        let (x1, y1) = (x + w, y + d);
        let uv = |w: f64, h: f64| [[0.0, 0.0], [w as f32 / 4.0, 0.0], [w as f32 / 4.0, h as f32 / 4.0], [0.0, h as f32 / 4.0]];
        self.panel([[x, y, 0.0], [x1, y, 0.0], [x1, y, h], [x, y, h]], uv(w, h), material, object);
        self.panel([[x1, y, 0.0], [x1, y1, 0.0], [x1, y1, h], [x1, y, h]], uv(d, h), material, object + 1);
        self.panel([[x1, y1, 0.0], [x, y1, 0.0], [x, y1, h], [x1, y1, h]], uv(w, h), material, object + 2);
        self.panel([[x, y1, 0.0], [x, y, 0.0], [x, y, h], [x, y1, h]], uv(d, h), material, object + 3);
        self.panel([[x, y, h], [x1, y, h], [x1, y1, h], [x, y1, h]], uv(w, d), material, object + 4);
    }

    pub fn ground(&mut self, half: f64, repeats: f32, material: u32, object: u32) {
        let c = [[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]];
        self.panel(c, [[0.0, 0.0], [repeats, 0.0], [repeats, repeats], [0.0, repeats]], material, object);
    }

    /// Writes, builds and opens the scene.
    pub fn open(&self, folder: &TempFolder) -> RenderScene {
        scenes::rebuild(folder, self);
        RenderScene::open(&folder.0, 64 << 20).expect("open")
    }
}

pub fn all_layers(color: LayerFormat) -> Vec<LayerSpec> {
    let png = |kind| LayerSpec::new(kind, LayerFormat::Png);
    vec![LayerSpec::new(LayerKind::Color, color), png(LayerKind::Normal), png(LayerKind::Id), png(LayerKind::Depth)]
}

/// Returns a frame of `size_m` centred on the origin.
pub fn frame(look_at_deg: f64, pitch_deg: f64, size_m: f64, zmax: u8) -> Frame {
    Frame { zmax, layers: all_layers(LayerFormat::Png), ..scenes::frame(look_at_deg, pitch_deg, size_m) }
}

/// Returns bricks of several colours with mortar, `side` texels square.
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

/// Returns an image without sharp edges.
pub fn waves(side: u32) -> Raster {
    let tau = std::f64::consts::TAU / f64::from(side);
    let pixel = |i: u32| {
        let (x, y) = (f64::from(i % side) * tau, f64::from(i / side) * tau);
        let byte = |v: f64| (128.0 + 90.0 * v) as u8;
        [byte((2.0 * x).sin()), byte((3.0 * y).cos()), byte((x + 2.0 * y).sin()), 255]
    };
    Raster::new(side, side, (0..side * side).map(pixel).collect())
}
