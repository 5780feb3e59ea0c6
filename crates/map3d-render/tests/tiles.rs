//! Base tiles against the reference renderer.

use crate::town::reference_renderer::{ReferenceRenderer, SampleHit};
use crate::town::{Town, bricks, frame, new_folder, waves};
use map3d_base::asset::{Rank, Wrap};
use map3d_base::layers::{COLOR, DEPTH, ID, NORMAL};
use map3d_base::{DEPTH_NOTHING, Frame};
use map3d_image::srgb::BYTE;
use map3d_image::{GBuffer, Raster};

const VIEWS: [(f64, f64); 5] = [(0.0, 45.0), (45.0, 22.5), (117.3, 10.0), (200.0, 90.0), (290.0, 60.0)];

fn houses() -> Town {
    let mut town = Town::default();
    let (grass, red, brick) = (town.flat([0.2, 0.6, 0.3]), town.flat([0.9, 0.1, 0.05]), town.textured(bricks(64), Wrap::Wrap));
    town.ground(28.0, 1.0, grass, 0);
    town.house([-12.0, -9.0], [7.3, 6.1, 9.7], red, 1);
    town.house([3.0, -4.0], [8.0, 5.0, 4.0], brick, 11);
    town.house([-3.5, 7.25], [2.0, 9.0, 13.0], red, 21);
    town
}

/// Returns every `step`-th pixel (i, j) of a tile.
fn sampled_pixels(step: usize) -> impl Iterator<Item = (u32, u32)> {
    (0..65_536usize).step_by(step).map(|p| (p as u32 % 256, p as u32 / 256))
}

fn at(i: u32, j: u32) -> usize {
    (j * 256 + i) as usize
}

fn assert_same_center(g: &GBuffer, hit: Option<&SampleHit>, (i, j): (u32, u32)) {
    let p = at(i, j);
    let Some(hit) = hit else {
        assert_eq!((g[ID][p], g[DEPTH][p], g[NORMAL][p]), (0, DEPTH_NOTHING, [0; 3]), "({i}, {j})");
        return;
    };
    assert_eq!(g[ID][p], hit.id, "({i}, {j}): {hit:?}");
    assert!(g[DEPTH][p].abs_diff(hit.depth) <= 1, "({i}, {j}): {} {hit:?}", g[DEPTH][p]);
    assert!((0..3).all(|k| (f64::from(g[NORMAL][p][k]) - hit.normal[k] * 32_767.0).abs() <= 2.0), "({i}, {j}): {:?} {hit:?}", g[NORMAL][p]);
}

#[test]
fn ids_depths_and_normals_agree_with_the_reference() {
    let (folder, town) = (new_folder("reference"), houses());
    let scene = town.open(&folder);
    for (look_at, pitch) in VIEWS {
        let f = frame(look_at, pitch, 64.0, 0);
        let (g, reference) = (scene.gbuffer(&f, 0, 0).expect("renders"), ReferenceRenderer::new(&scene, &town, &f));
        let mut seen = 0;
        for (i, j) in sampled_pixels(7) {
            let hit = reference.pixel_sample(i, j, 0);
            seen += usize::from(hit.is_some());
            assert_same_center(&g, hit.as_ref(), (i, j));
        }
        assert!(seen > 800, "{look_at} {pitch}: {seen} pixels with content");
    }
}

