//! Triangulates polygons with very many vertices by constrained Delaunay triangulation, in about n log n steps where ear clipping takes n².
//!
//! Every vertex of the polygon is a vertex of the triangulation and every edge of a ring is one of its edges, so there are no T-junctions. A triangle
//! belongs to the polygon by the even-odd rule: a way to it from outside crosses the rings an odd number of times.

use std::panic::{AssertUnwindSafe, catch_unwind};

use spade::handles::FixedVertexHandle;
use spade::{
    ConstrainedDelaunayTriangulation, HasPosition, HierarchyHintGenerator, Intersection, LineIntersectionIterator, Point2, Triangulation,
    mitigate_underflow,
};
use twox_hash::XxHash3_64;

use super::polygon_error::PolygonError;

/// A polygon with more vertices has no triangles; its triangulation would take more memory than a parser has.
pub const MAX_VERTICES: usize = 1_000_000;

/// Steps for each vertex beyond which a polygon has no triangles. A step takes some nanoseconds.
const STEPS_PER_VERTEX: u64 = 1_000;
const STEPS_PER_CROSSED_EDGE: u64 = 8;
/// Edges that cross a new edge of a ring are flipped, each up to as often as there are others.
const FLIPS_PER_STEP: u64 = 8;

pub struct Vertex {
    pub position: Point2<f64>,
    /// Index among the points of the polygon.
    pub index: u32,
}

impl HasPosition for Vertex {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.position
    }
}

/// How many edges of rings lie on an edge: even or odd.
#[derive(Clone, Copy, Default)]
pub struct Parity(bool);

pub type Cdt = ConstrainedDelaunayTriangulation<Vertex, (), Parity, (), HierarchyHintGenerator<f64>>;

/// Steps that a polygon may still take.
pub struct Budget {
    left: u64,
}

impl Budget {
    pub fn for_vertices(count: usize) -> Self {
        Self { left: count as u64 * STEPS_PER_VERTEX }
    }

    pub fn spend(&mut self, steps: u64) -> Result<(), PolygonError> {
        self.left = self.left.checked_sub(steps).ok_or(PolygonError::TooManyVertices)?;
        Ok(())
    }
}

/// Appends the triangles of a polygon, counter-clockwise. `points`: in the plane; ring `k` ends before `ends[k]` and is open.
///
/// Triangles use the first of several points in the same place. Where rings cross, triangles that an edge divides belong to the polygon as a whole or not.
/// Returns an error if the polygon takes too many steps: its edges cross each other nearly everywhere.
pub fn triangulate(points: &[[f64; 2]], ends: &[usize], triangles: &mut Vec<u32>) -> Result<(), PolygonError> {
    if points.len() > MAX_VERTICES {
        return Err(PolygonError::TooManyVertices);
    }
    let mut budget = Budget::for_vertices(points.len());
    // The library panics where rounding defeats it. That costs this polygon, not the document.
    let run = AssertUnwindSafe(|| triangulate_within(points, ends, &mut budget));
    triangles.extend(catch_unwind(run).unwrap_or(Err(PolygonError::NumericalFailure))?.as_flattened());
    Ok(())
}

fn triangulate_within(points: &[[f64; 2]], ends: &[usize], budget: &mut Budget) -> Result<Vec<[u32; 3]>, PolygonError> {
    let distinct = find_distinct_points(points);
    let (mut cdt, mut handles) = (Cdt::new(), vec![FixedVertexHandle::from_index(0); points.len()]);
    for k in choose_insertion_order(points).into_iter().filter(|k| distinct[*k as usize] == *k) {
        let vertex = Vertex { position: place(points[k as usize]), index: k };
        handles[k as usize] = cdt.insert(vertex).map_err(|_| PolygonError::NumericalFailure)?;
    }

    let mut is_exact = true;
    for [a, b] in ring_edges(ends) {
        let (from, to) = (handles[distinct[a] as usize], handles[distinct[b] as usize]);
        is_exact &= from == to || add_ring_edge(&mut cdt, from, to, budget)?;
    }
    let inside = if is_exact { fill_from_outside(&cdt) } else { locate_centroids(&cdt, points, ends, budget)? };
    let faces = cdt.inner_faces().filter(|face| inside[face.index()]);
    Ok(faces.map(|face| face.vertices().map(|v| v.data().index)).collect())
}

