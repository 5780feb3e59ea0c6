//! Bundles against single rays, and their own laws.

mod scenes;

use map3d_base::asset::Rank;
use map3d_base::vec3::{add, normalized, scale, sub};
use map3d_base::{Vec3, vec3};
use map3d_scene::SceneStore;
use map3d_trace::{Isa, Opaque, Openness, Patch, RAYS, Ray, Rays, Surroundings};
use scenes::closed::{ball, crate_of, planted, soup_of};
use scenes::{Dice, Soup, build, mixed_soup, new_folder};

fn direction(dice: &mut Dice) -> Vec3 {
    loop {
        let d = dice.point(1.0);
        if let Some(d) = normalized(d).filter(|_| vec3::length(d) <= 1.0) {
            return d;
        }
    }
}

fn everything(store: &SceneStore, center: Vec3) -> Surroundings {
    Surroundings::gather(store, Surroundings::center_near(center), |_| true).expect("parts")
}

/// Points around a place with normals that face the direction.
fn patch(around: &Surroundings, points: &[Vec3], normal: Vec3) -> Patch {
    let mut out = Patch::default();
    points.iter().enumerate().for_each(|(k, p)| out.put(k, sub(*p, around.center()), normal));
    out
}

/// What single rays say, `None` where a millimetre to a side or along changes it.
fn settled(rays: &Rays, origin: Vec3, direction: Vec3, far_m: f64) -> Option<bool> {
    let across = normalized(vec3::cross(direction, [0.3, -0.5, 0.81])).expect("not parallel");
    let other = vec3::cross(direction, across);
    let ask = |shift: Vec3| rays.any_hit(&Ray { origin: add(origin, shift), direction, width_m: 0.0 }, far_m, &Opaque).expect("ray");
    let first = ask([0.0; 3]);
    let shifts = [across, other, direction].into_iter().flat_map(|a| [scale(a, 1e-3), scale(a, -1e-3)]);
    shifts.map(ask).all(|hit| hit == first).then_some(first)
}

#[test]
fn bundles_meet_what_single_rays_meet() {
    let (mut settled_count, mut hits) = (0, 0);
    for seed in 0..6 {
        let mut dice = Dice(seed + 11);
        let soup = mixed_soup(&mut dice, 150);
        let folder = new_folder("bundles");
        let store = build(&folder, &soup);
        let rays = Rays::new(&store);
        for _ in 0..12 {
            let (towards, at, spread) = (direction(&mut dice), dice.point(14.0), [0.1, 2.0, 20.0][dice.below(3) as usize]);
            let points: Vec<Vec3> = (0..RAYS).map(|_| add(at, dice.point(spread))).collect();
            let far_m = [0.5, 5.0, 1e6][dice.below(3) as usize];
            let around = everything(&store, at);
            let shadow = around.along(towards, 0.1, Isa::best()).expect("bundles").any_hit(&patch(&around, &points, towards), far_m, &Opaque);
            assert_eq!(shadow.sent, u64::MAX);
            for (k, p) in points.iter().enumerate() {
                if let Some(hit) = settled(&rays, *p, towards, far_m) {
                    assert_eq!(shadow.hit >> k & 1 == 1, hit, "seed {seed}: {p:?} towards {towards:?}, {far_m} m");
                    settled_count += 1;
                    hits += usize::from(hit);
                }
            }
        }
    }
    assert!(settled_count > 4_000 && hits > 1_000 && settled_count - hits > 1_000, "{hits} of {settled_count}");
}

