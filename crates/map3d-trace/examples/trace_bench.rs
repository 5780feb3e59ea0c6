//! Measures beams alone: the median thread CPU time in milliseconds per tile of 256² pixels with 16 samples, on a synthetic town or on a scene's folder.
//!
//! `trace_bench [triangles in millions | scene folder] [tiles]`; with MAP3D_KEEP set, the town is kept in the temporary folder.

use std::path::{Path, PathBuf};

use map3d_base::asset::{AssetReport, AssetWriter, Batch, Material, Materials, Object, Rank};
use map3d_base::{Frame, Vec3};
use map3d_build::{BuildOptions, BuildRequest, GroundPlane, build_scene};
use map3d_scene::SceneStore;
use map3d_trace::{BeamTracer, IgnoreCutouts, Isa, SUBTILE_PX};

const TOWN_M: f64 = 1800.0;
const PIXEL_M: f64 = 0.2;
const TILE_PX: usize = 256;
const REPEATS: usize = 20;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let source = arguments.next().unwrap_or_else(|| "1".into());
    let tiles: usize = arguments.next().and_then(|t| t.parse().ok()).unwrap_or(200);
    let (folder, made) = match source.parse::<f64>() {
        Ok(millions) => (make_town(millions), true),
        Err(_) => (PathBuf::from(source), false),
    };
    let store = SceneStore::open(&folder, 8 << 30).expect("scene");
    println!("{} triangles, {} parts", store.triangle_count(), store.parts().len());
    for isa in Isa::available() {
        // Scalar is slow.
        measure(&store, isa, if isa == Isa::Scalar { tiles / 4 } else { tiles });
    }
    if made && std::env::var_os("MAP3D_KEEP").is_none() {
        std::fs::remove_dir_all(folder).expect("clean up");
    }
}

/// Returns the CPU time of this thread in nanoseconds.
fn thread_ns() -> u64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    text.split(' ').next().and_then(|n| n.parse().ok()).expect("nanoseconds")
}

fn measure(store: &SceneStore, isa: Isa, tiles: usize) {
    let side = (TOWN_M * 0.7 / (TILE_PX as f64 * PIXEL_M)) as usize;
    let mut times = Vec::new();
    for heading in 0..5 {
        let frame = town_frame(store, 45.0 + 72.0 * heading as f64);
        let mut tracer = BeamTracer::with_isa(store, &frame, isa).expect("tracer");
        let first = (1usize << frame.zmax) / 2 - side / 2;
        for k in 0..tiles.div_ceil(5) {
            let n = k * 61 + 7;
            let (x, y) = (first + n % side, first + n / side % side);
            // The kernel's clock ticks every few milliseconds, so each tile is traced many times; the first run warms the caches.
            tile(&mut tracer, x, y);
            let before = thread_ns();
            (0..REPEATS).for_each(|_| tile(&mut tracer, x, y));
            times.push((thread_ns() - before) as f64 / REPEATS as f64 / 1e6);
        }
    }
    times.sort_by(f64::total_cmp);
    let mean = times.iter().sum::<f64>() / times.len() as f64;
    println!("{isa:?}: median {:.3} ms, mean {mean:.3}, p95 {:.3}, {} tiles", times[times.len() / 2], times[times.len() * 95 / 100], times.len());
}

fn tile(tracer: &mut BeamTracer, x: usize, y: usize) {
    for top in (0..TILE_PX).step_by(SUBTILE_PX) {
        for left in (0..TILE_PX).step_by(SUBTILE_PX) {
            tracer.trace((x * TILE_PX + left) as u64, (y * TILE_PX + top) as u64, &IgnoreCutouts).expect("trace");
        }
    }
}

/// Returns a frame at pitch 45° that is centred on the scene.
fn town_frame(store: &SceneStore, look_at_deg: f64) -> Frame {
    let zmax = 6;
    let size_m = TILE_PX as f64 * PIXEL_M * f64::from(1 << zmax);
    let mut frame = Frame { look_at_deg, pitch_deg: 45.0, u0_m: 0.0, v0_m: 0.0, d0_m: 0.0, size_m, tile_px: TILE_PX as u32, zmax, layers: vec![] };
    let [u, v, d] = frame.axes().uvd_from_local(store.bounds().center());
    (frame.u0_m, frame.v0_m, frame.d0_m) = (u - size_m / 2.0, v + size_m / 2.0, d - 5000.0);
    frame
}

/// A linear congruential generator of numbers in [0, 1).
struct Lcg(u64);

impl Lcg {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / f64::from(1 << 24)
    }
}

struct Town {
    batch: Batch,
    object: u32,
    random: Lcg,
}

impl Town {
    fn triangle(&mut self, corners: [Vec3; 3], rank: Rank) {
        let first = self.batch.positions.len() as u32;
        self.batch.positions.extend_from_slice(&corners);
        self.batch.triangles.push([first, first + 1, first + 2]);
        self.batch.materials.push(0);
        self.batch.objects.push(self.object);
        self.batch.ranks.push(rank);
    }

    fn quad(&mut self, c: [Vec3; 4], rank: Rank) {
        self.triangle([c[0], c[1], c[2]], rank);
        self.triangle([c[0], c[2], c[3]], rank);
    }

