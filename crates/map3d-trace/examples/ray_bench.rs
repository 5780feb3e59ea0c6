//! Rays from what a view shows: millions a second of thread CPU time, single rays and bundles, shadow rays towards a sun, ambient occlusion, and what
//! lies behind. `ray_bench <scene folder> [tiles] [metres a pixel] [instruction set]`

use std::path::PathBuf;

use map3d_base::{Box3, DEPTH_UNITS_PER_M, Frame, RAY_LIFT_M, Vec3, vec3};
use map3d_scene::SceneStore;
use map3d_trace::{BeamTracer, Isa, Opaque, Openness, Patch, Ray, Rays, SUBTILE_PX, Surroundings};

const RADIUS_M: f64 = 20.0;
const DIRECTIONS: usize = 64;

struct Point {
    at: Vec3,
    normal: Vec3,
}

/// Blocks of 8 × 8 pixels of a sub-tile, each row by row in blocks of 4 × 4.
type Blocks = Vec<Vec<Option<Point>>>;

/// A sub-tile ready for bundles.
struct Ready {
    blocks: Blocks,
    bounds: Box3,
    center: Vec3,
    lifted: Vec<Patch>,
    flat: Vec<Patch>,
}

impl Ready {
    fn new(blocks: Blocks) -> Self {
        let bounds = bounds(&blocks);
        let center = Surroundings::center_near(bounds.center());
        let patches = |lift_m: f64| blocks.iter().map(|b| patch_of(b, center, lift_m)).collect();
        Self { bounds, center, lifted: patches(RAY_LIFT_M), flat: patches(0.0), blocks }
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().expect("a scene's folder"));
    let tiles: usize = arguments.next().and_then(|t| t.parse().ok()).unwrap_or(20);
    let pixel_m: f64 = arguments.next().and_then(|t| t.parse().ok()).unwrap_or(0.2);
    let store = SceneStore::open(&folder, 8 << 30).expect("scene");
    println!("{} triangles, {} parts", store.triangle_count(), store.parts().len());
    let frame = frame(&store, pixel_m);
    let patches = patches(&store, &frame, tiles);
    let points: usize = patches.iter().flat_map(|p| &p.blocks).flatten().flatten().count();
    println!("{points} points of {} sub-tiles", patches.len());
    let suns = [[0.6, -0.3, 0.74], [0.8, -0.55, 0.24]];
    let only = arguments.next();
    for isa in Isa::available().into_iter().filter(|i| only.as_ref().is_none_or(|o| format!("{i:?}").eq_ignore_ascii_case(o))) {
        for sun in suns {
            report(&format!("{isa:?} bundles, sun {:.2}", sun[2]), points, || {
                patches.iter().map(|p| sun_bundles(&store, p, sun, isa)).fold((0, 0), add)
            });
        }
        report(&format!("{isa:?} bundles, ao"), points, || patches.iter().map(|p| ambient(&store, p, isa)).fold((0, 0), add));
        report(&format!("{isa:?} bundles, behind"), points, || patches.iter().map(|p| behind(&store, p, &frame, isa)).fold((0, 0), add));
    }
    for sun in suns {
        report(&format!("single rays, sun {:.2}", sun[2]), points, || patches.iter().map(|p| single(&store, p, sun)).fold((0, 0), add));
    }
}

fn add(a: (usize, usize), b: (usize, usize)) -> (usize, usize) {
    (a.0 + b.0, a.1 + b.1)
}

/// `work` gives rays and hits; the least of some rounds counts.
fn report(what: &str, points: usize, work: impl Fn() -> (usize, usize)) {
    let mut best = f64::INFINITY;
    let (mut rays, mut hits) = (0, 0);
    for _ in 0..5 {
        let before = thread_ns();
        (rays, hits) = work();
        best = best.min((thread_ns() - before) as f64);
    }
    let (rate, tile_ms) = (rays as f64 / best * 1e3, best / 1e6 / (points as f64 / 65_536.0));
    println!(
        "{what}: {rate:.1} M rays/s, {tile_ms:.2} ms a tile, {:.2} rays a point, {:.1} % hit",
        rays as f64 / points as f64,
        hits as f64 * 100.0 / rays as f64
    );
}

/// Nanoseconds that this thread has run.
fn thread_ns() -> u64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    text.split(' ').next().and_then(|n| n.parse().ok()).expect("nanoseconds")
}

/// Pitch 45°, looking north-west, centred on the scene.
fn frame(store: &SceneStore, pixel_m: f64) -> Frame {
    let size = store.bounds().half_extents();
    let zmax = ((3.0 * size[0].max(size[1])) / (256.0 * pixel_m)).log2().ceil().max(0.0) as u8;
    let size_m = 256.0 * pixel_m * f64::from(1u32 << zmax);
    let mut frame = Frame { look_at_deg: 45.0, pitch_deg: 45.0, u0_m: 0.0, v0_m: 0.0, d0_m: 0.0, size_m, tile_px: 256, zmax, layers: vec![] };
    let [u, v, d] = frame.axes().uvd_from_local(store.bounds().center());
    (frame.u0_m, frame.v0_m, frame.d0_m) = (u - size_m / 2.0, v + size_m / 2.0, d - 5000.0);
    frame
}