pub fn place([x, y]: [f64; 2]) -> Point2<f64> {
    mitigate_underflow(Point2::new(x, y))
}

/// Returns for each point the first point in the same place.
pub fn find_distinct_points(points: &[[f64; 2]]) -> Vec<u32> {
    let placed = |k: u32| place(points[k as usize]);
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    // Adding zero makes zeros of both signs equal.
    order.sort_unstable_by(|a, b| {
        let (p, q) = (placed(*a), placed(*b));
        (p.x + 0.0).total_cmp(&(q.x + 0.0)).then((p.y + 0.0).total_cmp(&(q.y + 0.0))).then(a.cmp(b))
    });
    let mut first = vec![0; points.len()];
    for (k, point) in order.iter().enumerate() {
        let before = k.checked_sub(1).map(|before| order[before]).filter(|before| placed(*before) == placed(*point));
        first[*point as usize] = before.map_or(*point, |before| first[before as usize]);
    }
    first
}

/// Returns the corners of a large triangle first: as long as all points are on one line, each new one takes as many steps as there are. Then the points
/// in rounds, each about twice as large as the one before, chosen by a hash; in a round, along a Z-order curve. In such an order
/// an incremental Delaunay triangulation takes n log n steps whatever the points (Amenta, Choi, Rote: Incremental constructions con BRIO, 2003).
pub fn choose_insertion_order(points: &[[f64; 2]]) -> Vec<u32> {
    let low = points.iter().fold([f64::MAX; 2], |low, p| [low[0].min(p[0]), low[1].min(p[1])]);
    let high = points.iter().fold([f64::MIN; 2], |high, p| [high[0].max(p[0]), high[1].max(p[1])]);
    let cell = |k: u32, axis: usize| {
        let share = (points[k as usize][axis] - low[axis]) / (high[axis] - low[axis]);
        spread_bits((share * f64::from(u16::MAX)) as u16)
    };
    let round = |k: u32| 64 - XxHash3_64::oneshot(&k.to_le_bytes()).trailing_zeros();
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    let corners = find_wide_triangle(points);
    order.sort_by_cached_key(|k| (!corners.contains(k), round(*k), cell(*k, 0) | cell(*k, 1) << 1));
    order
}

/// Returns the first point, the one farthest from it, and the one farthest from the line through both.
fn find_wide_triangle(points: &[[f64; 2]]) -> [u32; 3] {
    let Some(first) = points.first() else { return [0; 3] };
    let offset = |p: &[f64; 2]| [p[0] - first[0], p[1] - first[1]];
    let find_greatest = |size: &dyn Fn(&[f64; 2]) -> f64| {
        let greatest = points.iter().enumerate().max_by(|a, b| size(a.1).total_cmp(&size(b.1)));
        greatest.map_or(0, |(number, _)| number)
    };
    let second = find_greatest(&|p| offset(p)[0].hypot(offset(p)[1]));
    let along = offset(&points[second]);
    let third = find_greatest(&|p| (along[0] * offset(p)[1] - along[1] * offset(p)[0]).abs());
    [0, second as u32, third as u32]
}

/// Moves bit k to bit 2k.
fn spread_bits(value: u16) -> u32 {
    let mut bits = u32::from(value);
    for (shift, mask) in [(8, 0x00ff_00ff), (4, 0x0f0f_0f0f), (2, 0x3333_3333), (1, 0x5555_5555)] {
        bits = (bits | bits << shift) & mask;
    }
    bits
}

/// Iterates over the edges of all rings.
fn ring_edges(ends: &[usize]) -> impl Iterator<Item = [usize; 2]> + '_ {
    let starts = std::iter::once(0).chain(ends.iter().copied());
    starts.zip(ends).flat_map(|(start, end)| (start..*end).map(move |k| [k, if k + 1 == *end { start } else { k + 1 }]))
}

