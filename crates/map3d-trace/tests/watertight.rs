//! Shared edges leave no crack and no double hit, wherever a mesh is cut.

mod scenes;

use map3d_base::ViewAxes;
use map3d_base::asset::Rank;
use map3d_base::vec3::{normalized, scale};
use map3d_scene::SceneStore;
use map3d_trace::{BeamTracer, Opaque, Pixel, Ray, Rays, SUBTILE_PX};
use scenes::closed::{ball, crate_of, planted, soup_of};
use scenes::{Dice, Soup, build, frame, new_folder};

/// Look-at angle and pitch: along axes and diagonals, straight down, steep and grazing; then all around.
fn directions(dice: &mut Dice) -> Vec<(f64, f64)> {
    let along = [0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0];
    let pitches = [90.0, 89.999, 60.0, 45.0, 30.0, 5.0, 0.5, 0.001];
    let mut out: Vec<(f64, f64)> = along.into_iter().flat_map(|a| pitches.map(|p| (a, p))).collect();
    out.extend((0..200 - out.len()).map(|_| (dice.between(0.0, 360.0), dice.between(0.0, 1.0).asin().to_degrees().max(0.1))));
    out
}

/// Whether all samples around the middle are covered; (look at, pitch) and pixel of the first that is not.
fn first_hole(store: &SceneStore, directions: &[(f64, f64)], reach_px: f64) -> Option<((f64, f64), usize)> {
    directions.iter().find_map(|&(look_at, pitch)| {
        let frame = frame(look_at, pitch, 64.0);
        let mut tracer = BeamTracer::new(store, &frame).expect("tracer");
        let result = tracer.trace(96, 96, &Opaque).expect("trace");
        let is_hole = |p: &usize| match result.pixel(p % SUBTILE_PX, p / SUBTILE_PX) {
            Pixel::Nothing => true,
            Pixel::One(_) => false,
            Pixel::Mixed(slots) => slots.contains(&u32::MAX),
        };
        let is_inside = |p: &usize| ((p % SUBTILE_PX) as f64 - 31.5).hypot((p / SUBTILE_PX) as f64 - 31.5) < reach_px;
        (0..SUBTILE_PX * SUBTILE_PX).filter(is_inside).find(is_hole).map(|p| ((look_at, pitch), p))
    })
}

#[test]
fn a_closed_mesh_shows_no_background_from_any_side() {
    let mut dice = Dice(3);
    let directions = directions(&mut dice);
    assert_eq!(directions.len(), 200);
    for (name, mesh) in [("ball", ball(12.0, 14, &mut dice, [0.0; 3])), ("crate", crate_of(12.0, 8))] {
        let scenes = [("one chunk", soup_of(&mesh, false)), ("several chunks", soup_of(&mesh, true)), ("instances", planted(&mesh))];
        for (place, soup) in scenes {
            let folder = new_folder("closed");
            let store = build(&folder, &soup);
            let near = store.parts().iter().filter(|p| p.bounds.lo[0].abs() < 100.0).count();
            assert!(near >= [("one chunk", 1), ("several chunks", 4), ("instances", 3)].into_iter().find(|n| n.0 == place).expect("named").1);
            // Within 8.5 m of the middle; the least radius of each is 9 m or more.
            assert_eq!(first_hole(&store, &directions, 34.0), None, "a hole in the {name} of {place}");
        }
    }
}

#[test]
fn rays_do_not_slip_through_a_closed_mesh() {
    let mut dice = Dice(8);
    let folder = new_folder("rays");
    let triangles = ball(12.0, 10, &mut dice, [0.0; 3]);
    let store = build(&folder, &soup_of(&triangles, true));
    let rays = Rays::new(&store);
    for k in 0..3000 {
        // From the inside towards corners, edges' middles and random points.
        let t = triangles[dice.below(triangles.len() as u64) as usize];
        let snapped = t.map(|p| p.map(|v| (v * 4096.0 + 0.5).floor() / 4096.0));
        let target = match k % 3 {
            0 => snapped[0],
            1 => [0, 1, 2].map(|a| (snapped[0][a] + snapped[1][a]) / 2.0),
            _ => dice.point(10.0),
        };
        let Some(direction) = normalized(target) else { continue };
        let ray = Ray { origin: [0.0; 3], direction, width_m: 0.0 };
        let hit = rays.closest(&ray, &Opaque).expect("ray").expect("the ball is closed");
        assert!((9.0..14.0).contains(&hit.distance_m), "{}", hit.distance_m);
        assert!(rays.any_hit(&ray, 20.0, &Opaque).expect("ray") && !rays.any_hit(&ray, 5.0, &Opaque).expect("ray"));
    }
}

