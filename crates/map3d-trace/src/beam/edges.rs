//! Coverage by edge functions: exact integers for the samples of a pixel, and a conservative form for spans of 16 pixels.

use super::pixels::{SAMPLE_X, SAMPLE_Y, SUBTILE_PX, SnappedCorners};
use crate::lanes::Lanes;

/// Triangles with a corner farther from the sub-tile than this number of lattice steps take the exact path.
const DISTANCE_MAX_STEPS: u64 = 1 << 24;
/// Column numbers within a span.
pub(crate) const COLUMNS: [i32; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/// The three edges of a triangle.
pub(crate) type TriangleEdges<L> = [EdgeFunction<L>; 3];

/// An edge function in units of 16 square lattice steps: `at + x·i + y·j + offsets[sample]` ≥ 0 where the sample of pixel (i, j) is inside. Exact.
#[derive(Clone, Copy)]
pub(crate) struct EdgeFunction<L> {
    at: i64,
    x: i64,
    y: i64,
    offsets: L,
    /// Bounds of `offsets`.
    lo: i32,
    hi: i32,
}

impl<L: Lanes> EdgeFunction<L> {
    /// Creates the edge from a to b. The inside is on its right-hand side on the screen; a bias of one implements the top-left rule.
    #[inline(always)]
    fn new(a: [i64; 2], b: [i64; 2]) -> Self {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let is_top_left = dy < 0 || (dy == 0 && dx > 0);
        let at_corner = dy * a[0] - dx * a[1] - i64::from(!is_top_left);
        let (kx, ky) = (-dy as i32, dx as i32);
        let offsets = L::load(&SAMPLE_X).mul(L::splat(kx)).add(L::load(&SAMPLE_Y).mul(L::splat(ky)));
        // Every lattice column and row of a pixel has a sample, so these safe bounds are close to the true ones.
        let (lo, hi) = (15 * (kx.min(0) + ky.min(0)), 15 * (kx.max(0) + ky.max(0)));
        Self { at: at_corner >> 4, x: -dy * 16, y: dx * 16, offsets, lo, hi }
    }

    /// Returns the values at the samples of a pixel.
    #[inline(always)]
    fn samples(&self, i: i32, j: i32) -> L {
        L::splat(self.corner(i, j)).add(self.offsets)
    }

    /// Returns the value at the top left corner of a pixel, limited so that adding offsets neither overflows nor changes the sign.
    #[inline(always)]
    fn corner(&self, i: i32, j: i32) -> i32 {
        const LIMIT: i64 = 1 << 30;
        (self.at + self.x * i64::from(i) + self.y * i64::from(j)).clamp(-LIMIT, LIMIT) as i32
    }
}

/// Returns the edges of a triangle whose corners are near (`is_near`), or `None` for a triangle without area.
#[inline(always)]
pub(crate) fn triangle_edges<L: Lanes>(s: &SnappedCorners) -> Option<TriangleEdges<L>> {
    let e = |k: usize, axis: usize| s[k][axis] - s[0][axis];
    let area = e(1, 0) * e(2, 1) - e(1, 1) * e(2, 0);
    if area == 0 {
        return None;
    }
    let (b, c) = if area > 0 { (s[1], s[2]) } else { (s[2], s[1]) };
    Some([EdgeFunction::new(s[0], b), EdgeFunction::new(b, c), EdgeFunction::new(c, s[0])])
}

/// Returns the mask of the samples of pixel (i, j) that are inside all edges.
#[inline(always)]
pub(crate) fn covered_samples<L: Lanes>(edges: &TriangleEdges<L>, i: i32, j: i32) -> u32 {
    !edges[0].samples(i, j).or(edges[1].samples(i, j)).or(edges[2].samples(i, j)).negative() & 0xFFFF
}

/// Returns whether all corners are near enough for 32-bit edge offsets.
#[inline(always)]
pub(crate) fn is_near(s: &SnappedCorners) -> bool {
    s.iter().flatten().all(|v| v.unsigned_abs() < DISTANCE_MAX_STEPS)
}

/// An edge function in 32 bits for 16 pixels of a row at a time. It is shifted right until it fits, so it is conservative: a pixel may be neither wholly
/// inside nor wholly outside.
#[derive(Clone, Copy)]
pub(crate) struct CoarseEdge<L> {
    along: L,
    inside: i32,
    outside: i32,
    x: i32,
    y: i32,
}

impl<L: Lanes> CoarseEdge<L> {
    #[inline(always)]
    pub fn new(edge: &EdgeFunction<L>) -> Self {
        const LIMIT: i64 = 1 << 29;
        // The shift that makes the value fit 29 bits over the whole sub-tile.
        let size = (edge.x.unsigned_abs() + edge.y.unsigned_abs()) * SUBTILE_PX as u64;
        let shift = (64 - size.leading_zeros()).saturating_sub(29);
        let (x, y) = ((edge.x >> shift) as i32, (edge.y >> shift) as i32);
        let at = (edge.at >> shift).clamp(-LIMIT, LIMIT) as i32;
        // Rounding down loses less than one at each step.
        let rounding = if shift == 0 { 0 } else { 2 * SUBTILE_PX as i32 };
        Self {
            along: L::load(&COLUMNS).mul(L::splat(x)),
            inside: at + (edge.lo >> shift),
            outside: at + (edge.hi >> shift) + i32::from(shift > 0) + rounding,
            x,
            y,
        }
    }

    #[inline(always)]
    fn values(&self, at: i32, i: i32, j: i32) -> L {
        L::splat(at + self.x * i + self.y * j).add(self.along)
    }
}

/// Returns the mask of the 16 pixels from (i, j) on that have a sample outside an edge or may have one.
#[inline(always)]
pub(crate) fn pixels_partly_outside<L: Lanes>([a, b, c]: &[CoarseEdge<L>; 3], i: i32, j: i32) -> u32 {
    a.values(a.inside, i, j).or(b.values(b.inside, i, j)).or(c.values(c.inside, i, j)).negative()
}

/// Returns the mask of the 16 pixels from (i, j) on that are wholly outside an edge.
#[inline(always)]
pub(crate) fn pixels_outside<L: Lanes>([a, b, c]: &[CoarseEdge<L>; 3], i: i32, j: i32) -> u32 {
    a.values(a.outside, i, j).or(b.values(b.outside, i, j)).or(c.values(c.outside, i, j)).negative()
}