#[test]
fn constant_colours_are_the_mean_of_the_samples() {
    let mut town = Town::default();
    let colors = [[0.9, 0.1, 0.05], [0.1, 0.2, 0.9], [0.3, 0.9, 0.4], [1.0, 1.0, 1.0]].map(|c| town.flat(c));
    town.house([-12.0, -9.0], [7.3, 6.1, 9.7], colors[0], 1);
    town.house([3.0, -4.0], [8.0, 5.0, 4.0], colors[1], 11);
    town.house([-3.5, 7.25], [2.0, 9.0, 13.0], colors[2], 21);
    town.face([[-20.0, -20.0, 1.0], [21.0, -18.0, 2.0], [0.0, 15.0, 3.0]], colors[3], 30);
    let folder = new_folder("flat");
    let scene = town.open(&folder);
    for (look_at, pitch) in VIEWS {
        let f = frame(look_at, pitch, 64.0, 0);
        let (g, reference) = (scene.gbuffer(&f, 0, 0).expect("renders"), ReferenceRenderer::new(&scene, &town, &f));
        let mut edges = 0;
        for (i, j) in sampled_pixels(5) {
            let samples: Vec<Option<SampleHit>> = (0..16).map(|k| reference.pixel_sample(i, j, k)).collect();
            let hits = samples.iter().flatten().count();
            edges += usize::from(hits > 0 && hits < 16);
            let sum = samples.iter().flatten().map(|m| reference.color(m)).fold([0.0; 3], |s, c| [0, 1, 2].map(|k| s[k] + c[k]));
            let got = g[COLOR][at(i, j)];
            assert!((0..3).all(|c| (f64::from(got[c]) - sum[c] / 16.0).abs() <= 1.0), "({i}, {j}): {got:?} {sum:?}");
            assert_eq!(got[3], ((65_535 * hits + 8) / 16) as u16);
        }
        assert!(edges > 50, "{look_at} {pitch}: {edges} edge pixels");
    }
}

/// Returns the PSNR in sRGB over wholly covered pixels, and the ratio of gradient energies.
fn compare(g: &GBuffer, reference: &ReferenceRenderer, side: u32, n: i128) -> (f64, f64) {
    let byte = |c: f64| f64::from(BYTE[c.round().clamp(0.0, 65_535.0) as usize]);
    let (mut square, mut count, mut gradients) = (0.0, 0.0, [0.0; 2]);
    let mut row: Vec<Option<[[f64; 3]; 2]>> = vec![None; side as usize];
    for j in 0..side {
        for i in 0..side {
            let (i, j) = (i + (256 - side) / 2, j + (256 - side) / 2);
            let (exact, cover) = reference.mean(i, j, n);
            let got = g[COLOR][at(i, j)];
            let now = (cover == 1.0 && got[3] == 65_535).then(|| [[0, 1, 2].map(|c| byte(f64::from(got[c]))), exact.map(byte)]);
            let x = (i - (256 - side) / 2) as usize;
            if let Some([got, exact]) = now {
                square += (0..3).map(|c| (got[c] - exact[c]).powi(2)).sum::<f64>() / 3.0;
                count += 1.0;
                let left = if x > 0 { row[x - 1] } else { None };
                for (other, above) in [(left, false), (row[x], true)] {
                    let Some(other) = other else { continue };
                    let _ = above;
                    for (k, own) in [got, exact].iter().enumerate() {
                        gradients[k] += (0..3).map(|c| (own[c] - other[k][c]).powi(2)).sum::<f64>();
                    }
                }
            }
            row[x] = now;
        }
    }
    assert!(count > 0.5 * f64::from(side * side), "{count} covered pixels");
    (10.0 * (255.0f64.powi(2) / (square / count).max(1e-9)).log10(), gradients[0] / gradients[1])
}

#[test]
fn textures_are_neither_blurred_nor_aliased() {
    // Bright lines one texel wide at 4.4 texels per pixel are the hardest case: 32 dB.
    for (image, repeats, least_db) in [(waves(256), 8.0, 40.0), (bricks(256), 5.3, 31.0)] {
        let mut town = Town::default();
        let material = town.textured(image, Wrap::Wrap);
        town.ground(60.0, repeats, material, 0);
        let folder = new_folder("texture");
        let scene = town.open(&folder);
        for pitch in [10.0, 22.5, 45.0, 90.0] {
            let size = 100.0 * f64::from(pitch as f32).to_radians().sin().max(0.2);
            let f = frame(20.0, pitch, size, 0);
            let g = scene.gbuffer(&f, 0, 0).expect("renders");
            let (psnr, gradient) = compare(&g, &ReferenceRenderer::new(&scene, &town, &f), 40, 24);
            eprintln!("pitch {pitch}, {repeats} repeats: PSNR {psnr:.1} dB, gradient energy {gradient:.3}");
            assert!(psnr >= least_db, "pitch {pitch}, {repeats} repeats: PSNR {psnr:.1} dB");
            assert!((gradient - 1.0).abs() <= 0.1, "pitch {pitch}, {repeats} repeats: gradient energy {gradient:.3}");
        }
    }
}

