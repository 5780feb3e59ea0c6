//! Normals of instances against the inverse transpose in float64, within the rounding of int16 (spec/pyramid.md §5).

use std::f64::consts::{PI, TAU};

use crate::town::reference::{ReferenceTriangle, ReferenceView};
use crate::town::scenes::Lcg;
use crate::town::{SoupFace, Town, frame, new_folder};
use map3d_base::Vec3;
use map3d_base::asset::Instance;
use map3d_base::layers::NORMAL;
use map3d_base::vec3::{cross, dot, normalized, scale, triangle_normal};

/// Returns a hemisphere, open below, with the normals of a sphere; every second face has the opposite winding.
fn hemisphere() -> Vec<SoupFace> {
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
            out.push(SoupFace { normals: Some(t.map(|p| p.map(|c| c as f32))), ..SoupFace::new(t) });
        }
    }
    out
}

/// Returns random faces; two of three have shading normals that deviate by up to 55°.
fn random_faces(random: &mut Lcg) -> Vec<SoupFace> {
    let mut out = Vec::new();
    while out.len() < 12 {
        let face = SoupFace::new([random.point(1.5), random.point(1.5), random.point(1.5)]);
        let Some(n) = normalized(triangle_normal(face.corners)) else { continue };
        let tilted = |random: &mut Lcg| {
            let to = random.point(0.48);
            normalized([0, 1, 2].map(|k| n[k] + to[k])).expect("the deviation is shorter than the normal").map(|c| c as f32)
        };
        let normals = (out.len() % 3 != 0).then(|| [tilted(random), tilted(random), tilted(random)]);
        out.push(SoupFace { normals, ..face });
    }
    out
}

/// Returns a placement that rotates about any axis, stretches by up to 2.2 along three axes, and mirrors every second instance.
fn placement(random: &mut Lcg, k: u32, at: Vec3) -> [f64; 12] {
    let axes = |random: &mut Lcg| {
        let (a, b) = (normalized(random.point(1.0)).expect("a direction"), random.point(1.0));
        let c = normalized(cross(a, b)).expect("a direction");
        [a, cross(c, a), c]
    };
    let (from, to) = (axes(random), axes(random));
    let stretch = [1.0, random.between(1.0, 2.2), random.between(1.0, 2.2) * if k.is_multiple_of(2) { -1.0 } else { 1.0 }];
    let entry = |row: usize, column: usize| (0..3).map(|k| to[k][row] * stretch[k] * from[k][column]).sum();
    let mut out = [0.0; 12];
    (0..12).for_each(|k| out[k] = if k % 4 == 3 { at[k / 4] } else { entry(k / 4, k % 4) });
    out
}

/// Returns the rows of the inverse of a transform's linear part.
fn inverse(t: &[f64; 12]) -> [Vec3; 3] {
    let columns = [0, 1, 2].map(|k| [t[k], t[k + 4], t[k + 8]]);
    let determinant = dot(columns[0], cross(columns[1], columns[2]));
    [0, 1, 2].map(|k| scale(cross(columns[(k + 1) % 3], columns[(k + 2) % 3]), 1.0 / determinant))
}

fn transposed_times(rows: &[Vec3; 3], n: Vec3) -> Vec3 {
    [0, 1, 2].map(|k| (0..3).map(|r| rows[r][k] * n[r]).sum())
}

/// Returns the normal × 32767 at a pixel's centre, or `None` if rounding may turn it, or on a sliver, which magnifies the error.
fn expected(view: &ReferenceView, t: &ReferenceTriangle, source: &SoupFace, at: [i128; 2]) -> Option<Vec3> {
    let Some(given) = source.normals else { return Some(scale(t.normal, 32_767.0)) };
    let rows = t.transform.as_ref().map(inverse);
    let corners = given.map(|n| {
        let n = n.map(f64::from);
        normalized(rows.as_ref().map_or(n, |r| transposed_times(r, n))).expect("a normal")
    });
    let along = corners.map(|n| dot(n, t.normal));
    let weights = view.weights(t, at);
    let right = view.weights(t, [at[0] + 256, at[1]]);
    let down = view.weights(t, [at[0], at[1] + 256]);
    let steep = (0..3).any(|k| (right[k] - weights[k]).abs() + (down[k] - weights[k]).abs() > 4.0);
    if steep || along.iter().any(|a| a.abs() < 1e-3) {
        return None;
    }
    let w = weights.map(|w| w.clamp(0.0, 1.0));
    let mixed = [0, 1, 2].map(|k| (0..3).map(|c| w[c] * corners[c][k] * along[c].signum()).sum());
    Some(scale(normalized(mixed)?, 32_767.0))
}