fn patches(store: &SceneStore, frame: &Frame, tiles: usize) -> Vec<Ready> {
    let mut tracer = BeamTracer::new(store, frame).expect("tracer");
    let middle = (256u64 << frame.zmax) / 2;
    let side = (tiles as f64).sqrt().ceil() as u64;
    let step = ((frame.size_m / 4.0 / frame.pixel_m(frame.zmax)) as u64 / side).max(256);
    let mut out = Vec::new();
    for k in 0..tiles as u64 {
        let corner = [middle - side / 2 * step + k % side * step, middle - side / 2 * step + k / side * step];
        for sub in 0..16u64 {
            let at = [corner[0] + sub % 4 * 64, corner[1] + sub / 4 * 64];
            out.push(patch(&mut tracer, frame, at));
        }
    }
    out.retain(|p: &Blocks| p.iter().flatten().any(Option::is_some));
    out.into_iter().map(Ready::new).collect()
}

fn patch(tracer: &mut BeamTracer, frame: &Frame, [x, y]: [u64; 2]) -> Blocks {
    let vis = tracer.trace(x, y, &Opaque).expect("trace");
    let (axes, pixel) = (frame.axes(), frame.pixel_m(frame.zmax));
    let blocks = SUBTILE_PX / 8;
    let point = |i: usize, j: usize| {
        let surface = vis.surface(vis.center_slot(i, j)?);
        let (u, v) = (frame.u0_m + (x as f64 + i as f64 + 0.5) * pixel, frame.v0_m - (y as f64 + j as f64 + 0.5) * pixel);
        let at = axes.local_from_uvd([u, v, frame.d0_m + f64::from(vis.center_depth(i, j)) / DEPTH_UNITS_PER_M]);
        Some(Point { at, normal: surface.normal.map(f64::from) })
    };
    let order = |k: usize| (k % 4 + k / 16 % 2 * 4, k / 4 % 4 + k / 32 * 4);
    let block = |b: usize| (0..64).map(order).map(|(i, j)| point(b % blocks * 8 + i, b / blocks * 8 + j)).collect();
    (0..blocks * blocks).map(block).collect()
}

fn bounds(patch: &Blocks) -> Box3 {
    let mut out = Box3::EMPTY;
    patch.iter().flatten().flatten().for_each(|p| out.add_point(p.at));
    out
}

fn patch_of(block: &[Option<Point>], center: Vec3, lift_m: f64) -> Patch {
    let mut out = Patch::default();
    for (k, p) in block.iter().enumerate() {
        if let Some(p) = p {
            out.put(k, vec3::sub(vec3::add(p.at, vec3::scale(p.normal, lift_m)), center), p.normal);
        }
    }
    out
}

fn sun_bundles(store: &SceneStore, ready: &Ready, sun: Vec3, isa: Isa) -> (usize, usize) {
    let sun = vec3::normalized(sun).expect("a sun");
    let around = Surroundings::ahead(store, ready.center, &ready.bounds, sun).expect("parts");
    let mut bundles = around.along(sun, 0.2, isa).expect("bundles");
    let mut count = (0, 0);
    for patch in &ready.lifted {
        let shadow = bundles.any_hit(patch, 1e6, &Opaque);
        count = add(count, (shadow.sent.count_ones() as usize, shadow.hit.count_ones() as usize));
    }
    count
}

fn ambient(store: &SceneStore, ready: &Ready, isa: Isa) -> (usize, usize) {
    let around = Surroundings::within(store, ready.center, &ready.bounds, RADIUS_M).expect("parts");
    let mut sums = vec![Openness::default(); ready.lifted.len()];
    let mut count = (0, 0);
    for n in 0..DIRECTIONS {
        let z = 1.0 - (2.0 * n as f64 + 1.0) / DIRECTIONS as f64;
        let turn = n as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let r = (1.0 - z * z).sqrt();
        let mut bundles = around.along([r * turn.cos(), r * turn.sin(), z], 0.2, isa).expect("bundles");
        for (patch, sums) in ready.lifted.iter().zip(&mut sums) {
            bundles.add_open(patch, RADIUS_M, &Opaque, sums);
            count = add(count, (patch.there().count_ones() as usize / 2, 0));
        }
    }
    count
}

fn behind(store: &SceneStore, ready: &Ready, frame: &Frame, isa: Isa) -> (usize, usize) {
    let forward = frame.axes().forward;
    let around = Surroundings::ahead(store, ready.center, &ready.bounds, forward).expect("parts");
    let mut bundles = around.along(forward, 0.2, isa).expect("bundles");
    let mut count = (0, 0);
    for patch in &ready.flat {
        count = add(count, (patch.there().count_ones() as usize, bundles.nearest(patch, 1.0 / 16.0, &Opaque).of_point.iter().flatten().count()));
    }
    count
}

fn single(store: &SceneStore, ready: &Ready, sun: Vec3) -> (usize, usize) {
    let rays = Rays::new(store);
    let mut count = (0, 0);
    for p in ready.blocks.iter().flatten().flatten().step_by(16).filter(|p| vec3::dot(p.normal, sun) > 0.0) {
        let origin = vec3::add(p.at, vec3::scale(p.normal, RAY_LIFT_M));
        let hit = rays.any_hit(&Ray { origin, direction: sun, width_m: 0.0 }, 1e6, &Opaque).expect("ray");
        count = add(count, (1, usize::from(hit)));
    }
    count
}
