//! Measures rays from the visible points of a view, in millions per second of thread CPU time: ray packets towards a sun, for ambient occlusion and for the
//! second surface, and single rays towards a sun. `ray_bench <scene folder> [tiles] [metres per pixel] [instruction set]`

use std::path::PathBuf;

use map3d_base::{Box3, DEPTH_UNITS_PER_M, Frame, RAY_LIFT_M, Vec3, vec3};
use map3d_scene::SceneStore;
use map3d_trace::{AmbientOcclusion, BeamTracer, IgnoreCutouts, Isa, PacketOrigins, Ray, Rays, SUBTILE_PX, SceneRegion};

const RADIUS_M: f64 = 20.0;
const DIRECTIONS: usize = 64;

/// A visible point.
struct VisiblePoint {
    at: Vec3,
    normal: Vec3,
}

/// The points of a sub-tile in squares of 8 × 8 pixels, each ordered in squares of 4 × 4.
type Squares = Vec<Vec<Option<VisiblePoint>>>;

/// The packets of a sub-tile.
struct SubtilePackets {
    squares: Squares,
    bounds: Box3,
    center: Vec3,
    lifted: Vec<PacketOrigins>,
    flat: Vec<PacketOrigins>,
}

impl SubtilePackets {
    fn new(squares: Squares) -> Self {
        let bounds = bounds(&squares);
        let center = SceneRegion::snap_center(bounds.center());
        let packets = |lift_m: f64| squares.iter().map(|s| origins_of(s, center, lift_m)).collect();
        Self { bounds, center, lifted: packets(RAY_LIFT_M), flat: packets(0.0), squares }
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
    let subtiles = trace_subtiles(&store, &frame, tiles);
    let points: usize = subtiles.iter().flat_map(|p| &p.squares).flatten().flatten().count();
    println!("{points} points of {} sub-tiles", subtiles.len());
    let suns = [[0.6, -0.3, 0.74], [0.8, -0.55, 0.24]];
    let only = arguments.next();
    for isa in Isa::available().into_iter().filter(|i| only.as_ref().is_none_or(|o| format!("{i:?}").eq_ignore_ascii_case(o))) {
        for sun in suns {
            report(&format!("{isa:?} packets, sun {:.2}", sun[2]), points, || {
                subtiles.iter().map(|p| trace_sun(&store, p, sun, isa)).fold((0, 0), add)
            });
        }
        report(&format!("{isa:?} packets, ao"), points, || subtiles.iter().map(|p| trace_ao(&store, p, isa)).fold((0, 0), add));
        report(&format!("{isa:?} packets, second surface"), points, || {
            subtiles.iter().map(|p| trace_second_surface(&store, p, &frame, isa)).fold((0, 0), add)
        });
    }
    for sun in suns {
        report(&format!("single rays, sun {:.2}", sun[2]), points, || subtiles.iter().map(|p| trace_single_rays(&store, p, sun)).fold((0, 0), add));
    }
}

fn add(a: (usize, usize), b: (usize, usize)) -> (usize, usize) {
    (a.0 + b.0, a.1 + b.1)
}

/// Prints the fastest of five rounds; `work` returns the numbers of rays and hits.
fn report(name: &str, points: usize, work: impl Fn() -> (usize, usize)) {
    let mut best = f64::INFINITY;
    let (mut rays, mut hits) = (0, 0);
    for _ in 0..5 {
        let before = thread_ns();
        (rays, hits) = work();
        best = best.min((thread_ns() - before) as f64);
    }
    let (rate, tile_ms) = (rays as f64 / best * 1e3, best / 1e6 / (points as f64 / 65_536.0));
    println!(
        "{name}: {rate:.1} M rays/s, {tile_ms:.2} ms per tile, {:.2} rays per point, {:.1} % hit",
        rays as f64 / points as f64,
        hits as f64 * 100.0 / rays as f64
    );
}

/// Returns the CPU time of this thread in nanoseconds.
fn thread_ns() -> u64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    text.split(' ').next().and_then(|n| n.parse().ok()).expect("nanoseconds")
}

/// Returns a frame of view 45-45 that is centred on the scene.
fn frame(store: &SceneStore, pixel_m: f64) -> Frame {
    let size = store.bounds().half_extents();
    let zmax = ((3.0 * size[0].max(size[1])) / (256.0 * pixel_m)).log2().ceil().max(0.0) as u8;
    let size_m = 256.0 * pixel_m * f64::from(1u32 << zmax);
    let mut frame = Frame { look_at_deg: 45.0, pitch_deg: 45.0, u0_m: 0.0, v0_m: 0.0, d0_m: 0.0, size_m, tile_px: 256, zmax, layers: vec![] };
    let [u, v, d] = frame.axes().uvd_from_local(store.bounds().center());
    (frame.u0_m, frame.v0_m, frame.d0_m) = (u - size_m / 2.0, v + size_m / 2.0, d - 5000.0);
    frame
}

