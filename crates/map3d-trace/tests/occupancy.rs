//! Occupancy holds every tile with content; a block's key changes if and only if its content does.

use std::collections::HashSet;

use crate::scenes::{Lcg, Soup, build, frame, new_folder, open, rebuild};
use map3d_base::Frame;
use map3d_base::asset::Rank;
use map3d_base::tile::morton;
use map3d_scene::SceneStore;
use map3d_trace::{BeamTracer, CPU, IgnoreCutouts, SUBTILE_PX, block_keys, occupied, occupied_within};

fn houses(seed: u64) -> Soup {
    let mut dice = Lcg(seed);
    let mut soup = Soup::default();
    for k in 0..40 {
        let (x, y) = (dice.between(-45.0, 45.0), dice.between(-45.0, 45.0));
        let (w, h) = (dice.between(1.0, 3.0), dice.between(1.0, 5.0));
        soup.quad([[x, y, h], [x + w, y, h], [x + w, y + w, h], [x, y + w, h]], k, Rank::Other);
        soup.quad([[x, y, 0.0], [x + w, y, 0.0], [x + w, y, h], [x, y, h]], k, Rank::Other);
    }
    soup
}

#[test]
fn occupancy_holds_every_tile_that_a_beam_hits() {
    let folder = new_folder("occupied");
    let store = build(&folder, &houses(4));
    let mut frame = frame(30.0, 45.0, 128.0);
    frame.zmax = 2;
    for level in 0..=2u8 {
        let found = occupied(&store, &frame, level).expect("occupied");
        let mut tracer = BeamTracer::new(&store, &frame).expect("tracer");
        let tile_px = 256 << (2 - level);
        for top in (0..1024).step_by(SUBTILE_PX) {
            for left in (0..1024).step_by(SUBTILE_PX) {
                let is_hit = !tracer.trace(left as u64, top as u64, &IgnoreCutouts).expect("trace").is_empty();
                let tile = morton((left / tile_px) as u32, (top / tile_px) as u32);
                assert!(!is_hit || found.contains(&tile), "level {level}: {left} {top}");
            }
        }
    }
}

/// Corners of every triangle in tiles of a level.
fn triangles_in_tiles(soup: &Soup, frame: &Frame, level: u8) -> Vec<[[f64; 2]; 3]> {
    let (axes, tile_m) = (frame.axes(), frame.size_m / f64::from(1u32 << level));
    let tile = |p: [f64; 3]| {
        let [u, v, _] = axes.uvd_from_local(p);
        [(u - frame.u0_m) / tile_m, (frame.v0_m - v) / tile_m]
    };
    soup.faces.iter().map(|f| f.corners.map(tile)).collect()
}

/// Whether a triangle meets a tile that is grown by `room` tiles: no edge of either separates them.
fn meets(c: &[[f64; 2]; 3], x: u32, y: u32, room: f64) -> bool {
    let (lo, hi) = ([f64::from(x) - room, f64::from(y) - room], [f64::from(x + 1) + room, f64::from(y + 1) + room]);
    let boxes_meet = (0..2).all(|k| c.iter().any(|p| p[k] <= hi[k]) && c.iter().any(|p| p[k] >= lo[k]));
    let edge_meets = |k: usize| {
        let (a, b, c) = (c[k], c[(k + 1) % 3], c[(k + 2) % 3]);
        let side = |p: [f64; 2]| (a[1] - b[1]) * (p[0] - a[0]) + (b[0] - a[0]) * (p[1] - a[1]);
        let corners = [[lo[0], lo[1]], [hi[0], lo[1]], [lo[0], hi[1]], [hi[0], hi[1]]];
        side(c) == 0.0 || corners.into_iter().any(|p| side(p) * side(c).signum() >= 0.0)
    };
    boxes_meet && (0..3).all(edge_meets)
}

