//! What holds for every kind of layer: a row whose array cannot be stored, reduced or encoded fails here.

use map3d_base::layers::{COLOR, DEPTH, ID, LAYERS, LayerRow};
use map3d_base::{LayerFormat, LayerSpec};
use map3d_image::encode::{Encoder, decode_png};
use map3d_image::seam::{read_seam, write_seam};
use map3d_image::{Arrays, GBuffer, PixelArray, reduce};

const SIDE: u32 = 16;

/// Returns a tile of one object whose array has the byte 1 throughout.
fn uniform(row: &LayerRow) -> GBuffer {
    let mut g = GBuffer::with(SIDE, SIDE, Arrays::LEAST.and(row.kind));
    g[ID].fill(7);
    g[DEPTH].fill(9);
    if row.array.is_some() {
        g.by_code_mut()[usize::from(row.code)].bytes_mut().fill(1);
    }
    g
}

#[test]
fn four_equal_children_have_an_equal_parent() {
    for row in &LAYERS {
        let child = uniform(row);
        assert_eq!(reduce([Some(&child); 4], SIDE), child, "{:?}", row.kind);
    }
}

#[test]
fn nothing_stays_nothing() {
    for row in &LAYERS {
        let nothing = GBuffer::with(SIDE, SIDE, Arrays::LEAST.and(row.kind));
        assert_eq!(reduce([Some(&nothing), None, Some(&nothing), None], SIDE), nothing, "{:?}", row.kind);
        let Some(array) = row.array else { continue };
        assert_eq!(nothing.by_code()[usize::from(row.code)], PixelArray::new(array.pixel, array.nothing, (SIDE * SIDE) as usize), "{:?}", row.kind);
    }
}

#[test]
fn seams_keep_the_array_of_each_kind() {
    for row in &LAYERS {
        let g = uniform(row);
        assert_eq!(read_seam("test", &write_seam(&g)).expect("sound"), g, "{:?}", row.kind);
    }
}

#[test]
fn other_arrays_are_dropped() {
    for row in &LAYERS {
        let mut g = GBuffer::with(SIDE, SIDE, LAYERS.iter().fold(Arrays::LEAST, |all, row| all.and(row.kind)));
        g.keep(Arrays::NONE.and(row.kind));
        assert_eq!(g.arrays(), Arrays::LEAST.and(row.kind), "{:?}", row.kind);
    }
}

#[test]
fn each_kind_is_encoded_in_its_formats_and_in_no_other() {
    for row in &LAYERS {
        let g = uniform(row);
        let encode = |format| Encoder::new().layer(&g, &LayerSpec::new(row.kind, format));
        for format in [LayerFormat::Webp, LayerFormat::Png, LayerFormat::Jpeg, LayerFormat::M3d] {
            assert_eq!(encode(format).is_ok(), row.formats.contains(&format), "{:?} as {format:?}", row.kind);
        }
        if row.formats == [LayerFormat::Png] {
            let image = decode_png(&encode(LayerFormat::Png).expect("its format")).expect("sound");
            assert_eq!((image.width, image.height), (SIDE, SIDE), "{:?}", row.kind);
        }
    }
}

#[test]
fn a_tile_without_colour_is_judged_by_its_ids() {
    let mut g = GBuffer::with(SIDE, SIDE, Arrays::LEAST);
    assert!(g.is_empty() && g[COLOR].is_empty());
    g[ID][3] = 1;
    assert!(!g.is_empty());
}
