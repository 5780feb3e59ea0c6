//! Laws of polygons with very many vertices: they are triangulated exactly, in bounded time, and a hopeless one is skipped alone.

use std::f64::consts::TAU;

use crate::documents::city_model::{building, member, multi_surface, polygon, read_text, square};
use crate::documents::random::Random;
use map3d_base::Vec3;
use map3d_read::{Coverage, PolygonError, Triangulator};

type Ring = Vec<[f64; 2]>;

/// Area by the shoelace formula; positive if counter-clockwise.
fn compute_ring_area(ring: &[[f64; 2]]) -> f64 {
    (0..ring.len()).map(|k| ring[k][0] * ring[(k + 1) % ring.len()][1] - ring[k][1] * ring[(k + 1) % ring.len()][0]).sum::<f64>() / 2.0
}

/// Returns the points on a plane that slopes along x, and the end of each ring.
fn lift(rings: &[Ring]) -> (Vec<Vec3>, Vec<usize>) {
    let points = rings.iter().flatten().map(|[x, y]| [691_000.0 + x, 5_336_000.0 + y, 500.0 + 0.5 * x]).collect();
    let ends = rings.iter().scan(0, |end, ring| {
        *end += ring.len();
        Some(*end)
    });
    (points, ends.collect())
}

/// Returns the area of each triangle in the plan; negative if clockwise.
fn compute_areas(triangles: &[u32], points: &[Vec3]) -> Vec<f64> {
    let corners = triangles.as_chunks::<3>().0.iter().map(|t| t.map(|i| [points[i as usize][0] - 691_000.0, points[i as usize][1] - 5_336_000.0]));
    corners.map(|c| compute_ring_area(&c)).collect()
}

/// Asserts that the triangles cover the polygon once, keep its orientation, and have all its vertices.
fn assert_covered(name: &str, rings: &[Ring]) {
    let (points, ends) = lift(rings);
    let mut triangulator = Triangulator::default();
    assert_eq!(triangulator.triangulate(&points, &ends), Ok(Coverage::Exact), "{name}");
    let orientation = compute_ring_area(&rings[0]).signum();
    let areas = compute_areas(triangulator.triangles(), &points);
    assert!(areas.iter().all(|a| a * orientation > -1e-6), "{name}: every triangle has the polygon's orientation");
    let expected = compute_ring_area(&rings[0]).abs() - rings[1..].iter().map(|r| compute_ring_area(r).abs()).sum::<f64>();
    let got = areas.iter().sum::<f64>() * orientation;
    assert!((got - expected).abs() < 1e-7 * expected, "{name}: {got} m², expected {expected}");
    let mut used = vec![false; points.len()];
    triangulator.triangles().iter().for_each(|i| used[*i as usize] = true);
    assert!(used.iter().all(|u| *u), "{name}: an unused vertex is a T-junction");
    let simple = points.len() + 2 * (rings.len() - 1) - 2;
    assert_eq!(triangulator.triangles().len() / 3, simple, "{name}: n + 2 holes - 2 triangles");
}

/// A band of `n` vertices, wound up.
fn build_spiral(n: usize, turns: f64) -> Ring {
    let point = |k: usize, offset: f64| {
        let angle = turns * TAU * k as f64 / (n / 2) as f64;
        let radius = 10.0 + angle + offset;
        [radius * angle.cos(), radius * angle.sin()]
    };
    (0..n / 2).map(|k| point(k, 1.5)).chain((0..n / 2).rev().map(|k| point(k, -1.5))).collect()
}

/// A square plate with square holes in rows.
fn build_plate(side: usize, holes: usize) -> Vec<Ring> {
    let (size, box_at) = (side as f64, |x: f64, y: f64| vec![[x, y], [x, y + 0.5], [x + 0.5, y + 0.5], [x + 0.5, y]]);
    let plate = vec![[0.0, 0.0], [size, 0.0], [size, size], [0.0, size]];
    std::iter::once(plate).chain((0..holes).map(|k| box_at((k % side) as f64 + 0.25, (k / side) as f64 + 0.25))).collect()
}

