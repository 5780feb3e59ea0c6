//! JPEG pixels and bytes are those of libjpeg-turbo 3, whose digests are recorded here.

use std::path::Path;

use crate::common::noise;
use map3d_image::decode::decode;
use map3d_image::encode::encode_jpeg;
use map3d_image::{ImageLimits, Raster};
use twox_hash::XxHash3_64;

fn read(bytes: &[u8]) -> Raster {
    decode(Path::new("test image"), bytes, &ImageLimits::default()).expect("decodes")
}

#[test]
fn decoded_pixels_are_those_of_libjpeg_turbo() {
    let images: [(&[u8], u64); 3] = [
        (include_bytes!("data/420.jpg"), 0x3b3f_444a_5717_c41a),
        (include_bytes!("data/422-progressive.jpg"), 0x7101_edd4_444c_a63a),
        (include_bytes!("data/grey.jpg"), 0x0156_8ba0_0ab8_e15b),
    ];
    for (bytes, expected) in images {
        let image = read(bytes);
        assert_eq!((image.width, image.height), (45, 35));
        assert_eq!(XxHash3_64::oneshot(image.pixels.as_flattened()), expected, "{} bytes", bytes.len());
    }
}

#[test]
fn encoded_bytes_are_those_of_libjpeg_turbo() {
    let image = noise(45, 35, 7);
    let expected = [(10, 0x0a54_9744_98b9_8018), (85, 0x02c6_d481_220f_445e)];
    for (quality, digest) in expected {
        let bytes = encode_jpeg(&image, quality).expect("encodes");
        assert_eq!(XxHash3_64::oneshot(&bytes), digest, "quality {quality}");
    }
}

#[test]
fn a_cmyk_image_is_decoded() {
    let image = read(include_bytes!("data/cmyk.jpg"));
    assert_eq!((image.width, image.height), (45, 35));
}
