//! Measures milliseconds per tile by stage and bytes per layer, on a built scene.
//!
//! `cargo run --release -p map3d-render --example tiles -- <scene folder> [--look-at 45] [--pitch 45] [--res 0.2] [--tiles 400] [--color webp|png|jpeg]
//! [--layers color,data,normal,id,depth,sun,sun16,ao,depth2,picture] [--rounds 3] [--save folder]`. Times are CPU times of one thread. Prints the median and the fastest round.

use std::path::PathBuf;

use map3d_base::layers::{LAYERS, LayerRow};
use map3d_base::tile::Tile;
use map3d_base::{Box3, Frame, LayerFormat, LayerSpec, Vec3};
use map3d_image::GBuffer;
use map3d_image::encode::Encoder;
use map3d_image::reduce;
use map3d_image::seam::write_seam;
use map3d_render::{RenderScene, TileRenderer};
use rustix::time::{ClockId, clock_gettime};

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let option = |name: &str| args.iter().position(|a| a == name).and_then(|k| args.get(k + 1).cloned());
    let number = |name: &str, default: f64| option(name).map_or(default, |v| v.parse().expect("a number"));
    let scene = RenderScene::open(&PathBuf::from(&args[0]), 1 << 30).expect("a scene folder");
    let color = match option("--color").as_deref() {
        Some("png") => LayerFormat::Png,
        Some("jpeg") => LayerFormat::Jpeg,
        _ => LayerFormat::Webp,
    };
    let quality = 80;
    let f = pinned_frame(
        &scene.store().bounds(),
        number("--look-at", 45.0),
        number("--pitch", 45.0),
        number("--res", 0.2),
        layers(&option("--layers").unwrap_or_else(|| "color,data".into()), color, quality),
    );
    let tiles = middle_tiles(&scene, &f, number("--tiles", 400.0) as usize);
    println!("{} triangles, zmax {}, {} tiles, color {color:?} q{quality}", scene.store().triangle_count(), f.zmax, tiles.len());
    let mut rounds: Vec<RoundStats> = (0..number("--rounds", 3.0) as usize + 1).map(|_| round(&scene, &f, &tiles, None)).skip(1).collect();
    if let Some(folder) = option("--save") {
        round(&scene, &f, &tiles, Some(PathBuf::from(folder)));
    }
    rounds.sort_by(|a, b| a.total().total_cmp(&b.total()));
    print!("median ");
    rounds[rounds.len() / 2].print(f.layers.as_slice());
    print!("least  ");
    rounds[0].print(f.layers.as_slice());
    println!("{:?}", scene.stats());
}

/// Returns suns from sunrise to sunset of a summer day.
fn suns(count: usize) -> Vec<Vec3> {
    let at = |k: usize| {
        let (azimuth, altitude) =
            ((60.0 + 240.0 * (k as f64 + 0.5) / count as f64).to_radians(), (k as f64 + 0.5) / count as f64 * std::f64::consts::PI);
        let altitude = altitude.sin();
        [azimuth.sin() * (1.0 - altitude * altitude).sqrt(), azimuth.cos() * (1.0 - altitude * altitude).sqrt(), altitude]
    };
    (0..count).map(at).collect()
}

fn layers(names: &str, color: LayerFormat, quality: u8) -> Vec<LayerSpec> {
    let afternoon = vec![[0.6, -0.48, 0.64]];
    let layer = |name: &str| {
        let is_named = |row: &&LayerRow| format!("{:?}", row.kind).to_lowercase() == name;
        let row = LAYERS.iter().find(is_named).unwrap_or_else(|| panic!("unknown layer {name}"));
        let format = if row.formats.contains(&color) { color } else { row.formats[0] };
        let suns = match row.suns[1] {
            0 => Vec::new(),
            1 => afternoon.clone(),
            most => suns(most),
        };
        LayerSpec { quality, suns, radius_m: if row.radius { 20.0 } else { 0.0 }, ..LayerSpec::new(row.kind, format) }
    };
    names.split(',').map(layer).collect()
}

