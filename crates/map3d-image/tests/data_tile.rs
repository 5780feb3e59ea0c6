//! Data tiles: equal pixels after encoding and decoding, the specification's vectors, and refusals of hostile bytes.

use crate::common::Random;
use map3d_base::DEPTH_NOTHING;
use map3d_image::data_tile::{DataTile, DataTileEncoder, MAX_DATA_TILE_PX, decode_data_tile};
use map3d_image::encode::{Deflate, Encoder, bytes_from_normals};
use serde_json::Value;

fn empty(width: u32, height: u32) -> DataTile {
    let n = (width * height) as usize;
    DataTile { width, height, normals: vec![[0; 3]; n], ids: vec![0; n], depths: vec![DEPTH_NOTHING; n] }
}

fn made(width: u32, height: u32, mut pixel: impl FnMut(u32, u32) -> ([u8; 3], u32, u32)) -> DataTile {
    let mut tile = empty(width, height);
    for k in 0..tile.ids.len() {
        (tile.normals[k], tile.ids[k], tile.depths[k]) = pixel(k as u32 % width, k as u32 / width);
    }
    tile
}

fn encode(tile: &DataTile, deflate: Deflate) -> Vec<u8> {
    let normals: Vec<u32> = tile.normals.iter().map(|n| u32::from_le_bytes([n[0], n[1], n[2], 0])).collect();
    DataTileEncoder::default().encode((tile.width, tile.height), &normals, &tile.ids, &tile.depths, deflate).expect("encodes")
}

fn assert_round_trip(tile: &DataTile, what: &str) -> usize {
    let bytes = encode(tile, Deflate::Matching);
    let decoded = decode_data_tile(&bytes).unwrap_or_else(|e| panic!("{what}: {e}"));
    assert!(decoded == *tile, "{what}: the pixels differ");
    assert_eq!(decode_data_tile(&encode(tile, Deflate::Thorough)).expect("thorough"), *tile, "{what}");
    bytes.len()
}

/// Depth of a slanted plane, rounded.
fn plane(right: f64, down: f64) -> impl Fn(u32, u32) -> u32 {
    move |x, y| (2_000_000.0 + right * f64::from(x) + down * f64::from(y)).round() as u32
}

#[test]
fn pixels_are_equal_after_decoding() {
    for (width, height) in [(256, 256), (512, 512), (1, 1), (1, 9), (9, 1), (300, 7), (255, 257), (1_024, 3)] {
        let size = format!("{width} × {height}");
        assert_round_trip(&empty(width, height), &format!("empty {size}"));
        let slanted = plane(143.7, -88.3);
        assert_round_trip(&made(width, height, |x, y| ([128, 128, 255], 7, slanted(x, y))), &format!("one plane {size}"));
        let mut random = Random(u64::from(width));
        assert_round_trip(&made(width, height, |_, _| ([random.bits() as u8; 3], random.bits() << 1, random.bits() << 1)), &format!("noise {size}"));
        assert_round_trip(&mixed(width, height, 5), &format!("faces, bumps and holes {size}"));
    }
}

/// Faces on planes, of which some repeat their normal, behind columns; bumpy ground; holes; scattered pixels.
fn mixed(width: u32, height: u32, seed: u64) -> DataTile {
    let mut random = Random(seed);
    let (wall, roof) = (plane(250.25, 31.5), plane(-77.0, 140.125));
    made(width, height, |x, y| match (x / 5 + y / 9) % 6 {
        0 => ([200, 90, 130], 40 + x / 11, wall(x, y)),
        1 => ([128, 128, 255], 3, 5_000_000 + 140 * y + random.below(9)),
        2 if random.below(7) == 0 => ([random.below(255) as u8, 7, 9], 900 + random.below(3), random.bits()),
        2 => ([0, 0, 0], 0, DEPTH_NOTHING),
        3 if random.below(40) == 0 => ([90, 90, 90], 8, roof(x, y) + 100_000),
        _ => ([90, 90, 90], 8, roof(x, y)),
    })
}

#[test]
fn any_value_is_kept() {
    let ids = [0, 1, u32::MAX];
    let depths = [0, 1, 1 << 31, u32::MAX - 1, DEPTH_NOTHING];
    let mut random = Random(4);
    assert_round_trip(
        &made(64, 64, |_, _| ([random.below(2) as u8 * 255; 3], ids[random.below(3) as usize], depths[random.below(5) as usize])),
        "extremes",
    );
    let steep = plane(99_000.0, -4_000.0);
    assert_round_trip(&made(20, 20, |x, y| ([1, 2, 3], 5, steep(x, y))), "a steep plane");
    let falling = |x: u32, y: u32| 70_000u32.wrapping_sub(9_000 * x + 100 * y);
    assert_round_trip(&made(20, 20, |x, y| ([1, 2, 3], 5, falling(x, y))), "a plane through depth 0");
}

#[test]
fn planes_take_few_bytes() {
    let bytes = assert_round_trip(&made(256, 256, |x, y| ([128, 128, 255], 7, plane(143.7, -88.3)(x, y))), "one plane");
    assert!(bytes < 200, "{bytes} bytes");
}

#[test]
fn the_encoder_of_layers_gives_the_bytes_of_their_pngs() {
    let mut random = Random(9);
    let normals: Vec<[i16; 3]> = (0..64).map(|k| if k % 7 == 0 { [0; 3] } else { [random.bits() as i16, -32_767, 32_767] }).collect();
    let (ids, depths): (Vec<u32>, Vec<u32>) = (0..64).map(|k| (k / 8, 1_000 + 3 * k)).unzip();
    let decoded = decode_data_tile(&Encoder::new().data_tile((8, 8), &normals, &ids, &depths).expect("encodes")).expect("decodes");
    assert_eq!((decoded.normals.as_flattened(), decoded.ids, decoded.depths), (&bytes_from_normals(&normals)[..], ids, depths));
}

