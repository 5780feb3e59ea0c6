//! The constants of `map3d_base::limits` are those of `spec/limits.json`.

use map3d_base::asset::{Rank, Wrap};
use map3d_base::limits::{AO_RADIUS_M, DEEPEST_LEVEL, MAX_IMAGE_PX, MAX_IMAGE_SIDE_PX, MAX_SUNS, NAME_PATTERN, OBJECTS_PER_SHARD, QUALITY, TILE_PX};
use map3d_base::{Frame, LayerFormat, LayerKind, LayerSpec};
use serde_json::{Value, json};

#[test]
fn limits_are_those_of_the_specification() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../spec/limits.json");
    let specified: Value = serde_json::from_str(&std::fs::read_to_string(path).expect("the file is in the repository")).expect("JSON");
    let [ao_least, ao_most] = AO_RADIUS_M;
    let ours = json!({
        "tile_px": TILE_PX,
        "deepest_level": DEEPEST_LEVEL,
        "quality": QUALITY,
        "suns": MAX_SUNS,
        "ao_radius_m": [ao_least, ao_most as u64],
        "name": NAME_PATTERN,
        "image_side_px": MAX_IMAGE_SIDE_PX,
        "image_px": MAX_IMAGE_PX,
        "objects_per_shard": OBJECTS_PER_SHARD,
    });
    assert_eq!(ours, specified);
}

fn frame() -> Frame {
    Frame { look_at_deg: 0.0, pitch_deg: 45.0, u0_m: 0.0, v0_m: 0.0, d0_m: 0.0, size_m: 100.0, tile_px: 256, zmax: 3, layers: vec![] }
}

#[test]
fn a_frame_at_a_limit_is_valid_and_one_beyond_is_not() {
    let ao = |radius_m| Frame { layers: vec![LayerSpec { radius_m, ..LayerSpec::new(LayerKind::Ao, LayerFormat::Png) }], ..frame() };
    let color = |quality| Frame { layers: vec![LayerSpec { quality, ..LayerSpec::new(LayerKind::Color, LayerFormat::Webp) }], ..frame() };
    let day = |suns| Frame {
        layers: vec![LayerSpec { suns: vec![[0.0, 0.0, 1.0]; suns], ..LayerSpec::new(LayerKind::Sun16, LayerFormat::Png) }],
        ..frame()
    };
    let valid = [
        Frame { tile_px: 512, ..frame() },
        Frame { zmax: DEEPEST_LEVEL, ..frame() },
        ao(AO_RADIUS_M[0]),
        ao(AO_RADIUS_M[1]),
        color(QUALITY[0]),
        color(QUALITY[1]),
        day(MAX_SUNS),
    ];
    for frame in valid {
        assert!(frame.validate().is_ok(), "{frame:?}");
    }
    let invalid = [
        Frame { tile_px: 128, ..frame() },
        Frame { tile_px: 1024, ..frame() },
        Frame { zmax: DEEPEST_LEVEL + 1, ..frame() },
        ao(0.49),
        ao(200.01),
        color(0),
        color(101),
        day(MAX_SUNS + 1),
    ];
    for frame in invalid {
        assert!(frame.validate().is_err(), "{frame:?}");
    }
}

#[test]
fn codes_of_wrap_modes_and_ranks_read_back() {
    for code in 0..=u8::MAX {
        assert_eq!(Wrap::from_code(code).map(|wrap| wrap as u8), (code < 5).then_some(code));
        assert_eq!(Rank::from_number(code).map(|rank| rank as u8), (code < 6).then_some(code));
    }
}
