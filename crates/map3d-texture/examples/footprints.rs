//! Footprint sampling against the exact integral: a float64 box over the pixel's parallelogram of the texture interpolated bilinearly, by many samples.
//!
//! `cargo run --release -p map3d-texture --example footprints [-- scan | axis compensation gap point]` prints a row for each texture, pitch and scale:
//! taps, cost, PSNR (in sRGB, peak 255) and the ratio of gradient energies (1 = neither blurred nor aliased).

use std::sync::Arc;

use map3d_base::asset::Wrap;
use map3d_image::Raster;
use map3d_image::srgb::{BYTE, LINEAR16};
use map3d_texture::sample::{Sampler, SurfaceColors, TapPlan, Tuning, UvMap, compute_footprint};
use map3d_texture::{Level, LinearRaster, first_mip, level_count, next_mip};

const SIDE: u32 = 256;
const PIXELS: i32 = 32;

/// sRGB of a texel.
type Paint = fn(u32, u32) -> [u8; 3];

fn main() {
    let tunings: Vec<Tuning> = tunings();
    let mut totals = vec![Total::default(); tunings.len()];
    let textures: [(&str, Paint); 5] = [("town", town), ("noise", noise), ("smooth", smooth), ("checker", checker), ("brick", brick)];
    println!(
        "{:8} {:>6} {:>6} {:>5} {:>5} {:>5} {:>8} {:>8} {:>8}",
        "texture", "pitch", "tex/px", "turn", "level", "taps", "ns/px", "PSNR", "gradient"
    );
    for (name, paint) in textures {
        let pyramid = Pyramid::new(paint);
        for pitch in [10.0f64, 22.5, 45.0, 90.0] {
            for scale in [0.4, 1.0, 2.0, 3.0, 4.0, 5.5] {
                for turn in [0.0f64, 30.0] {
                    let uv = uv_map(pitch, scale, turn);
                    let exact: Vec<[u16; 3]> =
                        (0..PIXELS * PIXELS).map(|i| pyramid.integrate(&uv, f64::from(i % PIXELS), f64::from(i / PIXELS))).collect();
                    for (tuning, total) in tunings.iter().zip(&mut totals) {
                        let row = measure(&pyramid, &uv, &exact, tuning);
                        if tunings.len() == 1 {
                            let Row { level, taps, ns, psnr, gradient } = row;
                            println!("{name:8} {pitch:6} {scale:6} {turn:5} {level:5} {taps:5} {ns:8.1} {psnr:8.1} {gradient:8.3}");
                        }
                        total.add(name, &row);
                    }
                }
            }
        }
    }
    for (tuning, total) in tunings.iter().zip(&totals) {
        total.print(tuning);
    }
}

/// The default, or one, or a scan: `scan`, or `axis compensation gap point`.
fn tunings() -> Vec<Tuning> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let make = |n: &[f64]| Tuning { texels_per_axis: n[0], compensation: n[1], max_gap: n[2], point_below: n[3] };
    match args.first().map(String::as_str) {
        None => vec![Tuning::default()],
        Some("scan") => {
            let mut out = Vec::new();
            for axis in [1.75, 2.0, 2.5, 3.0] {
                for compensation in [0.33, 0.67, 1.0] {
                    out.extend([1.0, 1.25].map(|gap| make(&[axis, compensation, gap, 0.4])));
                }
            }
            out
        }
        Some(_) => vec![make(&args.iter().map(|a| a.parse().expect("numbers: axis compensation gap point")).collect::<Vec<f64>>())],
    }
}

#[derive(Clone, Default)]
struct Total {
    rows: std::collections::BTreeMap<String, (f64, f64, f64)>,
    taps: usize,
    ns: f64,
    n: usize,
}

impl Total {
    fn add(&mut self, name: &str, row: &Row) {
        let worst = self.rows.entry(name.to_owned()).or_insert((f64::INFINITY, f64::INFINITY, 0.0));
        *worst = (worst.0.min(row.psnr), worst.1.min(row.gradient), worst.2.max(row.gradient));
        self.taps += row.taps;
        self.ns += row.ns;
        self.n += 1;
    }

    /// Least PSNR, and range of the ratio of gradient energies, by texture.
    fn print(&self, t: &Tuning) {
        let n = self.n as f64;
        print!(
            "{:4} {:4} {:4} {:4} | {:5.1} taps {:6.1} ns/px |",
            t.texels_per_axis,
            t.compensation,
            t.max_gap,
            t.point_below,
            self.taps as f64 / n,
            self.ns / n
        );
        for (name, (psnr, low, high)) in &self.rows {
            print!(" {name} {psnr:.1} dB {low:.2}..{high:.2} |");
        }
        println!();
    }
}

