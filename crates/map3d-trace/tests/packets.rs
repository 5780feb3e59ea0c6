//! Ray packets against single rays, and laws of their own.

use crate::scenes::closed::{as_prototypes, box_mesh, soup_from, sphere_mesh};
use crate::scenes::{Lcg, Soup, build, mixed_soup, new_folder};
use map3d_base::asset::Rank;
use map3d_base::vec3::{add, normalized, scale, sub};
use map3d_base::{Vec3, vec3};
use map3d_scene::SceneStore;
use map3d_trace::{AmbientOcclusion, IgnoreCutouts, Isa, PACKET_SIZE, PacketOrigins, Ray, Rays, SceneRegion};

fn direction(random: &mut Lcg) -> Vec3 {
    loop {
        let d = random.point(1.0);
        if let Some(d) = normalized(d).filter(|_| vec3::length(d) <= 1.0) {
            return d;
        }
    }
}

fn whole_scene(store: &SceneStore, center: Vec3) -> SceneRegion {
    SceneRegion::open(store, SceneRegion::snap_center(center), |_| true).expect("parts")
}

/// Returns origins at local points that share a normal.
fn origins_at(region: &SceneRegion, points: &[Vec3], normal: Vec3) -> PacketOrigins {
    let mut out = PacketOrigins::default();
    points.iter().enumerate().for_each(|(k, p)| out.set(k, sub(*p, region.center()), normal));
    out
}

/// Returns whether a single ray hits anything, or `None` if shifting it by a millimetre changes the result.
fn stable_hit(rays: &Rays, origin: Vec3, direction: Vec3, far_m: f64) -> Option<bool> {
    let across = normalized(vec3::cross(direction, [0.3, -0.5, 0.81])).expect("not parallel");
    let other = vec3::cross(direction, across);
    let hits = |shift: Vec3| rays.any_hit(&Ray { origin: add(origin, shift), direction, width_m: 0.0 }, far_m, &IgnoreCutouts).expect("ray");
    let first = hits([0.0; 3]);
    let shifts = [across, other, direction].into_iter().flat_map(|a| [scale(a, 1e-3), scale(a, -1e-3)]);
    shifts.map(hits).all(|hit| hit == first).then_some(first)
}

#[test]
fn any_hit_agrees_with_single_rays() {
    let (mut compared, mut hits) = (0, 0);
    for seed in 0..6 {
        let mut random = Lcg(seed + 11);
        let soup = mixed_soup(&mut random, 150);
        let folder = new_folder("packets");
        let store = build(&folder, &soup);
        let rays = Rays::new(&store);
        for _ in 0..12 {
            let (towards, at, spread) = (direction(&mut random), random.point(14.0), [0.1, 2.0, 20.0][random.below(3) as usize]);
            let points: Vec<Vec3> = (0..PACKET_SIZE).map(|_| add(at, random.point(spread))).collect();
            let far_m = [0.5, 5.0, 1e6][random.below(3) as usize];
            let region = whole_scene(&store, at);
            let result = region.packets_along(towards, 0.1, Isa::best()).expect("packets").any_hit(
                &origins_at(&region, &points, towards),
                far_m,
                &IgnoreCutouts,
            );
            assert_eq!(result.sent, u64::MAX);
            for (k, p) in points.iter().enumerate() {
                if let Some(hit) = stable_hit(&rays, *p, towards, far_m) {
                    assert_eq!(result.hit >> k & 1 == 1, hit, "seed {seed}: {p:?} towards {towards:?}, {far_m} m");
                    compared += 1;
                    hits += usize::from(hit);
                }
            }
        }
    }
    assert!(compared > 4_000 && hits > 1_000 && compared - hits > 1_000, "{hits} of {compared}");
}

#[test]
fn closest_hits_agree_with_single_rays() {
    let mut random = Lcg(5);
    let mut agreeing = 0;
    let soup = mixed_soup(&mut random, 120);
    let folder = new_folder("closest");
    let store = build(&folder, &soup);
    let rays = Rays::new(&store);
    for _ in 0..20 {
        let (towards, at) = (direction(&mut random), random.point(14.0));
        let points: Vec<Vec3> = (0..PACKET_SIZE).map(|_| add(at, random.point(1.0))).collect();
        let region = whole_scene(&store, at);
        let closest = region.packets_along(towards, 0.1, Isa::best()).expect("packets").closest_hits(
            &origins_at(&region, &points, towards),
            0.0,
            &IgnoreCutouts,
        );
        for (k, p) in points.iter().enumerate() {
            if stable_hit(&rays, *p, towards, 1e9).is_none() {
                continue;
            }
            let single = rays.closest_hit(&Ray { origin: *p, direction: towards, width_m: 0.0 }, &IgnoreCutouts).expect("ray");
            let Some(number) = closest.triangle_of_ray[k] else {
                assert!(single.is_none(), "{p:?} towards {towards:?}");
                continue;
            };
            // By distance, since single rays prefer some classes among nearly coplanar faces.
            let corners = closest.triangles[number as usize];
            let n = vec3::triangle_normal(corners);
            let distance = vec3::dot(n, sub(corners[0], *p)) / vec3::dot(n, towards);
            let single = single.expect("a hit").distance_m;
            let steep = vec3::length(n) / vec3::dot(n, towards).abs();
            if steep < 50.0 {
                assert!(distance <= single + 2e-3 * steep, "{p:?} towards {towards:?}: {distance}, single {single}");
                agreeing += usize::from((distance - single).abs() < 2e-3 * steep);
            }
        }
    }
    assert!(agreeing > 300, "only {agreeing} rays agree");
}

