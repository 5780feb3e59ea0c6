//! Triangulates the control points of a `gml:Tin` in the plan: a Delaunay triangulation, constrained by break lines.
//!
//! Triangles that a stop line crosses or encloses are left out, and those with a side that is too long (GML 3.2.1, 10.5.12.7).

use std::panic::{AssertUnwindSafe, catch_unwind};

use map3d_base::{Reason, Vec3};
use spade::handles::{FixedDirectedEdgeHandle, FixedFaceHandle, FixedVertexHandle, InnerTag};
use spade::{Intersection, LineIntersectionIterator, PositionInTriangulation, Triangulation};

use super::constrained_delaunay::{
    Budget, Cdt, MAX_VERTICES, Vertex, add_ring_edge, choose_insertion_order, find_distinct_points, locate_centroids, place,
};
use super::polygon_error::PolygonError;

/// A stop line that comes no further into a triangle touches it.
const TOUCH_M: f64 = 1e-6;

/// All coordinates are in metres, near the origin.
#[derive(Clone, Debug, Default)]
pub struct TinSource {
    /// Control points, then the vertices of break lines.
    pub points: Vec<Vec3>,
    /// Pairs of indices.
    pub break_edges: Vec<[u32; 2]>,
    pub stop_lines: Vec<Vec<Vec3>>,
    /// Longest side of a triangle.
    pub max_length: Option<f64>,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TinTriangles {
    /// Indices of points, counter-clockwise from above.
    pub triangles: Vec<[u32; 3]>,
    /// Points in the place of an earlier one, with another height.
    pub other_heights: u64,
    /// Segments of break lines that cross another one, which are left out.
    pub crossing_breaks: u64,
    /// Triangles left out.
    pub stopped: u64,
    pub too_long: u64,
}

/// The reason why a TIN has no triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TinError {
    Unreadable,
    MixedCrs,
    TooManyCrs,
    TooFewPoints,
    OnALine,
    TooManyPoints,
    NumericalFailure,
}

impl TinError {
    /// Returns the reason as written to reports.
    pub fn reason(self) -> Reason {
        match self {
            Self::Unreadable => Reason::TinCoordinatesUnreadable,
            Self::MixedCrs => Reason::TinInSeveralCrs,
            Self::TooManyCrs => Reason::TinCrsTooMany,
            Self::TooFewPoints => Reason::TinWithTooFewPoints,
            Self::OnALine => Reason::TinPointsOnALine,
            Self::TooManyPoints => Reason::TinWithTooManyPoints,
            Self::NumericalFailure => Reason::TinNotTriangulated,
        }
    }
}

impl From<PolygonError> for TinError {
    fn from(error: PolygonError) -> Self {
        match error {
            PolygonError::TooManyVertices => Self::TooManyPoints,
            _ => Self::NumericalFailure,
        }
    }
}

/// Triangulates a TIN. Of points in the same place, triangles have the first.
pub fn triangulate_tin(source: &TinSource) -> Result<TinTriangles, TinError> {
    let stop_points: usize = source.stop_lines.iter().map(Vec::len).sum();
    if source.points.len() + stop_points > MAX_VERTICES {
        return Err(TinError::TooManyPoints);
    }
    // The library panics where rounding defeats it. That costs this TIN, not the document.
    catch_unwind(AssertUnwindSafe(|| triangulate_within(source))).unwrap_or(Err(TinError::NumericalFailure))
}

