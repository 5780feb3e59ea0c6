//! Normals of placed prototypes: the inverse transpose in float64, within what int16 can hold (spec/pyramid.md §5).

mod town;

use std::f64::consts::{PI, TAU};

use map3d_base::Vec3;
use map3d_base::asset::Instance;
use map3d_base::vec3::{cross, dot, normalized, scale, triangle_normal};
use town::brute::{Eye, Known};
use town::scenes::Dice;
use town::{Face, Town, frame, new_folder};

/// Half a ball, open below, with the normals of a ball; every second face runs the other way round.
fn bowl() -> Vec<Face> {
    let point = |i: usize, j: usize| {
        let (t, a) = (PI / 2.0 * i as f64 / 5.0, TAU * j as f64 / 12.0);
        [t.sin() * a.cos(), t.sin() * a.sin(), t.cos()]
    };
    let mut out = Vec::new();
    for (i, j) in (0..5).flat_map(|i| (0..12).map(move |j| (i, j))) {
        let c = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
        let quad = if i == 0 { vec![[c[0], c[1], c[2]]] } else { vec![[c[0], c[1], c[2]], [c[2], c[0], c[3]]] };
        for (k, t) in quad.into_iter().enumerate() {
            let t = if k == 0 { t } else { [t[1], t[0], t[2]] };
            out.push(Face { normals: Some(t.map(|p| p.map(|c| c as f32))), ..Face::new(t) });
        }
    }
    out
}

/// Random faces: flat ones, and some whose normals lean up to 55° to all sides.
fn shards(dice: &mut Dice) -> Vec<Face> {
    let mut out = Vec::new();
    while out.len() < 12 {
        let face = Face::new([dice.point(1.5), dice.point(1.5), dice.point(1.5)]);
        let Some(n) = normalized(triangle_normal(face.corners)) else { continue };
        let lean = |dice: &mut Dice| {
            let to = dice.point(0.48);
            normalized([0, 1, 2].map(|k| n[k] + to[k])).expect("leans less than it is long").map(|c| c as f32)
        };
        let normals = (out.len() % 3 != 0).then(|| [lean(dice), lean(dice), lean(dice)]);
        out.push(Face { normals, ..face });
    }
    out
}

/// Turned about any axis, stretched by up to 2.2 along three axes, every second one mirrored.
fn placement(dice: &mut Dice, k: u32, at: Vec3) -> [f64; 12] {
    let axes = |dice: &mut Dice| {
        let (a, b) = (normalized(dice.point(1.0)).expect("a direction"), dice.point(1.0));
        let c = normalized(cross(a, b)).expect("a direction");
        [a, cross(c, a), c]
    };
    let (from, to) = (axes(dice), axes(dice));
    let stretch = [1.0, dice.between(1.0, 2.2), dice.between(1.0, 2.2) * if k.is_multiple_of(2) { -1.0 } else { 1.0 }];
    let entry = |row: usize, column: usize| (0..3).map(|k| to[k][row] * stretch[k] * from[k][column]).sum();
    let mut out = [0.0; 12];
    (0..12).for_each(|k| out[k] = if k % 4 == 3 { at[k / 4] } else { entry(k / 4, k % 4) });
    out
}

/// Rows of the inverse of a 3 × 4 transform's linear part.
fn inverse(t: &[f64; 12]) -> [Vec3; 3] {
    let columns = [0, 1, 2].map(|k| [t[k], t[k + 4], t[k + 8]]);
    let determinant = dot(columns[0], cross(columns[1], columns[2]));
    [0, 1, 2].map(|k| scale(cross(columns[(k + 1) % 3], columns[(k + 2) % 3]), 1.0 / determinant))
}

fn transposed_times(rows: &[Vec3; 3], n: Vec3) -> Vec3 {
    [0, 1, 2].map(|k| (0..3).map(|r| rows[r][k] * n[r]).sum())
}