fn build_comb(n: usize) -> Ring {
    let teeth =
        (0..n / 4).flat_map(|k| [[0.0, 0.0], [0.1, 1000.0 + (k * 7919 % 13) as f64], [0.5, 1000.0], [0.6, 0.0]].map(|[x, y]| [x + k as f64, y]));
    teeth.chain([[(n / 4) as f64, -1.0], [0.0, -1.0]]).collect()
}

/// Two dense rows of vertices far apart.
fn build_long_teeth(n: usize) -> Ring {
    let teeth = (0..n / 2).flat_map(|k| [[k as f64 * 1e-3, 0.0], [k as f64 * 1e-3 + 5e-4, 1e4]]);
    teeth.chain([[n as f64 * 1e-3, -1e4], [-1.0, -1e4]]).collect()
}

fn build_star(n: usize, smallest: f64) -> Ring {
    let mut random = Random(5);
    let mut point = |k: usize| {
        let (angle, radius) = (TAU * k as f64 / n as f64, 100.0 * (smallest + (1.0 - smallest) * random.next_f64()));
        [radius * angle.cos(), radius * angle.sin()]
    };
    (0..n).map(&mut point).collect()
}

#[test]
fn a_spiral_of_200_000_vertices_is_covered() {
    assert_covered("spiral", &[build_spiral(200_000, 500.0)]);
    assert_covered("clockwise spiral", &[build_spiral(50_000, 100.0).into_iter().rev().collect()]);
}

#[test]
fn a_plate_with_20_000_holes_is_covered() {
    assert_covered("plate", &build_plate(150, 20_000));
}

#[test]
fn other_large_polygons_are_covered() {
    assert_covered("comb", &[build_comb(20_000)]);
    assert_covered("long teeth", &[build_long_teeth(20_000)]);
    assert_covered("star", &[build_star(5_000, 0.3)]);
    assert_covered("circle", &[build_star(50_000, 1.0)]);
    let steps = (0..5_000).flat_map(|k| [[k as f64, k as f64], [k as f64 + 1.0, k as f64]]);
    assert_covered("stairs", &[steps.chain([[5_000.0, 5_000.0], [0.0, 5_000.0]]).collect()]);
    let side = |from: [f64; 2], to: [f64; 2]| (0..500).map(move |k| [0, 1].map(|a| from[a] + (to[a] - from[a]) * k as f64 / 500.0));
    let corners = [[0.0, 0.0], [64.0, 0.0], [64.0, 64.0], [0.0, 64.0]];
    assert_covered("square with points on its sides", &[(0..4).flat_map(|k| side(corners[k], corners[(k + 1) % 4])).collect()]);
    let wedge = (0..600).map(|k| [1000.0 * 0.97f64.powi(k), 0.0]).chain((0..600).rev().map(|k| [1000.0 * 0.97f64.powi(k), 1000.0 * 0.97f64.powi(k)]));
    assert_covered("wedge of ever smaller steps", &[wedge.collect()]);
}

#[test]
fn an_edge_may_have_very_many_vertices_on_or_near_it() {
    let mut random = Random(23);
    for (count, deviation) in [(900, 0.0), (900, 1e-6), (10_000, 0.0), (10_000, 1e-6), (100_000, 0.0), (100_000, 1e-6)] {
        let edge = (0..count).map(|k| [100.0 * f64::from(k) / f64::from(count), deviation * (random.next_f64() - 0.5)]);
        let ring: Ring = edge.chain([[100.0, 0.0], [100.0, 50.0], [0.0, 50.0]]).collect();
        assert_covered(&format!("{count} vertices within {deviation} m"), &[ring]);
    }
}

#[test]
fn large_and_small_polygons_have_the_same_area() {
    let mut random = Random(17);
    for n in [997, 998, 999, 1_000, 1_001, 1_002, 1_003] {
        let ring = build_star(n, 0.5);
        let ring: Ring = ring.into_iter().map(|[x, y]| [x + random.next_f64() * 1e-3, y]).collect();
        assert_covered(&format!("{n} vertices"), &[ring]);
    }
}

