//! The scenes of the golden pictures, each a few metres wide and centred on the origin.

use std::f64::consts::{PI, TAU};

use map3d_base::Vec3;
use map3d_base::asset::{Instance, Rank, Wrap};
use map3d_image::Raster;

use crate::town::{SoupFace, Town, bricks};

pub struct GoldenPicture {
    pub name: &'static str,
    pub scene: fn() -> Town,
    /// Side of the picture.
    pub metres: f64,
    /// Look-at angle and pitch.
    pub views: &'static [(f64, f64)],
}

pub const PICTURES: [GoldenPicture; 6] = [
    GoldenPicture { name: "atlas-cube", scene: atlas_cube, metres: 11.0, views: &[(0.0, 30.0), (30.0, 45.0), (210.0, 60.0)] },
    GoldenPicture { name: "trees", scene: trees, metres: 14.0, views: &[(0.0, 30.0), (45.0, 22.5), (45.0, 90.0)] },
    GoldenPicture { name: "signs", scene: signs, metres: 13.0, views: &[(0.0, 30.0), (45.0, 45.0), (300.0, 10.0)] },
    GoldenPicture { name: "bricks", scene: brick_court, metres: 8.0, views: &[(0.0, 90.0), (20.0, 10.0)] },
    GoldenPicture { name: "balls", scene: balls, metres: 10.0, views: &[(0.0, 45.0), (90.0, 90.0)] },
    GoldenPicture { name: "gable", scene: gabled_house, metres: 14.0, views: &[(45.0, 45.0), (200.0, 60.0)] },
];

/// Four images in one: an F on yellow, an R on blue, stripes, a ramp; magenta between them.
fn atlas() -> Raster {
    const F: [u8; 7] = [0b11111, 0b10000, 0b10000, 0b11110, 0b10000, 0b10000, 0b10000];
    const R: [u8; 7] = [0b11110, 0b10001, 0b10001, 0b11110, 0b10100, 0b10010, 0b10001];
    let letter = |rows: &[u8; 7], x: usize, y: usize| (1..6).contains(&(x / 4)) && y >= 1 && y / 4 < 7 && rows[y / 4] >> (5 - x / 4) & 1 == 1;
    let pixel = |k: usize| {
        let (x, y) = (k % 64, k / 64);
        let (i, j) = (x % 32, y % 32);
        if !(2..30).contains(&i) || !(2..30).contains(&j) {
            return [255, 0, 255, 255];
        }
        match (x / 32, y / 32) {
            (0, 0) if letter(&F, i, j - 2) => [150, 20, 20, 255],
            (0, 0) => [235, 210, 70, 255],
            (1, 0) if letter(&R, i, j - 2) => [250, 250, 250, 255],
            (1, 0) => [40, 70, 160, 255],
            (0, 1) => [[60, 140, 90, 255], [220, 230, 225, 255]][i / 4 % 2],
            _ => [(j * 8) as u8, 90, 255 - (i * 8) as u8, 255],
        }
    };
    Raster::new(64, 64, (0..4096).map(pixel).collect())
}

pub fn atlas_cube() -> Town {
    let mut town = Town::default();
    let material = town.textured(atlas(), Wrap::Clamp);
    let h = 3.0;
    let sides: [[Vec3; 4]; 5] = [
        [[-h, -h, -h], [h, -h, -h], [h, -h, h], [-h, -h, h]],
        [[h, -h, -h], [h, h, -h], [h, h, h], [h, -h, h]],
        [[h, h, -h], [-h, h, -h], [-h, h, h], [h, h, h]],
        [[-h, h, -h], [-h, -h, -h], [-h, -h, h], [-h, h, h]],
        [[-h, -h, h], [h, -h, h], [h, h, h], [-h, h, h]],
    ];
    for (k, side) in sides.into_iter().enumerate() {
        // Side 0 shows F, 1 R, 2 stripes, 3 the ramp; the lid F again.
        let (u, v) = ((k % 2) as f32 / 2.0, if k % 4 < 2 { 0.5 } else { 0.0 });
        let (near, far) = (2.0 / 64.0, 30.0 / 64.0);
        town.panel(side, [[u + near, v + near], [u + far, v + near], [u + far, v + far], [u + near, v + far]], material, 10 + k as u32);
    }
    town
}