/// The normal that a pixel's centre shows × 32767; `None` where rounding may turn it or a sliver stretches it.
fn expected(eye: &Eye, t: &Known, source: &Face, at: [i128; 2]) -> Option<Vec3> {
    let Some(given) = source.normals else { return Some(scale(t.normal, 32_767.0)) };
    let rows = t.transform.as_ref().map(inverse);
    let corners = given.map(|n| {
        let n = n.map(f64::from);
        normalized(rows.as_ref().map_or(n, |r| transposed_times(r, n))).expect("a normal")
    });
    let along = corners.map(|n| dot(n, t.normal));
    let weights = eye.weights(t, at);
    let right = eye.weights(t, [at[0] + 256, at[1]]);
    let down = eye.weights(t, [at[0], at[1] + 256]);
    let steep = (0..3).any(|k| (right[k] - weights[k]).abs() + (down[k] - weights[k]).abs() > 4.0);
    if steep || along.iter().any(|a| a.abs() < 1e-3) {
        return None;
    }
    let w = weights.map(|w| w.clamp(0.0, 1.0));
    let mixed = [0, 1, 2].map(|k| (0..3).map(|c| w[c] * corners[c][k] * along[c].signum()).sum());
    Some(scale(normalized(mixed)?, 32_767.0))
}

/// One view; counts of pixels compared, of those with shading normals, and of those of which some corner's normal was turned.
fn compare(town: &Town, look_at: f64, pitch: f64) -> [u32; 3] {
    let (folder, f) = (new_folder("normals"), frame(look_at, pitch, 24.0, 0));
    let scene = town.open(&folder);
    let g = scene.gbuffer(&f, 0, 0).expect("renders");
    let (eye, faces) = (Eye::new(&f), town.all_faces().collect::<Vec<_>>());
    let (known, mut counts) = (eye.know(scene.store()), [0; 3]);
    for p in (0..65_536).step_by(3) {
        let at = Eye::sample([p % 256, p / 256], 0);
        let mut found: Vec<(i64, &Known)> = known.iter().filter(|t| t.covers(at)).map(|t| (t.key(eye.depth(t, at)), t)).collect();
        found.sort_by_key(|r| r.0);
        let Some(&(key, t)) = found.first() else {
            assert_eq!(g.normal[p], [0; 3]);
            continue;
        };
        let source = faces[town.face_number(t.object_id, t.source, t.transform.is_some())];
        let Some(n) = expected(&eye, t, source, at).filter(|_| found.get(1).is_none_or(|second| second.0 > key + 2)) else { continue };
        // Half a unit of the stored normal at most doubles under the placement; half a unit of the result; float32 between them.
        let got = g.normal[p].map(f64::from);
        assert!((0..3).all(|k| (got[k] - n[k]).abs() <= 3.0), "pixel {p} from {look_at} / {pitch}: {got:?}, expected {n:?} of {source:?}");
        let is_turned = |given: [[f32; 3]; 3]| {
            let plain = |n: [f32; 3]| t.transform.map_or(n.map(f64::from), |m| transposed_times(&inverse(&m), n.map(f64::from)));
            given.iter().any(|n| dot(plain(*n), t.normal) < 0.0)
        };
        let of = [true, source.normals.is_some(), source.normals.is_some_and(is_turned)];
        (0..3).for_each(|k| counts[k] += u32::from(of[k]));
    }
    counts
}

#[test]
fn placed_normals_are_those_of_the_inverse_transpose() {
    let mut dice = Dice(44);
    let mut town = Town { prototypes: vec![bowl(), shards(&mut dice)], ..Town::default() };
    for k in 0..16u32 {
        let at = [f64::from(k % 4) * 4.5 - 7.0, f64::from(k / 4) * 4.5 - 7.0, dice.between(-1.0, 1.0)];
        town.instances.push(Instance { prototype: k / 2 % 2 + 1, object: k, transform: placement(&mut dice, k, at) });
    }
    for (look_at, pitch) in [(0.0, 90.0), (75.0, 40.0), (190.0, 12.0)] {
        let [all, smooth, turned] = compare(&town, look_at, pitch);
        assert!(all > 3_000 && smooth > 2_000 && turned > 500, "{all} pixels, {smooth} with shading normals, {turned} turned");
    }
}

#[test]
fn faces_that_are_not_placed_keep_their_normals() {
    let mut dice = Dice(45);
    let mut town = Town { faces: bowl().into_iter().chain(shards(&mut dice)).collect(), ..Town::default() };
    town.faces.iter_mut().for_each(|f| f.corners = f.corners.map(|c| scale(c, 6.0)));
    for (look_at, pitch) in [(0.0, 90.0), (75.0, 40.0), (190.0, 12.0)] {
        let [all, smooth, _] = compare(&town, look_at, pitch);
        assert!(all > 5_000 && smooth > 3_000, "{all} pixels, {smooth} with shading normals");
    }
}
