//! Reduces four children to their parent (spec/pyramid.md §7), from unencoded pixels.

use std::ops::Range;

use map3d_base::DEPTH_NOTHING;
use map3d_base::layers::{DEPTH, ID, LAYERS, NORMAL, Reduction};

use crate::gbuffer::{Arrays, GBuffer, SurfaceArrays};
use crate::pixel_array::PixelArray;

/// Pixels of a row that are reduced together.
const PIECE: usize = 64;
/// A shorter mean normal has no direction.
const MIN_MEAN: f64 = 1e-6;

/// Returns the parent of four children in the order TL, TR, BL, BR; `None` is a child without content. All children are `side` × `side` px (even) and
/// have the same arrays.
pub fn reduce(children: [Option<&GBuffer>; 4], side: u32) -> GBuffer {
    assert!(side.is_multiple_of(2), "a tile's side is even, not {side}");
    let arrays = children.iter().flatten().next().map_or(Arrays::STANDARD, |c| c.arrays());
    let (means, followers) = (ReducedArray::means(arrays), ReducedArray::followers(arrays));
    let mut parent = GBuffer::with(side, side, arrays);
    for (number, child) in children.into_iter().enumerate() {
        let Some(child) = child else { continue };
        assert_eq!((child.width, child.height, child.arrays()), (side, side, arrays), "a child's size and arrays");
        let half = side as usize / 2;
        let (left, top) = (number % 2 * half, number / 2 * half);
        for y in 0..half {
            let rows = Rows { width: side as usize, y, at: (top + y) * side as usize + left };
            rows.ids(child, &mut parent, &followers);
            for mean in &means {
                rows.mean(mean.reduction, &child.by_code()[mean.code], &child[ID], &mut parent.by_code_mut()[mean.code]);
            }
        }
    }
    parent
}

/// An array and how it is reduced.
struct ReducedArray {
    code: usize,
    reduction: Reduction,
}

impl ReducedArray {
    /// Returns the arrays that are reduced one by one.
    fn means(arrays: Arrays) -> Vec<Self> {
        Self::chosen(arrays, |reduction| matches!(reduction, Reduction::Mean | Reduction::MeanOfCovered))
    }

    /// Returns the arrays besides id, depth and normal that follow the children with the parent's id.
    fn followers(arrays: Arrays) -> Vec<Self> {
        let mut all = Self::chosen(arrays, |reduction| matches!(reduction, Reduction::Least | Reduction::Nearest));
        all.retain(|array| array.code != DEPTH.kind as usize);
        all
    }

