//! Ear clipping leaves out points that lie on a straight line with their neighbours. Whoever has a corner there, another polygon or a
//! triangle of the same one, would show a crack, so they are put back.

/// Polygons of more points × triangles than this are left as they are.
const MAX_PAIRS: usize = 20_000_000;

/// Where points were left out, splits triangles so that no point lies inside of an edge. `flat`: all points of the polygon.
pub fn mend(flat: &[[f64; 2]], triangles: &mut Vec<u32>) {
    let mut used = vec![false; flat.len()];
    triangles.iter().for_each(|v| used[*v as usize] = true);
    if used.iter().all(|u| *u) || flat.len().saturating_mul(triangles.len()) > MAX_PAIRS {
        return;
    }
    let size = flat.as_flattened().iter().fold(0.0f64, |size, c| size.max(c.abs()));
    for v in 0..flat.len() {
        split_at(flat, triangles, v as u32, 8.0 * f64::EPSILON * size);
    }
}

/// Splits the triangles that have a point inside of an edge: one on either side at most.
fn split_at(flat: &[[f64; 2]], triangles: &mut Vec<u32>, v: u32, tolerance: f64) {
    let mut split = 0;
    let mut at = 0;
    while at < triangles.len() && split < 2 {
        let t = [triangles[at], triangles[at + 1], triangles[at + 2]];
        let is_corner = t.iter().any(|corner| flat[*corner as usize] == flat[v as usize]);
        let contains = |k: &usize| is_inside(flat[v as usize], flat[t[*k] as usize], flat[t[(*k + 1) % 3] as usize], tolerance);
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

/// Whether a point lies between the ends of an edge, as nearly as numbers can tell.
fn is_inside(p: [f64; 2], a: [f64; 2], b: [f64; 2], tolerance: f64) -> bool {
    let (edge, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length2 = edge[0] * edge[0] + edge[1] * edge[1];
    let along = edge[0] * to[0] + edge[1] * to[1];
    let across = edge[0] * to[1] - edge[1] * to[0];
    along > 0.0 && along < length2 && across.abs() <= tolerance * length2.sqrt()
}
