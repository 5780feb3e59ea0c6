//! Layers as sent (spec/pyramid.md §6).

use crate::common::{Random, noise};
use map3d_base::layers::{AO, COLOR, DEPTH, DEPTH2, ID, NORMAL, SUN, SUN16};
use map3d_base::{LayerFormat, LayerKind, LayerSpec};
use map3d_image::decode::decode;
use map3d_image::encode::{Deflate, Encoder, Filter, bytes_from_normals, bytes_from_u32, color_from_linear, decode_png, encode_png};
use map3d_image::gbuffer::normal_from_vector;
use map3d_image::srgb::LINEAR16;
use map3d_image::{Arrays, GBuffer};
use serde_json::Value;

fn data_vectors() -> Value {
    let path = format!("{}/../../spec/vectors/data.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).expect("vectors")).expect("JSON")
}

fn byte(v: &Value) -> u8 {
    u8::try_from(v.as_u64().expect("number")).expect("a byte")
}

#[test]
fn data_bytes_follow_the_vectors() {
    let vectors = data_vectors();
    for row in vectors["uint32"].as_array().expect("rows") {
        let value = row["value"].as_u64().expect("number") as u32;
        let expected: Vec<u8> = row["rgba"].as_array().expect("four").iter().map(byte).collect();
        assert_eq!(bytes_from_u32(&[value]), expected);
    }
    for row in vectors["normal"].as_array().expect("rows") {
        let n = [0, 1, 2].map(|k| row["n"][k].as_f64().expect("number"));
        let expected: Vec<u8> = row["rgb"].as_array().expect("three").iter().map(byte).collect();
        assert_eq!(bytes_from_normals(&[normal_from_vector(n).expect("has a direction")]), expected);
    }
    assert_eq!(bytes_from_normals(&[[0; 3]]), [0, 0, 0]);
}

#[test]
fn png_round_trips_with_every_filter_and_deflate() {
    let image = noise(33, 17, 5);
    let rgb: Vec<u8> = image.pixels.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
    for filter in [Filter::None, Filter::Sub, Filter::Up, Filter::Average, Filter::Paeth] {
        for deflate in [Deflate::Fast, Deflate::Matching] {
            let grey: Vec<u8> = rgb.iter().step_by(3).copied().collect();
            for (channels, pixels) in [(1, &grey[..]), (2, &rgb[..2 * grey.len()]), (3, &rgb[..]), (4, image.pixels.as_flattened())] {
                let back = decode_png(&encode_png((33, 17), channels, pixels, filter, deflate)).expect("sound");
                assert_eq!((back.width, back.height, back.channels, &back.pixels[..]), (33, 17, channels, pixels), "{filter:?} {deflate:?}");
            }
        }
    }
}

#[test]
fn data_layers_are_lossless() {
    let mut random = Random(3);
    let mut g = GBuffer::empty(256, 256);
    g[ID].iter_mut().for_each(|v| *v = random.bits() << 1);
    g[DEPTH].iter_mut().enumerate().for_each(|(i, v)| *v = 1_000_000 + (i as u32 % 256) * 37 + (i as u32 / 256) * 91);
    g[NORMAL].iter_mut().for_each(|v| *v = normal_from_vector([random.unit(), random.unit(), 0.1]).expect("has a direction"));
    let mut encoder = Encoder::new();
    let mut layer = |kind| {
        let spec = LayerSpec::new(kind, LayerFormat::Png);
        let bytes = encoder.layer(&g, &spec).expect("encodes");
        assert_eq!(&bytes[24..29], &[8, if kind == LayerKind::Normal { 2 } else { 6 }, 0, 0, 0], "8 bit, colour type, not interlaced");
        decode_png(&bytes).expect("sound").pixels
    };
    assert_eq!(layer(LayerKind::Id), bytes_from_u32(&g[ID]));
    assert_eq!(layer(LayerKind::Depth), bytes_from_u32(&g[DEPTH]));
    assert_eq!(layer(LayerKind::Normal), bytes_from_normals(&g[NORMAL]));
}

#[test]
fn shades_and_suns_are_lossless() {
    let mut random = Random(4);
    let arrays = [LayerKind::Sun, LayerKind::Sun16, LayerKind::Ao, LayerKind::Depth2].into_iter().fold(Arrays::LEAST, Arrays::and);
    let mut g = GBuffer::with(64, 64, arrays);
    g[SUN].iter_mut().for_each(|v| *v = random.bits() as u8);
    g[AO].iter_mut().for_each(|v| *v = random.bits() as u8);
    g[SUN16].iter_mut().for_each(|v| *v = random.bits() as u16);
    g[DEPTH2].iter_mut().for_each(|v| *v = random.bits());
    let layer = |kind, color_type: u8| {
        let bytes = Encoder::new().layer(&g, &LayerSpec::new(kind, LayerFormat::Png)).expect("encodes");
        assert_eq!(&bytes[24..26], &[8, color_type]);
        decode_png(&bytes).expect("sound").pixels
    };
    assert_eq!(layer(LayerKind::Sun, 0), g[SUN]);
    assert_eq!(layer(LayerKind::Ao, 0), g[AO]);
    assert_eq!(layer(LayerKind::Sun16, 4), g[SUN16].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
    assert_eq!(layer(LayerKind::Depth2, 6), bytes_from_u32(&g[DEPTH2]));
    assert!(Encoder::new().layer(&g, &LayerSpec::new(LayerKind::Color, LayerFormat::Png)).is_err(), "an array that is not there");
}

#[test]
fn data_layers_refuse_lossy_formats() {
    let g = GBuffer::empty(4, 4);
    for kind in [LayerKind::Id, LayerKind::Depth, LayerKind::Normal] {
        for format in [LayerFormat::Webp, LayerFormat::Jpeg] {
            assert!(Encoder::new().layer(&g, &LayerSpec::new(kind, format)).is_err());
        }
    }
    assert!(Encoder::new().layer(&g, &LayerSpec { quality: 0, ..LayerSpec::new(LayerKind::Color, LayerFormat::Jpeg) }).is_err());
    assert!(Encoder::new().color((4, 5), &g[COLOR], LayerFormat::Png, 80).is_err());
}

#[test]
fn every_byte_and_alpha_survives_linear_light() {
    for b in 0..=255u8 {
        let l = LINEAR16[b as usize];
        assert_eq!(color_from_linear((1, 1), &[[l, l, l, 65_535]]).pixels[0], [b, b, b, 255]);
    }
    let half = color_from_linear((1, 1), &[[LINEAR16[200] / 2, 0, 0, 32_768]]).pixels[0];
    assert_eq!(half, [200, 0, 0, 128]);
}

#[test]
fn uncovered_pixels_take_the_nearest_covered_colour() {
    let mut color = vec![[0u16; 4]; 64];
    color[9] = [65_535, 0, 0, 65_535];
    color[54] = [0, 0, 65_535, 65_535];
    let image = color_from_linear((8, 8), &color);
    assert_eq!(image.pixels[0], [255, 0, 0, 0]);
    assert_eq!(image.pixels[63], [0, 0, 255, 0]);
    assert_eq!(image.pixels[9], [255, 0, 0, 255]);
}

#[test]
fn colour_formats_keep_coverage_where_they_have_alpha() {
    let mut g = GBuffer::empty(64, 64);
    for (i, c) in g[COLOR].iter_mut().enumerate() {
        if i % 64 < 40 {
            *c = [30_000, 20_000, 10_000, 65_535];
        }
    }
    for (format, alpha) in [(LayerFormat::Png, true), (LayerFormat::Webp, true), (LayerFormat::Jpeg, false)] {
        let bytes = Encoder::new().layer(&g, &LayerSpec { quality: 85, ..LayerSpec::new(LayerKind::Color, format) }).expect("encodes");
        let image = decode(std::path::Path::new("tile"), &bytes, &map3d_image::ImageLimits::default()).expect("decodes");
        assert_eq!((image.pixels[0][3], image.pixels[50][3]), (255, if alpha { 0 } else { 255 }), "{format:?}");
        assert!(image.pixels[10].iter().zip([179u8, 149, 109]).all(|(a, b)| a.abs_diff(b) < 6), "{format:?} {:?}", image.pixels[10]);
        assert!(image.pixels[55].iter().zip([179u8, 149, 109]).all(|(a, b)| a.abs_diff(b) < 12), "{format:?} filled {:?}", image.pixels[55]);
    }
}

#[test]
fn small_tiles_take_fewer_bytes_and_show_the_same() {
    let mut random = Random(29);
    let arrays = [LayerKind::Color, LayerKind::Normal, LayerKind::Sun, LayerKind::Ao, LayerKind::Sun16].into_iter().fold(Arrays::LEAST, Arrays::and);
    let mut g = GBuffer::with(256, 256, arrays);
    for i in 0..g[ID].len() {
        let (x, y) = (i as u32 % 256, i as u32 / 256);
        let house = x / 40 + y / 24 * 7;
        g[ID][i] = 1000 + house;
        g[DEPTH][i] = 900_000 + 117 * x + (house * 7919 % 31) * y;
        g[NORMAL][i] = normal_from_vector([f64::from(house % 5) - 2.0, f64::from(house % 3) - 1.0, 1.0]).expect("has a direction");
        let light = 20_000 + (house * 911 % 29_000) as u16 + random.below(3000) as u16;
        g[COLOR][i] = [light, light / 2, light / 3, 65_535];
        (g[SUN][i], g[AO][i], g[SUN16][i]) = (if x > y { 255 } else { 0 }, (x / 2 + house) as u8, house as u16);
    }
    let tile = |kind, format, small| Encoder::new().layer(&g, &LayerSpec { small, ..LayerSpec::new(kind, format) }).expect("encodes");
    for kind in [LayerKind::Color, LayerKind::Normal, LayerKind::Id, LayerKind::Depth, LayerKind::Sun, LayerKind::Ao, LayerKind::Sun16] {
        let [quick, small] = [false, true].map(|small| tile(kind, LayerFormat::Png, small));
        let alike = matches!(kind, LayerKind::Sun | LayerKind::Ao | LayerKind::Sun16);
        assert!(if alike { small == quick } else { small.len() < quick.len() }, "{kind:?}: {} and {} bytes", small.len(), quick.len());
        assert_eq!(decode_png(&small).expect("sound"), decode_png(&quick).expect("sound"), "{kind:?}");
    }
    let [quick, small] = [false, true].map(|small| tile(LayerKind::Color, LayerFormat::Webp, small));
    assert!(small.len() < quick.len(), "{} and {} bytes", small.len(), quick.len());
    let [a, b] = [&quick, &small].map(|t| decode(std::path::Path::new("tile"), t, &map3d_image::ImageLimits::default()).expect("decodes"));
    let worst = a.pixels.as_flattened().iter().zip(b.pixels.as_flattened()).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(worst <= Some(40), "{worst:?}");
    let jpegs = [false, true].map(|small| tile(LayerKind::Color, LayerFormat::Jpeg, small));
    assert_eq!(jpegs[0], jpegs[1], "JPEG is always encoded for size");
}

#[test]
fn encoded_bytes_are_the_same_again() {
    let mut random = Random(17);
    let mut g = GBuffer::empty(64, 64);
    g[COLOR].iter_mut().for_each(|c| *c = [random.below(65_536) as u16, 5, 9, 65_535]);
    let mut reused = Encoder::new();
    for format in [LayerFormat::Png, LayerFormat::Webp, LayerFormat::Jpeg] {
        let spec = LayerSpec::new(LayerKind::Color, format);
        let first = reused.layer(&g, &spec).expect("encodes");
        assert_eq!(reused.layer(&g, &spec).expect("encodes"), first);
        assert_eq!(Encoder::new().layer(&g, &spec).expect("encodes"), first);
    }
}
