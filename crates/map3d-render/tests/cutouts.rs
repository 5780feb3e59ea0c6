//! Cut-outs by the alpha of a texture against brute force, which filters the same alpha in float64.

use crate::town::reference::comparison::{BeamComparison, HoleState};
use crate::town::reference::{ReferenceTriangle, TexturePoint};
use crate::town::scenes::RANKS;
use crate::town::{Town, frame, new_folder};
use map3d_base::Vec3;
use map3d_base::asset::Wrap;
use map3d_image::Raster;
use map3d_render::TextureCutout;

const SIDE: i64 = 64;
/// Side of a chequer cell in texels.
const CELL: i64 = 8;

/// A chequer with inverted specks of 1, 2 and 4 texels, so that the holes differ between levels.
fn is_hole(x: i64, y: i64) -> bool {
    let speck = |size: i64| ((x / size) * 7 + (y / size) * 13 + (x / size) * (y / size)) % 11 == 3;
    ((x / CELL + y / CELL) % 2 == 1) ^ speck(1) ^ speck(2) ^ speck(4)
}

fn chequer() -> Raster {
    let alpha = |k: i64| if is_hole(k % SIDE, k / SIDE) { 0 } else { 255 };
    Raster::new(SIDE as u32, SIDE as u32, (0..SIDE * SIDE).map(|k| [90, 140, 60, alpha(k)]).collect())
}

/// Returns the alpha of texel (x, y) of a level in a wrap mode. Textures that end at their edges repeat the last texels there.
fn texel(wrap: u8, level: u32, x: i64, y: i64) -> f64 {
    let side = SIDE >> level;
    let mirrored = |i: i64| if i.rem_euclid(2 * side) < side { i.rem_euclid(side) } else { side - 1 - i.rem_euclid(side) };
    let fold = |i: i64| match wrap {
        0 => i.rem_euclid(side),
        1 => mirrored(i),
        _ => i.clamp(0, side - 1),
    };
    let (x, y, size) = (fold(x), fold(y), 1i64 << level);
    let opaque = (0..size * size).filter(|k| !is_hole(x * size + k % size, y * size + k / size)).count();
    opaque as f64 / (size * size) as f64
}

/// Filters bilinearly at the level whose texels are about a quarter pixel; uncertain beyond level 3, where few holes remain.
fn hole_state(t: &ReferenceTriangle, point: &TexturePoint) -> HoleState {
    let side = SIDE as f64;
    let [a, b] = point.footprint;
    let wanted = ((a[0] * b[1] - a[1] * b[0]).abs().sqrt() * side / 4.0).log2().max(0.0);
    let (level, size) = (wanted.round() as u32, side / wanted.round().exp2());
    if level > 3 {
        return HoleState::Uncertain;
    }
    // Outside a texture that ends at its edges there is no surface; an eighth of a texel is still inside.
    let slack = (point.tolerance[0] + point.tolerance[1]) * size + 1.0 / 64.0;
    let beyond = point.uv.iter().map(|c| (c - 0.5).abs() - 0.5).fold(f64::MIN, f64::max) * size;
    if t.material.wrap >= 3 && beyond > -slack {
        return if beyond > 0.125 + slack { HoleState::Hole } else { HoleState::Uncertain };
    }
    let (x, y) = (point.uv[0] * size - 0.5, (1.0 - point.uv[1]) * size - 0.5);
    let (fx, fy) = (x - x.floor(), y - y.floor());
    let at = |i: i64, j: i64| texel(t.material.wrap, level, x.floor() as i64 + i, y.floor() as i64 + j);
    let alpha = (at(0, 0) * (1.0 - fx) + at(1, 0) * fx) * (1.0 - fy) + (at(0, 1) * (1.0 - fx) + at(1, 1) * fx) * fy;
    // Taps are quantised to 1/128 texel, and each level rounds alpha to a byte.
    let tolerance = f64::from(level) / 510.0 + 2.0 / 256.0 + (point.tolerance[0] + point.tolerance[1]) * size + 1.0 / 1024.0;
    match (alpha - 0.5).abs() > tolerance && (wanted - wanted.floor() - 0.5).abs() > 1e-4 {
        true if alpha > 0.5 => HoleState::Covered,
        true => HoleState::Hole,
        false => HoleState::Uncertain,
    }
}

/// Returns panels at random angles that repeat the texture `least` to `most` times per metre.
fn screens(wrap: Wrap, [least, most]: [f64; 2]) -> Town {
    let mut town = Town::default();
    let (grey, cut) = (town.flat([0.6; 3]), town.textured(chequer(), wrap));
    town.panel([[-30.0, -30.0, -9.0], [30.0, -30.0, -9.0], [30.0, 30.0, -9.0], [-30.0, 30.0, -9.0]], [[0.0; 2]; 4], grey, 0);
    let mut random = crate::town::scenes::Lcg(17);
    for k in 1..14u32 {
        let (at, size, repeats) = (random.point(7.0), random.between(5.0, 9.0), random.between(least, most));
        let (a, b) = (random.point(1.0), random.point(1.0));
        let axes = [a, map3d_base::vec3::cross(a, b)].map(|v| map3d_base::vec3::normalized(v).expect("a direction"));
        let point = |s: f64, t: f64| -> Vec3 { [0, 1, 2].map(|k| at[k] + axes[0][k] * s * size + axes[1][k] * t * size) };
        let span = (repeats * size) as f32;
        let from = random.between(-0.4, 0.3) as f32;
        let uv = [[from, from], [from + span, from], [from + span, from + span], [from, from + span]];
        town.panel([point(-0.5, -0.5), point(0.5, -0.5), point(0.5, 0.5), point(-0.5, 0.5)], uv, if k % 4 == 0 { grey } else { cut }, k);
    }
    town.faces.iter_mut().for_each(|f| f.rank = RANKS[f.object as usize % 6]);
    town
}

#[test]
fn beams_agree_with_brute_force_at_the_holes_of_textures() {
    // With 64 texels per repeat and about 11 pixels per metre, the second and third row use coarser levels.
    let wraps = [
        (Wrap::Wrap, [0.06, 0.15]),
        (Wrap::Wrap, [0.9, 1.9]),
        (Wrap::Wrap, [1.5, 2.8]),
        (Wrap::Mirror, [0.1, 0.9]),
        (Wrap::Clamp, [0.1, 0.3]),
        (Wrap::Border, [0.1, 0.3]),
        (Wrap::None, [0.1, 0.3]),
    ];
    for (wrap, repeats) in wraps {
        let folder = new_folder("screens");
        let scene = screens(wrap, repeats).open(&folder);
        for (look_at, pitch) in [(0.0, 90.0), (130.0, 35.0)] {
            let cutout = TextureCutout::new(scene.textures());
            let frame = frame(look_at, pitch, 24.0, 0);
            let counts = BeamComparison { store: scene.store(), frame: &frame, cutout: &cutout, hole_state: &hole_state }.run();
            assert_eq!(cutout.failures(), 0);
            assert!(counts.cutouts * 100 > counts.covered && counts.holes * 100 > counts.covered, "{wrap:?}: few holes: {counts:?}");
            assert!(counts.uncertain * 25 < counts.covered, "{wrap:?}: too many samples at edges of holes: {counts:?}");
        }
    }
}
