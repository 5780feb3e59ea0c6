//! Parents from four children (spec/pyramid.md §7), from unencoded pixels.

use map3d_base::DEPTH_NOTHING;

use crate::gbuffer::{GBuffer, normal_from_vector};

/// A mean shorter than this has no direction.
const MIN_MEAN: f64 = 1e-6;

/// The parent of four children in the order TL, TR, BL, BR; `None`: a child without content. All children are `side` × `side` px, even.
pub fn reduce(children: [Option<&GBuffer>; 4], side: u32) -> GBuffer {
    assert!(side.is_multiple_of(2), "a tile's side is even, not {side}");
    let mut parent = GBuffer::empty(side, side);
    for (number, child) in children.into_iter().enumerate() {
        let Some(child) = child else { continue };
        assert_eq!((child.width, child.height), (side, side), "a child's size");
        let half = side as usize / 2;
        let (left, top) = (number % 2 * half, number / 2 * half);
        for y in 0..half {
            reduce_row(child, y, &mut parent, (top + y) * side as usize + left);
        }
    }
    parent
}

/// One row of a quadrant: two rows of the child.
fn reduce_row(child: &GBuffer, y: usize, parent: &mut GBuffer, at: usize) {
    let w = child.width as usize;
    let (upper, lower) = (2 * y * w..(2 * y + 1) * w, (2 * y + 1) * w..(2 * y + 2) * w);
    let half = w / 2;
    let colors = pairs(&child.color[upper.clone()], &child.color[lower.clone()]);
    for (to, four) in parent.color[at..at + half].iter_mut().zip(colors) {
        *to = mean_color(four);
    }
    let ids = pairs(&child.id[upper.clone()], &child.id[lower.clone()]);
    let depths = pairs(&child.depth[upper.clone()], &child.depth[lower.clone()]);
    let normals = pairs(&child.normal[upper], &child.normal[lower]);
    for (x, ((ids, depths), normals)) in ids.zip(depths).zip(normals).enumerate() {
        let id = winner(ids, depths);
        if id == 0 {
            continue;
        }
        let of_id = [0, 1, 2, 3].map(|k| ids[k] == id);
        let (nearest, depth) = nearest(of_id, depths);
        parent.id[at + x] = id;
        parent.depth[at + x] = depth;
        parent.normal[at + x] = mean_normal(of_id, normals, nearest);
    }
}

/// 2 × 2 squares of two rows, in the order TL, TR, BL, BR.
fn pairs<'a, T: Copy>(upper: &'a [T], lower: &'a [T]) -> impl Iterator<Item = [T; 4]> + 'a {
    let squares = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
    squares.map(|(u, l)| [u[0], u[1], l[0], l[1]])
}

#[inline(always)]
fn mean_color(four: [[u16; 4]; 4]) -> [u16; 4] {
    let mut out = [0; 4];
    for (c, mean) in out.iter_mut().enumerate() {
        let sum = u32::from(four[0][c]) + u32::from(four[1][c]) + u32::from(four[2][c]) + u32::from(four[3][c]);
        *mean = ((sum + 2) / 4) as u16;
    }
    out
}

/// The commonest id; nothing only when three are nothing. Ties: the id with the nearest child, then the first.
fn winner(ids: [u32; 4], depths: [u32; 4]) -> u32 {
    if ids == [ids[0]; 4] {
        return ids[0];
    }
    if ids.iter().filter(|id| **id == 0).count() >= 3 {
        return 0;
    }
    let mut best = (0, u32::MAX, 0);
    for id in ids.into_iter().filter(|id| *id != 0) {
        let of_id = [0, 1, 2, 3].map(|k| ids[k] == id);
        let count = of_id.iter().filter(|b| **b).count();
        let (_, depth) = nearest(of_id, depths);
        if count > best.0 || (count == best.0 && depth < best.1) {
            best = (count, depth, id);
        }
    }
    best.2
}

/// (child, depth) of the nearest of some children; the first of equals.
fn nearest(of_id: [bool; 4], depths: [u32; 4]) -> (usize, u32) {
    let mut best = (0, DEPTH_NOTHING);
    let mut found = false;
    for k in (0..4).filter(|k| of_id[*k]) {
        if !found || depths[k] < best.1 {
            best = (k, depths[k]);
            found = true;
        }
    }
    best
}

fn mean_normal(of_id: [bool; 4], normals: [[i16; 3]; 4], nearest: usize) -> [i16; 3] {
    if of_id == [true; 4] && normals == [normals[0]; 4] {
        return normals[0];
    }
    let chosen = || (0..4).filter(|k| of_id[*k]).map(|k| normals[k]);
    let first = normals[nearest];
    if chosen().all(|n| n == first) {
        return first;
    }
    let count = chosen().count() as f64;
    let sum = chosen().fold([0.0; 3], |s, n| [0, 1, 2].map(|c| s[c] + f64::from(n[c])));
    let mean = sum.map(|c| c / (count * 32_767.0));
    if map3d_base::vec3::length(mean) < MIN_MEAN {
        return first;
    }
    normal_from_vector(mean).unwrap_or(first)
}
