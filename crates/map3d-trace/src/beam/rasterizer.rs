//! Rasterises triangles into the sample buffer: whole pixels in spans of 16, pixels on edges sample by sample.

use std::cell::Cell;

use super::edges::{CoarseEdge, TriangleEdges, covered_samples, pixels_outside, pixels_partly_outside};
use super::key_plane::KeyPlane;
use super::pixels::{PixelBox, SUBTILE_PX};
use super::sample_buffer::{FAR, MIXED, NOTHING, PIXELS, SPANS_PER_ROW, SampleBuffer, VisibleTriangle};
use crate::cutout::{Cutout, CutoutTriangle};
use crate::lanes::Lanes;

/// Boxes of at most this number of pixels are drawn pixel by pixel, without spans.
const FEW_PIXELS: i32 = 6;

/// A triangle that competes for samples.
pub(crate) struct Candidate<'a, P> {
    pub triangle: VisibleTriangle,
    /// Valid if `has_plane`.
    pub plane: P,
    pub has_plane: bool,
    /// `NOTHING` until the triangle wins a sample.
    pub slot: Cell<u32>,
    /// For a material that is a cut-out.
    pub cutout: Option<CutoutTriangle<'a>>,
}

pub(crate) struct Rasterizer<'a, P> {
    pub samples: &'a mut SampleBuffer,
    /// By slot.
    pub triangles: &'a mut Vec<VisibleTriangle>,
    /// By slot. A plane is valid if its triangle can cover whole pixels.
    pub planes: &'a mut Vec<P>,
    pub cutout: &'a dyn Cutout,
}

