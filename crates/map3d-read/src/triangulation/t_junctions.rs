//! Repairs T-junctions. Ear clipping drops vertices that are collinear with their neighbours. An adjacent polygon or triangle that has a corner
//! at such a vertex would show a crack, so the vertices are inserted again.

/// Re-inserts dropped vertices: splits triangles so that no vertex is inside an edge. `points`: all vertices of the polygon, which has few, because the
/// time grows with the square of their number.
pub fn repair_t_junctions(points: &[[f64; 2]], triangles: &mut Vec<u32>) {
    let mut used = vec![false; points.len()];
    triangles.iter().for_each(|v| used[*v as usize] = true);
    if used.iter().all(|u| *u) {
        return;
    }
    let size = points.as_flattened().iter().fold(0.0f64, |size, c| size.max(c.abs()));
    for v in 0..points.len() {
        insert_vertex(points, triangles, v as u32, 8.0 * f64::EPSILON * size);
    }
}

/// Splits the triangles that have the vertex inside an edge: at most one on each side of the edge.
fn insert_vertex(points: &[[f64; 2]], triangles: &mut Vec<u32>, v: u32, tolerance: f64) {
    let mut split = 0;
    let mut at = 0;
    while at < triangles.len() && split < 2 {
        let t = [triangles[at], triangles[at + 1], triangles[at + 2]];
        let is_corner = t.iter().any(|corner| points[*corner as usize] == points[v as usize]);
        let contains = |k: &usize| is_inside_edge(points[v as usize], points[t[*k] as usize], points[t[(*k + 1) % 3] as usize], tolerance);
        let edge = (0..3).find(contains).filter(|_| !is_corner);
        if let Some(k) = edge {
            let (a, b, apex) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
            triangles[at..at + 3].copy_from_slice(&[a, v, apex]);
            triangles.extend([v, b, apex]);
            split += 1;
        }
        at += 3;
    }
}

/// Returns true if `p` is within `tolerance` of the edge from `a` to `b`, and strictly between its ends.
fn is_inside_edge(p: [f64; 2], a: [f64; 2], b: [f64; 2], tolerance: f64) -> bool {
    let (edge, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length2 = edge[0] * edge[0] + edge[1] * edge[1];
    let along = edge[0] * to[0] + edge[1] * to[1];
    let across = edge[0] * to[1] - edge[1] * to[0];
    along > 0.0 && along < length2 && across.abs() <= tolerance * length2.sqrt()
}
