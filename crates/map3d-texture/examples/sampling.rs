//! Measures the cost of a sample: least ns per pixel over many rounds, for runs of several lengths in sub-tiles of 64 × 64 pixels.
//!
//! `cargo run --release -p map3d-texture --example sampling`

use std::sync::Arc;
use std::time::Instant;

use map3d_base::Isa;
use map3d_base::asset::Wrap;
use map3d_image::Raster;
use map3d_texture::sample::{Sampler, SurfaceColors, TapPlan, Tuning, UvMap, compute_footprint};
use map3d_texture::{Level, level_count};

const SIDE: u32 = 1024;
const WHITE: SurfaceColors = SurfaceColors { diffuse: [255; 4], border: [255; 4] };

fn main() {
    let texel = |i: u32| (i.wrapping_mul(0x9E37_79B1) ^ i >> 7).to_le_bytes();
    let image = Raster::new(SIDE, SIDE, (0..SIDE * SIDE).map(|i| [texel(i)[0], texel(i)[1], texel(i)[2], 255]).collect());
    let level = Arc::new(Level::from_raster(image.clone()));
    println!("{:>8} {:>22} {:>5} | ns a pixel in runs of 64, 8, 1", "isa", "texels a pixel", "taps");
    for isa in Isa::available() {
        for [right, down, shear] in [[0.4, 0.6, 0.0], [1.0, 1.4, 0.3], [2.0, 2.8, 0.7], [3.0, 4.2, 0.7], [2.8, 5.6, 2.0], [3.8, 5.4, 0.0]] {
            let s = f64::from(SIDE);
            let uv = UvMap { u: [0.1, right / s, 0.0], v: [0.9, -shear / s, -down / s] };
            let plan = compute_footprint(uv.jacobian(SIDE, SIDE), level_count(SIDE, SIDE), &Tuning::default());
            let sampler = Sampler::new(level.clone(), Arc::new(TapPlan::with_isa(&plan, isa)), false, &uv, Wrap::Wrap, WHITE);
            let least = [64, 8, 1].map(|run| (0..200).map(|_| round(&sampler, run)).fold(f64::INFINITY, f64::min));
            println!("{:>8} {right:6.1} × {down:4.1}, {shear:4.1} {:7} | {least:7.1?}", format!("{isa:?}"), plan.taps.len());
        }
    }
}

/// ns per pixel.
fn round(sampler: &Sampler, run: usize) -> f64 {
    let mut row = [[0u16; 4]; 64];
    let start = Instant::now();
    for j in 0..64 {
        for i in (0..64).step_by(run) {
            if run == 1 {
                let [r, g, b] = sampler.sample((i as i32) << 8 | 100, j << 8 | 100);
                row[i] = [r, g, b, 0];
            } else {
                sampler.sample_row((i as i32) << 8 | 128, j << 8 | 128, &mut row[i..i + run]);
            }
        }
        std::hint::black_box(&mut row);
    }
    start.elapsed().as_secs_f64() * 1e9 / 4096.0
}
