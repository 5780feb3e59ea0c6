//! Drapes objects over the ground: each of their triangles is cut along those of the surfaces below it, and the pieces lie in them.

use std::path::Path;

use map3d_base::asset::{AssetMesh, AssetReport, AssetWriter, Batch, DRAPED_FILE, Materials, Rank};
use map3d_base::{Error, Result, Vec3};

use super::plan_index::{PlanIndex, Rectangle};
use super::surfaces::{PlanTriangle, Surface, surface_heights};

/// Where the draped mesh of an asset is written before it is complete.
pub const DRAPED_FOLDER: &str = ".draped";
/// Pieces in memory at once.
const PIECES: usize = 2 << 20;
/// Pieces of an asset; with more, triangles stay whole, with their corners on the ground.
const MAX_PIECES: f64 = 5e7;
/// A triangle is covered by the pieces of surfaces whose areas differ from its own by at most this share.
const UNCOVERED: f64 = 1e-3;

/// What to drape over which ground.
pub struct Draping<'a> {
    /// For each object of the asset, its height that lies on the ground; NaN for objects that are not draped.
    pub bases: &'a [f64],
    /// Heights are multiplied by this first.
    pub scale: f64,
    pub surfaces: &'a [Surface],
    /// Ground where the surfaces have none.
    pub fallback: Option<&'a Surface>,
}

/// Writes the mesh that stands for draped objects beside that of their asset; returns the number of its triangles.
pub fn drape(folder: &Path, draping: &Draping) -> Result<u64> {
    let mesh = AssetMesh::open(&folder.join("mesh.m3a"))?;
    let place = folder.join(DRAPED_FOLDER);
    let mut writer = AssetWriter::create(&place)?;
    let numbers = draped_triangles(&mesh, draping.bases);
    let total = numbers.len();
    let grounds = Grounds::new(&mesh, draping, &numbers)?;
    let per_batch = (PIECES as f64 / grounds.pieces_per_triangle).clamp(1.0, PIECES as f64) as usize;
    let is_cut = grounds.pieces_per_triangle * total as f64 <= MAX_PIECES;
    for (k, part) in numbers.chunks(per_batch).enumerate() {
        let covered = if is_cut { cut(&mesh, draping, part)? } else { part.iter().map(|_| Vec::new()).collect() };
        let mut batch = Batch { uvs_shifted: true, ..Batch::default() };
        for (i, (t, pieces)) in part.iter().zip(covered).enumerate() {
            match pieces.is_empty() {
                true => append(&mesh, *t, &[grounds.corners(&mesh, draping, *t, k * per_batch + i)], &mut batch),
                false => append(&mesh, *t, &pieces, &mut batch),
            }
        }
        writer.append(&batch)?;
    }
    let report = writer.finish(&Materials::default(), &[], AssetReport::default())?;
    let target = folder.join(DRAPED_FILE);
    std::fs::rename(place.join("mesh.m3a"), &target).map_err(|e| Error::storage(&target, e))?;
    std::fs::remove_dir_all(&place).map_err(|e| Error::storage(&place, e))?;
    Ok(report.triangles)
}

/// A corner of a piece: its position, and the weights of the corners of the triangle that it is a piece of. Pieces are turned as that.
#[derive(Clone, Copy)]
struct PieceCorner {
    at: Vec3,
    weights: [f64; 3],
}

type Piece = [PieceCorner; 3];

fn draped_triangles(mesh: &AssetMesh, bases: &[f64]) -> Vec<usize> {
    let is_draped = |t: &usize| mesh.prototypes()[*t] == 0 && bases.get(mesh.objects()[*t] as usize).is_some_and(|b| !b.is_nan());
    (0..mesh.triangles().len()).filter(is_draped).collect()
}

fn corners_of(mesh: &AssetMesh, t: usize) -> [Vec3; 3] {
    mesh.triangles()[t].map(|v| mesh.positions()[v as usize])
}

/// The ground below the corners of draped triangles.
struct Grounds {
    /// At the three corners of each triangle; NaN without ground.
    heights: Vec<f64>,
    pieces_per_triangle: f64,
}

