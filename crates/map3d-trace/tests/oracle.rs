//! Beams against brute force: every sample of every pixel against every triangle, in plain loops of their own.

mod scenes;

use map3d_base::samples::SAMPLES;
use map3d_base::vec3::{cross, dot, length, sub};
use map3d_base::{Frame, Vec3};
use map3d_scene::SceneStore;
use map3d_scene::instances::place;
use map3d_scene::records::EMPTY;
use map3d_trace::{BeamTracer, Isa, Opaque, Pixel, SUBTILE_PX, VisBuf};
use scenes::{Dice, RANKS, Soup, build, frame, new_folder};

/// What brute force knows of a triangle.
struct Known {
    /// Snapped, in steps of 1/256 pixel from the square's corner.
    steps: [[i128; 2]; 3],
    corners: [Vec3; 3],
    depth: (f64, f64),
    rank: u8,
    object_id: u32,
    source: u32,
    bias: i64,
}

fn known(store: &SceneStore, frame: &Frame) -> Vec<Known> {
    let axes = frame.axes();
    let mut out = Vec::new();
    for part in store.parts() {
        let chunk = store.chunk(part.chunk).expect("chunk");
        let instance = part.instance.map(|k| store.instances()[k as usize]);
        for leaf in chunk.leaves() {
            for lane in (0..8).filter(|l| leaf.triangle[*l] != EMPTY) {
                let record = chunk.triangles()[leaf.triangle[lane] as usize];
                let corners = [0, 3, 6].map(|c| {
                    let p = [0, 1, 2].map(|k| chunk.origin()[k] + f64::from(leaf.corners[c + k][lane]));
                    instance.map_or(p, |i| place(&i.transform, p))
                });
                let steps = corners.map(|p| {
                    let px = (dot(axes.right, p) - frame.u0_m) / frame.pixel_m(frame.zmax);
                    let py = (frame.v0_m - dot(axes.up, p)) / frame.pixel_m(frame.zmax);
                    [px, py].map(|v| (256.0 * v + 0.5).floor() as i128)
                });
                let d = corners.map(|p| (dot(axes.forward, p) - frame.d0_m) * 1024.0);
                let n = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
                let cosine = (dot(n, axes.forward) / length(n)).abs();
                out.push(Known {
                    steps,
                    corners,
                    depth: (d[0].min(d[1]).min(d[2]), d[0].max(d[1]).max(d[2])),
                    rank: record.rank,
                    object_id: instance.map_or(chunk.objects()[record.object as usize].id, |i| i.object_id),
                    source: record.source,
                    bias: (f64::from(record.rank) * 2.0 / cosine.max(1.0 / 16.0)).round() as i64,
                });
            }
        }
    }
    out
}

