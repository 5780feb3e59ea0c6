//! Cut-outs against brute force, which evaluates the same holes in float64.

use std::cell::RefCell;
use std::f64::consts::TAU;

use crate::reference::comparison::{BeamComparison, HoleState, SampleCounts};
use crate::reference::{ReferenceTriangle, ReferenceView, TexturePoint};
use crate::scenes::{Lcg, RANKS, Soup, SoupFace, build, frame, mixed_soup, new_folder};
use map3d_base::asset::{Instance, Material, Rank};
use map3d_base::vec3::{add, scale, sub};
use map3d_base::{Frame, Vec3};
use map3d_image::Raster;
use map3d_scene::{MaterialRecord, SceneStore};
use map3d_trace::{
    Affine, BeamTracer, Cutout, CutoutMask, CutoutSample, IgnoreCutouts, Isa, PACKET_SIZE, PacketOrigins, Ray, Rays, SUBTILE_PX, SceneRegion,
};

const CHEQUERED: u32 = 1;
const DOTTED: u32 = 2;

/// Material 0 is opaque; the others have holes and differ in their diffuse red.
fn with_materials(mut soup: Soup) -> Soup {
    let holes = Raster::new(2, 1, vec![[255; 4], [255, 255, 255, 0]]);
    soup.materials = [0.0, 1.0, 0.2].map(|red| Material { diffuse: [red, 1.0, 1.0, 1.0], cutout: red > 0.0, ..Material::default() }).into();
    soup.images = vec![None, Some(holes.clone()), Some(holes)];
    soup
}

/// Returns the distance of (u, v) from the edge of the nearest hole, negative in a hole. Chequers have 4 × 4 cells per unit; dots are round, one per unit.
fn distance_to_hole(material: &MaterialRecord, uv: [f64; 2]) -> f64 {
    let folded = |v: f64, n: f64| (v * n).rem_euclid(1.0);
    if material.diffuse[0] == 255 {
        let edge = uv.map(|c| folded(c, 4.0).min(1.0 - folded(c, 4.0)) / 4.0);
        let odd = (uv[0] * 4.0).floor() + (uv[1] * 4.0).floor();
        return edge[0].min(edge[1]) * if odd.rem_euclid(2.0) == 0.0 { 1.0 } else { -1.0 };
    }
    0.35 - (folded(uv[0], 1.0) - 0.5).hypot(folded(uv[1], 1.0) - 0.5)
}

struct Holes;

impl Cutout for Holes {
    fn covers(&self, material: &MaterialRecord, sample: &CutoutSample) -> bool {
        assert!(material.is_cutout(), "called for an opaque material");
        distance_to_hole(material, sample.uv.map(f64::from)) >= 0.0
    }
}

fn hole_state(t: &ReferenceTriangle, point: &TexturePoint) -> HoleState {
    let distance = distance_to_hole(&t.material, point.uv);
    match distance.abs() > point.tolerance[0] + point.tolerance[1] {
        true if distance > 0.0 => HoleState::Covered,
        true => HoleState::Hole,
        false => HoleState::Uncertain,
    }
}

fn compare(store: &SceneStore, frame: &Frame) -> SampleCounts {
    let counts = BeamComparison { store, frame, cutout: &Holes, hole_state: &hole_state }.run();
    assert!(counts.uncertain * 50 < counts.covered, "too many samples at edges of holes: {counts:?}");
    assert!(counts.cutouts * 20 > counts.covered && counts.holes * 20 > counts.covered, "few holes: {counts:?}");
    counts
}

/// Returns the texture coordinates of a local point, `per_m` units per metre.
fn uv_at(p: Vec3, per_m: f64) -> [f64; 2] {
    [(p[0] + 0.3 * p[2]) * per_m, (p[1] + 0.9 * p[2]) * per_m]
}

fn set_material(face: &mut SoupFace, material: u32, per_m: f64) {
    face.material = material;
    face.uv = face.corners.map(|c| uv_at(c, per_m).map(|v| v as f32));
}

