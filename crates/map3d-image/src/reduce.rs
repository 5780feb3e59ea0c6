//! Reduces four children to their parent (spec/pyramid.md §7), from unencoded pixels.

use map3d_base::DEPTH_NOTHING;

use crate::gbuffer::{Arrays, GBuffer, normal_from_vector};

/// A shorter mean normal has no direction.
const MIN_MEAN: f64 = 1e-6;

/// Returns the parent of four children in the order TL, TR, BL, BR; `None` is a child without content. All children are `side` × `side` px (even) and
/// have the same arrays.
pub fn reduce(children: [Option<&GBuffer>; 4], side: u32) -> GBuffer {
    assert!(side.is_multiple_of(2), "a tile's side is even, not {side}");
    let arrays = children.iter().flatten().next().map_or(Arrays::STANDARD, |c| c.arrays());
    let mut parent = GBuffer::with(side, side, arrays);
    for (number, child) in children.into_iter().enumerate() {
        let Some(child) = child else { continue };
        assert_eq!((child.width, child.height, child.arrays()), (side, side, arrays), "a child's size and arrays");
        let half = side as usize / 2;
        let (left, top) = (number % 2 * half, number / 2 * half);
        for y in 0..half {
            let rows = Rows { width: side as usize, y, at: (top + y) * side as usize + left };
            rows.ids(child, &mut parent);
            rows.colors(&child.color, &mut parent.color);
            rows.colors(&child.picture, &mut parent.picture);
            rows.shades(child, &child.sun, &mut parent.sun);
            rows.shades(child, &child.ao, &mut parent.ao);
        }
    }
    parent
}

/// Two rows of a child and the half row of the parent to which they reduce.
struct Rows {
    /// Width of the child.
    width: usize,
    /// Row of the parent within the child's quadrant.
    y: usize,
    /// First pixel of the half row.
    at: usize,
}

impl Rows {
    /// Returns the squares of 2 × 2 pixels, each in the order TL, TR, BL, BR.
    fn squares<'a, T: Copy>(&self, array: &'a [T]) -> impl Iterator<Item = [T; 4]> + use<'a, T> {
        let w = self.width;
        pairs(&array[2 * self.y * w..(2 * self.y + 1) * w], &array[(2 * self.y + 1) * w..(2 * self.y + 2) * w])
    }

    /// Returns the square of pixel x of the half row.
    fn square<T: Copy>(&self, array: &[T], x: usize) -> [T; 4] {
        let (upper, lower) = (2 * self.y * self.width + 2 * x, (2 * self.y + 1) * self.width + 2 * x);
        [array[upper], array[upper + 1], array[lower], array[lower + 1]]
    }

    fn ids(&self, child: &GBuffer, parent: &mut GBuffer) {
        let is_plain = child.sun16.is_empty() && child.depth2.is_empty();
        for (x, (ids, depths)) in self.squares(&child.id).zip(self.squares(&child.depth)).enumerate() {
            let to = self.at + x;
            // Most squares show one object, so there is no choice to make.
            if is_plain && ids == [ids[0]; 4] {
                if ids[0] != 0 {
                    (parent.id[to], parent.depth[to]) = (ids[0], depths[0].min(depths[1]).min(depths[2].min(depths[3])));
                    if !child.normal.is_empty() {
                        parent.normal[to] = normal_of_one(self.square(&child.normal, x), depths);
                    }
                }
                continue;
            }
            let id = most_frequent_id(ids, depths);
            if id == 0 {
                continue;
            }
            let of_id = [0, 1, 2, 3].map(|k| ids[k] == id);
            let (nearest, depth) = nearest(of_id, depths);
            (parent.id[to], parent.depth[to]) = (id, depth);
            if !child.normal.is_empty() {
                parent.normal[to] = mean_normal(of_id, self.square(&child.normal, x), nearest);
            }
            if !child.sun16.is_empty() {
                parent.sun16[to] = self.square(&child.sun16, x)[nearest];
            }
            if !child.depth2.is_empty() {
                let second = self.square(&child.depth2, x);
                parent.depth2[to] = (0..4).filter(|k| of_id[*k]).map(|k| second[k]).min().expect("the nearest is of the id");
            }
        }
    }

    fn colors(&self, child: &[[u16; 4]], parent: &mut [[u16; 4]]) {
        if !child.is_empty() {
            parent[self.at..][..self.width / 2].iter_mut().zip(self.squares(child)).for_each(|(to, four)| *to = mean_color(four));
        }
    }

    fn shades(&self, child: &GBuffer, array: &[u8], parent: &mut [u8]) {
        if !array.is_empty() {
            let fours = self.squares(array).zip(self.squares(&child.id));
            parent[self.at..][..self.width / 2].iter_mut().zip(fours).for_each(|(to, (four, ids))| *to = mean_shade(four, ids));
        }
    }
}

/// Returns the mean of the children that have an id, rounded half up; 255 when none has.
fn mean_shade(four: [u8; 4], ids: [u32; 4]) -> u8 {
    let there = (0..4).filter(|k| ids[*k] != 0);
    let (sum, count) = there.fold((0u32, 0u32), |(sum, count), k| (sum + u32::from(four[k]), count + 1));
    if count == 0 { 255 } else { ((2 * sum + count) / (2 * count)) as u8 }
}

/// Returns the squares of 2 × 2 pixels of two rows, each in the order TL, TR, BL, BR.
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

/// Returns the most frequent id; 0 only when at least three are 0. Ties: the id with the nearest child, then the first.
fn most_frequent_id(ids: [u32; 4], depths: [u32; 4]) -> u32 {
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

/// Returns child and depth of the nearest of some children; the first of equals.
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

/// Returns the normal of a square that shows one object.
#[inline(always)]
fn normal_of_one(normals: [[i16; 3]; 4], depths: [u32; 4]) -> [i16; 3] {
    match normals == [normals[0]; 4] {
        true => normals[0],
        false => mean_normal([true; 4], normals, nearest([true; 4], depths).0),
    }
}

#[inline(never)]
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
