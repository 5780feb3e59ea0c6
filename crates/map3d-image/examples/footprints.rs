//! Footprint sampling against the exact integral: a float64 box over the pixel's parallelogram of the texture interpolated bilinearly, by many samples.
//!
//! `cargo run --release -p map3d-image --example footprints [-- share gap point]` prints a row for each texture, pitch and scale:
//! taps, cost, PSNR (in sRGB, peak 255) and the ratio of gradient energies (1 = neither blurred nor aliased).

use std::sync::Arc;
use std::time::Instant;

use map3d_base::asset::Wrap;
use map3d_image::Raster;
use map3d_image::sample::{Outside, Sampler, Tuning, UvMap, footprint};
use map3d_image::srgb::{BYTE, LINEAR16};
use map3d_image::texture::{Level, LinearRaster, first_mip, level_count, next_mip};

const SIDE: u32 = 256;
const PIXELS: i32 = 40;

fn main() {
    let numbers: Vec<f64> = std::env::args().skip(1).map(|a| a.parse().expect("numbers: share gap point")).collect();
    let default = Tuning::default();
    let pick = |k: usize, d: f64| numbers.get(k).copied().unwrap_or(d);
    let tuning = Tuning { level_share: pick(0, default.level_share), max_gap: pick(1, default.max_gap), point_below: pick(2, default.point_below) };
    println!("{tuning:?}\n{:8} {:>6} {:>6} {:>5} {:>5} {:>5} {:>8} {:>8} {:>8}", "texture", "pitch", "tex/px", "turn", "level", "taps", "ns/px", "PSNR", "gradient");
    let textures: [(&str, fn(u32, u32) -> [u8; 3]); 4] = [("noise", noise), ("smooth", smooth), ("checker", checker), ("brick", brick)];
    let mut worst = (f64::INFINITY, 0.0f64);
    let mut sum = (0.0, 0.0, 0);
    for (name, paint) in textures {
        let pyramid = Pyramid::new(paint);
        for pitch in [10.0f64, 22.5, 45.0, 90.0] {
            for scale in [0.4, 1.0, 1.6, 2.5, 4.0, 6.3] {
                for turn in [0.0f64, 30.0] {
                    let row = measure(&pyramid, &uv_map(pitch, scale, turn), &tuning);
                    println!("{name:8} {pitch:6} {scale:6} {turn:5} {:5} {:5} {:8.1} {:8.1} {:8.3}", row.level, row.taps, row.ns, row.psnr, row.gradient);
                    worst = (worst.0.min(row.psnr), worst.1.max((row.gradient - 1.0).abs()));
                    sum = (sum.0 + row.taps as f64, sum.1 + row.ns, sum.2 + 1);
                }
            }
        }
    }
    let n = f64::from(sum.2);
    println!("worst: PSNR {:.1} dB, gradient off by {:.1} %; means: {:.1} taps, {:.1} ns/px", worst.0, worst.1 * 100.0, sum.0 / n, sum.1 / n);
}

/// Horizontal ground seen at a pitch: `scale` texels of level 0 a pixel across, more down the image; turned by `turn` degrees.
fn uv_map(pitch_deg: f64, scale: f64, turn_deg: f64) -> UvMap {
    let step = scale / f64::from(SIDE);
    let down = step / pitch_deg.to_radians().sin();
    let (s, c) = turn_deg.to_radians().sin_cos();
    UvMap { u: [0.317, step * c, down * s], v: [0.743, step * s, -down * c] }
}

struct Row {
    level: u32,
    taps: usize,
    ns: f64,
    psnr: f64,
    gradient: f64,
}

fn measure(pyramid: &Pyramid, uv: &UvMap, tuning: &Tuning) -> Row {
    let plan = footprint(uv.jacobian(SIDE, SIDE), level_count(SIDE, SIDE), tuning);
    let white = Outside { diffuse: [255; 4], border: [255; 4] };
    let sampler = Sampler::with(pyramid.levels[plan.level as usize].clone(), &plan, false, uv, Wrap::Wrap, white);
    let render = || -> Vec<[u16; 3]> { (0..PIXELS * PIXELS).map(|i| sampler.sample(i % PIXELS * 256 + 128, i / PIXELS * 256 + 128)).collect() };
    let got = render();
    let start = Instant::now();
    let rounds = 4;
    for _ in 0..rounds {
        std::hint::black_box(render());
    }
    let ns = start.elapsed().as_secs_f64() * 1e9 / f64::from(rounds * PIXELS * PIXELS);
    let exact: Vec<[u16; 3]> = (0..PIXELS * PIXELS).map(|i| pyramid.integrate(uv, f64::from(i % PIXELS), f64::from(i / PIXELS))).collect();
    Row { level: plan.level, taps: plan.taps.len(), ns, psnr: psnr(&got, &exact), gradient: gradient(&got) / gradient(&exact) }
}

struct Pyramid {
    levels: Vec<Arc<Level>>,
    /// Level 0 in linear light.
    exact: Vec<[f64; 3]>,
}

