//! The visible fragments of a sub-tile, as an A-buffer: runs of pixels that show one surface, and the surfaces within each pixel on an edge.

use std::ops::Range;

/// Runs in order, row by row. Empty pixels are in no run.
#[derive(Default)]
pub struct FragmentBuffer {
    pub runs: Vec<PixelRun>,
    /// The fragments of a pixel are consecutive.
    pub fragments: Vec<Fragment>,
}

/// Pixels `first..end` of a row.
#[derive(Clone, Copy, Debug)]
pub struct PixelRun {
    pub row: u8,
    pub first: u8,
    pub end: u8,
    pub content: RunContent,
}

#[derive(Clone, Copy, Debug)]
pub enum RunContent {
    /// All samples of all pixels show this surface of the sub-tile.
    Surface(u32),
    /// The run is one pixel. Its samples show several surfaces, or one surface and nothing: these fragments.
    Fragments { first: u32, end: u32 },
}

/// One surface within a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Fragment {
    /// Centroid of its samples in 1/256 px from the pixel's corner.
    pub centroid: [u8; 2],
    /// Number of the 16 samples that show it; a multiple where a pixel's colour is the mean of fewer.
    pub samples: u8,
    /// Index into the sub-tile's surfaces.
    pub surface: u32,
    /// Linear light; 0 if no layer needs colours.
    pub color: [u16; 3],
}

impl PixelRun {
    pub fn columns(&self) -> Range<usize> {
        self.first.into()..self.end.into()
    }

    /// The first pixel.
    pub fn pixel(&self) -> [usize; 2] {
        [self.first.into(), self.row.into()]
    }
}

impl FragmentBuffer {
    pub fn clear(&mut self) {
        self.runs.clear();
        self.fragments.clear();
    }

    pub fn push_run(&mut self, row: usize, first: usize, end: usize, surface: u32) {
        self.runs.push(PixelRun { row: row as u8, first: first as u8, end: end as u8, content: RunContent::Surface(surface) });
    }

    /// Finishes a pixel whose fragments are those from `first` on.
    pub fn finish_pixel(&mut self, row: usize, column: usize, first: usize) {
        let end = self.fragments.len();
        let content = match &self.fragments[first..] {
            [] => return,
            [only] if only.samples == 16 => RunContent::Surface(only.surface),
            _ => RunContent::Fragments { first: first as u32, end: end as u32 },
        };
        if let RunContent::Surface(_) = content {
            self.fragments.truncate(first);
        }
        self.runs.push(PixelRun { row: row as u8, first: column as u8, end: column as u8 + 1, content });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fragment(samples: u8) -> Fragment {
        Fragment { centroid: [128; 2], samples, surface: u32::from(samples), color: [0; 3] }
    }

    #[test]
    fn pixel_of_one_surface_has_no_fragments() {
        let mut buffer = FragmentBuffer::default();
        buffer.push_run(3, 0, 5, 7);
        buffer.fragments.push(fragment(16));
        buffer.finish_pixel(3, 5, 0);
        assert!(buffer.fragments.is_empty());
        assert!(matches!(buffer.runs[1], PixelRun { row: 3, first: 5, end: 6, content: RunContent::Surface(16) }));
        buffer.fragments.extend([fragment(4), fragment(5)]);
        buffer.finish_pixel(3, 6, 0);
        buffer.fragments.push(fragment(15));
        buffer.finish_pixel(3, 7, 2);
        assert!(matches!(buffer.runs[2].content, RunContent::Fragments { first: 0, end: 2 }));
        assert!(matches!(buffer.runs[3].content, RunContent::Fragments { first: 2, end: 3 }));
        buffer.finish_pixel(3, 8, 3);
        assert_eq!((buffer.runs.len(), buffer.fragments.len()), (4, 3));
    }
}