/// Pins the frame of one view as `map3d create-rendering` does (spec/pyramid.md §2).
fn pinned_frame(bounds: &Box3, look_at_deg: f64, pitch_deg: f64, res_m: f64, layers: Vec<LayerSpec>) -> Frame {
    let (c, h) = (bounds.center(), bounds.half_extents());
    let h = [h[0] * 1.05, h[1] * 1.05, (h[2] * 1.05).max(h[2] + 100.0)];
    let (sin, cos) = pitch_deg.to_radians().sin_cos();
    let extent = (2.0 * h[0].hypot(h[1])).max(2.0 * (sin * h[0].hypot(h[1]) + cos * h[2]));
    let zmax = (0..=26u8).find(|z| 256.0 * res_m * f64::from(1u32 << z) >= extent).expect("at most 26 levels");
    let mut f = Frame {
        look_at_deg,
        pitch_deg,
        u0_m: 0.0,
        v0_m: 0.0,
        d0_m: 0.0,
        size_m: 256.0 * res_m * f64::from(1u32 << zmax),
        tile_px: 256,
        zmax,
        layers,
    };
    let [u, v, d] = f.axes().uvd_from_local(c);
    let diagonal = (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
    (f.u0_m, f.v0_m, f.d0_m) = (u - f.size_m / 2.0, v + f.size_m / 2.0, d - diagonal - 1000.0);
    f
}

/// Returns tiles with content around the middle of the square, in Morton order.
fn middle_tiles(scene: &RenderScene, f: &Frame, count: usize) -> Vec<Tile> {
    let n = 1u32 << f.zmax;
    let mut renderer = TileRenderer::new(scene, f).expect("a frame");
    let side = ((count as f64).sqrt().ceil() as u32).min(n);
    let first = (n - side) / 2;
    let mut all: Vec<Tile> = (0..side * side).map(|k| Tile { z: f.zmax, x: first + k % side, y: first + k / side }).collect();
    all.sort_by_key(|t| map3d_base::tile::morton(t.x, t.y));
    all.retain(|t| renderer.tile(t.x, t.y).expect("renders").is_some());
    all.truncate(count);
    all
}

#[derive(Default)]
struct RoundStats {
    tiles: usize,
    visibility_s: f64,
    shade_s: f64,
    light_s: f64,
    reduce_s: f64,
    encode_s: Vec<f64>,
    bytes: Vec<usize>,
    shades: u64,
    setups: u64,
}

impl RoundStats {
    fn total(&self) -> f64 {
        self.visibility_s + self.shade_s + self.light_s + self.reduce_s + self.encode_s.iter().sum::<f64>()
    }

    fn print(&self, layers: &[LayerSpec]) {
        let n = self.tiles as f64;
        let ms = |s: f64| s * 1e3 / n;
        println!(
            "ms per tile: visibility {:.3}  shade {:.3}  light {:.3}  reduce {:.3}  encode {:.3}  total {:.3}",
            ms(self.visibility_s),
            ms(self.shade_s),
            ms(self.light_s),
            ms(self.reduce_s),
            ms(self.encode_s.iter().sum()),
            ms(self.total())
        );
        println!("shades per px {:.3}, prepared surfaces per tile {:.0}", self.shades as f64 / n / 65_536.0, self.setups as f64 / n);
        for (k, spec) in layers.iter().enumerate() {
            println!("  {:?} {:?}: {:.3} ms, {:.1} KB", spec.kind, spec.format, ms(self.encode_s[k]), self.bytes[k] as f64 / n / 1e3);
        }
    }
}

fn round(scene: &RenderScene, f: &Frame, tiles: &[Tile], save: Option<PathBuf>) -> RoundStats {
    let mut renderer = TileRenderer::new(scene, f).expect("a frame");
    let mut encoder = Encoder::new();
    let mut out = RoundStats { tiles: tiles.len(), encode_s: vec![0.0; f.layers.len()], bytes: vec![0; f.layers.len()], ..RoundStats::default() };
    let mut siblings: Vec<GBuffer> = Vec::new();
    for (number, t) in tiles.iter().enumerate() {
        let Some(g) = renderer.tile(t.x, t.y).expect("renders") else { continue };
        for (k, spec) in f.layers.iter().enumerate() {
            let start = cpu_s();
            out.bytes[k] += encoder.layer(&g, spec).expect("encodes").len();
            out.encode_s[k] += cpu_s() - start;
        }
        if let Some(folder) = &save {
            std::fs::create_dir_all(folder).expect("a folder");
            if number % (tiles.len() / 24).max(1) == 0 {
                std::fs::write(folder.join(format!("{}_{}_{}.seam", t.z, t.x, t.y)), write_seam(&g)).expect("written");
                for (spec, bytes) in f.layers.iter().map(|s| (s, encoder.layer(&g, s).expect("encodes"))) {
                    let name = format!("{}_{}_{}_{:?}.{:?}", t.z, t.x, t.y, spec.kind, spec.format).to_lowercase();
                    std::fs::write(folder.join(name), bytes).expect("written");
                }
            }
        }
        siblings.push(g);
        if siblings.len() == 4 {
            let start = cpu_s();
            std::hint::black_box(reduce([0, 1, 2, 3].map(|k| Some(&siblings[k])), 256));
            out.reduce_s += cpu_s() - start;
            siblings.clear();
        }
    }
    let times = renderer.times();
    (out.visibility_s, out.shade_s, out.light_s) = (times.visibility_s, times.shade_s, times.light_s);
    (out.shades, out.setups) = renderer.shade_counts();
    out
}

fn cpu_s() -> f64 {
    let t = clock_gettime(ClockId::ThreadCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}
