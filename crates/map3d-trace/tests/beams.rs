//! Beams against brute force: each sample of each pixel against all triangles.

use crate::reference::ReferenceView;
use crate::reference::comparison::{BeamComparison, HoleState, SampleCounts};
use crate::scenes::{Lcg, RANKS, Soup, SoupFace, build, frame, mixed_soup, new_folder};
use map3d_base::Frame;
use map3d_scene::SceneStore;
use map3d_trace::{BeamTracer, IgnoreCutouts, Isa, Pixel, SUBTILE_PX};

fn compare(store: &SceneStore, frame: &Frame) -> SampleCounts {
    BeamComparison { store, frame, cutout: &IgnoreCutouts, hole_state: &|_, _| HoleState::Covered }.run()
}

#[test]
fn beams_find_the_winner_of_each_sample() {
    let views = [(0.0, 90.0), (45.0, 45.0), (123.4, 22.5), (270.0, 10.0)];
    for (seed, (look_at, pitch)) in views.into_iter().enumerate() {
        let folder = new_folder("beams");
        let store = build(&folder, &mixed_soup(&mut Lcg(seed as u64 + 1), 150));
        let SampleCounts { covered, close, .. } = compare(&store, &frame(look_at, pitch, 40.0));
        assert!(covered > 150_000, "only {covered} samples show a surface");
        assert!(close * 4 < covered, "{close} of {covered} samples are too close to decide");
    }
}

/// The planes of steep triangles extend in front of D0 within the triangle's box.
#[test]
fn visibility_rule_holds_just_behind_the_plane_d0() {
    let mut random = Lcg(61);
    let mut soup = Soup::default();
    (0..80).for_each(|k| soup.add([random.point(12.0), random.point(12.0), random.point(12.0)], k, RANKS[k as usize % 6]));
    let folder = new_folder("near");
    let store = build(&folder, &soup);
    for (look_at, pitch) in [(0.0, 90.0), (45.0, 30.0)] {
        let counts = compare(&store, &Frame { d0_m: -24.0, ..frame(look_at, pitch, 40.0) });
        assert!(counts.covered > 50_000, "{counts:?}");
    }
}

#[test]
fn highest_rank_wins_among_coplanar_faces() {
    let mut soup = Soup::default();
    let mut random = Lcg(5);
    for (k, rank) in RANKS.into_iter().enumerate() {
        for _ in 0..6 {
            let (x, y) = (random.between(-12.0, 12.0), random.between(-12.0, 12.0));
            let point = |dx: f64, dy: f64| [x + dx, y + dy, (x + dx) * 0.25 + (y + dy) * 0.5];
            soup.quad([point(0.0, 0.0), point(6.0, 0.5), point(6.0, 7.0), point(0.0, 6.0)], k as u32, rank);
        }
    }
    let folder = new_folder("coplanar");
    let store = build(&folder, &soup);
    for (look_at, pitch) in [(0.0, 90.0), (45.0, 45.0), (200.0, 12.0)] {
        let frame = frame(look_at, pitch, 40.0);
        let all = ReferenceView::new(&frame).triangles(&store);
        let mut tracer = BeamTracer::new(&store, &frame).expect("tracer");
        let result = tracer.trace(64, 64, &IgnoreCutouts).expect("trace");
        for p in 0..SUBTILE_PX * SUBTILE_PX {
            let (i, j) = (p % SUBTILE_PX, p / SUBTILE_PX);
            let at = ReferenceView::sample([64 + i, 64 + j], 0);
            let highest = all.iter().filter(|t| t.covers(at)).map(|t| t.rank).max();
            let got = result.center_slot(i, j).map(|slot| result.surface(slot).rank);
            assert_eq!(got, highest, "pixel ({i}, {j})");
        }
    }
}

#[test]
fn visibility_rule_holds_for_instances_and_many_chunks() {
    let mut random = Lcg(99);
    let mut soup = mixed_soup(&mut random, 60);
    // Distant content enlarges the square, so that it has many cells.
    for k in 0..40 {
        let (x, y) = (random.between(-9000.0, 9000.0), random.between(-9000.0, 9000.0));
        soup.add([[x, y, 0.0], [x + 900.0, y + 50.0, 5.0], [x, y + 800.0, -5.0]], 100 + k, RANKS[0]);
    }
    soup.add([[-2000.0, -900.0, -30.0], [2500.0, -900.0, -30.0], [0.0, 3000.0, -31.0]], 90, RANKS[0]);
    soup.prototypes = vec![(0..12).map(|_| SoupFace::new([random.point(2.0), random.point(2.0), random.point(2.0)])).collect()];
    for k in 0..8 {
        let (a, s) = (random.between(0.0, std::f64::consts::TAU), random.between(0.5, 3.0));
        let (c, n, p) = (a.cos() * s, a.sin() * s, random.point(12.0));
        let transform = [c, -n, 0.0, p[0], n, c, 0.0, p[1], 0.0, 0.0, s, p[2]];
        soup.instances.push(map3d_base::asset::Instance { prototype: 1, object: 200 + k, transform });
    }
    let folder = new_folder("instances");
    let store = build(&folder, &soup);
    assert!(store.parts().len() > 15, "{} parts", store.parts().len());
    for (look_at, pitch) in [(30.0, 45.0), (180.0, 90.0)] {
        let SampleCounts { covered, .. } = compare(&store, &frame(look_at, pitch, 40.0));
        assert!(covered > 150_000, "only {covered} samples show a surface");
    }
}

#[test]
fn all_instruction_sets_give_equal_bits() {
    let folder = new_folder("isa");
    let store = build(&folder, &mixed_soup(&mut Lcg(77), 400));
    let frame = frame(45.0, 30.0, 40.0);
    let of = |isa: Isa| {
        let mut tracer = BeamTracer::with_isa(&store, &frame, isa).expect("tracer");
        let mut out = Vec::new();
        for (x, y) in [(0, 0), (64, 64), (128, 64), (192, 192)] {
            let result = tracer.trace(x, y, &IgnoreCutouts).expect("trace");
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
