//! What the first use of a texture costs, stage by stage: `first_use FOLDER [COUNT]`, folder of `.m3t` files.
use map3d_image::texture::*;
use std::path::PathBuf;
use std::time::Instant;

fn main() {
    let folder = PathBuf::from(std::env::args().nth(1).expect("folder"));
    let count: usize = std::env::args().nth(2).map_or(100, |n| n.parse().unwrap());
    let mut paths = Vec::new();
    for sub in std::fs::read_dir(&folder).unwrap() {
        for f in std::fs::read_dir(sub.unwrap().path()).unwrap() {
            paths.push(f.unwrap().path());
        }
        if paths.len() > count {
            break;
        }
    }
    paths.truncate(count);
    for p in &paths {
        std::fs::read(p).unwrap();
    }
    let mut t = [0.0f64; 5];
    let mut bytes = [0u64; 2];
    for p in &paths {
        let a = Instant::now();
        let f = TextureFile::open(p).unwrap();
        let b = Instant::now();
        let image = f.level_0().unwrap();
        let c = Instant::now();
        let l0 = Level::from_raster(image);
        let d = Instant::now();
        let l1 = l0.halved();
        let e = Instant::now();
        bytes[0] += l0.texels.len() as u64;
        bytes[1] += std::fs::metadata(p).unwrap().len();
        drop((l0, l1));
        let g = Instant::now();
        for (k, (x, y)) in [(a, b), (b, c), (c, d), (d, e), (e, g)].into_iter().enumerate() {
            t[k] += (y - x).as_secs_f64() * 1e3;
        }
    }
    let n = paths.len() as f64;
    println!(
        "open {:.2} level_0 {:.2} roots {:.2} halved {:.2} drop {:.2} ms; {:.2} Mpx, {:.0} kB a file",
        t[0] / n,
        t[1] / n,
        t[2] / n,
        t[3] / n,
        t[4] / n,
        bytes[0] as f64 / n / 1e6,
        bytes[1] as f64 / n / 1e3
    );
}
