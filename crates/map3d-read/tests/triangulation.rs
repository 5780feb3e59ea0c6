//! Laws of triangulation: the triangles cover the polygon, whatever its plane, and keep its side.

use std::f64::consts::TAU;

use map3d_base::Vec3;
use map3d_base::vec3::{add, cross, dot, normalized, scale, triangle_normal};
use map3d_read::{Fault, Triangulator};

/// A reproducible stream of numbers in [0, 1).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A star-shaped ring around a centre: simple, mostly concave.
fn star(numbers: &mut Numbers, n: usize, center: [f64; 2], radius: f64) -> Vec<[f64; 2]> {
    let ray = |k: usize, r: f64| {
        let a = TAU * k as f64 / n as f64;
        [center[0] + r * a.cos(), center[1] + r * a.sin()]
    };
    (0..n).map(|k| ray(k, radius * (0.3 + 0.7 * numbers.next()))).collect()
}

fn ring_area(ring: &[[f64; 2]]) -> f64 {
    (0..ring.len()).map(|k| ring[k][0] * ring[(k + 1) % ring.len()][1] - ring[k][1] * ring[(k + 1) % ring.len()][0]).sum::<f64>() / 2.0
}

/// Axes of a random plane.
fn plane(numbers: &mut Numbers) -> [Vec3; 3] {
    let normal = normalized([numbers.next() - 0.5, numbers.next() - 0.5, numbers.next() - 0.5]).unwrap_or([0.0, 0.0, 1.0]);
    let other = if normal[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let u = normalized(cross(other, normal)).expect("not parallel");
    [u, cross(normal, u), normal]
}

fn lifted(rings: &[Vec<[f64; 2]>], axes: [Vec3; 3], origin: Vec3) -> (Vec<Vec3>, Vec<usize>) {
    let lift = |p: &[f64; 2]| add(origin, add(scale(axes[0], p[0]), scale(axes[1], p[1])));
    let mut ends = Vec::new();
    let mut points: Vec<Vec3> = Vec::new();
    for ring in rings {
        points.extend(ring.iter().map(lift));
        ends.push(points.len());
    }
    (points, ends)
}

/// Area of the triangles, seen along the normal: negative where one shows its other side.
fn signed_areas(triangulator: &Triangulator, points: &[Vec3], normal: Vec3) -> Vec<f64> {
    let corners = triangulator.triangles().as_chunks::<3>().0.iter().map(|t| t.map(|i| points[i as usize]));
    corners.map(|c| dot(triangle_normal(c), normal) / 2.0).collect()
}

#[test]
fn triangles_cover_the_polygon_less_its_holes_on_any_plane() {
    let mut numbers = Numbers(7);
    let mut triangulator = Triangulator::default();
    for case in 0..2000 {
        let outer_size = 3 + case % 40;
        let mut rings = vec![star(&mut numbers, outer_size, [0.0, 0.0], 100.0)];
        if outer_size > 12 {
            // Inside of the least radius of the outer ring.
            rings.extend([[-8.0, 0.0], [8.0, 0.0], [0.0, 10.0]].into_iter().take(case % 4).map(|c| star(&mut numbers, 3 + case % 7, c, 4.0)));
            rings[1..].iter_mut().filter(|_| case % 3 == 0).for_each(|hole| hole.reverse());
        }
        if case % 2 == 0 {
            rings[0].reverse();
        }
        let side = ring_area(&rings[0]).signum();
        let expected = ring_area(&rings[0]).abs() - rings[1..].iter().map(|r| ring_area(r).abs()).sum::<f64>();
        let axes = plane(&mut numbers);
        let (points, ends) = lifted(&rings, axes, [691_000.0, 5_336_000.0, 500.0]);
        assert_eq!(triangulator.polygon(&points, &ends), Ok(true), "case {case}");
        let areas = signed_areas(&triangulator, &points, scale(axes[2], side));
        assert!(areas.iter().all(|a| *a >= -1e-6), "case {case}: every triangle shows the polygon's side");
        assert!((areas.iter().sum::<f64>() - expected).abs() < 1e-6 * expected, "case {case}");
    }
}

#[test]
fn every_point_of_every_ring_is_a_corner() {
    let mut triangulator = Triangulator::default();
    let square = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [4.0, 0.0], [4.0, 2.0], [4.0, 4.0], [2.0, 4.0], [0.0, 4.0], [0.0, 1.0]];
    let hole = [[1.0, 1.0], [1.0, 2.0], [1.0, 3.0], [2.0, 3.0], [3.0, 3.0], [3.0, 1.0], [2.5, 1.0]];
    let axes = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];
    for rings in [vec![square.to_vec()], vec![square.to_vec(), hole.to_vec()], vec![square.iter().rev().copied().collect(), hole.to_vec()]] {
        let (points, ends) = lifted(&rings, axes, [0.0; 3]);
        assert_eq!(triangulator.polygon(&points, &ends), Ok(true));
        let missing: Vec<usize> = (0..points.len()).filter(|i| !triangulator.triangles().contains(&(*i as u32))).collect();
        assert_eq!(missing, [0; 0], "a point left out is a crack beside the neighbour that has it");
        let total: f64 = signed_areas(&triangulator, &points, axes[2]).iter().sum();
        let expected = 16.0 - if rings.len() > 1 { 4.0 } else { 0.0 };
        assert!((total.abs() - expected).abs() < 1e-12);
    }
}