/// The atlas is magenta around the region that the faces use; no footprint may show it.
#[test]
fn atlas_background_never_shows() {
    let mut image = Raster::filled(128, 128, [255, 0, 255, 255]);
    for y in 40..80 {
        (24..100).for_each(|x| image.pixels[y * 128 + x] = [60, 170, 40, 255]);
    }
    let mut town = Town::default();
    let material = town.textured(image, Wrap::Clamp);
    let (u0, u1, v0, v1) = (24.0 / 128.0, 100.0 / 128.0, 1.0 - 80.0 / 128.0, 1.0 - 40.0 / 128.0);
    town.panel([[-9.0, -7.0, 0.0], [9.0, -7.0, 0.0], [9.0, 7.0, 5.0], [-9.0, 7.0, 5.0]], [[u0, v0], [u1, v0], [u1, v1], [u0, v1]], material, 0);
    let folder = new_folder("magenta");
    let scene = town.open(&folder);
    for size in [6.0, 40.0, 100.0, 600.0, 3000.0] {
        for (look_at, pitch) in VIEWS {
            let g = scene.gbuffer(&frame(look_at, pitch, size, 0), 0, 0).expect("renders");
            for c in g[COLOR].iter().filter(|c| c[3] > 0) {
                assert!(c[1] > c[0] && c[1] > c[2], "{c:?} at size {size}, {look_at} {pitch}");
            }
        }
    }
}

#[test]
fn cutout_shows_the_surface_behind_its_hole() {
    let mut image = Raster::filled(64, 64, [40, 200, 40, 255]);
    for y in 16..48 {
        (16..48).for_each(|x| image.pixels[y * 64 + x] = [0, 0, 0, 0]);
    }
    let mut town = Town::default();
    let (leaf, wall) = (town.textured(image, Wrap::Clamp), town.flat([0.8, 0.2, 0.1]));
    let square = |z: f64| [[-8.0, -8.0, z], [8.0, -8.0, z], [8.0, 8.0, z], [-8.0, 8.0, z]];
    town.panel(square(5.0), [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], leaf, 0);
    town.panel(square(0.0), [[0.0; 2]; 4], wall, 1);
    let folder = new_folder("cutout");
    let scene = town.open(&folder);
    let f = frame(0.0, 90.0, 32.0, 0);
    let g = scene.gbuffer(&f, 0, 0).expect("renders");
    assert_eq!((g[ID][at(128, 128)], g[ID][at(80, 128)]), (2, 1));
    let through = g[ID].iter().filter(|id| **id == 2).count();
    assert!((3900..4300).contains(&through), "a quarter of the leaf is a hole: {through} of 16,384 px");
    let edge = g[COLOR][at(128, 100)];
    assert!(edge[0] > edge[1], "the wall does not show: {edge:?}");
    let pick = scene.pick(&f, 0.0, 0.0).expect("a ray").expect("a hit");
    assert_eq!(pick.id, 2);
    assert!(pick.position[2].abs() < 1e-6);
}

#[test]
fn shading_normals_are_interpolated_and_face_the_viewer() {
    let mut town = Town::default();
    let grey = town.flat([0.5; 3]);
    town.face([[-10.0, -10.0, 0.0], [10.0, -10.0, 0.0], [0.0, 10.0, 0.0]], grey, 0);
    let tilt = |x: f32| [x, 0.0, (1.0 - x * x).sqrt()];
    town.faces[0].normals = Some([tilt(-0.6), tilt(0.6), tilt(0.0)]);
    town.face([[-10.0, 11.0, 0.0], [10.0, 11.0, 0.0], [0.0, 20.0, 0.0]], grey, 1);
    town.faces[1].normals = Some([[0.0, 0.0, -1.0]; 3]);
    let folder = new_folder("normals");
    let g = town.open(&folder).gbuffer(&frame(0.0, 90.0, 64.0, 0), 0, 0).expect("renders");
    let (left, middle, right) = (g[NORMAL][at(92, 166)], g[NORMAL][at(128, 128)], g[NORMAL][at(163, 166)]);
    assert!(left[0] < -12_000 && middle[0].abs() < 300 && right[0] > 12_000, "{left:?} {middle:?} {right:?}");
    let backwards = g[NORMAL][at(128, 75)];
    assert!(backwards[2] > 32_000, "not turned to the visible side: {backwards:?}");
}

