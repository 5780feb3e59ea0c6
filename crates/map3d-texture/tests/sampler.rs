//! Samples of textures: wrap modes, borders, alpha, and the exact integral.

use std::sync::Arc;

use crate::common::{Random, noise};
use map3d_base::Isa;
use map3d_base::asset::Wrap;
use map3d_base::samples::SAMPLES;
use map3d_image::Raster;
use map3d_image::srgb::{BYTE, LINEAR16};
use map3d_texture::Level;
use map3d_texture::sample::{AlphaSampler, Footprint, POSITION_BITS, Sampler, SurfaceColors, TapPlan, Tuning, UvMap, compute_footprint};

const WHITE: SurfaceColors = SurfaceColors { diffuse: [255; 4], border: [9, 200, 60, 255] };

fn point() -> Footprint {
    Footprint { level: 0, taps: vec![[0.0; 2]] }
}

fn made(plan: &Footprint) -> Arc<TapPlan> {
    Arc::new(TapPlan::new(plan))
}

/// One texel per pixel, v up, the image's upper left corner at the origin.
fn one_to_one(w: u32, h: u32) -> UvMap {
    UvMap { u: [0.0, 1.0 / f64::from(w), 0.0], v: [1.0, 0.0, -1.0 / f64::from(h)] }
}

fn bytes(c: [u16; 3]) -> [u8; 3] {
    c.map(|c| BYTE[c as usize])
}

#[test]
fn texel_centres_give_texels_in_every_wrap_mode() {
    for (w, h) in [(8, 8), (7, 5), (1, 1), (1, 6)] {
        let image = noise(w, h, 3);
        for wrap in [Wrap::Wrap, Wrap::Mirror, Wrap::Clamp, Wrap::Border, Wrap::None] {
            let sampler = Sampler::new(Arc::new(Level::from_raster(image.clone())), made(&point()), false, &one_to_one(w, h), wrap, WHITE);
            for y in -20..20 {
                for x in -20..20 {
                    let got = bytes(sampler.sample(x * 256 + 128, y * 256 + 128));
                    let expected = match (fold(x, w, wrap), fold(y, h, wrap)) {
                        (Some(i), Some(j)) => image.row(j)[i as usize],
                        _ if wrap == Wrap::Border => WHITE.border,
                        _ => [255; 4],
                    };
                    assert!((0..3).all(|c| got[c].abs_diff(expected[c]) <= 1), "{w} × {h} {wrap:?} ({x}, {y}): {got:?} {expected:?}");
                }
            }
        }
    }
}

fn fold(i: i32, n: u32, wrap: Wrap) -> Option<u32> {
    let n = n as i32;
    match wrap {
        Wrap::Wrap => Some(i.rem_euclid(n) as u32),
        Wrap::Mirror => Some(if i.rem_euclid(2 * n) < n { i.rem_euclid(n) } else { n - 1 - i.rem_euclid(n) } as u32),
        Wrap::Clamp => Some(i.clamp(0, n - 1) as u32),
        _ => (0..n).contains(&i).then_some(i as u32),
    }
}

#[test]
fn samples_together_equal_samples_one_by_one() {
    let mut random = Random(12);
    for (wrap, has_alpha) in [(Wrap::Wrap, false), (Wrap::Mirror, true), (Wrap::Clamp, false), (Wrap::Border, true), (Wrap::None, false)] {
        let level = Arc::new(Level::from_raster(noise(48, 37, 4)));
        for (right, down) in [(0.3, 0.4), (2.1, 3.4), (4.8, 1.2)] {
            let uv = UvMap { u: [0.2, right / 48.0, 0.01], v: [0.9, -0.02, -down / 37.0] };
            let plan = compute_footprint(uv.jacobian(48, 37), 1, &Tuning::default());
            let positions: Vec<[i32; 2]> = (0..300).map(|_| [0, 1].map(|_| (random.unit() * 64.0 * 256.0) as i32)).collect();
            let mut all = Vec::new();
            for isa in Isa::available() {
                let sampler = Sampler::new(level.clone(), Arc::new(TapPlan::with_isa(&plan, isa)), has_alpha, &uv, wrap, WHITE);
                let mut colors = vec![[0; 3]; positions.len()];
                sampler.sample_each(&positions, &mut colors);
                assert!(positions.iter().zip(&colors).all(|([x, y], color)| sampler.sample(*x, *y) == *color), "{isa:?} {wrap:?}");
                sampler.sample_each(&[], &mut []);
                all.push(colors);
            }
            assert!(all.windows(2).all(|pair| pair[0] == pair[1]), "{wrap:?}");
        }
    }
}