    fn chosen(arrays: Arrays, is_chosen: impl Fn(Reduction) -> bool) -> Vec<Self> {
        let rows = LAYERS.iter().filter(|row| arrays.has(row.kind)).filter_map(|row| Some((row.code, row.array?.reduction)));
        rows.filter(|(_, reduction)| is_chosen(*reduction)).map(|(code, reduction)| Self { code: code.into(), reduction }).collect()
    }
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
    /// Returns the squares of 2 × 2 pixels of some columns of the half row, each in the order TL, TR, BL, BR.
    fn squares<'a, T: Copy>(&self, array: &'a [T], columns: &Range<usize>) -> impl Iterator<Item = [T; 4]> + use<'a, T> {
        let (upper, lower) = (2 * self.y * self.width, (2 * self.y + 1) * self.width);
        let of_row = |row: usize| &array[row + 2 * columns.start..row + 2 * columns.end];
        pairs(of_row(upper), of_row(lower))
    }

    fn all_squares<'a, T: Copy>(&self, array: &'a [T]) -> impl Iterator<Item = [T; 4]> + use<'a, T> {
        self.squares(array, &(0..self.width / 2))
    }

    /// Returns the square of pixel x of the half row.
    fn square<T: Copy>(&self, array: &[T], x: usize) -> [T; 4] {
        let (upper, lower) = (2 * self.y * self.width + 2 * x, (2 * self.y + 1) * self.width + 2 * x);
        [array[upper], array[upper + 1], array[lower], array[lower + 1]]
    }

    fn ids(&self, child: &GBuffer, parent: &mut GBuffer, followers: &[ReducedArray]) {
        if followers.is_empty() {
            return self.plain_ids(child, &mut parent.surface_arrays());
        }
        for x in 0..self.width / 2 {
            let (ids, depths) = (self.square(&child[ID], x), self.square(&child[DEPTH], x));
            let Some(choice) = self.choose_id(x, ids, depths, child, &mut parent.surface_arrays()) else { continue };
            for follower in followers {
                self.follow(x, &choice, follower.reduction, &child.by_code()[follower.code], &mut parent.by_code_mut()[follower.code]);
            }
        }
    }

    /// Reduces id, depth and normal. Most squares show one object with one normal, so there is no choice to make: all are reduced as if they did, then the
    /// others again.
    fn plain_ids(&self, child: &GBuffer, parent: &mut SurfaceArrays) {
        let (child_ids, child_depths, child_normals) = (&child[ID], &child[DEPTH], &child[NORMAL]);
        let mut again = [false; PIECE];
        for first in (0..self.width / 2).step_by(PIECE) {
            let columns = first..(first + PIECE).min(self.width / 2);
            let to = self.at + columns.start..self.at + columns.end;
            let (ids, depths) = (&mut parent.id[to.clone()], &mut parent.depth[to.clone()]);
            let squares = self.squares(child_ids, &columns).zip(self.squares(child_depths, &columns));
            for (((id, depth), again), (of_ids, of_depths)) in ids.iter_mut().zip(depths).zip(&mut again).zip(squares) {
                *again = differ(of_ids);
                *id = of_ids[0];
                *depth = if of_ids[0] == 0 { DEPTH_NOTHING } else { of_depths[0].min(of_depths[1]).min(of_depths[2].min(of_depths[3])) };
            }
            if !child_normals.is_empty() {
                let normals = parent.normal[to].iter_mut().zip(&mut again).zip(&*ids);
                for (((normal, again), id), of_normals) in normals.zip(self.squares(child_normals, &columns)) {
                    *again |= *id != 0 && normals_differ(of_normals);
                    *normal = if *id == 0 { [0; 3] } else { of_normals[0] };
                }
            }
            columns.clone().filter(|x| again[x - first]).for_each(|x| self.reduce_mixed(x, child, parent));
        }
    }

    /// Reduces a square of several objects or several normals.
    #[inline(never)]
    fn reduce_mixed(&self, x: usize, child: &GBuffer, parent: &mut SurfaceArrays) {
        let (to, ids, depths) = (self.at + x, self.square(&child[ID], x), self.square(&child[DEPTH], x));
        if !differ(ids) {
            parent.normal[to] = normal_of_one(self.square(&child[NORMAL], x), depths);
            return;
        }
        (parent.id[to], parent.depth[to]) = (0, DEPTH_NOTHING);
        if !parent.normal.is_empty() {
            parent.normal[to] = [0; 3];
        }
        self.choose_id(x, ids, depths, child, parent);
    }

    /// Reduces a square to one of its ids; returns `None` and leaves the parent's pixel empty if that is 0.
    fn choose_id(&self, x: usize, ids: [u32; 4], depths: [u32; 4], child: &GBuffer, parent: &mut SurfaceArrays) -> Option<Choice> {
        let (to, id) = (self.at + x, most_frequent_id(ids, depths));
        if id == 0 {
            return None;
        }
        let of_id = [0, 1, 2, 3].map(|k| ids[k] == id);
        let (nearest, depth) = nearest(of_id, depths);
        (parent.id[to], parent.depth[to]) = (id, depth);
        if !parent.normal.is_empty() {
            parent.normal[to] = mean_normal(of_id, self.square(&child[NORMAL], x), nearest);
        }
        Some(Choice { of_id, nearest })
    }

    /// Reduces a pixel of an array by the children with the parent's id.
    fn follow(&self, x: usize, choice: &Choice, reduction: Reduction, from: &PixelArray, to: &mut PixelArray) {
        let at = self.at + x;
        match (reduction, from, to) {
            (Reduction::Least, PixelArray::U32(from), PixelArray::U32(to)) => {
                let square = self.square(from, x);
                to[at] = (0..4).filter(|k| choice.of_id[*k]).map(|k| square[k]).min().expect("the nearest is of the id");
            }
            (Reduction::Nearest, PixelArray::U8(from), PixelArray::U8(to)) => to[at] = self.square(from, x)[choice.nearest],
            (Reduction::Nearest, PixelArray::U16(from), PixelArray::U16(to)) => to[at] = self.square(from, x)[choice.nearest],
            (Reduction::Nearest, PixelArray::U32(from), PixelArray::U32(to)) => to[at] = self.square(from, x)[choice.nearest],
            (reduction, ..) => unreachable!("{reduction:?} of such pixels"),
        }
    }

    /// Reduces a row of an array to means.
    fn mean(&self, reduction: Reduction, from: &PixelArray, ids: &[u32], to: &mut PixelArray) {
        let half = self.at..self.at + self.width / 2;
        match (reduction, from, to) {
            (Reduction::Mean, PixelArray::U16x4(from), PixelArray::U16x4(to)) => {
                to[half].iter_mut().zip(self.all_squares(from)).for_each(|(to, four)| *to = mean_color(four));
            }
            (Reduction::MeanOfCovered, PixelArray::U8(from), PixelArray::U8(to)) => {
                let fours = self.all_squares(from).zip(self.all_squares(ids));
                to[half].iter_mut().zip(fours).for_each(|(to, (four, ids))| *to = mean_shade(four, ids));
            }
            (reduction, ..) => unreachable!("{reduction:?} of such pixels"),
        }
    }
}