fn triangulate_within(source: &TinSource) -> Result<TinTriangles, TinError> {
    let plan: Vec<[f64; 2]> = source.points.iter().map(|p| [p[0], p[1]]).collect();
    let distinct = find_distinct_points(&plan);
    let mut budget = Budget::for_vertices(plan.len() + source.stop_lines.iter().map(Vec::len).sum::<usize>());
    let (mut cdt, mut handles) = (Cdt::new(), vec![FixedVertexHandle::from_index(0); plan.len()]);
    for k in choose_insertion_order(&plan).into_iter().filter(|k| distinct[*k as usize] == *k) {
        let vertex = Vertex { position: place(plan[k as usize]), index: k };
        handles[k as usize] = cdt.insert(vertex).map_err(|_| TinError::NumericalFailure)?;
    }
    match cdt.num_vertices() {
        0..3 => return Err(TinError::TooFewPoints),
        _ if cdt.num_inner_faces() == 0 => return Err(TinError::OnALine),
        _ => {}
    }

    let is_other = |(k, first): (usize, &u32)| source.points[k][2] != source.points[*first as usize][2];
    let other_heights = distinct.iter().enumerate().filter(|pair| is_other(*pair)).count() as u64;
    let mut tin = TinTriangles { other_heights, ..TinTriangles::default() };
    for [a, b] in &source.break_edges {
        let [from, to] = [a, b].map(|k| handles[distinct[*k as usize] as usize]);
        let is_added = from == to || add_ring_edge(&mut cdt, from, to, &mut budget)?;
        tin.crossing_breaks += u64::from(!is_added);
    }
    let stopped = find_stopped(&cdt, &source.stop_lines, &mut budget)?;
    for face in cdt.inner_faces() {
        let triangle = face.vertices().map(|v| v.data().index);
        if stopped[face.index()] {
            tin.stopped += 1;
        } else if has_longer_side(triangle.map(|k| source.points[k as usize]), source.max_length) {
            tin.too_long += 1;
        } else {
            tin.triangles.push(triangle);
        }
    }
    Ok(tin)
}

/// Returns true if a side of the triangle is longer in space than allowed.
fn has_longer_side(corners: [Vec3; 3], max_length: Option<f64>) -> bool {
    const ROUNDING: f64 = 1.0 + 1e-9;
    let length2 = |a: Vec3, b: Vec3| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
    max_length.is_some_and(|max| (0..3).any(|k| length2(corners[k], corners[(k + 1) % 3]) > (max * ROUNDING).powi(2)))
}

/// Returns for each face whether a stop line crosses or encloses it.
fn find_stopped(cdt: &Cdt, stop_lines: &[Vec<Vec3>], budget: &mut Budget) -> Result<Vec<bool>, TinError> {
    let lines: Vec<Vec<[f64; 2]>> = stop_lines.iter().map(|line| line.iter().map(|p| [p[0], p[1]]).collect()).collect();
    let mut stopped = vec![false; cdt.num_all_faces()];
    for line in lines.iter().filter(|line| line.len() > 3 && line.first() == line.last()) {
        let enclosed = locate_centroids(cdt, line, &[line.len()], budget)?;
        stopped.iter_mut().zip(enclosed).for_each(|(stopped, enclosed)| *stopped |= enclosed);
    }
    for [from, to] in lines.iter().flat_map(|line| line.windows(2).map(|pair| [pair[0], pair[1]])) {
        for face in find_faces_along(cdt, [from, to], budget)? {
            stopped[face.index()] |= crosses([from, to], cdt.face(face).positions().map(|p| [p.x, p.y]));
        }
    }
    Ok(stopped)
}

type Face = FixedFaceHandle<InnerTag>;

/// Returns the faces that a segment crosses or touches.
fn find_faces_along(cdt: &Cdt, [from, to]: [[f64; 2]; 2], budget: &mut Budget) -> Result<Vec<Face>, TinError> {
    let [from, to] = [from, to].map(place);
    let mut faces = Vec::new();
    for end in [from, to] {
        match cdt.locate(end) {
            PositionInTriangulation::OnFace(face) => faces.push(face),
            PositionInTriangulation::OnEdge(edge) => faces.extend(faces_at(cdt, edge)),
            PositionInTriangulation::OnVertex(vertex) => faces.extend(faces_around(cdt, vertex)),
            PositionInTriangulation::OutsideOfConvexHull(_) | PositionInTriangulation::NoTriangulation => {}
        }
    }
    for met in LineIntersectionIterator::new(cdt, from, to) {
        budget.spend(1)?;
        match met {
            Intersection::EdgeIntersection(edge) | Intersection::EdgeOverlap(edge) => faces.extend(faces_at(cdt, edge.fix())),
            Intersection::VertexIntersection(vertex) => faces.extend(faces_around(cdt, vertex.fix())),
        }
        budget.spend(faces.len() as u64 / 64)?;
    }
    faces.sort_unstable_by_key(|face| face.index());
    faces.dedup();
    Ok(faces)
}

