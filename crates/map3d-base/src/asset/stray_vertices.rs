//! Finds triangles that reach from an object to a vertex kilometres away, as a typing error in one number makes them.

use std::collections::{BTreeMap, BTreeSet};

use super::Batch;
use crate::vec3::{Vec3, length, sub};

/// A vertex is not stray nearer to the rest of its object than this, nor than this many times the size of the rest, for objects of few and of many
/// vertices.
const LEAST_M: f64 = 1000.0;
const TIMES_SIZE: [f64; 2] = [20.0, 4.0];
const MANY_VERTICES: usize = 100;
/// The build of a scene leaves out triangles that reach farther than this.
const MOST_M: f64 = 100_000.0;
/// An object with more vertices far from the rest is made so.
const MAX_STRAYS: usize = 2;
const MIN_VERTICES: usize = 4;

type Key = [u64; 3];

/// Clears `keep` of the triangles that reach to a stray vertex; returns their number and the object of the first one.
pub fn leave_out_strays(batch: &Batch, keep: &mut [bool]) -> (u64, Option<u32>) {
    let (mut count, mut first) = (0, None);
    if batch.prototype != 0 {
        return (count, first);
    }
    for (object, triangles) in objects_with_long_edges(batch, keep) {
        let strays = stray_vertices(batch, &triangles);
        for i in triangles {
            let far = batch.triangles[i].iter().filter(|v| strays.contains(&key(batch.positions[**v as usize]))).count();
            if far > 0 && far < 3 && longest_m(batch, i) < MOST_M {
                keep[i] = false;
                count += 1;
                first = first.or(Some(object));
            }
        }
    }
    (count, first)
}

/// Returns the valid triangles of each object that has a long edge.
fn objects_with_long_edges(batch: &Batch, keep: &[bool]) -> BTreeMap<u32, Vec<usize>> {
    let kept = || (0..batch.triangles.len()).filter(|i| keep[*i]);
    let mut found: BTreeMap<u32, Vec<usize>> = kept().filter(|i| longest_m(batch, *i) >= LEAST_M).map(|i| (batch.objects[i], Vec::new())).collect();
    if !found.is_empty() {
        kept().for_each(|i| {
            if let Some(triangles) = found.get_mut(&batch.objects[i]) {
                triangles.push(i);
            }
        });
    }
    found
}

/// Returns the few vertices that lie far from three quarters of the others.
fn stray_vertices(batch: &Batch, triangles: &[usize]) -> BTreeSet<Key> {
    let corners = triangles.iter().flat_map(|i| batch.triangles[*i]).map(|v| batch.positions[v as usize]);
    let vertices: BTreeMap<Key, Vec3> = corners.map(|p| (key(p), p)).collect();
    if vertices.len() < MIN_VERTICES {
        return BTreeSet::new();
    }
    let middle = [0, 1, 2].map(|k| quantile(vertices.values().map(|p| p[k]).collect(), 2));
    let away = |p: Vec3| length(sub(p, middle));
    let usual_m = quantile(vertices.values().map(|p| away(*p)).collect(), 3);
    let least_m = LEAST_M.max(TIMES_SIZE[usize::from(vertices.len() >= MANY_VERTICES)] * usual_m);
    let far: BTreeSet<Key> = vertices.iter().filter(|(_, p)| away(**p) >= least_m).map(|(k, _)| *k).collect();
    if far.len() > MAX_STRAYS { BTreeSet::new() } else { far }
}

/// Returns the value that this many quarters of the others do not exceed.
fn quantile(mut values: Vec<f64>, quarters: usize) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() * quarters).div_ceil(4) - 1).min(values.len() - 1)]
}

fn longest_m(batch: &Batch, i: usize) -> f64 {
    let [a, b, c] = batch.triangles[i].map(|v| batch.positions[v as usize]);
    [sub(b, a), sub(c, b), sub(a, c)].map(length).into_iter().fold(0.0, f64::max)
}

fn key(p: Vec3) -> Key {
    p.map(f64::to_bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::Rank;

    /// Returns a batch of fans, each of an object, around its first corner.
    fn fans(objects: &[&[Vec3]]) -> Batch {
        let mut batch = Batch::default();
        for (object, corners) in objects.iter().enumerate() {
            let base = batch.positions.len() as u32;
            batch.positions.extend_from_slice(corners);
            for k in 1..corners.len() as u32 - 1 {
                batch.triangles.push([base, base + k, base + k + 1]);
                batch.materials.push(0);
                batch.objects.push(object as u32);
                batch.ranks.push(Rank::Other);
            }
        }
        batch
    }

    fn kept(batch: &Batch) -> Vec<bool> {
        let mut keep = vec![true; batch.triangles.len()];
        leave_out_strays(batch, &mut keep);
        keep
    }

    const HOUSE: [Vec3; 5] = [[0.0; 3], [10.0, 0.0, 0.0], [10.0, 8.0, 0.0], [5.0, 12.0, 3.0], [0.0, 8.0, 0.0]];

    #[test]
    fn a_needle_to_a_stray_vertex_is_left_out_of_its_object() {
        let mut broken = HOUSE;
        broken[3] = [5.0, 4012.0, 3.0];
        let batch = fans(&[&HOUSE, &broken]);
        assert_eq!(kept(&batch), [true, true, true, true, false, false]);
        assert_eq!(leave_out_strays(&batch, &mut [true; 6]), (2, Some(1)));
    }

    #[test]
    fn a_mesh_of_many_vertices_may_be_large() {
        let mut town: Vec<Vec3> = (0..400).map(|k| [f64::from(k % 20) * 50.0, f64::from(k / 20) * 50.0, 0.0]).collect();
        assert!(kept(&fans(&[&town])).iter().all(|k| *k));
        town[210] = [500.0, 6000.0, 0.0];
        assert_eq!(kept(&fans(&[&town])).iter().filter(|k| !**k).count(), 2);
    }

    #[test]
    fn long_and_far_parts_stay() {
        let road: Vec<Vec3> = (0..20).map(|k| [f64::from(k % 10) * 500.0, f64::from(k / 10) * 8.0, 0.0]).collect();
        let tip: [Vec3; 4] = [[0.0; 3], [900.0, 20.0, 0.0], [900.0, -20.0, 0.0], [-100.0, 0.0, 0.0]];
        let ground: Vec<Vec3> = HOUSE.into_iter().chain([[-3e3, -3e3, 0.0], [3e3, -3e3, 0.0], [3e3, 3e3, 0.0]]).collect();
        for object in [&road[..], &tip[..], &ground[..], &[[0.0; 3], [4e3, 9.0, 0.0], [4e3, 0.0, 0.0]][..]] {
            assert!(kept(&fans(&[object])).iter().all(|k| *k), "{object:?}");
        }
        let mut of_the_build = HOUSE;
        of_the_build[3] = [-5e6, 0.0, 0.0];
        assert!(kept(&fans(&[&of_the_build])).iter().all(|k| *k));
    }
}
