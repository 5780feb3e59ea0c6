//! Surfaces with holes against brute force, which evaluates the same holes in float64.

mod brute;
mod scenes;

use std::cell::RefCell;
use std::f64::consts::TAU;

use brute::contest::{Contest, Presence, Tally};
use brute::{Eye, Known, Place};
use map3d_base::asset::{Instance, Material, Rank};
use map3d_base::vec3::{add, scale, sub};
use map3d_base::{Frame, Vec3};
use map3d_image::Raster;
use map3d_scene::{MaterialRecord, SceneStore};
use map3d_trace::{Affine, BeamTracer, Cutout, CutoutSample, Isa, Opaque, Patch, RAYS, Ray, Rays, SUBTILE_PX, Stencil, Surroundings};
use scenes::{Dice, Face, RANKS, Soup, build, frame, mixed_soup, new_folder};

const CHEQUERED: u32 = 1;
const DOTTED: u32 = 2;

/// Material 0 is opaque, the others have holes, told apart by their diffuse red.
fn with_materials(mut soup: Soup) -> Soup {
    let holes = Raster::new(2, 1, vec![[255; 4], [255, 255, 255, 0]]);
    soup.materials = [0.0, 1.0, 0.2].map(|red| Material { diffuse: [red, 1.0, 1.0, 1.0], cutout: red > 0.0, ..Material::default() }).into();
    soup.images = vec![None, Some(holes.clone()), Some(holes)];
    soup
}

/// How far inside a surface (u, v) lies; negative in a hole. Chequers have 4 × 4 cells a unit; dots are round, one a unit.
fn inside(material: &MaterialRecord, uv: [f64; 2]) -> f64 {
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
        assert!(material.is_cutout(), "asked about an opaque material");
        inside(material, sample.uv.map(f64::from)) >= 0.0
    }
}

fn presence(t: &Known, place: &Place) -> Presence {
    let depth = inside(&t.material, place.uv);
    match depth.abs() > place.room[0] + place.room[1] {
        true if depth > 0.0 => Presence::There,
        true => Presence::Gone,
        false => Presence::Unsure,
    }
}

fn compare(store: &SceneStore, frame: &Frame) -> Tally {
    let tally = Contest { store, frame, cutout: &Holes, presence: &presence }.run();
    assert!(tally.unsure * 50 < tally.met, "too near the edge of a hole: {tally:?}");
    assert!(tally.cut * 20 > tally.met && tally.holes * 20 > tally.met, "few holes: {tally:?}");
    tally
}

/// Texture coordinates at a local point, `per_m` units a metre.
fn uv_at(p: Vec3, per_m: f64) -> [f64; 2] {
    [(p[0] + 0.3 * p[2]) * per_m, (p[1] + 0.9 * p[2]) * per_m]
}

fn spread(face: &mut Face, material: u32, per_m: f64) {
    face.material = material;
    face.uv = face.corners.map(|c| uv_at(c, per_m).map(|v| v as f32));
}

/// Two of three faces have holes of all sizes.
fn perforated(soup: Soup, dice: &mut Dice) -> Soup {
    let mut soup = with_materials(soup);
    for (k, face) in soup.faces.iter_mut().enumerate().filter(|(k, _)| k % 3 != 0) {
        spread(face, CHEQUERED + k as u32 % 2, [0.05, 0.2, 0.7][dice.below(3) as usize]);
    }
    soup
}

#[test]
fn beams_see_through_holes_and_nowhere_else() {
    for (seed, (look_at, pitch)) in [(0.0, 90.0), (45.0, 45.0), (123.4, 22.5), (270.0, 10.0)].into_iter().enumerate() {
        let mut dice = Dice(seed as u64 + 31);
        let folder = new_folder("holes");
        let soup = mixed_soup(&mut dice, 120);
        let store = build(&folder, &perforated(soup, &mut dice));
        let tally = compare(&store, &frame(look_at, pitch, 40.0));
        assert!(tally.met > 150_000 && tally.close * 4 < tally.met, "{tally:?}");
    }
}