impl Grounds {
    fn new(mesh: &AssetMesh, draping: &Draping, numbers: &[usize]) -> Result<Self> {
        let points: Vec<[f64; 2]> = numbers.iter().flat_map(|t| corners_of(mesh, *t)).map(|p| [p[0], p[1]]).collect();
        let mut heights = surface_heights(draping.surfaces, &points)?;
        if let Some(fallback) = draping.fallback {
            let others = surface_heights(std::slice::from_ref(fallback), &points)?;
            heights.iter_mut().zip(others).filter(|(h, _)| h.is_nan()).for_each(|(h, other)| *h = other);
        }
        let (mut area, mut count) = (0.0, 0_u64);
        for surface in draping.surfaces {
            surface.visit(&mut |corners| {
                area += PlanTriangle::new(corners).map_or(0.0, |t| t.area_m2());
                count += 1;
            })?;
        }
        let own: f64 = numbers.iter().filter_map(|t| PlanTriangle::new(corners_of(mesh, *t))).map(|t| t.area_m2()).sum();
        // A cut triangle has as many pieces as triangles of the ground fit into it, and some more at its edges.
        let inside = if area > 0.0 { own * count as f64 / area / numbers.len().max(1) as f64 } else { 0.0 };
        Ok(Self { heights, pieces_per_triangle: 4.0 + 3.0 * inside })
    }

    /// Returns the k-th triangle as a whole, with its corners on the ground; without ground, those corners stay as high as the others.
    fn corners(&self, mesh: &AssetMesh, draping: &Draping, t: usize, k: usize) -> Piece {
        let grounds = &self.heights[3 * k..3 * k + 3];
        let known: Vec<f64> = grounds.iter().copied().filter(|h| !h.is_nan()).collect();
        let base = draping.bases[mesh.objects()[t] as usize];
        let other = if known.is_empty() { base * draping.scale } else { known.iter().sum::<f64>() / known.len() as f64 };
        let corners = corners_of(mesh, t);
        [0, 1, 2].map(|i| {
            let ground = if grounds[i].is_nan() { other } else { grounds[i] };
            let weights = [0, 1, 2].map(|w| f64::from(u8::from(w == i)));
            PieceCorner { at: [corners[i][0], corners[i][1], ground + (corners[i][2] - base) * draping.scale], weights }
        })
    }
}

/// Returns the pieces of triangles; none for those that the surfaces do not cover as a whole.
fn cut(mesh: &AssetMesh, draping: &Draping, numbers: &[usize]) -> Result<Vec<Vec<Piece>>> {
    let triangles: Vec<Option<PlanTriangle>> = numbers.iter().map(|t| PlanTriangle::new(corners_of(mesh, *t))).collect();
    let outside: Rectangle = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    let first = triangles.iter().flatten().next().map(PlanTriangle::rectangle);
    let index = PlanIndex::new(&triangles.iter().map(|t| t.as_ref().map_or(first.unwrap_or(outside), PlanTriangle::rectangle)).collect::<Vec<_>>());
    let mut out: Vec<Vec<Piece>> = triangles.iter().map(|_| Vec::new()).collect();
    let mut kept = vec![false; triangles.len()];
    let fallback = draping.fallback.into_iter().map(std::slice::from_ref);
    // Surfaces of terrain complete each other; where they overlap, one that covers the whole triangle counts.
    let singles = draping.surfaces.iter().map(std::slice::from_ref).filter(|_| draping.surfaces.len() > 1);
    for group in std::iter::once(draping.surfaces).chain(singles).chain(fallback) {
        let mut areas = vec![0.0; triangles.len()];
        let mut seen = vec![0_u64; triangles.len()];
        let mut stamp = 0;
        out.iter_mut().zip(&kept).filter(|(_, kept)| !**kept).for_each(|(pieces, _)| pieces.clear());
        for surface in group {
            surface.visit(&mut |corners| {
                let Some(ground) = PlanTriangle::new(corners) else { return };
                stamp += 1;
                index.visit(&ground.rectangle(), &mut |n| {
                    if kept[n] || seen[n] == stamp {
                        return;
                    }
                    seen[n] = stamp;
                    if let Some(own) = &triangles[n] {
                        let base = draping.bases[mesh.objects()[numbers[n]] as usize];
                        areas[n] += clip(own, &ground, base, draping.scale, &mut out[n]);
                    }
                });
            })?;
        }
        for (n, own) in triangles.iter().enumerate() {
            kept[n] |= own.as_ref().is_some_and(|t| (areas[n] / t.area_m2() - 1.0).abs() <= UNCOVERED);
        }
        if kept.iter().zip(&triangles).all(|(kept, t)| *kept || t.is_none()) {
            break;
        }
    }
    out.iter_mut().zip(kept).filter(|(_, kept)| !kept).for_each(|(pieces, _)| pieces.clear());
    Ok(out)
}