#[test]
fn a_hole_may_touch_the_exterior_and_another_hole() {
    let exterior = build_star(2_000, 1.0);
    let touch = exterior[500];
    let first = vec![touch, [touch[0] - 10.0, touch[1] - 40.0], [touch[0] + 10.0, touch[1] - 40.0]];
    let second = vec![first[2], [first[2][0] + 20.0, first[2][1] - 10.0], [first[2][0] + 20.0, first[2][1] + 10.0]];
    let rings = [exterior, first, second];
    let (points, ends) = lift(&rings);
    let mut triangulator = Triangulator::default();
    assert_eq!(triangulator.triangulate(&points, &ends), Ok(Coverage::Exact));
    let expected = compute_ring_area(&rings[0]).abs() - rings[1..].iter().map(|r| compute_ring_area(r).abs()).sum::<f64>();
    assert!((compute_areas(triangulator.triangles(), &points).iter().sum::<f64>() - expected).abs() < 1e-7 * expected);
}

#[test]
fn crossing_rings_of_a_large_polygon_cost_little_of_it() {
    let mut ring = build_star(5_000, 1.0);
    for k in [100, 2_000, 4_444] {
        ring.swap(k, k + 40);
    }
    let (points, ends) = lift(&[ring]);
    let mut triangulator = Triangulator::default();
    assert_eq!(triangulator.triangulate(&points, &ends), Ok(Coverage::Inexact));
    let area: f64 = compute_areas(triangulator.triangles(), &points).iter().sum();
    let circle = compute_ring_area(&build_star(5_000, 1.0));
    assert!((area - circle).abs() < 1e-3 * circle, "{area} m² of {circle}");
}

#[test]
fn a_hopeless_polygon_is_an_error_and_the_next_one_is_covered() {
    let mut random = Random(3);
    let (points, ends) = lift(&[(0..50_000).map(|_| [random.next_f64() * 100.0, random.next_f64() * 100.0]).collect()]);
    let mut triangulator = Triangulator::default();
    assert_eq!(triangulator.triangulate(&points, &ends), Err(PolygonError::TooManyVertices));
    assert!(triangulator.triangles().is_empty());
    let (points, ends) = lift(&[build_comb(2_000)]);
    assert_eq!(triangulator.triangulate(&points, &ends), Ok(Coverage::Exact));
    let on_a_line: Vec<Vec3> = (0..5_000).map(|k| [f64::from(k % 70), 0.0, 0.0]).collect();
    assert_eq!(triangulator.triangulate(&on_a_line, &[5_000]), Err(PolygonError::NoArea));
}

#[test]
fn repeated_touching_and_extreme_points_terminate() {
    let mut random = Random(11);
    let mut triangulator = Triangulator::default();
    for case in 0..300 {
        let n = 1_001 + case;
        let (cells, unit) = ((2 + case % 60) as f64, [1.0, 1e-40, 1e-9, 1e30][case % 4]);
        let points: Vec<Vec3> =
            (0..n).map(|_| [(random.next_f64() * cells).floor() * unit, (random.next_f64() * cells).floor() * unit, 0.0]).collect();
        let first = 3 + (random.next_f64() * (n - 2) as f64) as usize;
        let ends = if first < n { vec![first, n] } else { vec![n] };
        let _ = triangulator.triangulate(&points, &ends);
        assert!(triangulator.triangles().iter().all(|i| (*i as usize) < n));
    }
}

#[test]
fn the_same_polygon_has_the_same_triangles() {
    let (points, ends) = lift(&build_plate(40, 1_500));
    let triangulate = || {
        let mut triangulator = Triangulator::default();
        triangulator.triangulate(&points, &ends).expect("valid");
        triangulator.triangles().to_vec()
    };
    let first = triangulate();
    assert!((0..3).all(|_| std::thread::scope(|s| s.spawn(triangulate).join().expect("no panic")) == first));
}

#[test]
fn a_hopeless_polygon_does_not_cost_the_document() {
    let mut random = Random(9);
    let ring: Vec<String> = (0..20_000).map(|_| format!("{:.3} {:.3} 0", random.next_f64() * 100.0, random.next_f64() * 100.0)).collect();
    let members = member(&polygon("hopeless", &format!("{} {}", ring.join(" "), ring[0]))) + &member(&square("good", 1));
    let document = read_text(&building(&format!("<bldg:lod2MultiSurface>{}</bldg:lod2MultiSurface>", multi_surface(&members))));
    assert_eq!((document.count(), document.area()), (2, 4.0));
    assert_eq!(document.reported("polygon-with-too-many-vertices"), 1, "{:?}", document.report);
}
