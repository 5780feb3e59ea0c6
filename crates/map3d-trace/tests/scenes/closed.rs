//! Closed meshes, which no ray or beam passes through.

use map3d_base::Vec3;
use map3d_base::asset::{Instance, Rank};

use super::{Lcg, Soup, SoupFace};

/// Returns a closed sphere whose corners are jittered along the radius.
pub fn sphere_mesh(radius: f64, rings: usize, random: &mut Lcg, at: Vec3) -> Vec<[Vec3; 3]> {
    let columns = 2 * rings;
    let mut points = vec![vec![[0.0; 3]; columns]; rings + 1];
    for (i, row) in points.iter_mut().enumerate() {
        let pole = radius * random.between(0.9, 1.1);
        for (j, p) in row.iter_mut().enumerate() {
            let (t, a) = (std::f64::consts::PI * i as f64 / rings as f64, std::f64::consts::TAU * j as f64 / columns as f64);
            let r = if i == 0 || i == rings { pole } else { radius * random.between(0.9, 1.1) };
            let ring = if i == 0 || i == rings { 0.0 } else { t.sin() };
            *p = [at[0] + r * ring * a.cos(), at[1] + r * ring * a.sin(), at[2] + r * t.cos()];
        }
    }
    let mut out = Vec::new();
    for i in 0..rings {
        for j in 0..columns {
            let k = (j + 1) % columns;
            // At a pole one of the two triangles is a point.
            if i + 1 < rings {
                out.push([points[i][j], points[i + 1][j], points[i + 1][k]]);
            }
            if i > 0 {
                out.push([points[i][j], points[i + 1][k], points[i][k]]);
            }
        }
    }
    out
}

/// Returns a closed axis-aligned box with `count` × `count` squares per side. In views along the axes its edges are on samples.
pub fn box_mesh(half: f64, count: usize) -> Vec<[Vec3; 3]> {
    let step = 2.0 * half / count as f64;
    let mut out = Vec::new();
    for (side, k) in (0..6).flat_map(|side| (0..count * count).map(move |k| (side, k))) {
        let point = |i: usize, j: usize| {
            let q = [if side % 2 == 0 { half } else { -half }, i as f64 * step - half, j as f64 * step - half];
            [0, 1, 2].map(|axis| q[(axis + side / 2) % 3])
        };
        let (i, j) = (k % count, k / count);
        let c = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
        out.extend([[c[0], c[1], c[2]], [c[0], c[2], c[3]]]);
    }
    out
}

/// `far`: adds distant triangles, which enlarge the square so that the mesh is cut into several cells.
pub fn soup_from(triangles: &[[Vec3; 3]], far: bool) -> Soup {
    let mut soup = Soup::default();
    triangles.iter().for_each(|t| soup.add(*t, 0, Rank::Other));
    if far {
        soup.add([[30_000.0, 30_000.0, 0.0], [30_001.0, 30_000.0, 0.0], [30_000.0, 30_001.0, 0.0]], 1, Rank::Other);
        soup.add([[-30_000.0, -30_000.0, 0.0], [-30_001.0, -30_000.0, 0.0], [-30_000.0, -30_001.0, 0.0]], 1, Rank::Other);
    }
    soup
}

/// Returns the mesh as three instances with a common placement that rotates, mirrors and stretches them.
pub fn as_prototypes(triangles: &[[Vec3; 3]]) -> Soup {
    let mut soup = Soup::default();
    for (k, third) in triangles.chunks(triangles.len().div_ceil(3)).enumerate() {
        soup.prototypes.push(third.iter().map(|t| SoupFace::new(*t)).collect());
        let transform = [0.96, -0.3, 0.1, 0.2, 0.28, 1.1, 0.0, -0.1, 0.0, 0.2, -1.2, 0.3];
        soup.instances.push(Instance { prototype: k as u32 + 1, object: k as u32, transform });
    }
    soup
}