impl<P: KeyPlane> Rasterizer<'_, P> {
    /// Draws a triangle with a depth key plane.
    #[inline(always)]
    pub fn draw<L: Lanes>(&mut self, candidate: &Candidate<P>, pixels: &PixelBox, edges: &TriangleEdges<L>) {
        if pixels.width() * pixels.height() > FEW_PIXELS {
            return self.draw_spans(candidate, pixels, edges);
        }
        for j in pixels.y0..pixels.y1 + 1 {
            for i in pixels.x0..pixels.x1 + 1 {
                self.draw_pixel(candidate, i, j, edges);
            }
        }
    }

    /// Draws rows in spans of 16 pixels. Whole pixels in front of the buffer's content are set at once.
    #[inline(always)]
    fn draw_spans<L: Lanes>(&mut self, candidate: &Candidate<P>, pixels: &PixelBox, edges: &TriangleEdges<L>) {
        let coarse = [CoarseEdge::new(&edges[0]), CoarseEdge::new(&edges[1]), CoarseEdge::new(&edges[2])];
        let plane = &candidate.plane;
        let along = plane.along::<L>();
        let allow_whole = if candidate.cutout.is_some() { 0 } else { 0xFFFF };
        for j in pixels.y0..pixels.y1 + 1 {
            for column in pixels.x0 >> 4..(pixels.x1 >> 4) + 1 {
                let i = column * 16;

                // Skip pixels outside of the triangle.
                let mut open = !pixels_outside(&coarse, i, j) & pixels.columns_of_span(i);
                if open == 0 {
                    continue;
                }

                // Skip pixels where the triangle is hidden.
                let values = plane.span::<L>(along, i, j);
                let lo = plane.least::<L>(values);
                let span = (j as usize * SPANS_PER_ROW + column as usize) & (SUBTILE_PX * SPANS_PER_ROW - 1);
                open &= !L::load(&self.samples.far[span]).less(lo);
                if open == 0 {
                    continue;
                }

                // Set the pixels that the triangle covers wholly and in front of all samples.
                let hi = plane.greatest::<L>(values);
                let partly = pixels_partly_outside(&coarse, i, j);
                let whole = !partly & hi.less(L::load(&self.samples.near[span])) & open & allow_whole;
                if whole != 0 {
                    self.set_whole_pixels(candidate, span, whole, lo, hi);
                }

                // Draw the others sample by sample.
                let mut rest = open & !whole;
                while rest != 0 {
                    let k = rest.trailing_zeros() as i32;
                    rest &= rest - 1;
                    self.draw_pixel(candidate, i + k, j, edges);
                }
            }
        }
    }

    /// Sets whole pixels of a span; `lo` and `hi` bound their depth keys.
    #[inline(always)]
    fn set_whole_pixels<L: Lanes>(&mut self, candidate: &Candidate<P>, span: usize, whole: u32, lo: L, hi: L) {
        let slot = self.slot_of(candidate);
        put_slots::<L>(slot, whole, &mut self.samples.slot[span]);
        lo.put(whole, &mut self.samples.near[span]);
        hi.put(whole, &mut self.samples.far[span]);
        self.samples.mark_span_dirty(span, whole);
    }

    /// Draws one pixel sample by sample.
    #[inline(always)]
    fn draw_pixel<L: Lanes>(&mut self, candidate: &Candidate<P>, i: i32, j: i32, edges: &TriangleEdges<L>) {
        let p = (j as usize * SUBTILE_PX + i as usize) & (PIXELS - 1);
        let near = candidate.plane.near_key(i, j);
        if near > self.samples.far_of(p) {
            return;
        }
        let covered = covered_samples(edges, i, j);
        if covered != 0 {
            let keys = candidate.plane.sample_keys::<L>(i, j);
            self.merge(candidate, p, covered, keys, near);
        }
    }

    /// Merges the covered samples of a triangle into a pixel; `near` is a lower bound of `keys`.
    #[inline(always)]
    pub fn merge<L: Lanes>(&mut self, candidate: &Candidate<P>, p: usize, covered: u32, keys: L, near: i32) {
        // Find the samples that the triangle wins.
        let old = self.keys_of::<L>(p);
        let mut wins = keys.less(old) & covered;
        let ties = keys.equal(old) & covered;
        if ties != 0 {
            wins |= self.break_ties(candidate, p, ties);
        }
        if let Some(cutout) = candidate.cutout.as_ref().filter(|_| wins != 0) {
            wins = cutout.covered(self.cutout, p % SUBTILE_PX, p / SUBTILE_PX, wins);
        }
        if wins == 0 {
            return;
        }

        // Store the slot once for a whole pixel, else for each sample.
        let slot = self.slot_of(candidate);
        if wins == 0xFFFF && candidate.has_plane {
            self.samples.slot[p >> 4][p & 15] = slot;
            self.samples.near[p >> 4][p & 15] = near;
            self.samples.far[p >> 4][p & 15] = candidate.plane.far_key((p % SUBTILE_PX) as i32, (p / SUBTILE_PX) as i32);
        } else {
            self.store_samples(p, wins, keys, old, slot);
            let least = &mut self.samples.near[p >> 4][p & 15];
            *least = near.min(*least);
            self.samples.mark_stale(p);
        }
        self.samples.mark_dirty(p);
    }

    /// Returns the depth keys of a pixel's samples.
    #[inline(always)]
    fn keys_of<L: Lanes>(&self, p: usize) -> L {
        match self.samples.slot_of(p) {
            NOTHING => L::splat(FAR),
            MIXED => L::load(&self.samples.sample_keys[p]),
            slot => self.planes[slot as usize].sample_keys::<L>((p % SUBTILE_PX) as i32, (p / SUBTILE_PX) as i32),
        }
    }

    /// Stores the samples that a triangle has won in a `MIXED` pixel; `old` are the pixel's keys.
    #[inline(always)]
    fn store_samples<L: Lanes>(&mut self, p: usize, wins: u32, keys: L, old: L, slot: u32) {
        let before = std::mem::replace(&mut self.samples.slot[p >> 4][p & 15], MIXED);
        if before != MIXED {
            old.store(&mut self.samples.sample_keys[p]);
            self.samples.sample_slots[p] = [before; 16];
        }
        keys.put(wins, &mut self.samples.sample_keys[p]);
        put_slots::<L>(slot, wins, &mut self.samples.sample_slots[p]);
    }

    /// Returns those of the samples with equal keys that the candidate wins.
    #[cold]
    #[inline(never)]
    fn break_ties(&self, candidate: &Candidate<P>, p: usize, ties: u32) -> u32 {
        let slot_of_sample = |k: usize| match self.samples.slot_of(p) {
            MIXED => self.samples.sample_slots[p][k],
            slot => slot,
        };
        let wins = |k: usize| ties >> k & 1 != 0 && candidate.triangle.tie_break < self.triangles[slot_of_sample(k) as usize].tie_break;
        (0..16).filter(|k| wins(*k)).fold(0, |mask, k| mask | 1 << k)
    }

    /// Returns the candidate's slot; its first win creates it.
    #[inline(always)]
    fn slot_of(&mut self, candidate: &Candidate<P>) -> u32 {
        if candidate.slot.get() == NOTHING {
            candidate.slot.set(self.triangles.len() as u32);
            self.triangles.push(candidate.triangle);
            self.planes.push(candidate.plane);
        }
        candidate.slot.get()
    }
}

#[inline(always)]
fn put_slots<L: Lanes>(slot: u32, mask: u32, to: &mut [u32; 16]) {
    L::splat(slot as i32).put(mask, bytemuck::cast_mut(to));
}