#[test]
fn behind_a_hole_the_highest_rank_that_is_there_wins() {
    let mut soup = Soup::default();
    let mut dice = Dice(5);
    for _ in 0..4 {
        for (k, rank) in RANKS.into_iter().enumerate() {
            let (x, y) = (dice.between(-8.0, 2.0), dice.between(-8.0, 2.0));
            let point = |dx: f64, dy: f64| [x + dx, y + dy, (x + dx) * 0.25 + (y + dy) * 0.5];
            soup.quad([point(0.0, 0.0), point(7.0, 0.5), point(7.0, 8.0), point(0.0, 7.0)], k as u32, rank);
        }
    }
    let folder = new_folder("ranks");
    let store = build(&folder, &perforated(soup, &mut dice));
    for (look_at, pitch) in [(0.0, 90.0), (45.0, 45.0), (200.0, 12.0)] {
        let frame = frame(look_at, pitch, 40.0);
        let (eye, mut seen) = (Eye::new(&frame), [0; 6]);
        let all = eye.know(&store);
        let mut tracer = BeamTracer::new(&store, &frame).expect("tracer");
        let result = tracer.trace(96, 96, &Holes).expect("trace");
        for p in 0..SUBTILE_PX * SUBTILE_PX {
            let (i, j) = (p % SUBTILE_PX, p / SUBTILE_PX);
            let at = Eye::sample([96 + i, 96 + j], 0);
            let state = |t: &Known| if t.material.is_cutout() { presence(t, &eye.place(t, at).expect("not edge-on")) } else { Presence::There };
            let here: Vec<(u8, Presence)> = all.iter().filter(|t| t.covers(at)).map(|t| (t.rank, state(t))).collect();
            if here.iter().any(|h| h.1 == Presence::Unsure) {
                continue;
            }
            let highest = here.iter().filter(|h| h.1 == Presence::There).map(|h| h.0).max();
            let got = result.center_slot(i, j).map(|slot| result.surface(slot).rank);
            assert_eq!(got, highest, "pixel ({i}, {j}) from {look_at} / {pitch}: {here:?}");
            got.iter().for_each(|rank| seen[usize::from(*rank)] += 1);
        }
        assert!(seen[0] + seen[1] + seen[2] > 30 && seen[3..].iter().all(|n| *n > 100), "pixels of each rank: {seen:?}");
    }
}

