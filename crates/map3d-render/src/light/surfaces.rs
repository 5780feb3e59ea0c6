//! Every surface in every pixel of a sub-tile as points, for what is averaged over a pixel; and the pixels' centres.

use map3d_base::RAY_LIFT_M;
use map3d_trace::SUBTILE_PX;

use super::place::Row;
use super::points::{BUCKET_PX, Points, key_of};
use super::subtile::Subtile;
use crate::seen::Shows;

const PIXELS: usize = SUBTILE_PX * SUBTILE_PX;

pub(super) struct Surfaces {
    pub points: Points,
    /// Where the shares are among them.
    pub share_places: Vec<u32>,
    /// Pixels of several surfaces in the order of buckets: a bit each, and their runs.
    shared: [u64; PIXELS / 64],
    run_of: Vec<u32>,
}

impl Default for Surfaces {
    fn default() -> Self {
        Self { points: Points::default(), share_places: Vec::new(), shared: [0; PIXELS / 64], run_of: vec![0; PIXELS] }
    }
}

impl Surfaces {
    pub fn take(&mut self, sub: &Subtile) {
        self.points.restart(RAY_LIFT_M, sub.first());
        self.shared.fill(0);
        let mut at: Row = [[0.0; SUBTILE_PX]; 3];
        for (number, run) in sub.seen.runs.iter().enumerate() {
            let (pixel, count) = ([run.columns().start, run.row.into()], run.columns().len());
            match run.shows {
                Shows::One(surface) => {
                    let surface = &sub.shaded[surface as usize];
                    sub.locator.row(pixel, count, &surface.depth, &mut at);
                    self.points.put_row(pixel, count, &at, surface.geometric_normal());
                }
                Shows::Several { .. } => {
                    let key = key_of(pixel, BUCKET_PX);
                    self.shared[key / 64] |= 1 << (key % 64);
                    self.run_of[key] = number as u32;
                }
            }
        }
        self.share_places.clear();
        self.share_places.resize(sub.seen.shares.len(), 0);
        (0..PIXELS / 64).for_each(|word| self.take_shares(sub, word));
    }

    /// The shares of up to 64 pixels, which are of one bucket.
    fn take_shares(&mut self, sub: &Subtile, word: usize) {
        let mut rest = self.shared[word];
        while rest != 0 {
            let key = word * 64 + rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let run = &sub.seen.runs[self.run_of[key] as usize];
            let Shows::Several { first, end } = run.shows else { continue };
            for k in first as usize..end as usize {
                let (at, normal) = sub.share([run.first.into(), run.row.into()], k);
                self.share_places[k] = self.points.add(key / (BUCKET_PX * BUCKET_PX), at, normal);
            }
        }
    }
}

/// The points at the centres of pixels.
pub(super) fn take_centers(points: &mut Points, sub: &Subtile, lift_m: f64) {
    let mut at: Row = [[0.0; SUBTILE_PX]; 3];
    let mut is_first = true;
    points.restart(lift_m, None);
    sub.center_runs(|pixel, count, surface| {
        if std::mem::take(&mut is_first) {
            points.restart(lift_m, Some(sub.center(pixel, surface)));
        }
        sub.locator.row(pixel, count, &surface.depth, &mut at);
        points.put_row(pixel, count, &at, surface.geometric_normal());
    });
}
