//! Suns, ambient occlusion, second surfaces and pictures (spec/pyramid.md §10): against single rays, and laws of their own.

use crate::town::{TempFolder, Town, frame, new_folder, waves};
use map3d_base::layers::{AO, COLOR, DEPTH, DEPTH2, ID, NORMAL, PICTURE, SUN, SUN16};
use map3d_base::vec3::{dot, normalized, scale};
use map3d_base::{DEPTH_NOTHING, DEPTH_UNITS_PER_M, Frame, Isa, LayerFormat, LayerKind, LayerSpec, RAY_LIFT_M, Vec3, vec3};
use map3d_image::{Arrays, GBuffer};
use map3d_render::{CPU, RenderScene, TileRenderer};

const AFTERNOON: Vec3 = [0.6, -0.48, 0.64];
const RADIUS_M: f64 = 12.0;

fn layer(kind: LayerKind) -> LayerSpec {
    let mut out = LayerSpec::new(kind, LayerFormat::Png);
    match kind {
        LayerKind::Sun => out.suns = vec![AFTERNOON],
        LayerKind::Sun16 => {
            out.suns =
                (0..16).map(|k| normalized([(f64::from(k) - 7.5) / 4.0, -1.0, 1.5 - (f64::from(k) - 7.5).abs() / 5.0]).expect("a sun")).collect()
        }
        LayerKind::Ao => out.radius_m = RADIUS_M,
        LayerKind::Picture => (out.suns, out.radius_m) = (vec![AFTERNOON], RADIUS_M),
        _ => {}
    }
    out
}

/// A courtyard: ground, a long house, a tower and a low building.
fn courtyard(name: &str) -> (TempFolder, RenderScene) {
    let mut town = Town::default();
    let (wall, red) = (town.textured(waves(64), map3d_base::asset::Wrap::Wrap), town.flat([0.9, 0.1, 0.05]));
    town.ground(60.0, 9.0, wall, 0);
    town.house([-20.0, -4.0], [25.0, 8.0, 7.0], red, 1);
    town.house([8.0, 6.0], [5.0, 5.0, 22.0], wall, 6);
    town.house([14.0, -16.0], [9.0, 9.0, 4.0], wall, 11);
    let folder = new_folder(name);
    let scene = town.open(&folder);
    (folder, scene)
}

fn with_layers(f: &Frame, kinds: &[LayerKind]) -> Frame {
    Frame { layers: kinds.iter().map(|k| layer(*k)).collect(), ..f.clone() }
}

const LIGHTS: [LayerKind; 5] = [LayerKind::Sun, LayerKind::Sun16, LayerKind::Ao, LayerKind::Depth2, LayerKind::Picture];
const ALL: [LayerKind; 9] = [
    LayerKind::Color,
    LayerKind::Normal,
    LayerKind::Id,
    LayerKind::Depth,
    LayerKind::Sun,
    LayerKind::Sun16,
    LayerKind::Ao,
    LayerKind::Depth2,
    LayerKind::Picture,
];

/// Returns the pixels whose neighbours show the same object.
fn inner(g: &GBuffer) -> impl Iterator<Item = usize> {
    let w = g.width as usize;
    let same = move |p: usize, q: usize| g[ID][p] == g[ID][q];
    let all = (0..g[ID].len()).filter(move |p| p % w > 1 && p % w + 2 < w && p / w > 1 && p / w + 2 < w);
    all.filter(move |p| g[ID][*p] != 0 && [1, 2, w, 2 * w].iter().all(|d| same(*p, p - d) && same(*p, p + d)))
}

/// Returns the local point and the geometric normal of a pixel; the faces of this town have no shading normals.
fn point(f: &Frame, g: &GBuffer, p: usize) -> (Vec3, Vec3) {
    let tile = map3d_base::tile::Tile { z: 0, x: 0, y: 0 };
    let (u, v) = f.uv_of_pixel(tile, p as u32 % g.width, p as u32 / g.width);
    let at = f.axes().local_from_uvd([u, v, f.d0_m + f64::from(g[DEPTH][p]) / DEPTH_UNITS_PER_M]);
    (at, normalized(g[NORMAL][p].map(f64::from)).expect("a normal"))
}

fn lifted((at, n): (Vec3, Vec3)) -> Vec3 {
    vec3::add(at, scale(n, RAY_LIFT_M))
}

