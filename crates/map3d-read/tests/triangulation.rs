//! Laws of triangulation: the triangles cover the polygon in any plane and keep its orientation.

use std::f64::consts::TAU;

use crate::documents::random::Random;
use map3d_base::Vec3;
use map3d_base::vec3::{add, cross, dot, normalized, scale, triangle_normal};
use map3d_read::{Coverage, PolygonError, Triangulator};

/// Builds a star-shaped ring around a centre: simple, mostly concave.
fn build_star(random: &mut Random, n: usize, center: [f64; 2], radius: f64) -> Vec<[f64; 2]> {
    let point = |k: usize, r: f64| {
        let a = TAU * k as f64 / n as f64;
        [center[0] + r * a.cos(), center[1] + r * a.sin()]
    };
    (0..n).map(|k| point(k, radius * (0.3 + 0.7 * random.next_f64()))).collect()
}

fn compute_ring_area(ring: &[[f64; 2]]) -> f64 {
    (0..ring.len()).map(|k| ring[k][0] * ring[(k + 1) % ring.len()][1] - ring[k][1] * ring[(k + 1) % ring.len()][0]).sum::<f64>() / 2.0
}

/// Returns the axes of a random plane: two in the plane, then its normal.
fn choose_plane(random: &mut Random) -> [Vec3; 3] {
    let normal = normalized([random.next_f64() - 0.5, random.next_f64() - 0.5, random.next_f64() - 0.5]).unwrap_or([0.0, 0.0, 1.0]);
    let other = if normal[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let u = normalized(cross(other, normal)).expect("not parallel");
    [u, cross(normal, u), normal]
}

/// Maps rings into a plane; returns the points and the end of each ring.
fn lift_rings(rings: &[Vec<[f64; 2]>], axes: [Vec3; 3], origin: Vec3) -> (Vec<Vec3>, Vec<usize>) {
    let lift = |p: &[f64; 2]| add(origin, add(scale(axes[0], p[0]), scale(axes[1], p[1])));
    let mut ends = Vec::new();
    let mut points: Vec<Vec3> = Vec::new();
    for ring in rings {
        points.extend(ring.iter().map(lift));
        ends.push(points.len());
    }
    (points, ends)
}

/// Computes the area of each triangle along the normal; negative for a reversed triangle.
fn compute_signed_areas(triangulator: &Triangulator, points: &[Vec3], normal: Vec3) -> Vec<f64> {
    let corners = triangulator.triangles().as_chunks::<3>().0.iter().map(|t| t.map(|i| points[i as usize]));
    corners.map(|c| dot(triangle_normal(c), normal) / 2.0).collect()
}

#[test]
fn triangles_cover_the_polygon_without_its_holes_in_any_plane() {
    let mut random = Random(7);
    let mut triangulator = Triangulator::default();
    for case in 0..2000 {
        let outer_size = 3 + case % 40;
        let mut rings = vec![build_star(&mut random, outer_size, [0.0, 0.0], 100.0)];
        if outer_size > 12 {
            // Inside the smallest radius of the outer ring.
            rings.extend([[-8.0, 0.0], [8.0, 0.0], [0.0, 10.0]].into_iter().take(case % 4).map(|c| build_star(&mut random, 3 + case % 7, c, 4.0)));
            rings[1..].iter_mut().filter(|_| case % 3 == 0).for_each(|hole| hole.reverse());
        }
        if case % 2 == 0 {
            rings[0].reverse();
        }
        let orientation = compute_ring_area(&rings[0]).signum();
        let expected = compute_ring_area(&rings[0]).abs() - rings[1..].iter().map(|r| compute_ring_area(r).abs()).sum::<f64>();
        let axes = choose_plane(&mut random);
        let (points, ends) = lift_rings(&rings, axes, [691_000.0, 5_336_000.0, 500.0]);
        assert_eq!(triangulator.triangulate(&points, &ends), Ok(Coverage::Exact), "case {case}");
        let areas = compute_signed_areas(&triangulator, &points, scale(axes[2], orientation));
        assert!(areas.iter().all(|a| *a >= -1e-6), "case {case}: every triangle has the polygon's orientation");
        assert!((areas.iter().sum::<f64>() - expected).abs() < 1e-6 * expected, "case {case}");
    }
}

#[test]
fn every_point_is_a_corner_of_a_triangle() {
    let mut triangulator = Triangulator::default();
    let square = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [4.0, 0.0], [4.0, 2.0], [4.0, 4.0], [2.0, 4.0], [0.0, 4.0], [0.0, 1.0]];
    let hole = [[1.0, 1.0], [1.0, 2.0], [1.0, 3.0], [2.0, 3.0], [3.0, 3.0], [3.0, 1.0], [2.5, 1.0]];
    let axes = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];
    for rings in [vec![square.to_vec()], vec![square.to_vec(), hole.to_vec()], vec![square.iter().rev().copied().collect(), hole.to_vec()]] {
        let (points, ends) = lift_rings(&rings, axes, [0.0; 3]);
        assert_eq!(triangulator.triangulate(&points, &ends), Ok(Coverage::Exact));
        let missing: Vec<usize> = (0..points.len()).filter(|i| !triangulator.triangles().contains(&(*i as u32))).collect();
        assert_eq!(missing, [0; 0], "a missing point makes a T-junction with the adjacent polygon");
        let total: f64 = compute_signed_areas(&triangulator, &points, axes[2]).iter().sum();
        let expected = 16.0 - if rings.len() > 1 { 4.0 } else { 0.0 };
        assert!((total.abs() - expected).abs() < 1e-12);
    }
}

