//! Beams against brute force: every sample of every pixel against every triangle, in plain loops of their own.

mod brute;
mod scenes;

use brute::Eye;
use brute::contest::{Contest, Presence, Tally};
use map3d_base::Frame;
use map3d_scene::SceneStore;
use map3d_trace::{BeamTracer, Isa, Opaque, Pixel, SUBTILE_PX};
use scenes::{Dice, Face, RANKS, Soup, build, frame, mixed_soup, new_folder};

fn compare(store: &SceneStore, frame: &Frame) -> Tally {
    Contest { store, frame, cutout: &Opaque, presence: &|_, _| Presence::There }.run()
}

#[test]
fn beams_find_the_winner_of_every_sample() {
    let views = [(0.0, 90.0), (45.0, 45.0), (123.4, 22.5), (270.0, 10.0)];
    for (seed, (look_at, pitch)) in views.into_iter().enumerate() {
        let folder = new_folder("oracle");
        let store = build(&folder, &mixed_soup(&mut Dice(seed as u64 + 1), 150));
        let Tally { met, close, .. } = compare(&store, &frame(look_at, pitch, 40.0));
        assert!(met > 150_000, "only {met} samples meet anything");
        assert!(close * 4 < met, "{close} of {met} samples are too close to call");
    }
}

/// Planes of steep triangles reach in front of D0 within the triangle's box.
#[test]
fn right_behind_the_start_of_the_depths_the_rule_is_the_same() {
    let mut dice = Dice(61);
    let mut soup = Soup::default();
    (0..80).for_each(|k| soup.add([dice.point(12.0), dice.point(12.0), dice.point(12.0)], k, RANKS[k as usize % 6]));
    let folder = new_folder("near");
    let store = build(&folder, &soup);
    for (look_at, pitch) in [(0.0, 90.0), (45.0, 30.0)] {
        let tally = compare(&store, &Frame { d0_m: -24.0, ..frame(look_at, pitch, 40.0) });
        assert!(tally.met > 50_000, "{tally:?}");
    }
}

#[test]
fn coplanar_stacks_go_to_the_highest_rank() {
    let mut soup = Soup::default();
    let mut dice = Dice(5);
    for (k, rank) in RANKS.into_iter().enumerate() {
        for _ in 0..6 {
            let (x, y) = (dice.between(-12.0, 12.0), dice.between(-12.0, 12.0));
            let point = |dx: f64, dy: f64| [x + dx, y + dy, (x + dx) * 0.25 + (y + dy) * 0.5];
            soup.quad([point(0.0, 0.0), point(6.0, 0.5), point(6.0, 7.0), point(0.0, 6.0)], k as u32, rank);
        }
    }
    let folder = new_folder("coplanar");
    let store = build(&folder, &soup);
    for (look_at, pitch) in [(0.0, 90.0), (45.0, 45.0), (200.0, 12.0)] {
        let frame = frame(look_at, pitch, 40.0);
        let all = Eye::new(&frame).know(&store);
        let mut tracer = BeamTracer::new(&store, &frame).expect("tracer");
        let result = tracer.trace(64, 64, &Opaque).expect("trace");
        for p in 0..SUBTILE_PX * SUBTILE_PX {
            let (i, j) = (p % SUBTILE_PX, p / SUBTILE_PX);
            let at = Eye::sample([64 + i, 64 + j], 0);
            let highest = all.iter().filter(|t| t.covers(at)).map(|t| t.rank).max();
            let got = result.center_slot(i, j).map(|slot| result.surface(slot).rank);
            assert_eq!(got, highest, "pixel ({i}, {j})");
        }
    }
}

#[test]
fn instances_and_many_chunks_follow_the_same_rule() {
    let mut dice = Dice(99);
    let mut soup = mixed_soup(&mut dice, 60);
    // Far away content makes the square large and its cells many.
    for k in 0..40 {
        let (x, y) = (dice.between(-9000.0, 9000.0), dice.between(-9000.0, 9000.0));
        soup.add([[x, y, 0.0], [x + 900.0, y + 50.0, 5.0], [x, y + 800.0, -5.0]], 100 + k, RANKS[0]);
    }
    soup.add([[-2000.0, -900.0, -30.0], [2500.0, -900.0, -30.0], [0.0, 3000.0, -31.0]], 90, RANKS[0]);
    soup.prototypes = vec![(0..12).map(|_| Face::new([dice.point(2.0), dice.point(2.0), dice.point(2.0)])).collect()];
    for k in 0..8 {
        let (a, s) = (dice.between(0.0, std::f64::consts::TAU), dice.between(0.5, 3.0));
        let (c, n, p) = (a.cos() * s, a.sin() * s, dice.point(12.0));
        let transform = [c, -n, 0.0, p[0], n, c, 0.0, p[1], 0.0, 0.0, s, p[2]];
        soup.instances.push(map3d_base::asset::Instance { prototype: 1, object: 200 + k, transform });
    }
    let folder = new_folder("instances");
    let store = build(&folder, &soup);
    assert!(store.parts().len() > 15, "{} parts", store.parts().len());
    for (look_at, pitch) in [(30.0, 45.0), (180.0, 90.0)] {
        let Tally { met, .. } = compare(&store, &frame(look_at, pitch, 40.0));
        assert!(met > 150_000, "only {met} samples meet anything");
    }
}

#[test]
fn every_instruction_set_gives_equal_bits() {
    let folder = new_folder("isa");
    let store = build(&folder, &mixed_soup(&mut Dice(77), 400));
    let frame = frame(45.0, 30.0, 40.0);
    let of = |isa: Isa| {
        let mut tracer = BeamTracer::with_isa(&store, &frame, isa).expect("tracer");
        let mut out = Vec::new();
        for (x, y) in [(0, 0), (64, 64), (128, 64), (192, 192)] {
            let result = tracer.trace(x, y, &Opaque).expect("trace");
            for p in 0..SUBTILE_PX * SUBTILE_PX {
                let (i, j) = (p % SUBTILE_PX, p / SUBTILE_PX);
                out.push(match result.pixel(i, j) {
                    Pixel::Nothing => [u32::MAX; 16],
                    Pixel::One(slot) => [slot; 16],
                    Pixel::Mixed(slots) => *slots,
                });
                out.push([result.center_depth(i, j); 16]);
            }
        }
        out
    };
    let scalar = of(Isa::Scalar);
    for isa in Isa::available() {
        assert!(of(isa) == scalar, "{isa:?} differs from scalar");
    }
}