#[test]
fn occupancy_is_that_of_all_triangles_against_all_tiles() {
    for (seed, look_at_deg, pitch_deg) in [(1, 0.0, 90.0), (2, 30.0, 45.0), (3, 291.5, 12.0)] {
        let folder = new_folder(&format!("brute-{seed}"));
        let soup = houses(seed);
        let store = build(&folder, &soup);
        let mut frame = frame(look_at_deg, pitch_deg, 128.0);
        frame.zmax = 8;
        for level in [0, 1, 2, 3, 5, 8] {
            let found: HashSet<u64> = occupied(&store, &frame, level).expect("occupied").into_iter().collect();
            let triangles = triangles_in_tiles(&soup, &frame, level);
            for (x, y) in (0..1 << level).flat_map(|y| (0..1 << level).map(move |x| (x, y))) {
                let is_found = found.contains(&morton(x, y));
                assert!(is_found || !triangles.iter().any(|t| meets(t, x, y, 0.0)), "level {level}: tile {x} {y} is missing");
                // A box of up to a quarter of a tile is marked as a whole.
                assert!(!is_found || triangles.iter().any(|t| meets(t, x, y, 0.3)), "level {level}: tile {x} {y} is empty");
            }
        }
    }
}

#[test]
fn occupancy_within_blocks_is_that_of_the_whole_level_there() {
    let folder = new_folder("within");
    let store = build(&folder, &houses(4));
    let frame = frame(30.0, 45.0, 128.0);
    let whole = occupied(&store, &frame, 7).expect("occupied");
    for (block_level, blocks) in
        [(1, vec![[0, 1], [1, 1]]), (4, vec![[3, 9], [8, 8], [8, 9], [3, 9]]), (6, vec![[31, 32]]), (7, vec![[64, 60]]), (2, vec![])]
    {
        let inside: HashSet<u64> = blocks.iter().map(|[x, y]| morton(*x, *y)).collect();
        let part = occupied_within(&store, &frame, 7, block_level, &blocks).expect("occupied");
        let expected: Vec<u64> = whole.iter().copied().filter(|n| inside.contains(&(n >> (2 * (7 - block_level))))).collect();
        assert_eq!(part, expected, "blocks of level {block_level}");
    }
    for (level, block_level, blocks) in [(5, 1, vec![[0, 2]]), (1, 2, vec![]), (27, 0, vec![[0, 0]])] {
        assert!(occupied_within(&store, &frame, level, block_level, &blocks).is_err());
    }
}

#[test]
fn occupancy_works_to_the_deepest_level() {
    let folder = new_folder("deepest");
    let mut soup = Soup::default();
    soup.quad([[-50.0, -50.0, 0.0], [-49.9, -50.0, 0.0], [-49.9, -49.9, 0.0], [-50.0, -49.9, 0.0]], 0, Rank::Other);
    soup.quad([[50.0, 50.0, 0.0], [50.1, 50.0, 0.0], [50.1, 50.1, 0.0], [50.0, 50.1, 0.0]], 1, Rank::Other);
    let store = build(&folder, &soup);
    // Tiles of level 20 are 0.01 m wide, so each face covers about 10 × 10 of them; every level above has half of that, at least one per face.
    let mut frame = frame(0.0, 90.0, 128.0);
    frame.zmax = 20;
    frame.size_m = 0.01 * f64::from(1 << 20);
    frame.u0_m = -frame.size_m / 2.0;
    frame.v0_m = frame.size_m / 2.0;
    for level in [13, 17, 20] {
        let count = occupied(&store, &frame, level).expect("occupied").len();
        let side = (0.1 / 0.01 / f64::from(1 << (20 - level))).ceil() as usize;
        assert!((2 * side * side..=2 * (side + 2) * (side + 2)).contains(&count), "level {level}: {count} tiles");
    }
    let blocks = occupied(&store, &frame, 17).expect("occupied");
    assert!(occupied(&store, &frame, 20).expect("occupied").iter().all(|n| blocks.binary_search(&(n >> 6)).is_ok()));
    frame.zmax = 26;
    assert!(occupied(&store, &frame, 26).expect("occupied").len() >= 2 * (640 * 640));
}

#[test]
fn an_empty_scene_occupies_nothing() {
    let folder = new_folder("empty");
    let store = build(&folder, &Soup::default());
    let frame = frame(0.0, 45.0, 64.0);
    assert!(occupied(&store, &frame, 3).expect("occupied").is_empty());
    let mut tracer = BeamTracer::new(&store, &frame).expect("tracer");
    assert!(tracer.trace(0, 0, &IgnoreCutouts).expect("trace").is_empty());
}