fn trace_subtiles(store: &SceneStore, frame: &Frame, tiles: usize) -> Vec<SubtilePackets> {
    let mut tracer = BeamTracer::new(store, frame).expect("tracer");
    let middle = (256u64 << frame.zmax) / 2;
    let side = (tiles as f64).sqrt().ceil() as u64;
    let step = ((frame.size_m / 4.0 / frame.pixel_m(frame.zmax)) as u64 / side).max(256);
    let mut out = Vec::new();
    for k in 0..tiles as u64 {
        let corner = [middle - side / 2 * step + k % side * step, middle - side / 2 * step + k / side * step];
        for sub in 0..16u64 {
            let at = [corner[0] + sub % 4 * 64, corner[1] + sub / 4 * 64];
            out.push(visible_points(&mut tracer, frame, at));
        }
    }
    out.retain(|p: &Squares| p.iter().flatten().any(Option::is_some));
    out.into_iter().map(SubtilePackets::new).collect()
}

fn visible_points(tracer: &mut BeamTracer, frame: &Frame, [x, y]: [u64; 2]) -> Squares {
    let vis = tracer.trace(x, y, &IgnoreCutouts).expect("trace");
    let (axes, pixel) = (frame.axes(), frame.pixel_m(frame.zmax));
    let squares = SUBTILE_PX / 8;
    let point = |i: usize, j: usize| {
        let surface = vis.surface(vis.center_slot(i, j)?);
        let (u, v) = (frame.u0_m + (x as f64 + i as f64 + 0.5) * pixel, frame.v0_m - (y as f64 + j as f64 + 0.5) * pixel);
        let at = axes.local_from_uvd([u, v, frame.d0_m + f64::from(vis.center_depth(i, j)) / DEPTH_UNITS_PER_M]);
        Some(VisiblePoint { at, normal: surface.normal.map(f64::from) })
    };
    let order = |k: usize| (k % 4 + k / 16 % 2 * 4, k / 4 % 4 + k / 32 * 4);
    let square = |s: usize| (0..64).map(order).map(|(i, j)| point(s % squares * 8 + i, s / squares * 8 + j)).collect();
    (0..squares * squares).map(square).collect()
}

fn bounds(squares: &Squares) -> Box3 {
    let mut out = Box3::EMPTY;
    squares.iter().flatten().flatten().for_each(|p| out.add_point(p.at));
    out
}

fn origins_of(square: &[Option<VisiblePoint>], center: Vec3, lift_m: f64) -> PacketOrigins {
    let mut out = PacketOrigins::default();
    for (k, p) in square.iter().enumerate() {
        if let Some(p) = p {
            out.set(k, vec3::sub(vec3::add(p.at, vec3::scale(p.normal, lift_m)), center), p.normal);
        }
    }
    out
}

fn trace_sun(store: &SceneStore, subtile: &SubtilePackets, sun: Vec3, isa: Isa) -> (usize, usize) {
    let sun = vec3::normalized(sun).expect("a sun");
    let region = SceneRegion::open_ahead(store, subtile.center, &subtile.bounds, sun).expect("parts");
    let mut packets = region.packets_along(sun, 0.2, isa).expect("packets");
    let mut count = (0, 0);
    for origins in &subtile.lifted {
        let result = packets.any_hit(origins, 1e6, &IgnoreCutouts);
        count = add(count, (result.sent.count_ones() as usize, result.hit.count_ones() as usize));
    }
    count
}

fn trace_ao(store: &SceneStore, subtile: &SubtilePackets, isa: Isa) -> (usize, usize) {
    let region = SceneRegion::open_within(store, subtile.center, &subtile.bounds, RADIUS_M).expect("parts");
    let mut sums = vec![AmbientOcclusion::default(); subtile.lifted.len()];
    let mut count = (0, 0);
    for n in 0..DIRECTIONS {
        let z = 1.0 - (2.0 * n as f64 + 1.0) / DIRECTIONS as f64;
        let turn = n as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let r = (1.0 - z * z).sqrt();
        let mut packets = region.packets_along([r * turn.cos(), r * turn.sin(), z], 0.2, isa).expect("packets");
        for (origins, sums) in subtile.lifted.iter().zip(&mut sums) {
            packets.accumulate_ao(origins, RADIUS_M, &IgnoreCutouts, sums);
            count = add(count, (origins.mask().count_ones() as usize / 2, 0));
        }
    }
    count
}

fn trace_second_surface(store: &SceneStore, subtile: &SubtilePackets, frame: &Frame, isa: Isa) -> (usize, usize) {
    let forward = frame.axes().forward;
    let region = SceneRegion::open_ahead(store, subtile.center, &subtile.bounds, forward).expect("parts");
    let mut packets = region.packets_along(forward, 0.2, isa).expect("packets");
    let mut count = (0, 0);
    for origins in &subtile.flat {
        count = add(
            count,
            (
                origins.mask().count_ones() as usize,
                packets.closest_hits(origins, 1.0 / 16.0, &IgnoreCutouts).triangle_of_ray.iter().flatten().count(),
            ),
        );
    }
    count
}

fn trace_single_rays(store: &SceneStore, subtile: &SubtilePackets, sun: Vec3) -> (usize, usize) {
    let rays = Rays::new(store);
    let mut count = (0, 0);
    for p in subtile.squares.iter().flatten().flatten().step_by(16).filter(|p| vec3::dot(p.normal, sun) > 0.0) {
        let origin = vec3::add(p.at, vec3::scale(p.normal, RAY_LIFT_M));
        let hit = rays.any_hit(&Ray { origin, direction: sun, width_m: 0.0 }, 1e6, &IgnoreCutouts).expect("ray");
        count = add(count, (1, usize::from(hit)));
    }
    count
}