/// Gives two of three faces holes of various sizes.
fn with_holes(soup: Soup, random: &mut Lcg) -> Soup {
    let mut soup = with_materials(soup);
    for (k, face) in soup.faces.iter_mut().enumerate().filter(|(k, _)| k % 3 != 0) {
        set_material(face, CHEQUERED + k as u32 % 2, [0.05, 0.2, 0.7][random.below(3) as usize]);
    }
    soup
}

#[test]
fn beams_pass_through_holes_only() {
    for (seed, (look_at, pitch)) in [(0.0, 90.0), (45.0, 45.0), (123.4, 22.5), (270.0, 10.0)].into_iter().enumerate() {
        let mut random = Lcg(seed as u64 + 31);
        let folder = new_folder("holes");
        let soup = mixed_soup(&mut random, 120);
        let store = build(&folder, &with_holes(soup, &mut random));
        let counts = compare(&store, &frame(look_at, pitch, 40.0));
        assert!(counts.covered > 150_000 && counts.close * 4 < counts.covered, "{counts:?}");
    }
}

#[test]
fn highest_covering_rank_wins_behind_a_hole() {
    let mut soup = Soup::default();
    let mut random = Lcg(5);
    for _ in 0..4 {
        for (k, rank) in RANKS.into_iter().enumerate() {
            let (x, y) = (random.between(-8.0, 2.0), random.between(-8.0, 2.0));
            let point = |dx: f64, dy: f64| [x + dx, y + dy, (x + dx) * 0.25 + (y + dy) * 0.5];
            soup.quad([point(0.0, 0.0), point(7.0, 0.5), point(7.0, 8.0), point(0.0, 7.0)], k as u32, rank);
        }
    }
    let folder = new_folder("ranks");
    let store = build(&folder, &with_holes(soup, &mut random));
    for (look_at, pitch) in [(0.0, 90.0), (45.0, 45.0), (200.0, 12.0)] {
        let frame = frame(look_at, pitch, 40.0);
        let (view, mut seen) = (ReferenceView::new(&frame), [0; 6]);
        let all = view.triangles(&store);
        let mut tracer = BeamTracer::new(&store, &frame).expect("tracer");
        let result = tracer.trace(96, 96, &Holes).expect("trace");
        for p in 0..SUBTILE_PX * SUBTILE_PX {
            let (i, j) = (p % SUBTILE_PX, p / SUBTILE_PX);
            let at = ReferenceView::sample([96 + i, 96 + j], 0);
            let state_of = |t: &ReferenceTriangle| {
                if t.material.is_cutout() { hole_state(t, &view.texture_point(t, at).expect("not edge-on")) } else { HoleState::Covered }
            };
            let here: Vec<(u8, HoleState)> = all.iter().filter(|t| t.covers(at)).map(|t| (t.rank, state_of(t))).collect();
            if here.iter().any(|h| h.1 == HoleState::Uncertain) {
                continue;
            }
            let highest = here.iter().filter(|h| h.1 == HoleState::Covered).map(|h| h.0).max();
            let got = result.center_slot(i, j).map(|slot| result.surface(slot).rank);
            assert_eq!(got, highest, "pixel ({i}, {j}) from {look_at} / {pitch}: {here:?}");
            got.iter().for_each(|rank| seen[usize::from(*rank)] += 1);
        }
        assert!(seen[0] + seen[1] + seen[2] > 30 && seen[3..].iter().all(|n| *n > 100), "pixels of each rank: {seen:?}");
    }
}

/// A trunk and three crossed quads of leaves.
fn tree() -> Vec<SoupFace> {
    let mut soup = Soup::default();
    soup.quad([[-0.2, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.0, 2.0], [-0.2, 0.0, 2.0]], 0, Rank::Other);
    for k in 0..3 {
        let (s, c) = (TAU * f64::from(k) / 6.0 + 0.1).sin_cos();
        soup.quad([[-2.0 * c, -2.0 * s, 1.0], [2.0 * c, 2.0 * s, 1.0], [2.0 * c, 2.0 * s, 5.0], [-2.0 * c, -2.0 * s, 5.0]], 0, Rank::Other);
    }
    for (k, face) in soup.faces.iter_mut().enumerate().skip(2) {
        face.material = if k < 6 { DOTTED } else { CHEQUERED };
        let uv = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        face.uv = if k % 2 == 0 { [uv[0], uv[1], uv[2]] } else { [uv[0], uv[2], uv[3]] };
    }
    soup.faces
}