#[test]
fn white_stays_white_and_diffuse_multiplies() {
    let level = Arc::new(Level::from_raster(Raster::filled(16, 16, [255; 4])));
    for scale in [0.3, 1.0, 2.3, 9.0, 40.0] {
        let uv = UvMap { u: [0.1, scale / 16.0, 0.01], v: [0.2, 0.02, scale / 16.0] };
        let plan = compute_footprint(uv.jacobian(16, 16), 1, &Tuning::default());
        let white = Sampler::new(level.clone(), made(&plan), false, &uv, Wrap::Wrap, WHITE);
        assert_eq!(white.sample(77, 1234), [65_535; 3], "{} taps", plan.taps.len());
        let tinted = Sampler::new(level.clone(), made(&plan), false, &uv, Wrap::Wrap, SurfaceColors { diffuse: [200, 100, 0, 255], ..WHITE });
        assert_eq!(bytes(tinted.sample(77, 1234)), [200, 100, 0]);
    }
}

#[test]
fn transparent_texels_add_no_colour() {
    let image = Raster::new(2, 1, vec![[255, 0, 255, 0], [0, 128, 0, 255]]);
    let sampler = Sampler::new(Arc::new(Level::from_raster(image.clone())), made(&point()), true, &one_to_one(2, 1), Wrap::Clamp, WHITE);
    for x in 140..500 {
        assert_eq!(bytes(sampler.sample(x, 128)), [0, 128, 0], "at {x}");
    }
}

#[test]
fn coverage_is_alpha_of_a_half() {
    let image = Raster::new(4, 1, vec![[0; 4], [0; 4], [9, 9, 9, 255], [9, 9, 9, 255]]);
    let alpha = AlphaSampler::new(Arc::new(Level::from_raster(image.clone())), &one_to_one(4, 1), Wrap::Clamp, 0);
    let covered: Vec<i32> = (0..1024).filter(|x| alpha.covers(*x, 128)).collect();
    assert!(covered[0].abs_diff(512) <= 2 && covered.len() == (1024 - covered[0]) as usize, "{:?}", covered.first());
    let border = |a| AlphaSampler::new(Arc::new(Level::from_raster(image.clone())), &one_to_one(4, 1), Wrap::Border, a).covers(2000, 128);
    assert!(border(255) && !border(0));
}

#[test]
fn samples_of_a_pixel_are_covered_as_one_by_one() {
    let mut random = Random(31);
    // Fully transparent and opaque patches, and noise between them.
    let alpha = |x: usize, y: usize, noise: f64| [0, 255, (noise * 255.0) as u8, 255][(x / 3 + 2 * (y / 4)) % 4];
    let texels = (0..24 * 17).map(|k| [9, 9, 9, alpha(k % 24, k / 24, random.unit())]).collect();
    let level = Arc::new(Level::from_raster(Raster::new(24, 17, texels)));
    let mut counts = [0, 0];
    for wrap in [Wrap::Wrap, Wrap::Mirror, Wrap::Clamp, Wrap::Border, Wrap::None] {
        let slopes = [0; 4].map(|_| (random.unit() - 0.5) / 4.0);
        let map = UvMap { u: [random.unit(), slopes[0], slopes[1]], v: [random.unit(), slopes[2], slopes[3]] };
        let stencil = AlphaSampler::new(level.clone(), &map, wrap, 77);
        for (i, j) in (0..256).map(|p| (p % 16, p / 16)) {
            let position = |c: i32, s: u8| (c << POSITION_BITS) + i32::from(s) * (1 << (POSITION_BITS - 4));
            let expected = SAMPLES.iter().enumerate().fold(0, |m, (k, (x, y))| m | u32::from(stencil.covers(position(i, *x), position(j, *y))) << k);
            assert_eq!(stencil.covered_samples(i, j, 0xFFFF), expected, "{wrap:?} ({i}, {j})");
            assert_eq!(stencil.covered_samples(i, j, 0x5A5A), expected & 0x5A5A);
            counts[0] += expected.count_ones();
            counts[1] += 16 - expected.count_ones();
        }
    }
    assert!(counts.iter().all(|n| *n > 2000), "{counts:?}");
}