/// Adds the pieces of a triangle that lie over a triangle of the ground; returns their area.
fn clip(own: &PlanTriangle, ground: &PlanTriangle, base: f64, scale: f64, pieces: &mut Vec<Piece>) -> f64 {
    let origin = own.corners[0];
    let mut polygon: Vec<[f64; 2]> = ground.corners.iter().map(|p| [p[0] - origin[0], p[1] - origin[1]]).collect();
    for k in 0..3 {
        let [from, to] = [own.corners[k], own.corners[(k + 1) % 3]].map(|p| [p[0] - origin[0], p[1] - origin[1]]);
        polygon = clip_to_edge(&polygon, from, to);
        if polygon.len() < 3 {
            return 0.0;
        }
    }
    let corner = |p: &[f64; 2]| {
        let at = [p[0] + origin[0], p[1] + origin[1]];
        let weights = own.weights(at);
        let above = (own.height_of(weights) - base) * scale;
        let weights = if own.is_turned { [weights[0], weights[2], weights[1]] } else { weights };
        PieceCorner { at: [at[0], at[1], ground.height_of(ground.weights(at)) + above], weights }
    };
    let mut area = 0.0;
    for k in 1..polygon.len() - 1 {
        let [a, b, c] = [polygon[0], polygon[k], polygon[k + 1]];
        area += ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0;
        let (second, third) = if own.is_turned { (c, b) } else { (b, c) };
        pieces.push([corner(&a), corner(&second), corner(&third)]);
    }
    area
}

/// Returns the part of a convex polygon to the left of an edge (Sutherland and Hodgman 1974).
fn clip_to_edge(polygon: &[[f64; 2]], from: [f64; 2], to: [f64; 2]) -> Vec<[f64; 2]> {
    let side = |p: &[f64; 2]| (to[0] - from[0]) * (p[1] - from[1]) - (to[1] - from[1]) * (p[0] - from[0]);
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (k, p) in polygon.iter().enumerate() {
        let q = &polygon[(k + 1) % polygon.len()];
        let (at_p, at_q) = (side(p), side(q));
        if at_p >= 0.0 {
            out.push(*p);
        }
        if (at_p > 0.0 && at_q < 0.0) || (at_p < 0.0 && at_q > 0.0) {
            let part = at_p / (at_p - at_q);
            out.push([0, 1].map(|i| p[i] + (q[i] - p[i]) * part));
        }
    }
    out
}

