//! Draws triangles into the sample buffer: whole pixels 16 at a time, pixels on edges sample by sample.

use std::cell::Cell;

use super::buffer::{BLOCKS_PER_ROW, FAR, MIXED, SampleBuffer, Track, bit_in_group, group_of};
use super::shape::{Edge, PixelBox};
use crate::cutout::{Cutout, Sheet};
use crate::lanes::Lanes;
use crate::visbuf::{NOTHING, SUBTILE_PX};

const SIDE: usize = SUBTILE_PX;
const COUNT_UP: [i32; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
/// Boxes of at most this many pixels skip the search for whole pixels.
const FEW_PIXELS: i32 = 6;

/// A triangle on its way into the buffer.
pub(crate) struct Candidate<'a> {
    /// `track.plane` is sound when `is_regular`.
    pub track: Track,
    pub is_regular: bool,
    /// Set once it has won a sample.
    pub slot: Cell<u32>,
    /// When the material is a cut-out.
    pub sheet: Option<Sheet<'a>>,
}

pub(crate) struct Canvas<'a> {
    pub samples: &'a mut SampleBuffer,
    pub tracks: &'a mut Vec<Track>,
    pub cutout: &'a dyn Cutout,
}

/// An edge in 32 bits, for 16 pixels of a row at a time: shifted right until it fits, so `inside` and `outside` are safe but may both be false.
#[derive(Clone, Copy)]
struct CoarseEdge<L> {
    along: L,
    inside: i32,
    outside: i32,
    x: i32,
    y: i32,
}

impl<L: Lanes> CoarseEdge<L> {
    #[inline(always)]
    fn of(edge: &Edge<L>) -> Self {
        const LIMIT: i64 = 1 << 29;
        let reach = (edge.x.unsigned_abs() + edge.y.unsigned_abs()) * SIDE as u64;
        let shift = (64 - reach.leading_zeros()).saturating_sub(29);
        let (x, y) = ((edge.x >> shift) as i32, (edge.y >> shift) as i32);
        let at = (edge.at >> shift).clamp(-LIMIT, LIMIT) as i32;
        // Each floored step loses less than one.
        let lost = if shift == 0 { 0 } else { 2 * SIDE as i32 };
        Self {
            along: L::load(&COUNT_UP).mul(L::splat(x)),
            inside: at + (edge.lo >> shift),
            outside: at + (edge.hi >> shift) + i32::from(shift > 0) + lost,
            x,
            y,
        }
    }

    /// 16 pixels from (i, j) on: negative where one may be not inside (`inside`), or is outside (`outside`).
    #[inline(always)]
    fn at(&self, from: i32, i: i32, j: i32) -> L {
        L::splat(from + self.x * i + self.y * j).add(self.along)
    }
}