#[test]
fn higher_rank_wins_among_coplanar_faces() {
    let mut town = Town::default();
    let (wall, door) = (town.flat([0.8; 3]), town.flat([0.3, 0.2, 0.1]));
    town.panel([[-8.0, 0.0, 0.0], [8.0, 0.0, 0.0], [8.0, 0.0, 10.0], [-8.0, 0.0, 10.0]], [[0.0; 2]; 4], wall, 0);
    town.panel([[-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, 8.0], [-2.0, 0.0, 8.0]], [[0.0; 2]; 4], door, 1);
    town.faces[2].rank = Rank::Opening;
    town.faces[3].rank = Rank::Opening;
    let folder = new_folder("ranks");
    let scene = town.open(&folder);
    for look_at in [0.0, 30.0, 160.0] {
        let f = frame(look_at, 30.0, 24.0, 0);
        let g = scene.gbuffer(&f, 0, 0).expect("renders");
        let (reference, mut doors) = (ReferenceRenderer::new(&scene, &town, &f), 0);
        for (i, j) in sampled_pixels(11) {
            let hit = reference.pixel_sample(i, j, 0);
            doors += usize::from(hit.as_ref().is_some_and(|m| m.id == 2));
            assert_same_center(&g, hit.as_ref(), (i, j));
        }
        assert!(doors > 100);
    }
}

#[test]
fn invalid_arguments_fail_and_empty_tiles_do_not() {
    let (folder, town) = (new_folder("empty"), houses());
    let scene = town.open(&folder);
    let far = Frame { u0_m: 10_000.0, ..frame(0.0, 45.0, 64.0, 0) };
    assert!(scene.gbuffer(&far, 0, 0).expect("renders").is_empty());
    assert_eq!(scene.pick(&far, 10_001.0, 0.0).expect("a ray"), None);
    assert!(scene.gbuffer(&frame(0.0, 45.0, 64.0, 2), 4, 0).is_err());
    assert!(scene.gbuffer(&frame(0.0, 0.0, 64.0, 0), 0, 0).is_err());
    assert!(scene.pick(&frame(0.0, 45.0, 64.0, 0), f64::NAN, 0.0).is_err());
    assert!(scene.occluded(&[[0.0; 3]], [0.0; 3], 1.0).is_err());
}

#[test]
fn pick_agrees_with_pixels() {
    let (folder, town) = (new_folder("pick"), houses());
    let scene = town.open(&folder);
    let f = frame(45.0, 30.0, 64.0, 0);
    let g = scene.gbuffer(&f, 0, 0).expect("renders");
    let mut hits = 0;
    for (i, j) in sampled_pixels(331) {
        let (u, v) = f.uv_of_pixel(map3d_base::tile::Tile { z: 0, x: 0, y: 0 }, i, j);
        match scene.pick(&f, u, v).expect("a ray") {
            None => assert_eq!(g[ID][at(i, j)], 0, "({i}, {j})"),
            Some(pick) => {
                hits += 1;
                assert_eq!(g[ID][at(i, j)], pick.id, "({i}, {j})");
                let depth = (pick.d_m - f.d0_m) * 1024.0;
                assert!((depth - f64::from(g[DEPTH][at(i, j)])).abs() <= 2.0, "({i}, {j}): {depth} {}", g[DEPTH][at(i, j)]);
            }
        }
    }
    assert!(hits > 50);
}