#[test]
fn the_nearest_is_what_a_single_ray_meets_first() {
    let mut dice = Dice(5);
    let mut met = 0;
    let soup = mixed_soup(&mut dice, 120);
    let folder = new_folder("nearest");
    let store = build(&folder, &soup);
    let rays = Rays::new(&store);
    for _ in 0..20 {
        let (towards, at) = (direction(&mut dice), dice.point(14.0));
        let points: Vec<Vec3> = (0..RAYS).map(|_| add(at, dice.point(1.0))).collect();
        let around = everything(&store, at);
        let nearest = around.along(towards, 0.1, Isa::best()).expect("bundles").nearest(&patch(&around, &points, towards), 0.0, &Opaque);
        for (k, p) in points.iter().enumerate() {
            if settled(&rays, *p, towards, 1e9).is_none() {
                continue;
            }
            let single = rays.closest(&Ray { origin: *p, direction: towards, width_m: 0.0 }, &Opaque).expect("ray");
            let Some(number) = nearest.of_point[k] else {
                assert!(single.is_none(), "{p:?} towards {towards:?}");
                continue;
            };
            // By distance, since single rays prefer some classes among nearly coplanar faces.
            let corners = nearest.triangles[number as usize];
            let n = vec3::triangle_normal(corners);
            let distance = vec3::dot(n, sub(corners[0], *p)) / vec3::dot(n, towards);
            let single = single.expect("met").distance_m;
            let steep = vec3::length(n) / vec3::dot(n, towards).abs();
            if steep < 50.0 {
                assert!(distance <= single + 2e-3 * steep, "{p:?} towards {towards:?}: {distance}, single {single}");
                met += usize::from((distance - single).abs() < 2e-3 * steep);
            }
        }
    }
    assert!(met > 300, "only {met} rays met the same");
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    let mut dice = Dice(77);
    let soup = mixed_soup(&mut dice, 200);
    let folder = new_folder("isa");
    let store = build(&folder, &soup);
    for _ in 0..40 {
        let (towards, at) = (direction(&mut dice), dice.point(14.0));
        let around = everything(&store, at);
        let points: Vec<Vec3> = (0..RAYS).map(|_| add(at, dice.point(3.0))).collect();
        let from = patch(&around, &points, direction(&mut dice));
        let answers = Isa::available().into_iter().map(|isa| {
            let mut bundles = around.along(towards, 0.1, isa).expect("bundles");
            let mut openness = Openness::default();
            let shadow = bundles.any_hit(&from, 9.0, &Opaque);
            bundles.add_open(&from, 9.0, &Opaque, &mut openness);
            let nearest = bundles.nearest(&from, 0.01, &Opaque);
            let shares: [u32; RAYS] = std::array::from_fn(|k| openness.share(k).to_bits());
            (shadow, shares, openness, nearest.of_point, nearest.triangles)
        });
        let answers: Vec<_> = answers.collect();
        assert!(answers.iter().all(|a| *a == answers[0]), "{towards:?}");
    }
}

/// Towards corners, edges and anywhere; the least radius is 9 m.
#[test]
fn no_ray_gets_out_of_a_closed_mesh() {
    let mut dice = Dice(3);
    for (name, mesh) in [("ball", ball(12.0, 14, &mut dice, [0.0; 3])), ("crate", crate_of(12.0, 8))] {
        for (place, soup) in [("one chunk", soup_of(&mesh, false)), ("several chunks", soup_of(&mesh, true)), ("instances", planted(&mesh))] {
            let folder = new_folder("escape");
            let store = build(&folder, &soup);
            for round in 0..400 {
                let towards = match round % 4 {
                    0 => [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 1.0, 0.0]][round / 4 % 5],
                    _ => direction(&mut dice),
                };
                // Rays that run right through corners and edges' middles of the mesh, as it lies on the lattice.
                let corner = |dice: &mut Dice| {
                    let t = mesh[dice.below(mesh.len() as u64) as usize].map(|p| p.map(|v| (v * 4096.0 + 0.5).floor() / 4096.0));
                    let k = dice.below(3) as usize;
                    if dice.below(2) == 0 { t[k] } else { scale(add(t[k], t[(k + 1) % 3]), 0.5) }
                };
                let unit = normalized(towards).expect("a direction");
                let start = |dice: &mut Dice| {
                    let p = corner(dice);
                    let across = sub(p, scale(unit, vec3::dot(p, unit)));
                    if vec3::length(across) < 8.5 { across } else { dice.point(4.0) }
                };
                let points: Vec<Vec3> = (0..RAYS).map(|_| start(&mut dice)).collect();
                let around = everything(&store, [0.0; 3]);
                let shadow = around.along(towards, 0.1, Isa::best()).expect("bundles").any_hit(&patch(&around, &points, unit), 1e6, &Opaque);
                assert_eq!(shadow.hit, u64::MAX, "the {name} of {place}, towards {towards:?}");
            }
        }
    }
}

/// Beyond 4096 m float32 no longer holds lattice points, so corners are rounded once, alike in all chunks.
#[test]
fn far_away_edges_hold_as_well() {
    let mut dice = Dice(8);
    let mesh = ball(12.0, 14, &mut dice, [0.0; 3]);
    let soup = soup_of(&mesh, true);
    let folder = new_folder("far");
    let store = build(&folder, &soup);
    for _ in 0..100 {
        let towards = direction(&mut dice);
        let away = scale(towards, -20_000.0);
        let points: Vec<Vec3> = (0..RAYS).map(|_| add(away, dice.point(4.0))).collect();
        let around = everything(&store, away);
        let mut bundles = around.along(towards, 0.1, Isa::best()).expect("bundles");
        assert_eq!(bundles.any_hit(&patch(&around, &points, towards), 1e6, &Opaque).hit, u64::MAX, "towards {towards:?}");
        assert_eq!(bundles.any_hit(&patch(&around, &points, towards), 19_980.0, &Opaque).hit, 0, "towards {towards:?}");
    }
}