/// Returns a placement that rotates, scales each axis differently, and mirrors every second instance.
fn random_placement(random: &mut Lcg, object: u32) -> Instance {
    let (s, c) = random.between(0.0, TAU).sin_cos();
    let scales = [0, 1, 2].map(|_| random.between(0.4, 2.5));
    let mirror = if object.is_multiple_of(2) { -1.0 } else { 1.0 };
    let (a, b, at) = (scales[0] * mirror, scales[1], random.point(12.0));
    Instance { prototype: 1, object, transform: [c * a, -s * b, 0.0, at[0], s * a, c * b, 0.1, at[1], 0.0, 0.05, scales[2], at[2] / 4.0] }
}

#[test]
fn instances_keep_their_holes() {
    let mut random = Lcg(11);
    let mut soup = with_materials(mixed_soup(&mut random, 20));
    soup.prototypes = vec![tree()];
    soup.instances = (0..30).map(|k| random_placement(&mut random, 100 + k)).collect();
    let folder = new_folder("trees");
    let store = build(&folder, &soup);
    for (look_at, pitch) in [(30.0, 45.0), (180.0, 90.0), (311.0, 15.0)] {
        compare(&store, &frame(look_at, pitch, 24.0));
    }
}

#[test]
fn holes_do_not_shift_at_chunk_borders() {
    let mut soup = Soup::default();
    // A grid of quads across the middle, where four cells meet, between quads so large that they are split.
    for k in 0..100u32 {
        let (x, y) = (f64::from(k % 10) * 4.0 - 21.3, f64::from(k / 10) * 4.0 - 18.7);
        let z = |x: f64, y: f64| (x * 0.4).sin() + y * 0.1;
        let c = [[x, y], [x + 4.0, y], [x + 4.0, y + 4.0], [x, y + 4.0]].map(|[x, y]| [x, y, z(x, y)]);
        soup.quad(c, k, RANKS[k as usize % 6]);
    }
    soup.quad([[-3000.0, -2500.0, 9.0], [3100.0, -2700.0, 9.0], [2900.0, 2600.0, 9.0], [-2800.0, 2900.0, 9.0]], 200, Rank::Other);
    soup.quad([[-9900.0, -9500.0, -9.0], [9100.0, -9900.0, -9.0], [9900.0, 9600.0, -9.0], [-9800.0, 9900.0, -9.0]], 201, Rank::Other);
    let mut soup = with_materials(soup);
    soup.faces.iter_mut().enumerate().filter(|(k, _)| k % 4 != 0 || *k >= 200).for_each(|(k, f)| set_material(f, CHEQUERED + k as u32 % 2, 0.125));
    let folder = new_folder("borders");
    let store = build(&folder, &soup);
    let in_middle = |b: &map3d_base::Box3| (0..2).all(|k| b.lo[k] < 20.0 && b.hi[k] > -20.0);
    assert!(store.parts().iter().filter(|p| in_middle(&p.bounds)).count() >= 4, "the grid is in one chunk");
    // Only whole numbers may be subtracted from a triangle's texture coordinates.
    let is_whole = |v: f64| (v - v.round()).abs() < 1e-3;
    let is_shifted_by_integers = |t: &ReferenceTriangle| (0..3).all(|c| (0..2).all(|k| is_whole(t.uv[c][k] - uv_at(t.corners[c], 0.125)[k])));
    let view = frame(0.0, 90.0, 40.0);
    assert!(
        ReferenceView::new(&view).triangles(&store).iter().all(|t| !t.material.is_cutout() || is_shifted_by_integers(t)),
        "splitting changed texture coordinates"
    );
    for (look_at, pitch) in [(30.0, 45.0), (0.0, 90.0), (77.0, 14.0)] {
        let counts = compare(&store, &frame(look_at, pitch, 40.0));
        assert!(counts.covered > 150_000, "{counts:?}");
    }
}