impl Known {
    /// Strictly inside, or on an edge that the top-left rule gives to this triangle.
    fn covers(&self, x: i128, y: i128) -> bool {
        let s = &self.steps;
        let turn = (s[1][0] - s[0][0]) * (s[2][1] - s[0][1]) - (s[1][1] - s[0][1]) * (s[2][0] - s[0][0]);
        if turn == 0 {
            return false;
        }
        (0..3).all(|k| {
            let (a, b) = if turn > 0 { (s[k], s[(k + 1) % 3]) } else { (s[(k + 1) % 3], s[k]) };
            let side = (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
            let owns = b[1] < a[1] || (b[1] == a[1] && b[0] > a[0]);
            side > 0 || (side == 0 && owns)
        })
    }

    /// Depth in units by intersecting the sample's line of sight with the triangle's plane.
    fn depth(&self, frame: &Frame, x: i128, y: i128) -> f64 {
        let axes = frame.axes();
        let pixel = frame.pixel_m(frame.zmax);
        let (u, v) = (frame.u0_m + x as f64 / 256.0 * pixel, frame.v0_m - y as f64 / 256.0 * pixel);
        let from = axes.local_from_uvd([u, v, frame.d0_m]);
        let n = cross(sub(self.corners[1], self.corners[0]), sub(self.corners[2], self.corners[0]));
        let along = dot(n, sub(self.corners[0], from)) / dot(n, axes.forward);
        if along.is_finite() { (along * 1024.0).clamp(self.depth.0, self.depth.1) } else { self.depth.0 }
    }
}

/// Compares a whole frame; returns (samples that meet something, samples too close to call).
fn compare(store: &SceneStore, frame: &Frame) -> (u64, u64) {
    let all = known(store, frame);
    let mut tracer = BeamTracer::new(store, frame).expect("tracer");
    let (mut met, mut close) = (0, 0);
    for top in (0..256).step_by(SUBTILE_PX) {
        // Every second sub-tile, as on a chessboard, to save time.
        for left in (top % 128..256).step_by(2 * SUBTILE_PX) {
            let result = tracer.trace(left as u64, top as u64, &Opaque).expect("trace");
            let here = in_subtile(&all, left as i128, top as i128);
            for j in 0..SUBTILE_PX {
                for i in 0..SUBTILE_PX {
                    let (m, c) = compare_pixel(&here, result, frame, (left, top), (i, j));
                    met += m;
                    close += c;
                }
            }
        }
    }
    (met, close)
}

fn in_subtile(all: &[Known], left: i128, top: i128) -> Vec<&Known> {
    let side = SUBTILE_PX as i128 * 256;
    let meets = |t: &Known, k: usize, from: i128| t.steps.iter().any(|s| s[k] >= from * 256) && t.steps.iter().any(|s| s[k] <= from * 256 + side);
    all.iter().filter(|t| meets(t, 0, left) && meets(t, 1, top)).collect()
}

fn compare_pixel(here: &[&Known], result: &VisBuf, frame: &Frame, corner: (usize, usize), at: (usize, usize)) -> (u64, u64) {
    let (mut met, mut close) = (0, 0);
    for (k, (sx, sy)) in SAMPLES.iter().enumerate() {
        let x = ((corner.0 + at.0) * 256 + usize::from(*sx) * 16) as i128;
        let y = ((corner.1 + at.1) * 256 + usize::from(*sy) * 16) as i128;
        let mut found: Vec<(i64, (u8, u32, u32), f64)> = here
            .iter()
            .filter(|t| t.covers(x, y))
            .map(|t| {
                let depth = t.depth(frame, x, y);
                ((depth + 0.5).floor() as i64 - t.bias, (255 - t.rank, t.object_id, t.source), depth)
            })
            .collect();
        found.sort_by_key(|f| (f.0, f.1));
        let slot = match result.pixel(at.0, at.1) {
            Pixel::Nothing => None,
            Pixel::One(slot) => Some(slot),
            Pixel::Mixed(slots) => (slots[k] != u32::MAX).then_some(slots[k]),
        };
        let place = format!("sample {k} of pixel ({}, {})", corner.0 + at.0, corner.1 + at.1);
        let (Some(best), Some(slot)) = (found.first(), slot) else {
            assert!(found.is_empty() && slot.is_none(), "{place}: expected {found:?}, got slot {slot:?}");
            continue;
        };
        met += 1;
        let surface = result.surface(slot);
        let source = result.chunk(surface.chunk).triangles()[surface.triangle as usize].source;
        let got = (255 - surface.rank, surface.object_id, source);
        // Rounding may differ by a unit at the centre and one more elsewhere, the bias by one.
        let room = if k == 0 { 2 } else { 3 };
        let rivals = found.iter().take_while(|f| f.0 <= best.0 + room).count();
        close += u64::from(rivals > 1);
        assert!(found[..rivals].iter().any(|f| f.1 == got), "{place}: {rivals} may win of {found:?}, got {got:?}");
        if k == 0 {
            let depth = result.center_depth(at.0, at.1);
            let mine = found.iter().find(|f| f.1 == got).expect("found above").2;
            assert!((f64::from(depth) - mine).abs() <= 1.0, "{place}: depth {depth}, expected {mine}");
        }
    }
    (met, close)
}

/// Random triangles of all sizes, slivers, walls seen edge-on, stacks of coplanar faces.
fn mixed_soup(dice: &mut Dice, count: usize) -> Soup {
    let mut soup = Soup::default();
    for k in 0..count {
        let object = k as u32 / 2;
        let rank = RANKS[dice.below(6) as usize];
        let at = dice.point(16.0);
        let size = [0.02, 0.2, 1.0, 4.0, 20.0, 300.0][dice.below(6) as usize];
        let corner = |dice: &mut Dice| {
            let e = dice.point(size);
            [at[0] + e[0], at[1] + e[1], at[2] + e[2]]
        };
        let mut t = [corner(dice), corner(dice), corner(dice)];
        match dice.below(8) {
            // A sliver.
            0 => t[2] = [0, 1, 2].map(|a| (t[0][a] + t[1][a]) / 2.0 + 0.002),
            // Upright, so that some views see it edge-on.
            1 => t = [t[0], t[1], [t[0][0], t[0][1], t[0][2] + size]],
            // Flat, to lie on others of the same height.
            2 | 3 => t.iter_mut().for_each(|c| c[2] = (at[2] / 4.0).floor() * 4.0),
            _ => {}
        }
        soup.add(t, object, rank);
    }
    soup
}

#[test]
fn beams_find_the_winner_of_every_sample() {
    let views = [(0.0, 90.0), (45.0, 45.0), (123.4, 22.5), (270.0, 10.0)];
    for (seed, (look_at, pitch)) in views.into_iter().enumerate() {
        let folder = new_folder("oracle");
        let store = build(&folder, &mixed_soup(&mut Dice(seed as u64 + 1), 150));
        let (met, close) = compare(&store, &frame(look_at, pitch, 40.0));
        assert!(met > 150_000, "only {met} samples meet anything");
        assert!(close * 4 < met, "{close} of {met} samples are too close to call");
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
        let all = known(&store, &frame);
        let mut tracer = BeamTracer::new(&store, &frame).expect("tracer");
        let result = tracer.trace(64, 64, &Opaque).expect("trace");
        for p in 0..SUBTILE_PX * SUBTILE_PX {
            let (i, j) = (p % SUBTILE_PX, p / SUBTILE_PX);
            let (x, y) = (((64 + i) * 256 + 128) as i128, ((64 + j) * 256 + 128) as i128);
            let highest = all.iter().filter(|t| t.covers(x, y)).map(|t| t.rank).max();
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
    soup.prototypes = vec![(0..12).map(|_| [dice.point(2.0), dice.point(2.0), dice.point(2.0)]).collect()];
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
        let (met, _) = compare(&store, &frame(look_at, pitch, 40.0));
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