#[test]
fn only_what_faces_the_direction_sends_rays() {
    let folder = new_folder("facing");
    let store = build(&folder, &mixed_soup(&mut Dice(1), 20));
    let around = everything(&store, [0.0; 3]);
    let mut bundles = around.along([0.0, 0.0, 2.0], 0.1, Isa::best()).expect("bundles");
    let mut from = Patch::default();
    from.put(3, [0.0; 3], [0.0, 0.0, 1.0]);
    from.put(40, [0.0; 3], [0.0, 1.0, 0.0]);
    from.put(63, [0.0; 3], [0.0, 0.6, -0.8]);
    assert_eq!(bundles.any_hit(&from, 1.0, &Opaque).sent, 1 << 3);
    from.put(17, [0.0, 0.0, 5e5], [0.6, 0.0, 0.8]);
    assert_eq!(bundles.any_hit(&from, 1.0, &Opaque).sent, 1 << 3 | 1 << 17);
}

/// A point on the ground beside a long wall: half of the sky is hidden, and more near it of what lies in reach.
#[test]
fn openness_is_the_share_of_cosines() {
    let mut soup = Soup::default();
    soup.quad([[5.0, -500.0, -1.0], [5.0, 500.0, -1.0], [5.0, 500.0, 400.0], [5.0, -500.0, 400.0]], 0, Rank::Other);
    let folder = new_folder("openness");
    let store = build(&folder, &soup);
    let around = everything(&store, [0.0; 3]);
    let mut from = Patch::default();
    let places = [-1000.0, 0.0, 4.99, 5.01];
    places.iter().enumerate().for_each(|(k, x)| from.put(k * 20, sub([*x, 0.0, 0.0], around.center()), [0.0, 0.0, 1.0]));
    let mut openness = Openness::default();
    let mut dice = Dice(9);
    for _ in 0..4000 {
        let mut bundles = around.along(direction(&mut dice), 0.1, Isa::best()).expect("bundles");
        bundles.add_open(&from, 10.0, &Opaque, &mut openness);
    }
    // Near the wall its half of the hemisphere counts nothing; from further away the square of how far rays come, as a share of 10 m.
    for (k, expected) in [1.0, open_beside(0.5), 0.5, 0.5].into_iter().enumerate() {
        assert!((openness.share(k * 20) - expected).abs() < 0.02, "at {}: {}, expected {expected}", places[k], openness.share(k * 20));
    }
    assert_eq!(openness.share(1), 1.0);
}

/// The cosine-weighted mean over the hemisphere of min(1, (least/x)²) for directions of positive x, 1 for the others: directions as points (x, y) of a disc.
fn open_beside(least: f32) -> f32 {
    let count = 400;
    let middle = |k: usize| (2.0 * k as f32 + 1.0) / count as f32 - 1.0;
    let points = (0..count * count).map(|k| (middle(k % count), middle(k / count))).filter(|(x, y)| x * x + y * y < 1.0);
    let values: Vec<f32> = points.map(|(x, _)| if x > least { (least / x).powi(2) } else { 1.0 }).collect();
    values.iter().sum::<f32>() / values.len() as f32
}

#[test]
fn nothing_around_means_nothing_met() {
    let folder = new_folder("nothing");
    let store = build(&folder, &mixed_soup(&mut Dice(1), 20));
    let around = Surroundings::gather(&store, [0.0; 3], |_| false).expect("none");
    assert!(around.is_empty());
    let from = patch(&around, &[[0.0; 3]; RAYS], [0.0, 0.0, 1.0]);
    let mut bundles = around.along([0.0, 0.0, 1.0], 0.1, Isa::best()).expect("bundles");
    assert_eq!(bundles.any_hit(&from, 1e9, &Opaque).hit, 0);
    assert_eq!(bundles.nearest(&from, 0.0, &Opaque).of_point, [None; RAYS]);
    assert_eq!(bundles.any_hit(&Patch::default(), 1e9, &Opaque).sent, 0);
    assert!(around.along([0.0; 3], 0.1, Isa::best()).is_err());
    assert!(Surroundings::gather(&store, [f64::NAN; 3], |_| true).is_err());
}