/// Round leaves on a transparent background.
fn leaves() -> Raster {
    let pixel = |k: usize| {
        let (x, y) = ((k % 32) as i32 * 2 - 31, (k / 32) as i32 * 2 - 31);
        let (i, j) = (k % 8, k / 32 % 8);
        let is_opaque = x * x + y * y < 31 * 31 && (i + j) % 8 < 5;
        [50 + (k * 7 % 40) as u8, 110 + (k * 13 % 60) as u8, 40, if is_opaque { 255 } else { 0 }]
    };
    Raster::new(32, 32, (0..1024).map(pixel).collect())
}

/// A trunk and two crossed quads.
fn tree(trunk: u32, crown: u32) -> Vec<SoupFace> {
    let mut town = Town::default();
    for (dx, dy) in [(0.2, 0.0), (0.0, 0.2)] {
        town.panel([[-dx, -dy, 0.0], [dx, dy, 0.0], [dx, dy, 2.0], [-dx, -dy, 2.0]], [[0.0; 2]; 4], trunk, 0);
    }
    for (dx, dy) in [(1.8, 0.0), (0.0, 1.8)] {
        let c = [[-dx, -dy, 1.4], [dx, dy, 1.4], [dx, dy, 5.0], [-dx, -dy, 5.0]];
        town.panel(c, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], crown, 0);
    }
    town.faces
}

/// Three trees: one unchanged, one rotated by 30° and small, one mirrored and stretched.
pub fn trees() -> Town {
    let mut town = Town::default();
    let (grass, trunk, crown) = (town.flat([0.45, 0.62, 0.35]), town.flat([0.36, 0.25, 0.18]), town.textured(leaves(), Wrap::Clamp));
    let z = -2.0;
    town.panel([[-6.0, -5.0, z], [6.0, -5.0, z], [6.0, 5.0, z], [-6.0, 5.0, z]], [[0.0; 2]; 4], grass, 0);
    town.prototypes = vec![tree(trunk, crown)];
    let (c, s) = (0.6, 0.35);
    let transforms = [
        [1.0, 0.0, 0.0, -3.0, 0.0, 1.0, 0.0, 1.5, 0.0, 0.0, 1.0, z],
        [c, -s, 0.0, 0.5, s, c, 0.0, -2.5, 0.0, 0.0, 0.6, z],
        [-1.0, 0.4, 0.0, 3.0, 0.4, 0.8, 0.1, 1.0, 0.0, 0.0, 1.3, z],
    ];
    town.instances = transforms.into_iter().zip(20..).map(|(transform, object)| Instance { prototype: 1, object, transform }).collect();
    town
}

/// The atlas with a transparent background.
fn letters() -> Raster {
    let mut image = atlas();
    image.pixels.iter_mut().filter(|p| p[0] > 200).for_each(|p| p[3] = 0);
    image
}

/// A wall with a door, signs with holes over both, and a road on the ground: coplanar faces that differ in rank.
pub fn signs() -> Town {
    let mut town = Town::default();
    let colors = [[0.85, 0.8, 0.7], [0.45, 0.25, 0.15], [0.5, 0.6, 0.4], [0.35, 0.35, 0.38]];
    let [wall, door, earth, asphalt] = colors.map(|c| town.flat(c));
    let sign = town.textured(letters(), Wrap::Clamp);
    let none = [[0.0; 2]; 4];
    let ground = |x0: f64, y0: f64, x1: f64, y1: f64| [[x0, y0, -3.0], [x1, y0, -3.0], [x1, y1, -3.0], [x0, y1, -3.0]];
    let upright = |x0: f64, z0: f64, x1: f64, z1: f64| [[x0, 0.0, z0], [x1, 0.0, z0], [x1, 0.0, z1], [x0, 0.0, z1]];
    let uv = [[0.0, 0.5], [0.5, 0.5], [0.5, 1.0], [0.0, 1.0]];
    for (object, rank, material, corners, uv) in [
        (1, Rank::Terrain, earth, ground(-6.0, -5.0, 6.0, 3.0), none),
        (2, Rank::Road, asphalt, ground(-6.0, -4.0, 6.0, -1.5), none),
        (3, Rank::Other, wall, upright(-5.0, -3.0, 5.0, 3.0), none),
        (4, Rank::Opening, door, upright(-1.0, -3.0, 1.0, 1.0), none),
        (5, Rank::Installation, sign, upright(-3.5, -1.0, 0.0, 2.5), uv),
        (6, Rank::Opening, sign, upright(0.5, -1.0, 4.0, 2.5), uv),
    ] {
        let first = town.faces.len();
        town.panel(corners, uv, material, object);
        town.faces[first..].iter_mut().for_each(|f| f.rank = rank);
    }
    town
}