/// A trunk and three crossed boards of leaves.
fn tree() -> Vec<Face> {
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

/// Turned, scaled by each axis its own way, every second one mirrored.
fn planted(dice: &mut Dice, object: u32) -> Instance {
    let (s, c) = dice.between(0.0, TAU).sin_cos();
    let scales = [0, 1, 2].map(|_| dice.between(0.4, 2.5));
    let mirror = if object.is_multiple_of(2) { -1.0 } else { 1.0 };
    let (a, b, at) = (scales[0] * mirror, scales[1], dice.point(12.0));
    Instance { prototype: 1, object, transform: [c * a, -s * b, 0.0, at[0], s * a, c * b, 0.1, at[1], 0.0, 0.05, scales[2], at[2] / 4.0] }
}

#[test]
fn trees_keep_their_holes_wherever_they_are_planted() {
    let mut dice = Dice(11);
    let mut soup = with_materials(mixed_soup(&mut dice, 20));
    soup.prototypes = vec![tree()];
    soup.instances = (0..30).map(|k| planted(&mut dice, 100 + k)).collect();
    let folder = new_folder("trees");
    let store = build(&folder, &soup);
    for (look_at, pitch) in [(30.0, 45.0), (180.0, 90.0), (311.0, 15.0)] {
        compare(&store, &frame(look_at, pitch, 24.0));
    }
}

#[test]
fn holes_do_not_shift_where_chunks_meet() {
    let mut soup = Soup::default();
    // A carpet across the middle, where four cells meet; above it and below it sheets so large that they are split.
    for k in 0..100u32 {
        let (x, y) = (f64::from(k % 10) * 4.0 - 21.3, f64::from(k / 10) * 4.0 - 18.7);
        let z = |x: f64, y: f64| (x * 0.4).sin() + y * 0.1;
        let c = [[x, y], [x + 4.0, y], [x + 4.0, y + 4.0], [x, y + 4.0]].map(|[x, y]| [x, y, z(x, y)]);
        soup.quad(c, k, RANKS[k as usize % 6]);
    }
    soup.quad([[-3000.0, -2500.0, 9.0], [3100.0, -2700.0, 9.0], [2900.0, 2600.0, 9.0], [-2800.0, 2900.0, 9.0]], 200, Rank::Other);
    soup.quad([[-9900.0, -9500.0, -9.0], [9100.0, -9900.0, -9.0], [9900.0, 9600.0, -9.0], [-9800.0, 9900.0, -9.0]], 201, Rank::Other);
    let mut soup = with_materials(soup);
    soup.faces.iter_mut().enumerate().filter(|(k, _)| k % 4 != 0 || *k >= 200).for_each(|(k, f)| spread(f, CHEQUERED + k as u32 % 2, 0.125));
    let folder = new_folder("borders");
    let store = build(&folder, &soup);
    let at_home = |b: &map3d_base::Box3| (0..2).all(|k| b.lo[k] < 20.0 && b.hi[k] > -20.0);
    assert!(store.parts().iter().filter(|p| at_home(&p.bounds)).count() >= 4, "the carpet lies in several chunks");
    // Whole numbers may be subtracted from a triangle's coordinates, nothing else.
    let is_whole = |v: f64| (v - v.round()).abs() < 1e-3;
    let in_place = |t: &Known| (0..3).all(|c| (0..2).all(|k| is_whole(t.uv[c][k] - uv_at(t.corners[c], 0.125)[k])));
    let view = frame(0.0, 90.0, 40.0);
    assert!(Eye::new(&view).know(&store).iter().all(|t| !t.material.is_cutout() || in_place(t)), "pieces of long triangles keep their coordinates");
    for (look_at, pitch) in [(30.0, 45.0), (0.0, 90.0), (77.0, 14.0)] {
        let tally = compare(&store, &frame(look_at, pitch, 40.0));
        assert!(tally.met > 150_000, "{tally:?}");
    }
}

#[test]
fn fences_seen_nearly_edge_on_have_their_holes_too() {
    let (look_at, pitch) = (30.0, 40.0);
    let frame = frame(look_at, pitch, 24.0);
    let axes = frame.axes();
    let mut soup = Soup::default();
    for k in 0..60u32 {
        // Planes that hold the line of sight, but for a turn of 6° down to nothing.
        let turn: f64 = if k % 10 == 9 { 0.0 } else { 0.1 * 0.1f64.powf(f64::from(k % 10) / 2.0) };
        let along: Vec3 = [0, 1, 2].map(|a| axes.forward[a] * turn.cos() + axes.right[a] * turn.sin());
        let from = [f64::from(k % 12) * 1.6 - 9.0, f64::from(k / 12) * 1.5 - 4.0, f64::from(k % 7) * 0.5];
        let point = |d: f64, u: f64| [0, 1, 2].map(|a| from[a] + along[a] * d + axes.up[a] * u);
        soup.quad([point(0.0, 0.0), point(6.0, 0.0), point(6.0, 4.0), point(0.0, 4.0)], k, RANKS[k as usize % 6]);
    }
    soup.quad([[-30.0, -30.0, -8.0], [30.0, -30.0, -8.0], [30.0, 30.0, -8.0], [-30.0, 30.0, -8.0]], 90, Rank::Terrain);
    let mut soup = with_materials(soup);
    soup.faces.iter_mut().filter(|f| f.object != 90).for_each(|f| spread(f, CHEQUERED + f.object % 2, 0.2));
    let folder = new_folder("edge-on");
    let tally = Contest { store: &build(&folder, &soup), frame: &frame, cutout: &Holes, presence: &presence }.run();
    assert!(tally.cut > 2_000 && tally.holes > 2_000 && tally.unsure * 200 < tally.met, "{tally:?}");
}

/// Notes what it is asked.
#[derive(Default)]
struct Asked(RefCell<Vec<CutoutSample>>);

impl Cutout for Asked {
    fn covers(&self, _: &MaterialRecord, sample: &CutoutSample) -> bool {
        self.0.borrow_mut().push(*sample);
        true
    }
}

#[test]
fn footprints_are_the_change_over_a_pixel() {
    let mut soup = Soup::default();
    soup.add([[-9.0, -8.0, 1.0], [10.0, -5.0, 3.0], [-2.0, 11.0, -4.0]], 0, Rank::Other);
    let mut soup = with_materials(soup);
    soup.faces[0].material = CHEQUERED;
    soup.faces[0].uv = [[0.1, 0.2], [3.3, 0.9], [1.2, 7.1]];
    let folder = new_folder("footprint");
    let store = build(&folder, &soup);
    for (look_at, pitch) in [(0.0, 90.0), (33.0, 50.0), (250.0, 25.0)] {
        let frame = frame(look_at, pitch, 40.0);
        let (eye, asked) = (Eye::new(&frame), Asked::default());
        BeamTracer::new(&store, &frame).expect("tracer").trace(96, 96, &asked).expect("trace");
        let known = &eye.know(&store)[0];
        let expected = eye.place(known, Eye::sample([128, 128], 0)).expect("not edge-on").footprint;
        let near = |s: &CutoutSample| (0..2).all(|a| (0..2).all(|b| (f64::from(s.footprint[a][b]) - expected[a][b]).abs() < 1e-6));
        let asked = asked.0.into_inner();
        assert!(asked.len() > 10_000 && asked.iter().all(near), "{} samples, {:?}, expected {expected:?}", asked.len(), asked.first());
    }
}

#[test]
fn rays_pass_through_the_same_holes() {
    let mut dice = Dice(21);
    let folder = new_folder("rays");
    let soup = mixed_soup(&mut dice, 60);
    let mut soup = perforated(soup, &mut dice);
    soup.prototypes = vec![tree()];
    soup.instances = (0..10).map(|k| planted(&mut dice, 100 + k)).collect();
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
            let hit = rays.closest(&ray, &Holes).expect("ray");
            let expected = result.center_slot(i, j).map(|slot| result.surface(slot).object_id);
            compared += 1;
            differ += u32::from(hit.map(|h| h.object_id) != expected);
        }
    }
    // Only where an edge, or the edge of a hole, passes within a lattice step of the pixel's centre.
    assert!(compared > 2_000 && differ * 100 < compared, "{differ} of {compared} differ");
}

