//! Decoding: the pixels of every format are preserved; exceeded limits and damaged files are errors.

use std::path::{Path, PathBuf};

use crate::common::{Random, noise, png};
use map3d_base::Error;
use map3d_image::decode::{decode, probe};
use map3d_image::encode::{encode_jpeg, encode_webp};
use map3d_image::{ImageLimits, Raster};

fn read(bytes: &[u8]) -> map3d_base::Result<Raster> {
    decode(Path::new("test image"), bytes, &ImageLimits::default())
}

fn mean_error(a: &Raster, b: &Raster) -> f64 {
    let sum: u64 = a.pixels.as_flattened().iter().zip(b.pixels.as_flattened()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.pixels.len() as f64 / 4.0
}

fn gradient(width: u32, height: u32) -> Raster {
    Raster::new(width, height, (0..width * height).map(|i| [(i % width * 3) as u8, (i / width * 2) as u8, 90, 255]).collect())
}

#[test]
fn png_pixels_round_trip_exactly() {
    for (w, h) in [(1, 1), (3, 5), (64, 64)] {
        let image = noise(w, h, 7);
        assert_eq!(read(&png(&image)).expect("png"), image);
    }
}

#[test]
fn lossy_formats_decode_to_similar_pixels() {
    let image = gradient(70, 50);
    assert!(mean_error(&read(&encode_jpeg(&image, 95).expect("jpeg")).expect("decodes"), &image) < 2.0);
    assert!(mean_error(&read(&encode_webp(&image, 95, false).expect("webp")).expect("decodes"), &image) < 3.0);
}

#[test]
fn bmp_gif_tga_and_tiff_are_read() {
    let image = gradient(20, 10);
    let rgba = image::RgbaImage::from_raw(20, 10, image.pixels.as_flattened().to_vec()).expect("20 × 10");
    for format in [image::ImageFormat::Bmp, image::ImageFormat::Tga, image::ImageFormat::Tiff, image::ImageFormat::Gif] {
        let mut bytes = std::io::Cursor::new(Vec::new());
        rgba.write_to(&mut bytes, format).expect("encodes");
        let back = read(bytes.get_ref()).unwrap_or_else(|e| panic!("{format:?}: {e}"));
        assert!(mean_error(&back, &image) < 1.0, "{format:?}");
    }
}

#[test]
fn limits_are_met_in_the_header() {
    let bytes = png(&noise(20, 30, 1));
    let ask = |side: u64, px: u64, decoded: u64| {
        let limits = ImageLimits { max_image_side_px: side, max_image_px: px, max_decoded_bytes: decoded };
        decode(Path::new("p"), &bytes, &limits)
    };
    assert!(ask(30, 600, 2400).is_ok() && ask(31, 601, 2401).is_ok());
    for (result, name, value) in
        [(ask(29, 600, 2400), "max_image_side_px", 29), (ask(30, 599, 2400), "max_image_px", 599), (ask(30, 600, 2399), "max_decoded_bytes", 2399)]
    {
        let Err(Error::Limit { limit, value: got, .. }) = result else { panic!("{name}: {result:?}") };
        assert_eq!((limit, got), (name, value));
    }
}

#[test]
fn a_huge_header_is_refused_before_decoding() {
    let mut bytes = png(&noise(4, 4, 1));
    bytes[16..20].copy_from_slice(&40_000u32.to_be_bytes());
    let crc = crc32fast::hash(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&crc.to_be_bytes());
    assert!(matches!(probe(Path::new("p"), &bytes, &ImageLimits::default()), Err(Error::Limit { got: 40_000, .. })));
}

#[test]
fn damage_is_an_error_or_an_image_and_never_a_panic() {
    let image = noise(40, 30, 3);
    let sources = [png(&image), encode_jpeg(&image, 80).expect("jpeg"), encode_webp(&image, 80, false).expect("webp")];
    let mut random = Random(11);
    for source in &sources {
        for cut in (0..source.len()).step_by(source.len() / 40 + 1) {
            let _ = read(&source[..cut]);
        }
        for _ in 0..300 {
            let mut bad = source.clone();
            for _ in 0..=random.below(4) {
                let at = random.below(bad.len() as u32) as usize;
                bad[at] = random.bits() as u8;
            }
            if let Ok(read) = read(&bad) {
                assert!(read.pixels.len() < 128 << 20);
            }
        }
    }
    assert!(read(&[]).is_err() && read(b"hello").is_err());
}

/// Public malformed files; `MAP3D_DATA` names their folder.
#[test]
fn public_malformed_images_never_panic() {
    let Some(data) = std::env::var_os("MAP3D_DATA").map(PathBuf::from) else {
        eprintln!("SKIPPED: MAP3D_DATA is not set");
        return;
    };
    let (mut seen, mut refused, mut must_refuse) = (0, 0, 0);
    for folder in ["malformed-jpeg-afl-small", "malformed-pngsuite", "malformed-gltf-validator-A", "malformed-assimp"] {
        for path in files(&data.join(folder)) {
            let bytes = std::fs::read(&path).expect("readable");
            let result = decode(&path, &bytes, &ImageLimits::default());
            let name = path.file_name().expect("a file").to_string_lossy().into_owned();
            seen += 1;
            refused += u32::from(result.is_err());
            if folder == "malformed-pngsuite" && name.starts_with('x') && name.ends_with(".png") {
                must_refuse += 1;
                assert!(result.is_err(), "{name} is corrupt");
            } else if folder == "malformed-pngsuite" && name.ends_with(".png") {
                assert!(result.is_ok(), "{name}: {result:?}");
            }
        }
    }
    eprintln!("{seen} files seen, {refused} refused, {must_refuse} of them known corrupt PNGs");
    assert!(seen > 100 && must_refuse > 5);
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut out = Vec::new();
    for entry in std::fs::read_dir(folder).expect("folder").flatten() {
        if entry.path().is_dir() { out.extend(files(&entry.path())) } else { out.push(entry.path()) }
    }
    out
}