#[test]
fn non_planar_polygons_are_covered_in_projection() {
    let mut random = Random(3);
    let mut triangulator = Triangulator::default();
    for _ in 0..200 {
        let ring = build_star(&mut random, 12, [0.0, 0.0], 10.0);
        let points: Vec<Vec3> = ring.iter().map(|p| [p[0], p[1], random.next_f64()]).collect();
        assert_eq!(triangulator.triangulate(&points, &[points.len()]), Ok(Coverage::Exact));
        let total: f64 = compute_signed_areas(&triangulator, &points, [0.0, 0.0, 1.0]).iter().sum();
        assert!((total - compute_ring_area(&ring)).abs() < 1e-9);
    }
}

#[test]
fn degenerate_polygons_are_an_error() {
    let mut triangulator = Triangulator::default();
    let (o, x, y) = ([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    for (points, error) in [
        (vec![], PolygonError::NoArea),
        (vec![o, x], PolygonError::NoArea),
        (vec![o, x, [2.0, 0.0, 0.0]], PolygonError::NoArea),
        (vec![o, x, x, o], PolygonError::NoArea),
        (vec![o, o, o, o, o], PolygonError::NoArea),
        (vec![o, x, [f64::NAN, 0.0, 0.0]], PolygonError::NotFinite),
        (vec![o, x, [0.0, f64::INFINITY, 0.0]], PolygonError::NotFinite),
        (vec![o, [1e300, 0.0, 0.0], [0.0, 1e300, 0.0]], PolygonError::NoArea),
    ] {
        assert_eq!(triangulator.triangulate(&points, &[points.len()]), Err(error), "{points:?}");
    }
    assert_eq!(triangulator.triangulate(&[], &[]), Err(PolygonError::NoArea));
    assert_eq!(triangulator.triangulate(&[o, x, y], &[3]), Ok(Coverage::Exact));
}

#[test]
fn crossing_rings_are_detected() {
    let bow_tie = [[0.0, 0.0, 0.0], [4.0, 4.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0]];
    assert_eq!(Triangulator::default().triangulate(&bow_tie, &[4]), Ok(Coverage::Inexact));
}

#[test]
fn repeated_and_touching_points_terminate() {
    let mut random = Random(11);
    let mut triangulator = Triangulator::default();
    for case in 0..5000 {
        // Few distinct positions, so that most points repeat and edges overlap.
        let n = 3 + case % 30;
        let points: Vec<Vec3> = (0..n).map(|_| [(random.next_f64() * 4.0).floor(), (random.next_f64() * 4.0).floor(), 0.0]).collect();
        let first = 3 + (random.next_f64() * (n - 2) as f64) as usize;
        let ends = if first < n { vec![first, n] } else { vec![n] };
        let _ = triangulator.triangulate(&points, &ends);
        assert!(triangulator.triangles().iter().all(|i| (*i as usize) < n));
    }
}