/// The children of a square that show the parent's id, and the nearest of them.
struct Choice {
    of_id: [bool; 4],
    nearest: usize,
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

/// Whether a square shows several ids.
#[inline(always)]
fn differ(ids: [u32; 4]) -> bool {
    (ids[0] ^ ids[1]) | (ids[0] ^ ids[2]) | (ids[0] ^ ids[3]) != 0
}

#[inline(always)]
fn normals_differ([a, b, c, d]: [[i16; 3]; 4]) -> bool {
    (0..3).fold(0, |all, k| all | (a[k] ^ b[k]) | (a[k] ^ c[k]) | (a[k] ^ d[k])) != 0
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
    if !normals_differ(normals) {
        return normals[0];
    }
    mean_direction(sum_of(normals), 4).unwrap_or_else(|| normals[nearest([true; 4], depths).0])
}

fn mean_normal(of_id: [bool; 4], normals: [[i16; 3]; 4], nearest: usize) -> [i16; 3] {
    let first = normals[nearest];
    let chosen = [0, 1, 2, 3].map(|k| if of_id[k] { normals[k] } else { first });
    if !normals_differ(chosen) {
        return first;
    }
    let (sum, others) = (sum_of(chosen), of_id.iter().filter(|is_chosen| !**is_chosen).count() as i32);
    mean_direction([0, 1, 2].map(|c| sum[c] - others * i32::from(first[c])), 4 - others).unwrap_or(first)
}

fn sum_of(normals: [[i16; 3]; 4]) -> [i32; 3] {
    [0, 1, 2].map(|c| normals.iter().map(|n| i32::from(n[c])).sum())
}

/// Returns the stored normal in the direction of a sum of `count` stored normals; `None` if their mean is too short.
#[inline(always)]
fn mean_direction(sum: [i32; 3], count: i32) -> Option<[i16; 3]> {
    let sum = sum.map(f64::from);
    let length = map3d_base::vec3::length(sum);
    if length < MIN_MEAN * 32_767.0 * f64::from(count) {
        return None;
    }
    let scale = 32_767.0 / length;
    Some(sum.map(|c| round_to_i16(c * scale)))
}

/// Rounds to the nearest, halves away from zero, as `f64::round` does, which is a call of the library where the processor's own rounding is not assumed.
#[inline(always)]
fn round_to_i16(x: f64) -> i16 {
    let whole = x as i32;
    let rest = x - f64::from(whole);
    (whole + i32::from(rest >= 0.5) - i32::from(rest <= -0.5)) as i16
}