#[test]
fn all_instruction_sets_give_equal_bits() {
    let mut random = Lcg(77);
    let soup = mixed_soup(&mut random, 200);
    let folder = new_folder("isa");
    let store = build(&folder, &soup);
    for _ in 0..40 {
        let (towards, at) = (direction(&mut random), random.point(14.0));
        let region = whole_scene(&store, at);
        let points: Vec<Vec3> = (0..PACKET_SIZE).map(|_| add(at, random.point(3.0))).collect();
        let from = origins_at(&region, &points, direction(&mut random));
        let results = Isa::available().into_iter().map(|isa| {
            let mut packets = region.packets_along(towards, 0.1, isa).expect("packets");
            let mut ao = AmbientOcclusion::default();
            let result = packets.any_hit(&from, 9.0, &IgnoreCutouts);
            packets.accumulate_ao(&from, 9.0, &IgnoreCutouts, &mut ao);
            let closest = packets.closest_hits(&from, 0.01, &IgnoreCutouts);
            let visibilities: [u32; PACKET_SIZE] = std::array::from_fn(|k| ao.visibility(k).to_bits());
            (result, visibilities, ao, closest.triangle_of_ray, closest.triangles)
        });
        let results: Vec<_> = results.collect();
        assert!(results.iter().all(|r| *r == results[0]), "{towards:?}");
    }
}

/// Rays towards corners, edges and random points; the least radius is 9 m.
#[test]
fn no_ray_escapes_a_closed_mesh() {
    let mut random = Lcg(3);
    for (name, mesh) in [("sphere", sphere_mesh(12.0, 14, &mut random, [0.0; 3])), ("box", box_mesh(12.0, 8))] {
        for (place, soup) in [("one chunk", soup_from(&mesh, false)), ("several chunks", soup_from(&mesh, true)), ("instances", as_prototypes(&mesh))]
        {
            let folder = new_folder("escape");
            let store = build(&folder, &soup);
            for round in 0..400 {
                let towards = match round % 4 {
                    0 => [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 1.0, 0.0]][round / 4 % 5],
                    _ => direction(&mut random),
                };
                // Rays exactly through the mesh's corners and the middles of its edges, on the lattice.
                let corner = |random: &mut Lcg| {
                    let t = mesh[random.below(mesh.len() as u64) as usize].map(|p| p.map(|v| (v * 4096.0 + 0.5).floor() / 4096.0));
                    let k = random.below(3) as usize;
                    if random.below(2) == 0 { t[k] } else { scale(add(t[k], t[(k + 1) % 3]), 0.5) }
                };
                let unit = normalized(towards).expect("a direction");
                let start = |random: &mut Lcg| {
                    let p = corner(random);
                    let across = sub(p, scale(unit, vec3::dot(p, unit)));
                    if vec3::length(across) < 8.5 { across } else { random.point(4.0) }
                };
                let points: Vec<Vec3> = (0..PACKET_SIZE).map(|_| start(&mut random)).collect();
                let region = whole_scene(&store, [0.0; 3]);
                let result = region.packets_along(towards, 0.1, Isa::best()).expect("packets").any_hit(
                    &origins_at(&region, &points, unit),
                    1e6,
                    &IgnoreCutouts,
                );
                assert_eq!(result.hit, u64::MAX, "the {name} of {place}, towards {towards:?}");
            }
        }
    }
}

/// Beyond 4096 m float32 does not represent lattice points exactly; corners are rounded once, equally in all chunks.
#[test]
fn no_ray_escapes_a_distant_closed_mesh() {
    let mut random = Lcg(8);
    let mesh = sphere_mesh(12.0, 14, &mut random, [0.0; 3]);
    let soup = soup_from(&mesh, true);
    let folder = new_folder("far");
    let store = build(&folder, &soup);
    for _ in 0..100 {
        let towards = direction(&mut random);
        let away = scale(towards, -20_000.0);
        let points: Vec<Vec3> = (0..PACKET_SIZE).map(|_| add(away, random.point(4.0))).collect();
        let region = whole_scene(&store, away);
        let mut packets = region.packets_along(towards, 0.1, Isa::best()).expect("packets");
        assert_eq!(packets.any_hit(&origins_at(&region, &points, towards), 1e6, &IgnoreCutouts).hit, u64::MAX, "towards {towards:?}");
        assert_eq!(packets.any_hit(&origins_at(&region, &points, towards), 19_980.0, &IgnoreCutouts).hit, 0, "towards {towards:?}");
    }
}