/// Appends the pieces of a triangle.
fn append(mesh: &AssetMesh, t: usize, pieces: &[Piece], batch: &mut Batch) {
    let uvs = mesh.uvs()[t];
    for piece in pieces {
        let start = batch.positions.len() as u32;
        batch.positions.extend(piece.iter().map(|c| c.at));
        batch.triangles.push([start, start + 1, start + 2]);
        batch.uvs.push(piece.map(|c| [0, 1].map(|i| (0..3).map(|k| c.weights[k] * f64::from(uvs[k][i])).sum::<f64>() as f32)));
        batch.materials.push(mesh.materials()[t]);
        batch.objects.push(mesh.objects()[t]);
        batch.ranks.push(Rank::from_number(mesh.ranks()[t]).unwrap_or(Rank::Other));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(x0: f64, x1: f64) -> Surface {
        let at = |i: u32, j: u32| {
            let x = x0 + (x1 - x0) * f64::from(i) / 8.0;
            [x, 20.0 * f64::from(j) - 20.0, 500.0 + 0.25 * x]
        };
        let positions = (0..9).flat_map(|j| (0..9).map(move |i| at(i, j))).collect();
        let triangles = (0..8_u32).flat_map(|j| (0..8).map(move |i| 9 * j + i)).flat_map(|k| [[k, k + 1, k + 10], [k, k + 10, k + 9]]).collect();
        Surface::Mesh { positions, triangles }
    }

    /// Drapes two triangles, one turned down and one up, that are a square of 100 m at height 0; returns their mesh.
    fn draped(name: &str, surfaces: &[Surface], fallback: Option<&Surface>) -> (u64, AssetMesh, std::path::PathBuf) {
        let folder = std::env::temp_dir().join(format!("map3d-drape-{name}-{}", std::process::id()));
        let mut writer = AssetWriter::create(&folder).expect("a writer");
        let batch = Batch {
            positions: vec![[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [100.0, 100.0, 0.0], [0.0, 100.0, 0.0], [500.0, 500.0, 7.0]],
            triangles: vec![[0, 2, 1], [0, 2, 3], [0, 1, 4]],
            uvs: vec![[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0]], [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]], [[0.0; 2]; 3]],
            materials: vec![0; 3],
            objects: vec![0, 0, 1],
            ranks: vec![Rank::Road; 3],
            ..Batch::default()
        };
        writer.append(&batch).expect("append");
        let objects = vec![map3d_base::asset::Object::default(); 2];
        let materials = Materials { materials: vec![map3d_base::asset::Material::default()], instances: Vec::new() };
        writer.finish(&materials, &objects, AssetReport::default()).expect("finish");
        let count = drape(&folder, &Draping { bases: &[0.0, f64::NAN], scale: 1.0, surfaces, fallback }).expect("draped");
        let mesh = AssetMesh::open(&folder.join("mesh.m3a")).expect("a mesh");
        (count, mesh, folder)
    }

    fn check(mesh: &AssetMesh, height: impl Fn(Vec3) -> f64) {
        let draped = mesh.drawn().nth(1).expect("a draped mesh");
        let (mut area, mut up) = (0.0, 0.0);
        for (t, corners) in draped.triangles().iter().enumerate() {
            let corners = corners.map(|v| draped.positions()[v as usize]);
            for (p, uv) in corners.iter().zip(draped.uvs()[t]) {
                assert!((p[2] - height(*p)).abs() < 1e-9, "{p:?}");
                assert!((f64::from(uv[0]) - p[0] / 100.0).abs() < 1e-6 && (f64::from(uv[1]) - p[1] / 100.0).abs() < 1e-6);
            }
            let n = map3d_base::vec3::triangle_normal(corners);
            (area, up) = (area + n[2].abs() / 2.0, up + n[2] / 2.0);
            assert_eq!((draped.objects()[t], draped.ranks()[t]), (0, Rank::Road as u8));
        }
        assert!((area - 10_000.0).abs() < 1e-6 && up.abs() < 1e-6, "one half faces down, the other up: {area} {up}");
    }

    #[test]
    fn a_road_lies_in_the_triangles_of_the_terrain() {
        let (count, mesh, folder) = draped("terrain", &[ramp(-50.0, 150.0)], None);
        assert!(count > 20);
        check(&mesh, |p| 500.0 + 0.25 * p[0]);
        std::fs::remove_dir_all(folder).expect("remove");
    }

    #[test]
    fn tiles_of_terrain_complete_each_other_and_overlaps_count_once() {
        let (_, mesh, folder) = draped("tiles", &[ramp(-50.0, 40.0), ramp(40.0, 150.0)], None);
        check(&mesh, |p| 500.0 + 0.25 * p[0]);
        std::fs::remove_dir_all(folder).expect("remove");
        let (_, mesh, folder) = draped("overlap", &[ramp(-50.0, 150.0), ramp(40.0, 150.0)], None);
        check(&mesh, |p| 500.0 + 0.25 * p[0]);
        std::fs::remove_dir_all(folder).expect("remove");
    }

    #[test]
    fn beyond_the_terrain_the_fallback_counts_and_without_any_ground_nothing_moves() {
        let fallback = ramp(-200.0, 400.0);
        let (_, mesh, folder) = draped("fallback", &[ramp(-50.0, 70.0)], Some(&fallback));
        check(&mesh, |p| 500.0 + 0.25 * p[0]);
        std::fs::remove_dir_all(folder).expect("remove");
        let (count, mesh, folder) = draped("nothing", &[], None);
        assert_eq!(count, 2);
        check(&mesh, |_| 0.0);
        std::fs::remove_dir_all(folder).expect("remove");
    }
}
