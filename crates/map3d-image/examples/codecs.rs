//! Measures codecs: milliseconds of CPU time and bytes per tile and layer for the G-buffers in seam files; nanoseconds per pixel to decode any other
//! file.
//!
//! `cargo run --release -p map3d-image --example codecs -- [--only NAME] tiles/*.seam textures/*.jpg` (`map3d-render`'s example `tiles` writes seams with
//! `--save`; NAME is part of a codec's name).

use std::path::Path;

use map3d_base::layers::{COLOR, DEPTH, ID, NORMAL};
use map3d_base::{LayerFormat, LayerKind, LayerSpec};
use map3d_image::decode::decode;
use map3d_image::encode::{Deflate, Encoder, Filter, bytes_from_normals, bytes_from_u32, color_from_linear, encode_jpeg, encode_png, encode_webp};
use map3d_image::seam::read_seam;
use map3d_image::{GBuffer, ImageLimits};

/// A way to encode a layer of a tile.
type Codec = (String, Box<dyn Fn(&GBuffer) -> Vec<u8>>);

fn main() {
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    let only = if args.first().is_some_and(|arg| arg == "--only") { args.drain(..2).nth(1).expect("a name") } else { String::new() };
    let (seams, images): (Vec<_>, Vec<_>) = args.into_iter().partition(|path| path.ends_with(".seam"));
    assert!(!seams.is_empty() || !images.is_empty(), "give seam files or images");
    measure_encoding(&seams, &only);
    measure_decoding(&images);
}

fn measure_encoding(seams: &[String], only: &str) {
    let tiles: Vec<GBuffer> = seams.iter().map(|path| read_seam(path, &std::fs::read(path).expect("readable")).expect("a seam")).collect();
    let Some(first) = tiles.first() else { return };
    println!("{} tiles of {} px", tiles.len(), first.width);
    for (name, codec) in codecs().into_iter().filter(|(name, _)| name.contains(only)) {
        let (seconds, bytes) = best_of_five(|| tiles.iter().map(|g| codec(g).len()).sum::<usize>());
        let n = tiles.len() as f64;
        println!("{name:42} {:8.3} ms {:9.1} KB", seconds * 1e3 / n, bytes as f64 / n / 1e3);
    }
}

fn measure_decoding(images: &[String]) {
    let files: Vec<Vec<u8>> = images.iter().map(|path| std::fs::read(path).expect("readable")).collect();
    if files.is_empty() {
        return;
    }
    let limits = ImageLimits::default();
    let decoded = |bytes: &Vec<u8>| decode(Path::new("image"), bytes, &limits).map_or(0, |image| image.pixels.len());
    let (seconds, pixels) = best_of_five(|| files.iter().map(decoded).sum::<usize>());
    println!("decode {} files, {:.1} Mpx {:24.3} ns/px", files.len(), pixels as f64 / 1e6, seconds * 1e9 / pixels as f64);
}

/// Returns the least CPU seconds of five runs, and the result of the last one.
fn best_of_five(work: impl Fn() -> usize) -> (f64, usize) {
    let (mut best, mut result) = (f64::INFINITY, 0);
    for _ in 0..5 {
        let start = cpu_s();
        result = work();
        best = best.min(cpu_s() - start);
    }
    (best, result)
}

fn codecs() -> Vec<Codec> {
    let mut out: Vec<Codec> =
        vec![("color to sRGB only".into(), Box::new(|g| color_from_linear((g.width, g.height), &g[COLOR]).pixels.into_flattened()))];
    for quality in [80, 90] {
        out.push((
            format!("color webp q{quality}"),
            Box::new(move |g| encode_webp(&color_from_linear((g.width, g.height), &g[COLOR]), quality, false).expect("webp")),
        ));
    }
    out.push(("color jpeg q85".into(), Box::new(|g| encode_jpeg(&color_from_linear((g.width, g.height), &g[COLOR]), 85).expect("jpeg"))));
    for filter in [Filter::None, Filter::Sub, Filter::Up, Filter::Average, Filter::Paeth] {
        for deflate in [Deflate::Fast, Deflate::Matching, Deflate::Thorough] {
            let png = move |g: &GBuffer, channels, bytes: &[u8]| encode_png((g.width, g.height), channels, bytes, filter, deflate);
            let name = |layer| format!("{layer} png {filter:?} {deflate:?}");
            out.push((
                name("color"),
                Box::new(move |g| {
                    let rgb: Vec<u8> = color_from_linear((g.width, g.height), &g[COLOR]).pixels.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
                    png(g, 3, &rgb)
                }),
            ));
            out.push((name("normal"), Box::new(move |g| png(g, 3, &bytes_from_normals(&g[NORMAL])))));
            out.push((name("id"), Box::new(move |g| png(g, 4, bytes_from_u32(&g[ID])))));
            out.push((name("depth"), Box::new(move |g| png(g, 4, bytes_from_u32(&g[DEPTH])))));
        }
    }
    for kind in [LayerKind::Color, LayerKind::Normal, LayerKind::Id, LayerKind::Depth, LayerKind::Data] {
        let format = match kind {
            LayerKind::Color => LayerFormat::Webp,
            LayerKind::Data => LayerFormat::M3d,
            _ => LayerFormat::Png,
        };
        let spec = LayerSpec::new(kind, format);
        let encoder = std::cell::RefCell::new(Encoder::new());
        out.push((format!("{kind:?} as shipped"), Box::new(move |g| encoder.borrow_mut().layer(g, &spec).expect("encodes"))));
    }
    out.sort_by(|a, b| a.0.split(' ').next().cmp(&b.0.split(' ').next()));
    out
}

fn cpu_s() -> f64 {
    let t = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}