#[test]
fn triangles_seen_nearly_edge_on_keep_their_holes() {
    let (look_at, pitch) = (30.0, 40.0);
    let frame = frame(look_at, pitch, 24.0);
    let axes = frame.axes();
    let mut soup = Soup::default();
    for k in 0..60u32 {
        // Planes along the line of sight, rotated by 6° down to 0°.
        let turn: f64 = if k % 10 == 9 { 0.0 } else { 0.1 * 0.1f64.powf(f64::from(k % 10) / 2.0) };
        let along: Vec3 = [0, 1, 2].map(|a| axes.forward[a] * turn.cos() + axes.right[a] * turn.sin());
        let from = [f64::from(k % 12) * 1.6 - 9.0, f64::from(k / 12) * 1.5 - 4.0, f64::from(k % 7) * 0.5];
        let point = |d: f64, u: f64| [0, 1, 2].map(|a| from[a] + along[a] * d + axes.up[a] * u);
        soup.quad([point(0.0, 0.0), point(6.0, 0.0), point(6.0, 4.0), point(0.0, 4.0)], k, RANKS[k as usize % 6]);
    }
    soup.quad([[-30.0, -30.0, -8.0], [30.0, -30.0, -8.0], [30.0, 30.0, -8.0], [-30.0, 30.0, -8.0]], 90, Rank::Terrain);
    let mut soup = with_materials(soup);
    soup.faces.iter_mut().filter(|f| f.object != 90).for_each(|f| set_material(f, CHEQUERED + f.object % 2, 0.2));
    let folder = new_folder("edge-on");
    let counts = BeamComparison { store: &build(&folder, &soup), frame: &frame, cutout: &Holes, hole_state: &hole_state }.run();
    assert!(counts.cutouts > 2_000 && counts.holes > 2_000 && counts.uncertain * 200 < counts.covered, "{counts:?}");
}

/// Records the samples that it is called with.
#[derive(Default)]
struct RecordedSamples(RefCell<Vec<CutoutSample>>);

impl Cutout for RecordedSamples {
    fn covers(&self, _: &MaterialRecord, sample: &CutoutSample) -> bool {
        self.0.borrow_mut().push(*sample);
        true
    }
}

#[test]
fn footprint_is_the_change_over_a_pixel() {
    let mut soup = Soup::default();
    soup.add([[-9.0, -8.0, 1.0], [10.0, -5.0, 3.0], [-2.0, 11.0, -4.0]], 0, Rank::Other);
    let mut soup = with_materials(soup);
    soup.faces[0].material = CHEQUERED;
    soup.faces[0].uv = [[0.1, 0.2], [3.3, 0.9], [1.2, 7.1]];
    let folder = new_folder("footprint");
    let store = build(&folder, &soup);
    for (look_at, pitch) in [(0.0, 90.0), (33.0, 50.0), (250.0, 25.0)] {
        let frame = frame(look_at, pitch, 40.0);
        let (view, recorded) = (ReferenceView::new(&frame), RecordedSamples::default());
        BeamTracer::new(&store, &frame).expect("tracer").trace(96, 96, &recorded).expect("trace");
        let triangle = &view.triangles(&store)[0];
        let expected = view.texture_point(triangle, ReferenceView::sample([128, 128], 0)).expect("not edge-on").footprint;
        let near = |s: &CutoutSample| (0..2).all(|a| (0..2).all(|b| (f64::from(s.footprint[a][b]) - expected[a][b]).abs() < 1e-6));
        let recorded = recorded.0.into_inner();
        assert!(recorded.len() > 10_000 && recorded.iter().all(near), "{} samples, {:?}, expected {expected:?}", recorded.len(), recorded.first());
    }
}