/// Returns whether single rays from a point reach a sun, or `None` near the edge of a shadow.
fn is_lit(scene: &RenderScene, (at, n): (Vec3, Vec3), sun: Vec3) -> Option<bool> {
    if dot(n, sun) <= 0.0 || sun[2] <= 0.0 {
        return Some(false);
    }
    let around: Vec<Vec3> =
        [[0.0; 3], [0.01, 0.0, 0.0], [-0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, -0.01, 0.0]].map(|d| vec3::add(lifted((at, n)), d)).to_vec();
    let hits = scene.occluded(&around, sun, f64::INFINITY).expect("rays");
    hits.iter().all(|h| *h == hits[0]).then_some(!hits[0])
}

#[test]
fn suns_light_the_points_from_which_single_rays_reach_them() {
    let (_folder, scene) = courtyard("suns");
    for (look_at, pitch) in [(20.0, 45.0), (200.0, 30.0), (0.0, 90.0)] {
        let f = with_layers(&frame(look_at, pitch, 80.0, 0), &ALL);
        let g = scene.gbuffer(&f, 0, 0).expect("renders");
        let suns = &f.layer(LayerKind::Sun16).expect("asked for").suns;
        let (mut checked, mut dark) = (0, 0);
        for p in inner(&g).step_by(7) {
            let at = point(&f, &g, p);
            if let Some(lit) = is_lit(&scene, at, AFTERNOON) {
                assert_eq!(g[SUN][p], if lit { 255 } else { 0 }, "pixel {p} of {look_at}/{pitch}");
                checked += 1;
                dark += usize::from(!lit);
            }
            for k in [0, 5, 8, 15] {
                if let Some(lit) = is_lit(&scene, at, suns[k]) {
                    assert_eq!(g[SUN16][p] >> k & 1 == 1, lit, "sun {k}, pixel {p} of {look_at}/{pitch}");
                }
            }
        }
        assert!(checked > 2_000 && dark > 200 && checked - dark > 200, "{dark} of {checked} dark");
        let night = suns.iter().map(|s| u16::from(s[2] <= 0.0)).enumerate().fold(0, |mask, (k, n)| mask | n << k);
        assert!(night != 0 && g[SUN16].iter().all(|bits| bits & night == 0), "suns below the horizon");
        assert!(g[COLOR].iter().zip(&g[SUN]).all(|(c, sun)| c[3] != 0 || *sun == 255), "empty pixels are lit");
    }
}