#[test]
fn only_points_that_face_the_direction_send_rays() {
    let folder = new_folder("facing");
    let store = build(&folder, &mixed_soup(&mut Lcg(1), 20));
    let region = whole_scene(&store, [0.0; 3]);
    let mut packets = region.packets_along([0.0, 0.0, 2.0], 0.1, Isa::best()).expect("packets");
    let mut from = PacketOrigins::default();
    from.set(3, [0.0; 3], [0.0, 0.0, 1.0]);
    from.set(40, [0.0; 3], [0.0, 1.0, 0.0]);
    from.set(63, [0.0; 3], [0.0, 0.6, -0.8]);
    assert_eq!(packets.any_hit(&from, 1.0, &IgnoreCutouts).sent, 1 << 3);
    from.set(17, [0.0, 0.0, 5e5], [0.6, 0.0, 0.8]);
    assert_eq!(packets.any_hit(&from, 1.0, &IgnoreCutouts).sent, 1 << 3 | 1 << 17);
}

/// Points on the ground in front of a long wall that hides half of the sky.
#[test]
fn visibility_is_the_cosine_weighted_mean_over_rays() {
    let mut soup = Soup::default();
    soup.quad([[5.0, -500.0, -1.0], [5.0, 500.0, -1.0], [5.0, 500.0, 400.0], [5.0, -500.0, 400.0]], 0, Rank::Other);
    let folder = new_folder("ao");
    let store = build(&folder, &soup);
    let region = whole_scene(&store, [0.0; 3]);
    let mut from = PacketOrigins::default();
    let positions = [-1000.0, 0.0, 4.99, 5.01];
    positions.iter().enumerate().for_each(|(k, x)| from.set(k * 20, sub([*x, 0.0, 0.0], region.center()), [0.0, 0.0, 1.0]));
    let mut ao = AmbientOcclusion::default();
    let mut random = Lcg(9);
    for _ in 0..4000 {
        let mut packets = region.packets_along(direction(&mut random), 0.1, Isa::best()).expect("packets");
        packets.accumulate_ao(&from, 10.0, &IgnoreCutouts, &mut ao);
    }
    // Close to the wall, its half of the hemisphere is invisible; farther away its visibility is (t/10 m)².
    for (k, expected) in [1.0, visibility_at_wall(0.5), 0.5, 0.5].into_iter().enumerate() {
        assert!((ao.visibility(k * 20) - expected).abs() < 0.02, "at {}: {}, expected {expected}", positions[k], ao.visibility(k * 20));
    }
    assert_eq!(ao.visibility(1), 1.0);
}

/// The cosine-weighted mean over the hemisphere of min(1, (least/x)²) for directions of positive x, 1 for the others: directions as points (x, y) of a disc.
fn visibility_at_wall(least: f32) -> f32 {
    let count = 400;
    let middle = |k: usize| (2.0 * k as f32 + 1.0) / count as f32 - 1.0;
    let points = (0..count * count).map(|k| (middle(k % count), middle(k / count))).filter(|(x, y)| x * x + y * y < 1.0);
    let values: Vec<f32> = points.map(|(x, _)| if x > least { (least / x).powi(2) } else { 1.0 }).collect();
    values.iter().sum::<f32>() / values.len() as f32
}

#[test]
fn empty_region_has_no_hits() {
    let folder = new_folder("empty");
    let store = build(&folder, &mixed_soup(&mut Lcg(1), 20));
    let region = SceneRegion::open(&store, [0.0; 3], |_| false).expect("none");
    assert!(region.is_empty());
    let from = origins_at(&region, &[[0.0; 3]; PACKET_SIZE], [0.0, 0.0, 1.0]);
    let mut packets = region.packets_along([0.0, 0.0, 1.0], 0.1, Isa::best()).expect("packets");
    assert_eq!(packets.any_hit(&from, 1e9, &IgnoreCutouts).hit, 0);
    assert_eq!(packets.closest_hits(&from, 0.0, &IgnoreCutouts).triangle_of_ray, [None; PACKET_SIZE]);
    assert_eq!(packets.any_hit(&PacketOrigins::default(), 1e9, &IgnoreCutouts).sent, 0);
    assert!(region.packets_along([0.0; 3], 0.1, Isa::best()).is_err());
    assert!(SceneRegion::open(&store, [f64::NAN; 3], |_| true).is_err());
}
