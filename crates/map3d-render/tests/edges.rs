//! Edges of textures that end there (`Wrap::None`, `Wrap::Border`): at coordinates within [0,1], no pixel takes in a colour from outside the image.

use crate::town::{Town, frame, new_folder};
use map3d_base::asset::Wrap;
use map3d_base::layers::COLOR;
use map3d_image::srgb::LINEAR16;
use map3d_image::{GBuffer, Raster};
use map3d_render::TileRenderer;

const SIDE: usize = 64;
/// Brightest byte of both textures; the colours outside them are much brighter.
const BRIGHTEST: u8 = 110;
const SQUARE: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
/// Widths of a tile in metres: the textures are drawn at 0.2 to 130 texels per pixel.
const WIDTHS_M: [f64; 5] = [4.0, 22.0, 90.0, 400.0, 2_600.0];
const VIEWS: [(f64, f64); 3] = [(0.0, 30.0), (30.0, 45.0), (205.0, 80.0)];

/// Leaves with gaps, up to the edges of the image; the colour of transparent texels is white.
fn leaves() -> Raster {
    let pixel = |k: usize| {
        let (x, y) = (k % SIDE, k / SIDE);
        if (x / 5 + y / 7) % 3 == 0 { [255, 255, 255, 0] } else { [30, BRIGHTEST - (k * 13 % 40) as u8, 20, 255] }
    };
    Raster::new(SIDE as u32, SIDE as u32, (0..SIDE * SIDE).map(pixel).collect())
}

/// Windows with a dark border.
fn facade() -> Raster {
    let pixel = |k: usize| {
        let (x, y) = (k % SIDE, k / SIDE);
        let is_border = x.min(y).min(SIDE - 1 - x).min(SIDE - 1 - y) < 3;
        if is_border || (x / 8 + y / 8) % 2 == 0 { [20, 20, 25, 255] } else { [BRIGHTEST, 90, 60, 255] }
    };
    Raster::new(SIDE as u32, SIDE as u32, (0..SIDE * SIDE).map(pixel).collect())
}

/// Crossed and tilted panels around the origin, each showing the whole image.
fn panels(image: Raster, wrap: Wrap) -> Town {
    let mut town = Town::default();
    let material = town.textured(image, wrap);
    town.materials[material as usize].border = [1.0, 0.9, 1.0, 1.0];
    for (k, (dx, dy)) in [(5.0, 0.3), (-1.1, 4.7), (3.2, 3.1)].into_iter().enumerate() {
        let tilt = k as f64 * 0.9;
        let corners = [[-dx, -dy, -5.0], [dx, dy, -5.0], [dx + tilt, dy - tilt, 4.6], [-dx + tilt, -dy - tilt, 4.6]];
        town.panel(corners, SQUARE, material, k as u32 + 1);
    }
    town
}

/// Returns the greatest linear light of the covered part of any pixel, and the number of covered pixels.
fn brightest(g: &GBuffer) -> (f64, usize) {
    let covered = g[COLOR].iter().filter(|c| c[3] > 0);
    let light = |c: &[u16; 4]| f64::from(*c[..3].iter().max().expect("three")) * 65_535.0 / f64::from(c[3]);
    covered.fold((0.0, 0), |(most, count), c| (light(c).max(most), count + 1))
}

fn assert_no_pixel_is_brighter_than_the_texture(image: fn() -> Raster, wrap: Wrap) {
    let folder = new_folder("edges");
    let scene = panels(image(), wrap).open(&folder);
    // Bytes q of a level stand for light q² and may be half a step off, as may each mip level.
    let limit = f64::from(LINEAR16[BRIGHTEST as usize]) * 1.02 + 64.0;
    for (look_at, pitch) in VIEWS {
        for width in WIDTHS_M {
            let g = TileRenderer::new(&scene, &frame(look_at, pitch, width, 0)).expect("a frame").tile(0, 0).expect("renders").expect("has content");
            let (most, count) = brightest(&g);
            assert!(count > 0 && most <= limit, "{wrap:?} {look_at}/{pitch}, {width} m: {most} > {limit}, {count} pixels");
        }
    }
}

#[test]
fn a_tree_has_no_bright_edges() {
    assert_no_pixel_is_brighter_than_the_texture(leaves, Wrap::None);
    assert_no_pixel_is_brighter_than_the_texture(leaves, Wrap::Border);
}

#[test]
fn a_facade_has_no_bright_edges() {
    assert_no_pixel_is_brighter_than_the_texture(facade, Wrap::None);
    assert_no_pixel_is_brighter_than_the_texture(facade, Wrap::Border);
}

/// Pixels of `wide_wall` outside the image.
const OUTSIDE: [(usize, usize); 4] = [(200, 180), (64, 60), (200, 60), (235, 128)];

/// Renders a wall whose coordinates run from 0 to 2, so that the image covers its lower left quarter.
fn wide_wall(image: Raster, wrap: Wrap) -> GBuffer {
    let mut town = Town::default();
    let material = town.textured(image, wrap);
    town.materials[material as usize].diffuse = [0.0, 1.0, 1.0, 1.0];
    town.materials[material as usize].border = [1.0, 0.0, 1.0, 1.0];
    let c = [[-8.0, 0.0, -8.0], [8.0, 0.0, -8.0], [8.0, 0.0, 8.0], [-8.0, 0.0, 8.0]];
    town.panel(c, SQUARE.map(|uv| uv.map(|c| c * 2.0)), material, 7);
    let folder = new_folder("wide-wall");
    let scene = town.open(&folder);
    // 16 m are 256 pixels across; pitch 0 is not a view of tiles, and 30° halves nothing but the height by its cosine.
    TileRenderer::new(&scene, &frame(0.0, 30.0, 16.0, 0)).expect("a frame").tile(0, 0).expect("renders").expect("has content")
}

#[test]
fn outside_the_image_an_opaque_texture_shows_the_diffuse_or_the_border_colour() {
    for (wrap, expected) in [(Wrap::None, [0, 65_535, 65_535, 65_535]), (Wrap::Border, [65_535, 0, 65_535, 65_535])] {
        let g = wide_wall(facade(), wrap);
        for (x, y) in OUTSIDE {
            assert_eq!(g[COLOR][y * 256 + x], expected, "{wrap:?} ({x}, {y})");
        }
        let inside = g[COLOR][180 * 256 + 64];
        assert!(inside[0] == 0 && inside[1] < 20_000, "{wrap:?}: {inside:?}");
    }
}

#[test]
fn outside_the_image_a_cut_out_has_no_surface_unless_its_border_is_opaque() {
    let coverage = |g: &GBuffer, (x, y): (usize, usize)| g[COLOR][y * 256 + x][3];
    let (none, border) = (wide_wall(leaves(), Wrap::None), wide_wall(leaves(), Wrap::Border));
    for at in OUTSIDE {
        assert_eq!(coverage(&none, at), 0, "{at:?}");
        assert_eq!(coverage(&border, at), 65_535, "{at:?}");
    }
    assert!((40..90).any(|x| coverage(&none, (x, 180)) == 65_535));
}
