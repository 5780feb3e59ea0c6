//! Functions that several tests share.
#![allow(dead_code)]

use std::path::PathBuf;

use map3d_image::Raster;
use map3d_image::encode::{Deflate, Filter, encode_png};

/// Creates a new folder for this test.
pub fn folder(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("map3d-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("temporary folder");
    path
}

/// A small random generator with the same numbers on every machine.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as u32
    }

    pub fn below(&mut self, n: u32) -> u32 {
        self.bits() % n
    }

    /// 0..1
    pub fn unit(&mut self) -> f64 {
        f64::from(self.bits()) / f64::from(1u32 << 31)
    }
}

pub fn png(image: &Raster) -> Vec<u8> {
    encode_png((image.width, image.height), 4, image.pixels.as_flattened(), Filter::Up, Deflate::Fast)
}

pub fn noise(width: u32, height: u32, seed: u64) -> Raster {
    let mut random = Random(seed);
    let pixel = |_| [random.below(256) as u8, random.below(256) as u8, random.below(256) as u8, 255];
    Raster::new(width, height, (0..width * height).map(pixel).collect())
}
