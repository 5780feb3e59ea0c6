//! Occupancy never misses content; block keys change with what a block shows and with nothing else.

mod scenes;

use map3d_base::asset::Rank;
use map3d_base::tile::Tile;
use map3d_scene::SceneStore;
use map3d_trace::{BeamTracer, Opaque, SUBTILE_PX, block_key, occupied};
use scenes::{Dice, Soup, build, frame, new_folder, open, rebuild};

fn houses(seed: u64) -> Soup {
    let mut dice = Dice(seed);
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
                if !tracer.trace(left as u64, top as u64, &Opaque).expect("trace").is_empty() {
                    met[top / tile_px * side + left / tile_px] = true;
                }
            }
        }
        assert!(met.iter().zip(&flags).all(|(m, f)| *f || !*m), "level {level}: {met:?} {flags:?}");
    }
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
    assert!(tracer.trace(0, 0, &Opaque).expect("trace").is_empty());
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
    frame.pitch_deg = 89.0;
    let turned = block_key(&open(&folder), &frame, Tile { z: 1, x: 0, y: 0 }).expect("key");
    assert_ne!(turned, after[0]);
    assert!(block_key(&store, &frame, Tile { z: 1, x: 2, y: 0 }).is_err());
}