impl Canvas<'_> {
    /// Draws a triangle with a key plane.
    #[inline(always)]
    pub fn draw<L: Lanes>(&mut self, candidate: &Candidate, b: &PixelBox, edges: &[Edge<L>; 3]) {
        if (b.x1 - b.x0 + 1) * (b.y1 - b.y0 + 1) > FEW_PIXELS {
            return self.draw_rows(candidate, b, edges);
        }
        for j in b.y0..b.y1 + 1 {
            for i in b.x0..b.x1 + 1 {
                self.draw_pixel(candidate, i, j, edges);
            }
        }
    }

    /// Rows of up to 64 pixels, 16 at a time: whole pixels in front of all that is there are set at once.
    #[inline(always)]
    fn draw_rows<L: Lanes>(&mut self, candidate: &Candidate, b: &PixelBox, edges: &[Edge<L>; 3]) {
        let coarse = [CoarseEdge::of(&edges[0]), CoarseEdge::of(&edges[1]), CoarseEdge::of(&edges[2])];
        let plane = &candidate.track.plane;
        let along = L::load(&COUNT_UP).mul(L::splat(plane.gx));
        let allow_whole = if candidate.sheet.is_some() { 0 } else { 0xFFFF };
        for j in b.y0..b.y1 + 1 {
            for block in b.x0 >> 4..(b.x1 >> 4) + 1 {
                let i = block * 16;
                let valid = columns(b, i);
                let [e, f, g] = &coarse;
                let mut open = !e.at(e.outside, i, j).or(f.at(f.outside, i, j)).or(g.at(g.outside, i, j)).negative() & valid;
                if open == 0 {
                    continue;
                }
                let fixed = L::splat(plane.center(i, j)).add(along);
                let lo = plane.keys(fixed.add(L::splat(plane.offset_lo)));
                let place = (j as usize * BLOCKS_PER_ROW + block as usize) & (SIDE * BLOCKS_PER_ROW - 1);
                open &= !L::load(&self.samples.far[place]).less(lo);
                if open == 0 {
                    continue;
                }
                let hi = plane.keys(fixed.add(L::splat(plane.offset_hi)));
                let partly = e.at(e.inside, i, j).or(f.at(f.inside, i, j)).or(g.at(g.inside, i, j)).negative();
                let whole = !partly & hi.less(L::load(&self.samples.near[place])) & open & allow_whole;
                if whole != 0 {
                    self.set_block(candidate, place, whole, lo, hi);
                }
                let mut rest = open & !whole;
                while rest != 0 {
                    let k = rest.trailing_zeros() as i32;
                    rest &= rest - 1;
                    self.draw_pixel(candidate, i + k, j, edges);
                }
            }
        }
    }

    /// Whole pixels of a block, all samples in front of what is there.
    #[inline(always)]
    fn set_block<L: Lanes>(&mut self, candidate: &Candidate, place: usize, whole: u32, lo: L, hi: L) {
        let slot = self.slot_of(candidate);
        put_slots::<L>(slot, whole, &mut self.samples.slot[place]);
        lo.put(whole, &mut self.samples.near[place]);
        hi.put(whole, &mut self.samples.far[place]);
        let group = group_of(place * 16);
        let (left, right) = (whole & 0xFF != 0, whole >> 8 != 0);
        self.samples.dirty |= (u64::from(left) | u64::from(right) << 1) << group;
    }

    /// One pixel, sample by sample.
    #[inline(always)]
    fn draw_pixel<L: Lanes>(&mut self, candidate: &Candidate, i: i32, j: i32, edges: &[Edge<L>; 3]) {
        let p = (j as usize * SIDE + i as usize) & (SIDE * SIDE - 1);
        let bounds = candidate.track.plane.key_bounds(i, j);
        if bounds.0 > self.samples.far_of(p) {
            return;
        }
        let covered = !edges[0].samples(i, j).or(edges[1].samples(i, j)).or(edges[2].samples(i, j)).negative() & 0xFFFF;
        if covered != 0 {
            let keys = candidate.track.plane.sample_keys::<L>(i, j);
            self.merge(candidate, p, covered, keys, bounds);
        }
    }

    /// The keys that a pixel holds.
    #[inline(always)]
    fn keys_at<L: Lanes>(&self, p: usize) -> L {
        match self.samples.slot_of(p) {
            NOTHING => L::splat(FAR),
            MIXED => L::load(&self.samples.keys[p]),
            slot => self.tracks[slot as usize].plane.sample_keys((p % SIDE) as i32, (p / SIDE) as i32),
        }
    }

    /// Lets the covered samples of a pixel compete; `bounds` hold all of `keys`.
    #[inline(always)]
    pub fn merge<L: Lanes>(&mut self, candidate: &Candidate, p: usize, covered: u32, keys: L, bounds: (i32, i32)) {
        let old = self.keys_at::<L>(p);
        let mut wins = keys.less(old) & covered;
        let ties = keys.equal(old) & covered;
        if ties != 0 {
            wins |= self.settle(candidate, p, ties);
        }
        if let Some(sheet) = candidate.sheet.as_ref().filter(|_| wins != 0) {
            wins = sheet.covered(self.cutout, p % SIDE, p / SIDE, wins);
        }
        if wins == 0 {
            return;
        }
        let slot = self.slot_of(candidate);
        if wins == 0xFFFF && candidate.is_regular {
            self.samples.slot[p >> 4][p & 15] = slot;
            self.samples.near[p >> 4][p & 15] = bounds.0;
            self.samples.far[p >> 4][p & 15] = bounds.1;
        } else {
            self.mix(p, wins, keys, old, slot);
            let near = &mut self.samples.near[p >> 4][p & 15];
            *near = bounds.0.min(*near);
            self.samples.stale[group_of(p)] |= bit_in_group(p);
        }
        self.samples.touch(p);
    }

    #[inline(always)]
    fn mix<L: Lanes>(&mut self, p: usize, wins: u32, keys: L, old: L, slot: u32) {
        let before = std::mem::replace(&mut self.samples.slot[p >> 4][p & 15], MIXED);
        if before != MIXED {
            old.store(&mut self.samples.keys[p]);
            self.samples.slots[p] = [before; 16];
        }
        keys.put(wins, &mut self.samples.keys[p]);
        put_slots::<L>(slot, wins, &mut self.samples.slots[p]);
    }

    /// Samples of equal keys that the candidate wins.
    #[cold]
    #[inline(never)]
    fn settle(&self, candidate: &Candidate, p: usize, ties: u32) -> u32 {
        let order = candidate.track.tie_order();
        let holder = |k: usize| match self.samples.slot_of(p) {
            MIXED => self.samples.slots[p][k],
            slot => slot,
        };
        let wins = |k: usize| ties >> k & 1 != 0 && order < self.tracks[holder(k) as usize].tie_order();
        (0..16).filter(|k| wins(*k)).fold(0, |mask, k| mask | 1 << k)
    }

    /// The candidate's slot; its first win makes one.
    #[inline(always)]
    fn slot_of(&mut self, candidate: &Candidate) -> u32 {
        if candidate.slot.get() == NOTHING {
            candidate.slot.set(self.tracks.len() as u32);
            self.tracks.push(candidate.track);
        }
        candidate.slot.get()
    }
}

/// Lanes of the 16 pixels from column i that lie in the box.
#[inline(always)]
fn columns(b: &PixelBox, i: i32) -> u32 {
    let first = (b.x0 - i).max(0) as u32;
    let last = (b.x1 - i).min(15) as u32;
    (0xFFFF << first) & (0xFFFF >> (15 - last))
}

#[inline(always)]
fn put_slots<L: Lanes>(slot: u32, mask: u32, to: &mut [u32; 16]) {
    L::splat(slot as i32).put(mask, bytemuck::cast_mut(to));
}