/// Makes an edge of a ring an edge of the triangulation. Returns false if it crosses an edge of a ring, and leaves it out.
pub fn add_ring_edge(cdt: &mut Cdt, from: FixedVertexHandle, to: FixedVertexHandle, budget: &mut Budget) -> Result<bool, PolygonError> {
    let mut count = 0u64;
    for crossed in LineIntersectionIterator::new_from_handles(cdt, from, to) {
        budget.spend(STEPS_PER_CROSSED_EDGE)?;
        count += 1;
        if matches!(crossed, Intersection::EdgeIntersection(edge) if edge.is_constraint_edge()) {
            return Ok(false);
        }
    }
    budget.spend(count * count / FLIPS_PER_STEP)?;
    for edge in cdt.try_add_constraint(from, to) {
        cdt.undirected_edge_data_mut(edge.as_undirected()).data_mut().0 ^= true;
    }
    Ok(true)
}

/// Returns for each face whether it is inside: crossing an edge with an odd number of ring edges leads in or out.
fn fill_from_outside(cdt: &Cdt) -> Vec<bool> {
    let mut inside = vec![false; cdt.num_all_faces()];
    let mut is_known = inside.clone();
    is_known[cdt.outer_face().index()] = true;
    let mut open: Vec<_> = cdt.convex_hull().map(|edge| edge.rev()).collect();
    open.extend(cdt.convex_hull());
    while let Some(edge) = open.pop() {
        let (face, other) = (edge.face(), edge.rev().face());
        if is_known[other.index()] || !is_known[face.index()] {
            continue;
        }
        is_known[other.index()] = true;
        inside[other.index()] = inside[face.index()] ^ edge.as_undirected().data().data().0;
        open.extend(other.as_inner().iter().flat_map(|face| face.adjacent_edges()));
    }
    inside
}

/// Returns for each face whether its centroid is inside: a line from there to the right crosses an odd number of ring edges.
pub fn locate_centroids(cdt: &Cdt, points: &[[f64; 2]], ends: &[usize], budget: &mut Budget) -> Result<Vec<bool>, PolygonError> {
    let mut centroids: Vec<(Point2<f64>, usize)> = cdt.inner_faces().map(|face| (face.center(), face.index())).collect();
    centroids.sort_unstable_by(|a, b| a.0.y.total_cmp(&b.0.y).then(a.1.cmp(&b.1)));
    let mut inside = vec![false; cdt.num_all_faces()];
    for [a, b] in ring_edges(ends) {
        let [mut low, mut high] = [points[a], points[b]];
        if low[1] > high[1] {
            (low, high) = (high, low);
        }
        let beside = &centroids[centroids.partition_point(|c| c.0.y < low[1])..centroids.partition_point(|c| c.0.y < high[1])];
        budget.spend(beside.len() as u64)?;
        for (centroid, face) in beside {
            let x = low[0] + (high[0] - low[0]) * (centroid.y - low[1]) / (high[1] - low[1]);
            inside[*face] ^= x > centroid.x;
        }
    }
    Ok(inside)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the steps for each vertex of a band of `n` vertices, wound up.
    fn count_steps_of_spiral(n: usize) -> f64 {
        let point = |k: usize, offset: f64| {
            let angle = k as f64 * 0.016;
            let radius = 10.0 + angle + offset;
            [radius * angle.cos(), radius * angle.sin()]
        };
        let points: Vec<[f64; 2]> = (0..n / 2).map(|k| point(k, 1.5)).chain((0..n / 2).rev().map(|k| point(k, -1.5))).collect();
        let mut budget = Budget { left: u64::MAX };
        assert_eq!(triangulate_within(&points, &[n], &mut budget).expect("valid").len(), n - 2);
        (u64::MAX - budget.left) as f64 / n as f64
    }

    #[test]
    fn steps_grow_with_the_number_of_vertices_not_with_its_square() {
        let steps = [2_000, 20_000, 200_000].map(count_steps_of_spiral);
        assert!(steps.iter().all(|s| *s < 50.0), "{steps:?}");
    }
}