/// Returns the faces on both sides of an edge.
fn faces_at(cdt: &Cdt, edge: FixedDirectedEdgeHandle) -> Vec<Face> {
    let edge = cdt.directed_edge(edge);
    [edge.face(), edge.rev().face()].iter().filter_map(|face| face.as_inner()).map(|face| face.fix()).collect()
}

fn faces_around(cdt: &Cdt, vertex: FixedVertexHandle) -> Vec<Face> {
    cdt.vertex(vertex).out_edges().filter_map(|edge| edge.face().as_inner()).map(|face| face.fix()).collect()
}

/// Returns true if the segment comes inside the triangle, which is counter-clockwise.
fn crosses([from, to]: [[f64; 2]; 2], corners: [[f64; 2]; 3]) -> bool {
    let (mut low, mut high) = (0.0f64, 1.0f64);
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let edge = [b[0] - a[0], b[1] - a[1]];
        let length = edge[0].hypot(edge[1]);
        let depth = |p: [f64; 2]| (edge[0] * (p[1] - a[1]) - edge[1] * (p[0] - a[0])) / length - TOUCH_M;
        // The part of the segment that is inside this edge.
        let (start, end) = (depth(from), depth(to));
        match (start > 0.0, end > 0.0) {
            (false, false) => return false,
            (true, true) => {}
            (false, true) => low = low.max(start / (start - end)),
            (true, false) => high = high.min(start / (start - end)),
        }
    }
    low < high
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns `n` points in a square of 100 m, on a grid of `cells` steps so that some are in one place or on one line.
    fn scatter(n: usize, cells: u64, seed: u64) -> Vec<Vec3> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) % (cells + 1)) as f64 * 100.0 / cells as f64
        };
        (0..n).map(|_| [next(), next(), next() * 0.1]).collect()
    }

    fn twice_area([a, b, c]: [Vec3; 3]) -> f64 {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    }

    /// Positive if `d` is inside the circle through the counter-clockwise triangle, by the determinant.
    fn in_circle([a, b, c]: [Vec3; 3], d: Vec3) -> f64 {
        let [a, b, c] = [a, b, c].map(|p| {
            let (x, y) = (p[0] - d[0], p[1] - d[1]);
            [x, y, x * x + y * y]
        });
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    }

    fn hull_area(points: &[Vec3]) -> f64 {
        let mut sorted: Vec<Vec3> = points.to_vec();
        sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let chain = |points: &mut dyn Iterator<Item = &Vec3>| {
            let mut chain: Vec<Vec3> = Vec::new();
            for p in points {
                while chain.len() > 1 && twice_area([chain[chain.len() - 2], chain[chain.len() - 1], *p]) <= 0.0 {
                    chain.pop();
                }
                chain.push(*p);
            }
            chain
        };
        let ring = [chain(&mut sorted.iter()), chain(&mut sorted.iter().rev())].concat();
        (0..ring.len()).map(|k| twice_area([[0.0; 3], ring[k], ring[(k + 1) % ring.len()]])).sum::<f64>() / 2.0
    }

    fn corners(source: &TinSource, tin: &TinTriangles) -> Vec<[Vec3; 3]> {
        tin.triangles.iter().map(|t| t.map(|k| source.points[k as usize])).collect()
    }

    #[test]
    fn no_point_is_inside_the_circumcircle_of_a_triangle_and_the_hull_is_covered() {
        for (n, cells, seed) in [(3, 1 << 20, 1), (10, 1 << 20, 2), (60, 7, 3), (300, 1 << 20, 4), (300, 12, 5), (150, 1000, 6)] {
            let source = TinSource { points: scatter(n, cells, seed), ..TinSource::default() };
            let tin = triangulate_tin(&source).expect("triangles");
            for triangle in corners(&source, &tin) {
                assert!(twice_area(triangle) > 0.0, "counter-clockwise");
                assert!(source.points.iter().all(|p| in_circle(triangle, *p) < 1e-6), "{n} points");
            }
            let area: f64 = corners(&source, &tin).into_iter().map(twice_area).sum::<f64>() / 2.0;
            assert!((area - hull_area(&source.points)).abs() < 1e-8 * area, "{n} points: {area}");
        }
    }

    #[test]
    fn break_lines_are_edges_and_other_edges_are_delaunay() {
        let mut source = TinSource { points: scatter(200, 1 << 20, 9), ..TinSource::default() };
        source.points.extend([[0.0, 50.0, 1.0], [100.0, 50.0, 2.0], [50.0, 100.0, 3.0], [50.0, 0.0, 4.0]]);
        source.break_edges = vec![[200, 201], [202, 203]];
        let tin = triangulate_tin(&source).expect("triangles");
        assert_eq!(tin.crossing_breaks, 1, "the second one crosses the first");
        let has_edge = |a: u32, b: u32| tin.triangles.iter().any(|t| t.contains(&a) && t.contains(&b));
        assert!(has_edge(200, 201) && !has_edge(202, 203));
        let side = |k: u32| source.points[k as usize][1] > 50.0;
        for (t, triangle) in tin.triangles.iter().zip(corners(&source, &tin)) {
            let visible = source.points.iter().enumerate().filter(|(k, _)| *k < 200 && side(*k as u32) == t.iter().any(|c| *c < 200 && side(*c)));
            assert!(visible.map(|(_, p)| p).all(|p| in_circle(triangle, *p) < 1e-6), "{t:?}");
        }
    }

    /// Returns true if a point of the segment is inside the triangle, by trying very many.
    fn crosses_by_samples(from: Vec3, to: Vec3, triangle: [Vec3; 3]) -> bool {
        (0..=4000).any(|k| {
            let p = std::array::from_fn(|axis| from[axis] + (to[axis] - from[axis]) * f64::from(k) / 4000.0);
            (0..3).all(|k| twice_area([triangle[k], triangle[(k + 1) % 3], p]) > 1e-3)
        })
    }

    #[test]
    fn triangles_that_a_stop_line_crosses_are_left_out() {
        let points = scatter(120, 1 << 20, 21);
        let through = vec![vec![[-5.0, 10.0, 0.0], [40.0, 60.0, 0.0], [105.0, 20.0, 0.0]], vec![points[3], points[17]]];
        let whole = TinSource { points, ..TinSource::default() };
        let source = TinSource { stop_lines: through.clone(), ..whole.clone() };
        let (all, tin) = (triangulate_tin(&whole).expect("triangles"), triangulate_tin(&source).expect("triangles"));
        assert!(tin.stopped > 10 && tin.stopped as usize + tin.triangles.len() == all.triangles.len());
        for (t, triangle) in all.triangles.iter().zip(corners(&whole, &all)) {
            let crossed = through.iter().flat_map(|line| line.windows(2)).any(|s| crosses_by_samples(s[0], s[1], triangle));
            assert!(!crossed || !tin.triangles.contains(t), "{t:?} is crossed");
            if !crossed && !tin.triangles.contains(t) {
                let shrunk = through
                    .iter()
                    .flat_map(|line| line.windows(2))
                    .any(|s| crosses([s[0], s[1]].map(|p| [p[0], p[1]]), triangle.map(|p| [p[0], p[1]])));
                assert!(shrunk, "{t:?} is not crossed");
            }
        }
    }

    /// A grid of `n` × `n` points, 1 m apart.
    fn grid(n: usize) -> TinSource {
        TinSource { points: (0..n * n).map(|k| [(k % n) as f64, (k / n) as f64, 0.0]).collect(), ..TinSource::default() }
    }

    fn area(source: &TinSource) -> f64 {
        corners(source, &triangulate_tin(source).expect("triangles")).into_iter().map(twice_area).sum::<f64>() / 2.0
    }

    #[test]
    fn a_closed_stop_line_along_edges_makes_a_hole_of_its_size() {
        let mut source = grid(11);
        assert_eq!(area(&source), 100.0);
        source.break_edges = vec![[36, 38], [38, 82], [82, 80], [80, 36]];
        source.stop_lines = vec![vec![[3.0, 3.0, 0.0], [5.0, 3.0, 0.0], [5.0, 7.0, 0.0], [3.0, 7.0, 0.0], [3.0, 3.0, 0.0]]];
        assert_eq!(area(&source), 92.0);
        source.stop_lines[0].iter_mut().for_each(|p| p[0] += 100.0);
        assert_eq!(area(&source), 100.0, "outside");
        source.stop_lines = vec![vec![[2.5, 2.5, 0.0]], vec![], vec![[2.0, 2.0, 0.0]; 2]];
        assert_eq!(area(&source), 100.0, "no line");
    }

    #[test]
    fn triangles_with_a_side_over_max_length_are_left_out() {
        let mut source = grid(5);
        source.points.push([50.0, 2.0, 0.0]);
        source.max_length = Some(2f64.sqrt());
        assert_eq!(area(&source), 16.0);
        source.points[12][2] = 3.0;
        let tin = triangulate_tin(&source).expect("triangles");
        assert!(tin.triangles.iter().all(|t| !t.contains(&12)) && (8.0..15.0).contains(&area(&source)), "length is measured in space");
        source.max_length = Some(0.5);
        assert_eq!(area(&source), 0.0);
    }

    #[test]
    fn degenerate_points_have_no_triangles_and_a_reason() {
        let points = |points: &[[f64; 2]]| TinSource { points: points.iter().map(|[x, y]| [*x, *y, 0.0]).collect(), ..TinSource::default() };
        for (case, source, expected) in [
            ("no point", points(&[]), TinError::TooFewPoints),
            ("one point", points(&[[1.0, 1.0]]), TinError::TooFewPoints),
            ("two points", points(&[[1.0, 1.0], [2.0, 1.0]]), TinError::TooFewPoints),
            ("one place", points(&[[1.0, 1.0]; 9]), TinError::TooFewPoints),
            ("two places", points(&[[1.0, 1.0], [2.0, 1.0], [1.0, 1.0]]), TinError::TooFewPoints),
            ("a line", points(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]), TinError::OnALine),
            ("infinite", points(&[[0.0, 0.0], [f64::INFINITY, 1.0], [2.0, 2.0]]), TinError::NumericalFailure),
            ("huge", points(&[[0.0, 0.0], [1e300, 1.0], [2.0, 2.0]]), TinError::NumericalFailure),
            ("too many", TinSource { points: vec![[0.0; 3]; MAX_VERTICES + 1], ..TinSource::default() }, TinError::TooManyPoints),
        ] {
            assert_eq!(triangulate_tin(&source), Err(expected), "{case}");
        }
        let mut source = points(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 0.0]]);
        source.points[3][2] = 7.0;
        let tin = triangulate_tin(&source).expect("a triangle");
        assert_eq!((tin.triangles.len(), tin.other_heights), (1, 1));
    }

    #[test]
    fn the_order_of_points_on_a_grid_does_not_make_it_slow() {
        for n in [30, 300] {
            assert_eq!(area(&grid(n)), ((n - 1) * (n - 1)) as f64);
        }
    }
}