#[test]
fn a_block_key_changes_with_the_content_of_its_block() {
    let folder = new_folder("key");
    let mut soup = houses(4);
    let store = build(&folder, &soup);
    let mut frame = frame(0.0, 90.0, 128.0);
    frame.zmax = 4;
    let keys =
        |store: &SceneStore| -> Vec<String> { (0..4).flat_map(|k| block_keys(store, &frame, CPU, 1, &[[k % 2, k / 2]]).expect("keys")).collect() };
    let before = keys(&store);
    assert_eq!(before, keys(&open(&folder)), "the same in every process");
    // One more house, in the north-east.
    soup.quad([[50.0, 50.0, 2.0], [52.0, 50.0, 2.0], [52.0, 52.0, 2.0], [50.0, 52.0, 2.0]], 41, Rank::Other);
    rebuild(&folder, &soup);
    let after = keys(&open(&folder));
    let changed: Vec<bool> = before.iter().zip(&after).map(|(a, b)| a != b).collect();
    assert_eq!(changed, [false, true, false, false]);
    let all: Vec<[u32; 2]> = (0..4).map(|k| [k % 2, k / 2]).collect();
    assert_eq!(block_keys(&open(&folder), &frame, CPU, 1, &all).expect("keys"), after, "one by one or together");
    assert!(block_keys(&store, &frame, CPU, 1, &[[0, 0], [0, 2]]).is_err());
    let elsewhere = block_keys(&open(&folder), &frame, "gpu", 1, &all).expect("keys");
    assert!(elsewhere.iter().zip(&after).all(|(a, b)| a != b), "a class of devices with other bytes has other keys");
    frame.pitch_deg = 89.0;
    let turned = block_keys(&open(&folder), &frame, CPU, 1, &[[0, 0]]).expect("keys");
    assert_ne!(turned[0], after[0]);
    assert!(block_keys(&store, &frame, CPU, 1, &[[2, 0]]).is_err());
}

#[test]
fn a_key_changes_if_and_only_if_content_of_its_block_does() {
    let folder = new_folder("keys");
    let mut soup = houses(9);
    build(&folder, &soup);
    let mut frame = frame(30.0, 45.0, 128.0);
    frame.zmax = 6;
    let places: Vec<[u32; 2]> = (0..64).map(|k| [k % 8, k / 8]).collect();
    let before = block_keys(&open(&folder), &frame, CPU, 3, &places).expect("keys");
    assert_eq!(before.iter().collect::<std::collections::BTreeSet<_>>().len(), 64, "empty blocks have keys of their own too");
    let (old, new) = (soup.faces[0].corners, soup.faces[0].corners.map(|p| [p[0] + 3.0, p[1], p[2]]));
    soup.faces[0].corners = new;
    rebuild(&folder, &soup);
    let after = block_keys(&open(&folder), &frame, CPU, 3, &places).expect("keys");
    // The object of the face is its house of four triangles.
    let house: Vec<[f64; 3]> = soup.faces.iter().filter(|f| f.object == 0).flat_map(|f| f.corners).chain(old).collect();
    let axes = frame.axes();
    let place = |p: &[f64; 3]| {
        let [u, v, _] = axes.uvd_from_local(*p);
        [(u - frame.u0_m) / frame.size_m * 8.0, (frame.v0_m - v) / frame.size_m * 8.0]
    };
    let range = |k: usize| house.iter().map(|p| place(p)[k]).fold((f64::INFINITY, f64::NEG_INFINITY), |a, v| (a.0.min(v), a.1.max(v)));
    let ((x0, x1), (y0, y1)) = (range(0), range(1));
    for (([x, y], a), b) in places.iter().zip(&before).zip(&after) {
        let (x, y) = (f64::from(*x), f64::from(*y));
        let sees = x + 1.0 > x0 && x < x1 && y + 1.0 > y0 && y < y1;
        let near = x + 1.5 > x0 && x - 0.5 < x1 && y + 1.5 > y0 && y - 0.5 < y1;
        assert!(!sees || a != b, "block {x} {y} shows the house and has its old key");
        assert!(near || a == b, "block {x} {y} does not show the house and has a new key");
    }
}