#[test]
fn each_sample_of_a_fan_is_covered_once() {
    // A flat disc cut into slices of different objects: of any two neighbours one alone covers a sample on their edge.
    let mut soup = Soup::default();
    let corner = |k: usize| {
        let a = std::f64::consts::TAU * (k % 24) as f64 / 24.0;
        [10.0 * a.cos(), 10.0 * a.sin(), 0.0]
    };
    (0..24).for_each(|k| soup.add([[0.0; 3], corner(k), corner(k + 1)], k as u32, Rank::Other));
    let folder = new_folder("fan");
    let store = build(&folder, &soup);
    // Pixel edges of 1/4 m put corners and many edges on samples.
    let frame = frame(0.0, 90.0, 64.0);
    let mut all = vec![0u32; 256 * 256 * 16];
    for single in 0..24 {
        let mut one = Soup::default();
        one.add([[0.0; 3], corner(single), corner(single + 1)], single as u32, Rank::Other);
        let folder = new_folder("slice");
        count(&build(&folder, &one), &frame, &mut all);
    }
    let mut whole = vec![0u32; 256 * 256 * 16];
    count(&store, &frame, &mut whole);
    assert!(all == whole, "slices cover some samples twice or not at all");
    assert!(whole.iter().sum::<u32>() > 70_000);
}

fn count(store: &SceneStore, frame: &map3d_base::Frame, counts: &mut [u32]) {
    let mut tracer = BeamTracer::new(store, frame).expect("tracer");
    for (left, top) in [(64, 64), (128, 64), (64, 128), (128, 128)] {
        let result = tracer.trace(left, top, &Opaque).expect("trace");
        for p in 0..SUBTILE_PX * SUBTILE_PX {
            let (i, j) = (p % SUBTILE_PX, p / SUBTILE_PX);
            let at = ((top as usize + j) * 256 + left as usize + i) * 16;
            match result.pixel(i, j) {
                Pixel::Nothing => {}
                Pixel::One(_) => counts[at..at + 16].iter_mut().for_each(|c| *c += 1),
                Pixel::Mixed(slots) => (0..16).filter(|k| slots[*k] != u32::MAX).for_each(|k| counts[at + k] += 1),
            }
        }
    }
}

#[test]
fn rays_agree_with_beams_away_from_edges() {
    let mut dice = Dice(21);
    let mut soup = Soup::default();
    for k in 0..80 {
        let at = dice.point(14.0);
        let corner = |dice: &mut Dice| {
            let e = dice.point(7.0);
            [at[0] + e[0], at[1] + e[1], at[2] + e[2]]
        };
        soup.add([corner(&mut dice), corner(&mut dice), corner(&mut dice)], k, scenes::RANKS[k as usize % 6]);
    }
    let folder = new_folder("agree");
    let store = build(&folder, &soup);
    let rays = Rays::new(&store);
    let frame = frame(33.0, 40.0, 40.0);
    let axes: ViewAxes = frame.axes();
    let mut tracer = BeamTracer::new(&store, &frame).expect("tracer");
    let (mut compared, mut differ) = (0, 0);
    for (left, top) in [(0u64, 0u64), (64, 64), (128, 128), (64, 128)] {
        let result = tracer.trace(left, top, &Opaque).expect("trace");
        for p in (0..SUBTILE_PX * SUBTILE_PX).step_by(3) {
            let (i, j) = (p % SUBTILE_PX, p / SUBTILE_PX);
            // A whole pixel of one surface is away from edges.
            if matches!(result.pixel(i, j), Pixel::Mixed(_)) {
                continue;
            }
            let px = frame.pixel_m(0);
            let (u, v) = (frame.u0_m + (left as f64 + i as f64 + 0.5) * px, frame.v0_m - (top as f64 + j as f64 + 0.5) * px);
            let ray = Ray { origin: axes.local_from_uvd([u, v, frame.d0_m]), direction: scale(axes.forward, 2.0), width_m: px };
            let hit = rays.closest(&ray, &Opaque).expect("ray");
            let expected = result.center_slot(i, j).map(|slot| (result.surface(slot).object_id, result.depth(slot, i, j)));
            compared += 1;
            match (hit, expected) {
                (None, None) => {}
                (Some(h), Some((id, depth))) if h.object_id == id => assert!((h.distance_m * 1024.0 - f64::from(depth)).abs() <= 1.0),
                _ => differ += 1,
            }
        }
    }
    assert!(compared > 3000 && differ * 1000 < compared, "{differ} of {compared} differ");
}
