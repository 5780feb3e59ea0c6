//! Codecs side by side: milliseconds of CPU time and bytes per tile and layer, for the G-buffers in seam files.
//!
//! `cargo run --release -p map3d-image --example codecs -- tiles/*.seam` (`map3d-render`'s example `tiles` writes such files with `--save`).

use map3d_base::{LayerFormat, LayerKind, LayerSpec};
use map3d_image::GBuffer;
use map3d_image::encode::{Deflate, Encoder, Filter, bytes_from_normals, bytes_from_u32, color_from_linear, encode_jpeg, encode_png, encode_webp};
use map3d_image::seam::read_seam;

/// A way to encode a layer of a tile.
type Codec = (String, Box<dyn Fn(&GBuffer) -> Vec<u8>>);

fn main() {
    let tiles: Vec<GBuffer> =
        std::env::args().skip(1).map(|path| read_seam(&path, &std::fs::read(&path).expect("readable")).expect("a seam")).collect();
    assert!(!tiles.is_empty(), "give seam files");
    println!("{} tiles of {} px", tiles.len(), tiles[0].width);
    for (name, codec) in codecs() {
        let mut best = f64::INFINITY;
        let mut bytes = 0;
        for _ in 0..5 {
            let start = cpu_s();
            bytes = tiles.iter().map(|g| codec(g).len()).sum::<usize>();
            best = best.min(cpu_s() - start);
        }
        let n = tiles.len() as f64;
        println!("{name:42} {:8.3} ms {:9.1} KB", best * 1e3 / n, bytes as f64 / n / 1e3);
    }
}

fn codecs() -> Vec<Codec> {
    let mut out: Vec<Codec> =
        vec![("color to sRGB only".into(), Box::new(|g| color_from_linear((g.width, g.height), &g.color).pixels.into_flattened()))];
    for quality in [80, 90] {
        out.push((
            format!("color webp q{quality}"),
            Box::new(move |g| encode_webp(&color_from_linear((g.width, g.height), &g.color), quality, false).expect("webp")),
        ));
    }
    out.push(("color jpeg q85".into(), Box::new(|g| encode_jpeg(&color_from_linear((g.width, g.height), &g.color), 85, false).expect("jpeg"))));
    for filter in [Filter::None, Filter::Sub, Filter::Up, Filter::Average, Filter::Paeth] {
        for deflate in [Deflate::Fast, Deflate::Matching, Deflate::Thorough] {
            let png = move |g: &GBuffer, channels, bytes: &[u8]| encode_png((g.width, g.height), channels, bytes, filter, deflate);
            let name = |layer| format!("{layer} png {filter:?} {deflate:?}");
            out.push((
                name("color"),
                Box::new(move |g| {
                    let rgb: Vec<u8> = color_from_linear((g.width, g.height), &g.color).pixels.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
                    png(g, 3, &rgb)
                }),
            ));
            out.push((name("normal"), Box::new(move |g| png(g, 3, &bytes_from_normals(&g.normal)))));
            out.push((name("id"), Box::new(move |g| png(g, 4, bytes_from_u32(&g.id)))));
            out.push((name("depth"), Box::new(move |g| png(g, 4, bytes_from_u32(&g.depth)))));
        }
    }
    for kind in [LayerKind::Color, LayerKind::Normal, LayerKind::Id, LayerKind::Depth] {
        let spec = LayerSpec::new(kind, if kind == LayerKind::Color { LayerFormat::Webp } else { LayerFormat::Png });
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