/// A pavement with a wall at its end.
pub fn brick_court() -> Town {
    let mut town = Town::default();
    let brick = town.textured(bricks(64), Wrap::Wrap);
    town.ground(7.0, 5.0, brick, 0);
    town.panel([[-7.0, 5.0, 0.0], [7.0, 5.0, 0.0], [7.0, 5.0, 3.0], [-7.0, 5.0, 3.0]], [[0.0, 0.0], [5.0, 0.0], [5.0, 1.1], [0.0, 1.1]], brick, 1);
    town
}

fn ball(is_smooth: bool) -> Vec<SoupFace> {
    let point = |i: usize, j: usize| {
        let (t, a) = (PI * i as f64 / 8.0, TAU * j as f64 / 16.0);
        // Rounded, so that the picture does not depend on the library's sine.
        [t.sin() * a.cos(), t.sin() * a.sin(), t.cos()].map(|c| (c * 256.0).round() / 256.0)
    };
    let mut out = Vec::new();
    for (i, j) in (0..8).flat_map(|i| (0..16).map(move |j| (i, j))) {
        let c = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
        for t in [[c[0], c[1], c[2]], [c[0], c[2], c[3]]].into_iter().filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) {
            let normals = is_smooth.then(|| t.map(|p| p.map(|c| c as f32)));
            out.push(SoupFace { normals, ..SoupFace::new(t) });
        }
    }
    out
}

/// A smooth ball, a faceted one, and the smooth one mirrored and flattened.
pub fn balls() -> Town {
    let mut town = Town::default();
    town.flat([0.75, 0.72, 0.7]);
    town.prototypes = vec![ball(true), ball(false)];
    let placed = |prototype: u32, [a, b, c]: Vec3, [x, y, z]: Vec3| (prototype, [a, 0.0, 0.0, x, 0.0, b, 0.2, y, 0.0, 0.0, c, z]);
    let all = [placed(1, [2.2; 3], [-2.3, 1.5, 0.0]), placed(2, [1.8; 3], [2.4, 1.8, 0.0]), placed(1, [-3.2, 1.1, 0.9], [0.5, -2.4, 0.0])];
    town.instances = all.into_iter().zip(30..).map(|((prototype, transform), object)| Instance { prototype, object, transform }).collect();
    town
}

/// Walls, gables and a roof 20 cm above the walls, without textures; the floor shows through a hole in one slope.
pub fn gabled_house() -> Town {
    let mut town = Town::default();
    let colors = [[0.5, 0.58, 0.42], [0.86, 0.83, 0.76], [0.62, 0.24, 0.18], [0.3, 0.5, 0.75]];
    let [grass, wall, roof, floor] = colors.map(|c| town.flat(c));
    let none = [[0.0; 2]; 4];
    let flat = |half: f64, z: f64| [[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]];
    town.panel(flat(6.0, -3.0), none, grass, 0);
    town.panel(flat(3.0, -2.5), none, floor, 1);
    for (k, [x0, y0, x1, y1]) in
        [[-3.0, -3.0, 3.0, -3.0], [3.0, -3.0, 3.0, 3.0], [3.0, 3.0, -3.0, 3.0], [-3.0, 3.0, -3.0, -3.0]].into_iter().enumerate()
    {
        town.panel([[x0, y0, -3.0], [x1, y1, -3.0], [x1, y1, 0.3], [x0, y0, 0.3]], none, wall, 2 + k as u32);
    }
    [-3.0, 3.0].into_iter().for_each(|x| town.face([[x, -3.0, 0.3], [x, 3.0, 0.3], [x, 0.0, 2.8]], wall, 6));
    // x along the eaves; t from the eaves (0) to the ridge (1).
    let slope = |side: f64, x: f64, t: f64| [x, side * (3.6 - 3.6 * t), 3.0 * t];
    town.panel([(-3.4, 0.0), (3.4, 0.0), (3.4, 1.0), (-3.4, 1.0)].map(|(x, t)| slope(1.0, x, t)), none, roof, 7);
    for [x0, t0, x1, t1] in [[-3.4, 0.0, 3.4, 0.3], [-3.4, 0.7, 3.4, 1.0], [-3.4, 0.3, -1.0, 0.7], [1.5, 0.3, 3.4, 0.7]] {
        town.panel([(x0, t0), (x1, t0), (x1, t1), (x0, t1)].map(|(x, t)| slope(-1.0, x, t)), none, roof, 8);
    }
    town
}