    /// Adds a box without a bottom.
    fn block(&mut self, at: Vec3, size: Vec3, turn: f64, rank: Rank) {
        let corner = |x: f64, y: f64, z: f64| {
            let (c, s) = (turn.cos(), turn.sin());
            [at[0] + x * c - y * s, at[1] + x * s + y * c, at[2] + z]
        };
        let (w, d, h) = (size[0], size[1], size[2]);
        let ring = [(0.0, 0.0), (w, 0.0), (w, d), (0.0, d)];
        for k in 0..4 {
            let (a, b) = (ring[k], ring[(k + 1) % 4]);
            self.quad([corner(a.0, a.1, 0.0), corner(b.0, b.1, 0.0), corner(b.0, b.1, h), corner(a.0, a.1, h)], rank);
        }
        self.quad(ring.map(|(x, y)| corner(x, y, h)), rank);
    }

    /// Adds a gabled house with windows that protrude from its walls: `detail` windows per side and floor.
    fn house(&mut self, x: f64, y: f64, detail: usize) {
        self.object += 1;
        let (w, d, h) = (8.0 + 10.0 * self.random.next(), 8.0 + 6.0 * self.random.next(), 6.0 + 12.0 * self.random.next());
        let turn = (self.random.next() * 4.0).floor() * 0.4;
        self.block([x, y, 0.0], [w, d, h], turn, Rank::Other);
        let corner = |x1: f64, y1: f64, z: f64| {
            let (c, s) = (turn.cos(), turn.sin());
            [x + x1 * c - y1 * s, y + x1 * s + y1 * c, z]
        };
        let (ridge0, ridge1) = (corner(0.0, d / 2.0, h + d * 0.35), corner(w, d / 2.0, h + d * 0.35));
        self.quad([corner(-0.4, -0.4, h), corner(w + 0.4, -0.4, h), ridge1, ridge0], Rank::Other);
        self.quad([corner(w + 0.4, d + 0.4, h), corner(-0.4, d + 0.4, h), ridge0, ridge1], Rank::Other);
        let floors = (h / 3.0) as usize;
        for floor in 0..floors {
            for k in 0..detail {
                let step = w / detail as f64;
                let at = [step * (k as f64 + 0.3), 1.0 + 3.0 * floor as f64];
                for side in [-0.1, d - 0.05] {
                    let p = corner(at[0], side, at[1]);
                    self.block(p, [step * 0.4, 0.15, 1.4], turn, Rank::Opening);
                }
            }
        }
    }

    /// Adds a spherical tree crown.
    fn tree(&mut self, x: f64, y: f64, rings: usize) {
        self.object += 1;
        let (radius, height) = (1.5 + 2.0 * self.random.next(), 4.0 + 3.0 * self.random.next());
        let point = |i: usize, j: usize| {
            let (t, a) = (std::f64::consts::PI * i as f64 / rings as f64, std::f64::consts::TAU * (j % (2 * rings)) as f64 / (2 * rings) as f64);
            let r = radius * (0.85 + 0.15 * ((i * 7 + j % (2 * rings) * 13) % 5) as f64 / 4.0);
            [x + r * t.sin() * a.cos(), y + r * t.sin() * a.sin(), height + r * t.cos()]
        };
        for i in 0..rings {
            for j in 0..2 * rings {
                self.quad([point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)], Rank::Other);
            }
        }
    }

    fn terrain(&mut self, cells: usize) {
        let step = TOWN_M / cells as f64;
        let point = |i: usize, j: usize| {
            let (x, y) = (i as f64 * step, j as f64 * step);
            [x, y, 1.5 * (x / 90.0).sin() * (y / 70.0).cos() - 0.5]
        };
        for j in 0..cells {
            for i in 0..cells {
                self.quad([point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)], Rank::Terrain);
            }
        }
    }
}

/// Builds a town of about `millions` million triangles: always the same town, in finer detail.
fn make_town(millions: f64) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("map3d-trace-bench-{}", std::process::id()));
    let asset = folder.join("assets/town");
    let mut writer = AssetWriter::create(&asset).expect("asset");
    let mut town = Town { batch: Batch::default(), object: 0, random: Lcg(1) };
    let finer = millions.sqrt();
    town.terrain((300.0 * finer) as usize);
    let grid = 76;
    for k in 0..grid * grid {
        let spacing = TOWN_M / grid as f64;
        let (x, y) = ((k % grid) as f64 * spacing + 3.0 * town.random.next(), (k / grid) as f64 * spacing + 3.0 * town.random.next());
        town.house(x, y, (2.0 * millions).round() as usize);
    }
    for _ in 0..5000 {
        let (x, y) = (TOWN_M * town.random.next(), TOWN_M * town.random.next());
        town.tree(x, y, (4.0 * finer) as usize);
    }
    writer.append(&town.batch).expect("append");
    let objects = vec![Object::default(); town.object as usize + 1];
    writer.finish(&Materials { materials: vec![Material::default()], instances: vec![] }, &objects, AssetReport::default()).expect("finish");
    let ids: Vec<u8> = (1..=objects.len() as u32).flat_map(u32::to_le_bytes).collect();
    std::fs::write(asset.join("ids.u32"), ids).expect("ids");
    drop(town);
    build(&folder);
    folder
}

fn build(folder: &Path) {
    let options = BuildOptions { ground_plane: GroundPlane::Off, ..BuildOptions::default() };
    let request = BuildRequest { assets: vec!["town".into()], origin: [0.0; 3], options, ground_id: 0, threads: 1, max_memory_bytes: 4 << 30 };
    let started = std::time::Instant::now();
    let report = build_scene(folder, &request, &mut |_, _, _| true).expect("build");
    let bytes: u64 = std::fs::read_dir(folder.join("chunks")).expect("chunks").map(|f| f.expect("file").metadata().expect("size").len()).sum();
    let per = |v: f64| v / report.triangles as f64;
    println!(
        "built in {:.2} s of wall time, one thread; {:.1} bytes per triangle with its record",
        started.elapsed().as_secs_f64(),
        per(bytes as f64)
    );
}