#[test]
fn a_polygon_that_is_not_flat_is_covered_as_seen_along_its_normal() {
    let mut numbers = Numbers(3);
    let mut triangulator = Triangulator::default();
    for _ in 0..200 {
        let ring = star(&mut numbers, 12, [0.0, 0.0], 10.0);
        let points: Vec<Vec3> = ring.iter().map(|p| [p[0], p[1], numbers.next()]).collect();
        assert_eq!(triangulator.polygon(&points, &[points.len()]), Ok(true));
        let total: f64 = signed_areas(&triangulator, &points, [0.0, 0.0, 1.0]).iter().sum();
        assert!((total - ring_area(&ring)).abs() < 1e-9);
    }
}

#[test]
fn degenerate_polygons_have_a_reason() {
    let mut triangulator = Triangulator::default();
    let (o, x, y) = ([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    for (points, fault) in [
        (vec![], Fault::NoArea),
        (vec![o, x], Fault::NoArea),
        (vec![o, x, [2.0, 0.0, 0.0]], Fault::NoArea),
        (vec![o, x, x, o], Fault::NoArea),
        (vec![o, o, o, o, o], Fault::NoArea),
        (vec![o, x, [f64::NAN, 0.0, 0.0]], Fault::NotFinite),
        (vec![o, x, [0.0, f64::INFINITY, 0.0]], Fault::NotFinite),
        (vec![o, [1e300, 0.0, 0.0], [0.0, 1e300, 0.0]], Fault::NoArea),
    ] {
        assert_eq!(triangulator.polygon(&points, &[points.len()]), Err(fault), "{points:?}");
    }
    assert_eq!(triangulator.polygon(&[], &[]), Err(Fault::NoArea));
    assert_eq!(triangulator.polygon(&[o, x, y], &[3]), Ok(true));
}

#[test]
fn rings_that_cross_are_noticed() {
    let bow = [[0.0, 0.0, 0.0], [4.0, 4.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0]];
    assert_eq!(Triangulator::default().polygon(&bow, &[4]), Ok(false));
}

#[test]
fn repeated_and_touching_points_do_not_hang() {
    let mut numbers = Numbers(11);
    let mut triangulator = Triangulator::default();
    for case in 0..5000 {
        // Few different points, so that most repeat, touch and overlap.
        let n = 3 + case % 30;
        let points: Vec<Vec3> = (0..n).map(|_| [(numbers.next() * 4.0).floor(), (numbers.next() * 4.0).floor(), 0.0]).collect();
        let first = 3 + (numbers.next() * (n - 2) as f64) as usize;
        let ends = if first < n { vec![first, n] } else { vec![n] };
        let _ = triangulator.polygon(&points, &ends);
        assert!(triangulator.triangles().iter().all(|i| (*i as usize) < n));
    }
}