/// Compares one view. Returns the numbers of compared pixels, of those with shading normals, and of those with a turned corner normal.
fn compare(town: &Town, look_at: f64, pitch: f64) -> [u32; 3] {
    let (folder, f) = (new_folder("normals"), frame(look_at, pitch, 24.0, 0));
    let scene = town.open(&folder);
    let g = scene.gbuffer(&f, 0, 0).expect("renders");
    let (view, faces) = (ReferenceView::new(&f), town.all_faces().collect::<Vec<_>>());
    let (triangles, mut counts) = (view.triangles(scene.store()), [0; 3]);
    for p in (0..65_536).step_by(3) {
        let at = ReferenceView::sample([p % 256, p / 256], 0);
        let mut found: Vec<(i64, &ReferenceTriangle)> =
            triangles.iter().filter(|t| t.covers(at)).map(|t| (t.depth_key(view.depth(t, at)), t)).collect();
        found.sort_by_key(|r| r.0);
        let Some(&(key, t)) = found.first() else {
            assert_eq!(g[NORMAL][p], [0; 3]);
            continue;
        };
        let source = faces[town.face_number(t.object_id, t.source, t.transform.is_some())];
        let Some(n) = expected(&view, t, source, at).filter(|_| found.get(1).is_none_or(|second| second.0 > key + 2)) else { continue };
        // The rounding of the stored normal, which the placement at most doubles, that of the result, and float32 in between.
        let got = g[NORMAL][p].map(f64::from);
        assert!((0..3).all(|k| (got[k] - n[k]).abs() <= 3.0), "pixel {p} from {look_at} / {pitch}: {got:?}, expected {n:?} of {source:?}");
        let is_turned = |given: [[f32; 3]; 3]| {
            let plain = |n: [f32; 3]| t.transform.map_or(n.map(f64::from), |m| transposed_times(&inverse(&m), n.map(f64::from)));
            given.iter().any(|n| dot(plain(*n), t.normal) < 0.0)
        };
        let flags = [true, source.normals.is_some(), source.normals.is_some_and(is_turned)];
        (0..3).for_each(|k| counts[k] += u32::from(flags[k]));
    }
    counts
}

#[test]
fn instances_transform_normals_by_the_inverse_transpose() {
    let mut random = Lcg(44);
    let mut town = Town { prototypes: vec![hemisphere(), random_faces(&mut random)], ..Town::default() };
    for k in 0..16u32 {
        let at = [f64::from(k % 4) * 4.5 - 7.0, f64::from(k / 4) * 4.5 - 7.0, random.between(-1.0, 1.0)];
        town.instances.push(Instance { prototype: k / 2 % 2 + 1, object: k, transform: placement(&mut random, k, at) });
    }
    for (look_at, pitch) in [(0.0, 90.0), (75.0, 40.0), (190.0, 12.0)] {
        let [all, smooth, turned] = compare(&town, look_at, pitch);
        assert!(all > 3_000 && smooth > 2_000 && turned > 500, "{all} pixels, {smooth} with shading normals, {turned} turned");
    }
}

#[test]
fn chunks_keep_their_normals() {
    let mut random = Lcg(45);
    let mut town = Town { faces: hemisphere().into_iter().chain(random_faces(&mut random)).collect(), ..Town::default() };
    town.faces.iter_mut().for_each(|f| f.corners = f.corners.map(|c| scale(c, 6.0)));
    for (look_at, pitch) in [(0.0, 90.0), (75.0, 40.0), (190.0, 12.0)] {
        let [all, smooth, _] = compare(&town, look_at, pitch);
        assert!(all > 5_000 && smooth > 3_000, "{all} pixels, {smooth} with shading normals");
    }
}