impl Pyramid {
    fn new(paint: fn(u32, u32) -> [u8; 3]) -> Self {
        let pixel = |i: u32| {
            let [r, g, b] = paint(i % SIDE, i / SIDE);
            [r, g, b, 255]
        };
        let image = Raster::new(SIDE, SIDE, (0..SIDE * SIDE).map(pixel).collect());
        let mut levels = vec![Arc::new(Level::from_raster(&image))];
        let mut mip: LinearRaster = first_mip(&image);
        for level in 1..level_count(SIDE, SIDE) {
            let stored = if level == 1 { Level::from_linear(&mip) } else { Level::from_raster(&mip.to_raster()) };
            levels.push(Arc::new(stored));
            mip = next_mip(&mip);
        }
        let exact = image.pixels.iter().map(|p| [0, 1, 2].map(|c| f64::from(LINEAR16[p[c] as usize]))).collect();
        Self { levels, exact }
    }

    fn bilinear(&self, x: f64, y: f64) -> [f64; 3] {
        let (x, y) = (x - 0.5, y - 0.5);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let n = i64::from(SIDE);
        let at = |i: i64, j: i64| self.exact[((y.floor() as i64 + j).rem_euclid(n) * n + (x.floor() as i64 + i).rem_euclid(n)) as usize];
        let (a, b, c, d) = (at(0, 0), at(1, 0), at(0, 1), at(1, 1));
        [0, 1, 2].map(|k| (a[k] * (1.0 - fx) + b[k] * fx) * (1.0 - fy) + (c[k] * (1.0 - fx) + d[k] * fx) * fy)
    }

    /// Mean over the pixel's square, of n × n samples, at least 1,024 and at least three a texel.
    fn integrate(&self, uv: &UvMap, i: f64, j: f64) -> [u16; 3] {
        let side = f64::from(SIDE);
        let longest = |d: usize| uv.u[d].hypot(uv.v[d]) * side;
        let counts = [1, 2].map(|d| ((longest(d) * 3.0).ceil() as usize).max(32));
        let mut sum = [0.0; 3];
        for b in 0..counts[1] {
            for a in 0..counts[0] {
                let (x, y) = (i + (a as f64 + 0.5) / counts[0] as f64, j + (b as f64 + 0.5) / counts[1] as f64);
                let texel = self.bilinear((uv.u[0] + uv.u[1] * x + uv.u[2] * y) * side, (1.0 - uv.v[0] - uv.v[1] * x - uv.v[2] * y) * side);
                (0..3).for_each(|k| sum[k] += texel[k]);
            }
        }
        sum.map(|s| (s / (counts[0] * counts[1]) as f64).round() as u16)
    }
}

fn byte(c: u16) -> f64 {
    f64::from(BYTE[c as usize])
}

fn psnr(a: &[[u16; 3]], b: &[[u16; 3]]) -> f64 {
    let square: f64 = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (byte(*a) - byte(*b)).powi(2)).sum();
    10.0 * (255.0f64.powi(2) / (square / (a.len() * 3) as f64).max(1e-9)).log10()
}

/// Mean square difference of neighbouring pixels in sRGB.
fn gradient(image: &[[u16; 3]]) -> f64 {
    let n = PIXELS as usize;
    let difference = |p: usize, q: usize| (0..3).map(|c| (byte(image[p][c]) - byte(image[q][c])).powi(2)).sum::<f64>();
    (0..n - 1).flat_map(|y| (0..n - 1).map(move |x| y * n + x)).map(|p| difference(p, p + 1) + difference(p, p + n)).sum()
}

fn hash(x: u32, y: u32, k: u32) -> u8 {
    let mut h = x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77) ^ k.wrapping_mul(0xC2B2_AE3D);
    h = (h ^ h >> 15).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ h >> 12).wrapping_mul(0x297A_2D39);
    (h >> 24) as u8
}

fn noise(x: u32, y: u32) -> [u8; 3] {
    [0, 1, 2].map(|k| hash(x, y, k))
}

/// Noise of many sizes, as photographs have.
fn smooth(x: u32, y: u32) -> [u8; 3] {
    [0, 1, 2].map(|k| {
        let octave = |shift: u32| {
            let (cell, f) = (1 << shift, |v: u32| f64::from(v % (1 << shift)) / f64::from(1 << shift));
            let at = |i: u32, j: u32| f64::from(hash((x / cell + i) % (SIDE / cell), (y / cell + j) % (SIDE / cell), k + 8 * shift));
            let (fx, fy) = (f(x), f(y));
            (at(0, 0) * (1.0 - fx) + at(1, 0) * fx) * (1.0 - fy) + (at(0, 1) * (1.0 - fx) + at(1, 1) * fx) * fy
        };
        (0.1 * octave(0) + 0.15 * octave(1) + 0.2 * octave(2) + 0.25 * octave(3) + 0.3 * octave(5)) as u8
    })
}

fn checker(x: u32, y: u32) -> [u8; 3] {
    if (x / 8 + y / 8).is_multiple_of(2) { [235, 235, 225] } else { [30, 35, 40] }
}

fn brick(x: u32, y: u32) -> [u8; 3] {
    let row = y / 8;
    let column = (x + row % 2 * 8) / 16;
    if y % 8 == 0 || (x + row % 2 * 8).is_multiple_of(16) {
        return [200, 195, 185];
    }
    let shade = hash(column % 32, row, 7) / 4;
    [120 + shade, 60 + shade / 2, 45 + shade / 3]
}