#[test]
fn rays_agree_with_beams_at_holes() {
    let mut random = Lcg(21);
    let folder = new_folder("rays");
    let soup = mixed_soup(&mut random, 60);
    let mut soup = with_holes(soup, &mut random);
    soup.prototypes = vec![tree()];
    soup.instances = (0..10).map(|k| random_placement(&mut random, 100 + k)).collect();
    let store = build(&folder, &soup);
    let rays = Rays::new(&store);
    let frame = frame(33.0, 40.0, 40.0);
    let (axes, pixel_m) = (frame.axes(), frame.pixel_m(0));
    let (mut compared, mut differ) = (0, 0);
    let mut tracer = BeamTracer::new(&store, &frame).expect("tracer");
    for (left, top) in [(64u64, 64u64), (128, 64), (128, 128)] {
        let result = tracer.trace(left, top, &Holes).expect("trace");
        for p in (0..SUBTILE_PX * SUBTILE_PX).step_by(5) {
            let (i, j) = (p % SUBTILE_PX, p / SUBTILE_PX);
            let (u, v) = (frame.u0_m + (left as f64 + i as f64 + 0.5) * pixel_m, frame.v0_m - (top as f64 + j as f64 + 0.5) * pixel_m);
            let ray = Ray { origin: axes.local_from_uvd([u, v, frame.d0_m]), direction: scale(axes.forward, 3.0), width_m: pixel_m };
            let hit = rays.closest_hit(&ray, &Holes).expect("ray");
            let expected = result.center_slot(i, j).map(|slot| result.surface(slot).object_id);
            compared += 1;
            differ += u32::from(hit.map(|h| h.object_id) != expected);
        }
    }
    // They may differ where an edge or the edge of a hole is within a lattice step of the pixel's centre.
    assert!(compared > 2_000 && differ * 100 < compared, "{differ} of {compared} differ");
}

/// Supports only prepared surfaces.
struct PreparedHoles;

struct PreparedHoleMask(MaterialRecord, [[f32; 2]; 2]);

impl Cutout for PreparedHoles {
    fn covers(&self, _: &MaterialRecord, _: &CutoutSample) -> bool {
        panic!("called for a surface that is not prepared");
    }

    fn prepare(&self, material: &MaterialRecord, [u, v]: &[Affine; 2]) -> Option<Box<dyn CutoutMask>> {
        Some(Box::new(PreparedHoleMask(*material, [[u.dx, v.dx], [u.dy, v.dy]])))
    }
}

impl CutoutMask for PreparedHoleMask {
    fn covered(&self, _: usize, _: usize, _: u32) -> u32 {
        panic!("called with pixel samples for a ray");
    }

    fn covers(&self, uv: [f32; 2]) -> bool {
        Holes.covers(&self.0, &CutoutSample { uv, footprint: self.1 })
    }
}

#[test]
fn packets_give_equal_results_for_prepared_cutouts() {
    let mut random = Lcg(77);
    let folder = new_folder("prepared");
    let soup = mixed_soup(&mut random, 60);
    let mut soup = with_holes(soup, &mut random);
    soup.prototypes = vec![tree()];
    soup.instances = (0..10).map(|k| random_placement(&mut random, 100 + k)).collect();
    let store = build(&folder, &soup);
    let region = SceneRegion::open(&store, [0.0; 3], |_| true).expect("parts");
    let (mut hit, mut passed) = (0, 0);
    for _ in 0..40 {
        let (from, towards) = (random.point(30.0), random.point(10.0));
        let direction = sub(towards, from);
        let mut origins = PacketOrigins::default();
        (0..PACKET_SIZE).for_each(|k| origins.set(k, add(from, random.point(4.0)), direction));
        for isa in Isa::available() {
            let mut packets = region.packets_along(direction, 0.1, isa).expect("packets");
            let holes = packets.any_hit(&origins, 1e6, &Holes);
            assert_eq!(holes, packets.any_hit(&origins, 1e6, &PreparedHoles));
            let closest = packets.closest_hits(&origins, 0.0, &Holes);
            let prepared = packets.closest_hits(&origins, 0.0, &PreparedHoles);
            assert_eq!((closest.triangle_of_ray, closest.triangles), (prepared.triangle_of_ray, prepared.triangles));
            hit += holes.hit.count_ones();
            passed += (packets.any_hit(&origins, 1e6, &IgnoreCutouts).hit & !holes.hit).count_ones();
        }
    }
    assert!(hit > 500 && passed > 100, "{hit} hit, {passed} passed through holes");
}