#[test]
fn wrong_sizes_are_refused() {
    let encode = |size, n: usize| DataTileEncoder::default().encode(size, &vec![0; n], &vec![0; n], &vec![0; n], Deflate::Matching);
    for (size, n) in [((0, 0), 0), ((2, 2), 3), ((MAX_DATA_TILE_PX + 1, 1), MAX_DATA_TILE_PX as usize + 1)] {
        assert!(encode(size, n).is_err(), "{size:?}");
    }
}

fn vectors() -> Value {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../spec/vectors/data-tiles.json");
    serde_json::from_slice(&std::fs::read(path).expect("vectors")).expect("JSON")
}

fn bytes_of(row: &Value) -> Vec<u8> {
    let digit = |byte: u8| b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/".iter().position(|d| *d == byte).map(|d| d as u32);
    let text = row["base64"].as_str().expect("text").as_bytes();
    let four = |part: &[u8]| {
        let digits: Vec<u32> = part.iter().map_while(|b| digit(*b)).collect();
        let n = digits.iter().fold(0, |n, d| n << 6 | d) << (6 * (4 - digits.len()));
        n.to_be_bytes()[1..digits.len().max(1)].to_vec()
    };
    text.chunks(4).flat_map(four).collect()
}

#[test]
fn vectors_decode_to_their_pixels() {
    let numbers =
        |row: &Value, key: &str| row[key].as_array().expect("array").iter().map(|n| n.as_u64().expect("number") as u32).collect::<Vec<u32>>();
    for row in vectors()["tiles"].as_array().expect("tiles") {
        let tile = decode_data_tile(&bytes_of(row)).unwrap_or_else(|e| panic!("{}: {e}", row["name"]));
        let normals: Vec<u32> = tile.normals.iter().map(|n| u32::from_le_bytes([n[0], n[1], n[2], 0])).collect();
        assert_eq!((u64::from(tile.width), u64::from(tile.height)), (row["width"].as_u64().unwrap(), row["height"].as_u64().unwrap()));
        assert_eq!(
            (normals, tile.ids.clone(), tile.depths.clone()),
            (numbers(row, "normal"), numbers(row, "id"), numbers(row, "depth")),
            "{}",
            row["name"]
        );
        assert_round_trip(&tile, row["name"].as_str().unwrap());
    }
}

#[test]
fn vectors_of_broken_tiles_are_refused() {
    let vectors = vectors();
    let refused = vectors["refused"].as_array().expect("refused");
    assert!(refused.len() > 30);
    for row in refused {
        assert!(decode_data_tile(&bytes_of(row)).is_err(), "{}", row["why"]);
    }
    let version_2 = refused.iter().find(|row| row["why"] == "version 2").expect("a tile of version 2");
    let message = decode_data_tile(&bytes_of(version_2)).unwrap_err().to_string();
    assert!(message.contains("version 2") && message.contains("version 1"), "{message}");
}

/// Decodes bodies that were changed before they were deflated, so that the checksum holds.
#[test]
fn changed_bytes_are_refused_or_give_other_pixels() {
    let tile = mixed(40, 30, 6);
    let bytes = encode(&tile, Deflate::Matching);
    let size = u32::from_le_bytes(bytes[8..12].try_into().unwrap()) as usize;
    let mut body = vec![0; size];
    libdeflater::Decompressor::new().zlib_decompress(&bytes[24..], &mut body).expect("inflates");
    let mut random = Random(11);
    let (mut refused, mut other) = (0, 0);
    for _ in 0..4_000 {
        let (mut header, mut changed) = (bytes[..24].to_vec(), body.clone());
        for _ in 0..=random.below(3) {
            let at = random.below(size as u32 + 20) as usize;
            let byte = if at < 20 { &mut header[4 + at] } else { &mut changed[at - 20] };
            *byte = [byte.wrapping_add(1), 0, 255, random.bits() as u8][random.below(4) as usize];
        }
        let mut compressor = libdeflater::Compressor::new(libdeflater::CompressionLvl::new(1).unwrap());
        let mut stream = vec![0; compressor.zlib_compress_bound(size)];
        let n = compressor.zlib_compress(&changed, &mut stream).expect("deflates");
        match decode_data_tile(&[&header[..], &stream[..n]].concat()) {
            Ok(decoded) => other += usize::from(decoded != tile),
            Err(_) => refused += 1,
        }
    }
    assert!(refused > 1_000 && other > 500, "{refused} refused, {other} with other pixels");
}

#[test]
fn truncated_bytes_are_refused() {
    let bytes = encode(&mixed(40, 30, 7), Deflate::Matching);
    for end in 0..bytes.len() {
        assert!(decode_data_tile(&bytes[..end]).is_err(), "{end} bytes");
    }
    assert!(decode_data_tile(&[&bytes[..], b"more"].concat()).is_err(), "bytes after the stream");
}

#[test]
fn random_bytes_are_refused() {
    let mut random = Random(12);
    for n in 0..2_000 {
        let mut bytes: Vec<u8> = (0..n).map(|_| random.bits() as u8).collect();
        if n >= 4 {
            bytes[..4].copy_from_slice(b"M3D\x01");
        }
        assert!(decode_data_tile(&bytes).is_err(), "{n} bytes");
    }
}
