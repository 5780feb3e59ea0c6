//! What the pixels of a sub-tile show, for layers that rays make: runs of pixels in order, row after row.

use std::ops::Range;

/// Pixels without anything are in no run.
#[derive(Default)]
pub struct Seen {
    pub runs: Vec<Run>,
    /// Those of a pixel follow each other.
    pub shares: Vec<Share>,
}

/// Pixels `first..end` of a row.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    pub row: u8,
    pub first: u8,
    pub end: u8,
    pub shows: Shows,
}

#[derive(Clone, Copy, Debug)]
pub enum Shows {
    /// All samples of all pixels meet this one of the sub-tile's surfaces.
    One(u32),
    /// The samples of the only pixel meet several surfaces, or one and nothing: some of the shares.
    Several { first: u32, end: u32 },
}

/// A surface in a pixel: its colour there, and how many of the pixel's samples meet it.
#[derive(Clone, Copy, Debug)]
pub struct Share {
    /// Middle of those samples, in 1/256 px from the pixel's corner.
    pub at: [u8; 2],
    pub samples: u8,
    /// Index into the sub-tile's surfaces.
    pub surface: u32,
    /// Linear light; 0 when nobody asks for colours.
    pub color: [u16; 3],
}

impl Run {
    /// Columns of its pixels.
    pub fn columns(&self) -> Range<usize> {
        self.first.into()..self.end.into()
    }
}

impl Seen {
    pub fn clear(&mut self) {
        self.runs.clear();
        self.shares.clear();
    }

    pub fn push_run(&mut self, row: usize, first: usize, end: usize, surface: u32) {
        self.runs.push(Run { row: row as u8, first: first as u8, end: end as u8, shows: Shows::One(surface) });
    }

    /// Ends a pixel whose shares from `first` on have been pushed.
    pub fn end_pixel(&mut self, row: usize, column: usize, first: usize) {
        let end = self.shares.len();
        let shows = match &self.shares[first..] {
            [] => return,
            [only] if only.samples == 16 => Shows::One(only.surface),
            _ => Shows::Several { first: first as u32, end: end as u32 },
        };
        if let Shows::One(_) = shows {
            self.shares.truncate(first);
        }
        self.runs.push(Run { row: row as u8, first: column as u8, end: column as u8 + 1, shows });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share(samples: u8) -> Share {
        Share { at: [128; 2], samples, surface: u32::from(samples), color: [0; 3] }
    }

    #[test]
    fn a_pixel_of_one_surface_has_no_shares() {
        let mut seen = Seen::default();
        seen.push_run(3, 0, 5, 7);
        seen.shares.push(share(16));
        seen.end_pixel(3, 5, 0);
        assert!(seen.shares.is_empty() && matches!(seen.runs[1], Run { row: 3, first: 5, end: 6, shows: Shows::One(16) }));
        seen.shares.extend([share(4), share(5)]);
        seen.end_pixel(3, 6, 0);
        seen.shares.push(share(15));
        seen.end_pixel(3, 7, 2);
        assert!(
            matches!(seen.runs[2].shows, Shows::Several { first: 0, end: 2 }) && matches!(seen.runs[3].shows, Shows::Several { first: 2, end: 3 })
        );
        seen.end_pixel(3, 8, 3);
        assert_eq!((seen.runs.len(), seen.shares.len()), (4, 3));
    }
}
