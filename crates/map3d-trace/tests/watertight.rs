//! Shared edges have neither cracks nor double hits, also across chunks and instances.

use crate::scenes::closed::{as_prototypes, box_mesh, soup_from, sphere_mesh};
use crate::scenes::{Lcg, Soup, build, frame, new_folder};
use map3d_base::ViewAxes;
use map3d_base::asset::Rank;
use map3d_base::vec3::{normalized, scale};
use map3d_scene::SceneStore;
use map3d_trace::{BeamTracer, IgnoreCutouts, NOTHING, Pixel, Ray, Rays, SUBTILE_PX};

/// Returns look-at angles and pitches: along axes and diagonals, straight down, steep and grazing; then random ones.
fn directions(random: &mut Lcg) -> Vec<(f64, f64)> {
    let along = [0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0];
    let pitches = [90.0, 89.999, 60.0, 45.0, 30.0, 5.0, 0.5, 0.001];
    let mut out: Vec<(f64, f64)> = along.into_iter().flat_map(|a| pitches.map(|p| (a, p))).collect();
    out.extend((0..200 - out.len()).map(|_| (random.between(0.0, 360.0), random.between(0.0, 1.0).asin().to_degrees().max(0.1))));
    out
}

/// Returns the first view (look-at angle, pitch) and pixel with an uncovered sample near the middle.
fn first_hole(store: &SceneStore, directions: &[(f64, f64)], radius_px: f64) -> Option<((f64, f64), usize)> {
    directions.iter().find_map(|&(look_at, pitch)| {
        let frame = frame(look_at, pitch, 64.0);
        let mut tracer = BeamTracer::new(store, &frame).expect("tracer");
        let result = tracer.trace(96, 96, &IgnoreCutouts).expect("trace");
        let is_hole = |p: &usize| match result.pixel(p % SUBTILE_PX, p / SUBTILE_PX) {
            Pixel::Nothing => true,
            Pixel::One(_) => false,
            Pixel::Mixed(slots) => slots.contains(&NOTHING),
        };
        let is_inside = |p: &usize| ((p % SUBTILE_PX) as f64 - 31.5).hypot((p / SUBTILE_PX) as f64 - 31.5) < radius_px;
        (0..SUBTILE_PX * SUBTILE_PX).filter(is_inside).find(is_hole).map(|p| ((look_at, pitch), p))
    })
}

#[test]
fn closed_mesh_has_no_hole_from_any_side() {
    let mut random = Lcg(3);
    let directions = directions(&mut random);
    assert_eq!(directions.len(), 200);
    for (name, mesh) in [("sphere", sphere_mesh(12.0, 14, &mut random, [0.0; 3])), ("box", box_mesh(12.0, 8))] {
        let scenes = [("one chunk", soup_from(&mesh, false)), ("several chunks", soup_from(&mesh, true)), ("instances", as_prototypes(&mesh))];
        for (place, soup) in scenes {
            let folder = new_folder("closed");
            let store = build(&folder, &soup);
            let near = store.parts().iter().filter(|p| p.bounds.lo[0].abs() < 100.0).count();
            assert!(near >= [("one chunk", 1), ("several chunks", 4), ("instances", 3)].into_iter().find(|n| n.0 == place).expect("named").1);
            // Within 8.5 m of the middle; the least radius of each mesh is at least 9 m.
            assert_eq!(first_hole(&store, &directions, 34.0), None, "a hole in the {name} of {place}");
        }
    }
}

#[test]
fn no_ray_escapes_a_closed_mesh() {
    let mut random = Lcg(8);
    let folder = new_folder("rays");
    let triangles = sphere_mesh(12.0, 10, &mut random, [0.0; 3]);
    let store = build(&folder, &soup_from(&triangles, true));
    let rays = Rays::new(&store);
    for k in 0..3000 {
        // From the inside towards corners, the middles of edges and random points.
        let t = triangles[random.below(triangles.len() as u64) as usize];
        let snapped = t.map(|p| p.map(|v| (v * 4096.0 + 0.5).floor() / 4096.0));
        let target = match k % 3 {
            0 => snapped[0],
            1 => [0, 1, 2].map(|a| (snapped[0][a] + snapped[1][a]) / 2.0),
            _ => random.point(10.0),
        };
        let Some(direction) = normalized(target) else { continue };
        let ray = Ray { origin: [0.0; 3], direction, width_m: 0.0 };
        let hit = rays.closest_hit(&ray, &IgnoreCutouts).expect("ray").expect("the sphere is closed");
        assert!((9.0..14.0).contains(&hit.distance_m), "{}", hit.distance_m);
        assert!(rays.any_hit(&ray, 20.0, &IgnoreCutouts).expect("ray") && !rays.any_hit(&ray, 5.0, &IgnoreCutouts).expect("ray"));
    }
}

#[test]
fn each_sample_of_a_fan_is_covered_once() {
    // A flat disc of slices that belong to different objects: only one of two neighbours covers a sample on their edge.
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
        let result = tracer.trace(left, top, &IgnoreCutouts).expect("trace");
        for p in 0..SUBTILE_PX * SUBTILE_PX {
            let (i, j) = (p % SUBTILE_PX, p / SUBTILE_PX);
            let at = ((top as usize + j) * 256 + left as usize + i) * 16;
            match result.pixel(i, j) {
                Pixel::Nothing => {}
                Pixel::One(_) => counts[at..at + 16].iter_mut().for_each(|c| *c += 1),
                Pixel::Mixed(slots) => (0..16).filter(|k| slots[*k] != NOTHING).for_each(|k| counts[at + k] += 1),
            }
        }
    }
}

#[test]
fn rays_agree_with_beams_away_from_edges() {
    let mut random = Lcg(21);
    let mut soup = Soup::default();
    for k in 0..80 {
        let at = random.point(14.0);
        let corner = |random: &mut Lcg| {
            let e = random.point(7.0);
            [at[0] + e[0], at[1] + e[1], at[2] + e[2]]
        };
        soup.add([corner(&mut random), corner(&mut random), corner(&mut random)], k, crate::scenes::RANKS[k as usize % 6]);
    }
    let folder = new_folder("agree");
    let store = build(&folder, &soup);
    let rays = Rays::new(&store);
    let frame = frame(33.0, 40.0, 40.0);
    let axes: ViewAxes = frame.axes();
    let mut tracer = BeamTracer::new(&store, &frame).expect("tracer");
    let (mut compared, mut differ) = (0, 0);
    for (left, top) in [(0u64, 0u64), (64, 64), (128, 128), (64, 128)] {
        let result = tracer.trace(left, top, &IgnoreCutouts).expect("trace");
        for p in (0..SUBTILE_PX * SUBTILE_PX).step_by(3) {
            let (i, j) = (p % SUBTILE_PX, p / SUBTILE_PX);
            // Pixels with several surfaces are on edges.
            if matches!(result.pixel(i, j), Pixel::Mixed(_)) {
                continue;
            }
            let px = frame.pixel_m(0);
            let (u, v) = (frame.u0_m + (left as f64 + i as f64 + 0.5) * px, frame.v0_m - (top as f64 + j as f64 + 0.5) * px);
            let ray = Ray { origin: axes.local_from_uvd([u, v, frame.d0_m]), direction: scale(axes.forward, 2.0), width_m: px };
            let hit = rays.closest_hit(&ray, &IgnoreCutouts).expect("ray");
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