/// Horizontal ground seen at a pitch: `scale` texels of level 0 per pixel across, more down the image; rotated by `turn` degrees.
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

fn measure(pyramid: &Pyramid, uv: &UvMap, exact: &[[u16; 3]], tuning: &Tuning) -> Row {
    let plan = compute_footprint(uv.jacobian(SIDE, SIDE), level_count(SIDE, SIDE), tuning);
    let white = SurfaceColors { diffuse: [255; 4], border: [255; 4] };
    let taps = Arc::new(TapPlan::new(&plan));
    let sampler = Sampler::new(pyramid.levels[plan.level as usize].clone(), taps, false, uv, Wrap::Wrap, white);
    let render = || -> Vec<[u16; 3]> { (0..PIXELS * PIXELS).map(|i| sampler.sample(i % PIXELS * 256 + 128, i / PIXELS * 256 + 128)).collect() };
    let got = render();
    let cpu_s = || {
        let t = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
    };
    let start = cpu_s();
    let rounds = 4;
    for _ in 0..rounds {
        std::hint::black_box(render());
    }
    let ns = (cpu_s() - start) * 1e9 / f64::from(rounds * PIXELS * PIXELS);
    Row { level: plan.level, taps: plan.taps.len(), ns, psnr: psnr(&got, exact), gradient: gradient(&got) / gradient(exact) }
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
        let mut levels = vec![Arc::new(Level::from_raster(image.clone()))];
        let mut mip: LinearRaster = first_mip(&image);
        for level in 1..level_count(SIDE, SIDE) {
            let stored = if level == 1 { Level::from_linear(&mip) } else { Level::from_raster(mip.to_raster()) };
            levels.push(Arc::new(stored));
            mip = next_mip(&mip);
        }
        let exact = image.pixels.iter().map(|p| [0, 1, 2].map(|c| f64::from(LINEAR16[p[c] as usize]))).collect();
        Self { levels, exact }
    }

    fn bilinear(&self, x: f64, y: f64) -> [f64; 3] {
        let (x, y) = (x - 0.5, y - 0.5);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let (ix, iy) = (x.floor() as i32, y.floor() as i32);
        let fold = |k: i32| (k & (SIDE as i32 - 1)) as usize;
        let at = |i: i32, j: i32| self.exact[fold(iy + j) * SIDE as usize + fold(ix + i)];
        let (a, b, c, d) = (at(0, 0), at(1, 0), at(0, 1), at(1, 1));
        [0, 1, 2].map(|k| (a[k] * (1.0 - fx) + b[k] * fx) * (1.0 - fy) + (c[k] * (1.0 - fx) + d[k] * fx) * fy)
    }

    /// Mean over the pixel's square, of n × n samples, at least 1,024 and at least three per texel.
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

/// Noise of many sizes, as in photographs.
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

/// Bricks with noise, like the textures of the measured town.
fn town(x: u32, y: u32) -> [u8; 3] {
    let (bh, bw) = (17, 41);
    let shift = y / bh % 2 * (bw / 2);
    let mortar = y % bh < 2 || (x + shift) % bw < 2;
    let [a, b, c] = smooth(x, y).map(|v| (i32::from(v) - 128) / 3);
    let fine = [0, 1, 2].map(|k| (i32::from(hash(x, y, k)) - 128) / 10);
    let dark = if mortar { -38 } else { 0 };
    [150 + a + fine[0] + dark, 105 + b + fine[1] + dark, 80 + c + fine[2] + dark].map(|v| v.clamp(0, 255) as u8)
}

fn checker(x: u32, y: u32) -> [u8; 3] {
    if (x / 8 + y / 8).is_multiple_of(2) { [235, 235, 225] } else { [30, 35, 40] }
}

fn brick(x: u32, y: u32) -> [u8; 3] {
    let row = y / 8;
    let column = (x + row % 2 * 8) / 16;
    if y.is_multiple_of(8) || (x + row % 2 * 8).is_multiple_of(16) {
        return [200, 195, 185];
    }
    let shade = hash(column % 32, row, 7) / 4;
    [120 + shade, 60 + shade / 2, 45 + shade / 3]
}
