//! Occupancy never misses content; block keys change with what a block shows and with nothing else.

mod scenes;

use map3d_base::asset::Rank;
use map3d_base::tile::Tile;
use map3d_scene::SceneStore;
use map3d_trace::occupancy::{block_keys, occupied_within};
use map3d_trace::{BeamTracer, IgnoreCutouts, SUBTILE_PX, block_key, occupied};
use scenes::{Lcg, Soup, build, frame, new_folder, open, rebuild};

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
fn occupancy_never_misses_what_a_beam_meets() {
    let folder = new_folder("occupied");
    let store = build(&folder, &houses(4));
    let mut frame = frame(30.0, 45.0, 128.0);
    frame.zmax = 2;
    for level in 0..=2u8 {
        let flags = occupied(&store, &frame, level).expect("occupied");
        let side = 1usize << level;
        assert_eq!(flags.len(), side * side);
        let mut met = vec![false; side * side];
        let mut tracer = BeamTracer::new(&store, &frame).expect("tracer");
        let tile_px = 256 << (2 - level);
        for top in (0..1024).step_by(SUBTILE_PX) {
            for left in (0..1024).step_by(SUBTILE_PX) {
                if !tracer.trace(left as u64, top as u64, &IgnoreCutouts).expect("trace").is_empty() {
                    met[top / tile_px * side + left / tile_px] = true;
                }
            }
        }
        assert!(met.iter().zip(&flags).all(|(m, f)| *f || !*m), "level {level}: {met:?} {flags:?}");
    }
    let blocks = [[0, 1], [1, 1]];
    let part = occupied_within(&store, &frame, 5, 1, &blocks).expect("occupied");
    let whole = occupied(&store, &frame, 5).expect("occupied");
    for (k, flag) in part.iter().enumerate() {
        let place = [k as u32 % 32 / 16, k as u32 / 32 / 16];
        assert_eq!(*flag, whole[k] && blocks.contains(&place), "{k}");
    }
    assert!(occupied_within(&store, &frame, 5, 1, &[[0, 2]]).is_err() && occupied_within(&store, &frame, 1, 2, &[]).is_err());
    let fine = occupied(&store, &frame, 7).expect("occupied");
    let share = fine.iter().filter(|f| **f).count() as f64 / fine.len() as f64;
    assert!(share < 0.2, "{share} of the tiles are said to be occupied");
}

#[test]
fn an_empty_scene_occupies_nothing() {
    let folder = new_folder("empty");
    let store = build(&folder, &Soup::default());
    let frame = frame(0.0, 45.0, 64.0);
    assert!(occupied(&store, &frame, 3).expect("occupied").iter().all(|f| !f));
    let mut tracer = BeamTracer::new(&store, &frame).expect("tracer");
    assert!(tracer.trace(0, 0, &IgnoreCutouts).expect("trace").is_empty());
}

#[test]
fn a_block_key_changes_with_what_the_block_shows() {
    let folder = new_folder("key");
    let mut soup = houses(4);
    let store = build(&folder, &soup);
    let mut frame = frame(0.0, 90.0, 128.0);
    frame.zmax = 4;
    let keys =
        |store: &SceneStore| -> Vec<String> { (0..4).map(|k| block_key(store, &frame, Tile { z: 1, x: k % 2, y: k / 2 }).expect("key")).collect() };
    let before = keys(&store);
    assert_eq!(before, keys(&open(&folder)), "the same in every process");
    // One more house, in the north-east.
    soup.quad([[50.0, 50.0, 2.0], [52.0, 50.0, 2.0], [52.0, 52.0, 2.0], [50.0, 52.0, 2.0]], 41, Rank::Other);
    rebuild(&folder, &soup);
    let after = keys(&open(&folder));
    let changed: Vec<bool> = before.iter().zip(&after).map(|(a, b)| a != b).collect();
    assert_eq!(changed, [false, true, false, false]);
    let all: Vec<[u32; 2]> = (0..4).map(|k| [k % 2, k / 2]).collect();
    assert_eq!(block_keys(&open(&folder), &frame, 1, &all).expect("keys"), after, "one by one or together");
    assert!(block_keys(&store, &frame, 1, &[[0, 0], [0, 2]]).is_err());
    frame.pitch_deg = 89.0;
    let turned = block_key(&open(&folder), &frame, Tile { z: 1, x: 0, y: 0 }).expect("key");
    assert_ne!(turned, after[0]);
    assert!(block_key(&store, &frame, Tile { z: 1, x: 2, y: 0 }).is_err());
}

#[test]
fn a_key_changes_just_when_something_in_the_beam_does() {
    let folder = new_folder("keys");
    let mut soup = houses(9);
    build(&folder, &soup);
    let mut frame = frame(30.0, 45.0, 128.0);
    frame.zmax = 6;
    let places: Vec<[u32; 2]> = (0..64).map(|k| [k % 8, k / 8]).collect();
    let before = block_keys(&open(&folder), &frame, 3, &places).expect("keys");
    assert_eq!(before.iter().collect::<std::collections::BTreeSet<_>>().len(), 64, "empty blocks have keys of their own too");
    let (old, new) = (soup.faces[0].corners, soup.faces[0].corners.map(|p| [p[0] + 3.0, p[1], p[2]]));
    soup.faces[0].corners = new;
    rebuild(&folder, &soup);
    let after = block_keys(&open(&folder), &frame, 3, &places).expect("keys");
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