#[test]
fn a_place_is_covered_as_the_origin_of_a_map_that_begins_there() {
    let mut random = Random(9);
    let texels = (0..35).map(|_| [7, 7, 7, (random.unit() * 255.0) as u8]).collect();
    let level = Arc::new(Level::from_raster(Raster::new(7, 5, texels)));
    let mut covered = 0;
    for wrap in [Wrap::Wrap, Wrap::Mirror, Wrap::Clamp, Wrap::Border, Wrap::None] {
        let map = |u: f64, v: f64| UvMap { u: [u, 0.03, -0.01], v: [v, 0.02, 0.05] };
        let sampler = AlphaSampler::new(level.clone(), &map(0.3, -4.2), wrap, 90);
        for k in 0..2_000 {
            let place = if k == 0 { [f64::NAN, 1.0] } else { [0, 1].map(|_| (random.unit() - 0.5) * [1.5, 9.0, 4e9][k % 3]) };
            let expected = AlphaSampler::new(level.clone(), &map(place[0], place[1]), wrap, 90).covers(0, 0);
            assert_eq!(sampler.covers_uv(place), expected, "{wrap:?} {place:?}");
            covered += u32::from(expected);
        }
    }
    assert!((2_000..8_000).contains(&covered), "{covered}");
}

/// Compares the taps with a box filter of many bilinear samples over each pixel.
#[test]
fn samples_come_near_the_exact_integral() {
    let mut random = Random(5);
    let image = Raster::new(
        64,
        64,
        (0..4096u32)
            .map(|i| {
                let (x, y) = (f64::from(i % 64) / 64.0 * std::f64::consts::TAU, f64::from(i / 64) / 64.0 * std::f64::consts::TAU);
                [(128.0 + 100.0 * (3.0 * x).sin()) as u8, (128.0 + 100.0 * (2.0 * y).cos()) as u8, (128.0 + 60.0 * (x + 5.0 * y).sin()) as u8, 255]
            })
            .collect(),
    );
    let level = Arc::new(Level::from_raster(image.clone()));
    for _ in 0..40 {
        let mut part = |s: f64| (random.unit() - 0.5) * s / 64.0;
        let uv = UvMap { u: [0.3, part(5.0), part(5.0)], v: [0.6, part(5.0), part(5.0)] };
        let plan = compute_footprint(uv.jacobian(64, 64), 1, &Tuning::default());
        let sampler = Sampler::new(level.clone(), made(&plan), false, &uv, Wrap::Wrap, WHITE);
        for (x, y) in [(0.5, 0.5), (7.5, 3.5), (30.5, 60.5)] {
            let exact = integral(&image, &uv, x, y);
            let got = sampler.sample((x * 256.0) as i32, (y * 256.0) as i32);
            assert!((0..3).all(|c| (f64::from(got[c]) - exact[c]).abs() < 700.0), "{uv:?}: {got:?} {exact:?}");
        }
    }
}

fn integral(image: &Raster, uv: &UvMap, x: f64, y: f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    let n = 48;
    for k in 0..n * n {
        let (px, py) = (x - 0.5 + (f64::from(k % n) + 0.5) / f64::from(n), y - 0.5 + (f64::from(k / n) + 0.5) / f64::from(n));
        let (u, v) = (uv.u[0] + uv.u[1] * px + uv.u[2] * py, uv.v[0] + uv.v[1] * px + uv.v[2] * py);
        let (tx, ty) = (u * 64.0 - 0.5, (1.0 - v) * 64.0 - 0.5);
        let (fx, fy) = (tx - tx.floor(), ty - ty.floor());
        for (i, j, w) in [(0, 0, (1.0 - fx) * (1.0 - fy)), (1, 0, fx * (1.0 - fy)), (0, 1, (1.0 - fx) * fy), (1, 1, fx * fy)] {
            let p = image.row((ty.floor() as i64 + j).rem_euclid(64) as u32)[(tx.floor() as i64 + i).rem_euclid(64) as usize];
            (0..3).for_each(|c| sum[c] += w * f64::from(LINEAR16[p[c] as usize]) / f64::from(n * n));
        }
    }
    sum
}