/// Compares with single rays in many more directions.
#[test]
fn ambient_occlusion_is_the_mean_visibility() {
    let (_folder, scene) = courtyard("ao");
    let f = with_layers(&frame(20.0, 45.0, 80.0, 0), &ALL);
    let g = scene.gbuffer(&f, 0, 0).expect("renders");
    let directions: Vec<Vec3> = (0..1500)
        .map(|n| {
            let (z, turn) = (1.0 - (2.0 * f64::from(n) + 1.0) / 1500.0, f64::from(n) * 2.399_963);
            [(1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin(), z]
        })
        .collect();
    let rays = map3d_trace::Rays::new(scene.store());
    let (mut worst, mut sum, mut count, mut darkest) = (0f64, 0.0, 0, 255u8);
    for p in inner(&g).step_by(431) {
        let (at, n) = point(&f, &g, p);
        let (mut visible, mut total) = (0.0, 0.0);
        for d in directions.iter().filter(|d| dot(**d, n) > 0.0) {
            let ray = map3d_trace::Ray { origin: lifted((at, n)), direction: *d, width_m: 0.0 };
            let hit = rays.closest_hit(&ray, &map3d_trace::IgnoreCutouts).expect("ray");
            let distance = hit.map_or(1.0, |h| (h.distance_m / RADIUS_M).min(1.0));
            (visible, total) = (visible + dot(*d, n) * distance * distance, total + dot(*d, n));
        }
        let error = (f64::from(g[AO][p]) / 255.0 - visible / total).abs();
        (worst, sum, count, darkest) = (worst.max(error), sum + error, count + 1, darkest.min(g[AO][p]));
    }
    assert!(count > 60 && darkest < 190, "{count} points, the darkest {darkest}");
    assert!(worst < 0.09 && sum / f64::from(count) < 0.02, "worst {worst}, mean {}", sum / f64::from(count));
}

#[test]
fn second_surface_is_the_next_hit_of_a_single_ray() {
    let (_folder, scene) = courtyard("behind");
    let f = with_layers(&frame(20.0, 40.0, 80.0, 0), &ALL);
    let g = scene.gbuffer(&f, 0, 0).expect("renders");
    let rays = map3d_trace::Rays::new(scene.store());
    let forward = f.axes().forward;
    let (mut found, mut nothing) = (0, 0);
    for p in inner(&g).step_by(5) {
        let (at, _) = point(&f, &g, p);
        let ray = |near_m: f64| map3d_trace::Ray { origin: vec3::add(at, scale(forward, near_m)), direction: forward, width_m: 0.0 };
        let hit = rays.closest_hit(&ray(0.0635), &map3d_trace::IgnoreCutouts).expect("ray");
        match hit {
            None => {
                assert_eq!(g[DEPTH2][p], DEPTH_NOTHING, "pixel {p}");
                nothing += 1;
            }
            Some(h) => {
                let expected = f64::from(g[DEPTH][p]) + (0.0635 + h.distance_m) * DEPTH_UNITS_PER_M;
                // Single rays start at a rounded depth.
                if (f64::from(g[DEPTH2][p]) - expected).abs() <= 2.0 {
                    found += 1;
                } else {
                    let side = rays.closest_hit(
                        &map3d_trace::Ray { origin: vec3::add(ray(0.0635).origin, scale(f.axes().right, 0.02)), ..ray(0.0) },
                        &map3d_trace::IgnoreCutouts,
                    );
                    let shifted = side.expect("ray").map_or(f64::INFINITY, |s| s.distance_m);
                    assert!((shifted - h.distance_m).abs() > 0.5, "pixel {p}: {} for {expected}", g[DEPTH2][p]);
                }
            }
        }
    }
    assert!(found > 500 && nothing > 500, "{found} found, {nothing} nothing");
}

#[test]
fn picture_is_colour_times_light() {
    let (_folder, scene) = courtyard("picture");
    let f = with_layers(&frame(20.0, 45.0, 80.0, 0), &ALL);
    let g = scene.gbuffer(&f, 0, 0).expect("renders");
    let mut count = 0;
    for p in inner(&g) {
        let (_, n) = point(&f, &g, p);
        let light = 0.42 * f64::from(g[AO][p]) / 255.0 + 0.76 * dot(n, AFTERNOON).max(0.0) * f64::from(g[SUN][p]) / 255.0;
        for c in 0..3 {
            let expected = (f64::from(g[COLOR][p][c]) * light).min(65_535.0);
            assert!(
                (f64::from(g[PICTURE][p][c]) - expected).abs() < 0.003 * f64::from(g[COLOR][p][c]) + 2.0,
                "pixel {p}: {:?}, light {light}",
                g[PICTURE][p]
            );
        }
        count += 1;
    }
    assert!(count > 10_000);
    assert!(g[COLOR].iter().zip(&g[PICTURE]).all(|(a, b)| a[3] == b[3]), "coverage");
}

/// Suns and ambient occlusion are means over a pixel's samples, so a pixel on an edge is neither darker nor lighter than its surfaces.
#[test]
fn edge_pixels_are_between_their_neighbours() {
    let (_folder, scene) = courtyard("edges");
    let f = with_layers(&frame(20.0, 45.0, 80.0, 0), &ALL);
    let g = scene.gbuffer(&f, 0, 0).expect("renders");
    let w = g.width as usize;
    let mut mixed = 0;
    for p in (w + 1..g[SUN].len() - w - 1).filter(|p| g[SUN][*p] != 0 && g[SUN][*p] != 255) {
        let around = [p - w - 1, p - w, p - w + 1, p - 1, p + 1, p + w - 1, p + w, p + w + 1].map(|q| g[SUN][q]);
        let sides = (around.iter().min().expect("eight"), around.iter().max().expect("eight"));
        mixed += usize::from(*sides.0 <= g[SUN][p] && g[SUN][p] <= *sides.1);
        assert!(g[COLOR][p][3] > 0);
    }
    assert!(mixed > 30, "{mixed} pixels are partly lit");
}

#[test]
fn pass_has_only_its_own_arrays_with_equal_values() {
    let (_folder, scene) = courtyard("pass");
    let f = frame(200.0, 45.0, 80.0, 0);
    let whole = scene.gbuffer(&with_layers(&f, &ALL), 0, 0).expect("renders");
    for kind in LIGHTS {
        let alone = scene.gbuffer(&with_layers(&f, &[kind]), 0, 0).expect("renders");
        assert_eq!(alone.arrays(), Arrays::LEAST.and(kind), "{kind:?}");
        let mut expected = whole.clone();
        expected.keep(alone.arrays());
        assert_eq!(alone, expected, "{kind:?}");
    }
    let standard = scene.gbuffer(&f, 0, 0).expect("renders");
    let mut expected = whole;
    expected.keep(Arrays::STANDARD);
    assert_eq!(standard, expected);
}

#[test]
fn light_does_not_depend_on_the_instruction_set() {
    let (_folder, scene) = courtyard("isa");
    let f = with_layers(&frame(75.0, 35.0, 80.0, 0), &ALL);
    let render = |isa| TileRenderer::with_isa(&scene, &f, isa).expect("frame").tile(0, 0).expect("renders").expect("content");
    let all: Vec<GBuffer> = Isa::available().into_iter().map(render).collect();
    assert!(all.iter().all(|g| *g == all[0]));
}

#[test]
fn light_does_not_depend_on_tiling() {
    let (_folder, scene) = courtyard("tiling");
    let small = with_layers(&frame(33.0, 40.0, 120.0, 1), &LIGHTS);
    let large = Frame { tile_px: 512, zmax: 0, ..small.clone() };
    let big = scene.gbuffer(&large, 0, 0).expect("renders");
    for k in 0..4usize {
        let g = scene.gbuffer(&small, k as u32 % 2, k as u32 / 2).expect("renders");
        for p in 0..256 * 256 {
            let q = (p / 256 + k / 2 * 256) * 512 + p % 256 + k % 2 * 256;
            assert_eq!(
                (g[SUN][p], g[SUN16][p], g[AO][p], g[DEPTH2][p], g[PICTURE][p]),
                (big[SUN][q], big[SUN16][q], big[AO][q], big[DEPTH2][q], big[PICTURE][q])
            );
        }
    }
}

/// Block keys cover objects that cast a shadow or occlude ambient light.
#[test]
fn keys_change_where_a_shadow_falls() {
    let block = |k: u32| [k % 8, k / 8];
    let places: Vec<[u32; 2]> = (0..64).map(block).collect();
    let keys = |tower_m: f64, kind: LayerKind| {
        let mut town = Town::default();
        let grey = town.flat([0.5; 3]);
        town.ground(60.0, 1.0, grey, 0);
        town.house([7.5, 7.5], [1.0, 1.0, tower_m], grey, 1);
        let folder = new_folder("shadow");
        let scene = town.open(&folder);
        let mut f = frame(0.0, 90.0, 128.0, 6);
        f.layers = vec![layer(kind)];
        scene.block_keys(&f, CPU, 3, &places).expect("keys")
    };
    let changed = |kind: LayerKind| -> Vec<[u32; 2]> {
        let (a, b) = (keys(30.0, kind), keys(31.0, kind));
        (0..64).filter(|k| a[*k as usize] != b[*k as usize]).map(block).collect()
    };
    // Blocks of 16 m; seen from above, the tower stands in column 4, row 3.
    let tower = changed(LayerKind::Id);
    assert_eq!(tower, [[4, 3]]);
    let shadow = changed(LayerKind::Sun);
    let (away, height) = (scale(AFTERNOON, -1.0 / AFTERNOON[2]), 31.0);
    for step in 0..=20 {
        let at = scale(away, height * f64::from(step) / 20.0);
        let place = [((at[0] + 72.0) / 16.0) as u32, ((56.0 - at[1]) / 16.0) as u32];
        assert!(shadow.contains(&place), "the shadow falls on {place:?}, not among {shadow:?}");
    }
    assert!(shadow.len() <= 10, "{shadow:?}");
    let near = changed(LayerKind::Ao);
    assert_eq!(near.len(), 9, "{near:?}");
}

#[test]
fn frames_with_invalid_lights_are_rejected() {
    let f = frame(0.0, 45.0, 80.0, 0);
    let is_rejected = |spec: LayerSpec| Frame { layers: vec![spec], ..f.clone() }.validate().is_err();
    assert!(is_rejected(LayerSpec { suns: vec![], ..layer(LayerKind::Sun) }));
    assert!(is_rejected(LayerSpec { suns: vec![AFTERNOON; 2], ..layer(LayerKind::Sun) }));
    assert!(is_rejected(LayerSpec { suns: vec![[0.0, 0.0, 2.0]], ..layer(LayerKind::Sun) }));
    assert!(is_rejected(LayerSpec { suns: vec![[f64::NAN, 0.0, 1.0]], ..layer(LayerKind::Sun) }));
    assert!(is_rejected(LayerSpec { suns: vec![AFTERNOON; 17], ..layer(LayerKind::Sun16) }));
    assert!(is_rejected(LayerSpec { suns: vec![AFTERNOON], ..layer(LayerKind::Depth2) }));
    for radius_m in [0.0, -1.0, f64::NAN, f64::INFINITY, 1001.0] {
        assert!(is_rejected(LayerSpec { radius_m, ..layer(LayerKind::Ao) }), "{radius_m}");
    }
    assert!(Frame { layers: vec![layer(LayerKind::Ao), layer(LayerKind::Ao)], ..f.clone() }.validate().is_err());
    assert!(with_layers(&f, &ALL).validate().is_ok());
}