/// Sets surfaces up before it is asked.
struct HolesInAdvance;

struct Stretched(MaterialRecord, [[f32; 2]; 2]);

impl Cutout for HolesInAdvance {
    fn covers(&self, _: &MaterialRecord, _: &CutoutSample) -> bool {
        panic!("a surface that is not set up");
    }

    fn stencil(&self, material: &MaterialRecord, [u, v]: &[Affine; 2]) -> Option<Box<dyn Stencil>> {
        Some(Box::new(Stretched(*material, [[u.dx, v.dx], [u.dy, v.dy]])))
    }
}

impl Stencil for Stretched {
    fn covered(&self, _: usize, _: usize, _: u32) -> u32 {
        panic!("rays are not the samples of a pixel");
    }

    fn covers(&self, uv: [f32; 2]) -> bool {
        Holes.covers(&self.0, &CutoutSample { uv, footprint: self.1 })
    }
}

#[test]
fn bundles_pass_through_the_holes_of_surfaces_that_are_set_up() {
    let mut dice = Dice(77);
    let folder = new_folder("stencils");
    let soup = mixed_soup(&mut dice, 60);
    let mut soup = perforated(soup, &mut dice);
    soup.prototypes = vec![tree()];
    soup.instances = (0..10).map(|k| planted(&mut dice, 100 + k)).collect();
    let store = build(&folder, &soup);
    let around = Surroundings::gather(&store, [0.0; 3], |_| true).expect("parts");
    let (mut hit, mut passed) = (0, 0);
    for _ in 0..40 {
        let (from, towards) = (dice.point(30.0), dice.point(10.0));
        let direction = sub(towards, from);
        let mut patch = Patch::default();
        (0..RAYS).for_each(|k| patch.put(k, add(from, dice.point(4.0)), direction));
        for isa in Isa::available() {
            let mut bundles = around.along(direction, 0.1, isa).expect("bundles");
            let holes = bundles.any_hit(&patch, 1e6, &Holes);
            assert_eq!(holes, bundles.any_hit(&patch, 1e6, &HolesInAdvance));
            let nearest = bundles.nearest(&patch, 0.0, &Holes);
            let in_advance = bundles.nearest(&patch, 0.0, &HolesInAdvance);
            assert_eq!((nearest.of_point, nearest.triangles), (in_advance.of_point, in_advance.triangles));
            hit += holes.hit.count_ones();
            passed += (bundles.any_hit(&patch, 1e6, &Opaque).hit & !holes.hit).count_ones();
        }
    }
    assert!(hit > 500 && passed > 100, "{hit} hit, {passed} passed through holes");
}
