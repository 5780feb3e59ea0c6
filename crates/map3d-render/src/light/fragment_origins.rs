//! The ray origins of all fragments of a sub-tile, for layers that average over a pixel, and of the pixels' centres.

use map3d_base::RAY_LIFT_M;
use map3d_trace::SUBTILE_PX;

use super::ray_origins::{BUCKET_PX, RayOrigins, bucket_index};
use super::subtile::ShadedSubtile;
use super::unprojection::PointRow;
use crate::fragments::RunContent;

const PIXELS: usize = SUBTILE_PX * SUBTILE_PX;

pub(super) struct FragmentOrigins {
    pub origins: RayOrigins,
    /// Index of each fragment in `origins`.
    pub origin_of_fragment: Vec<u32>,
    /// Pixels with several fragments, by bucket index: a bit each, and their runs.
    mixed: [u64; PIXELS / 64],
    run_of_pixel: Vec<u32>,
}

impl Default for FragmentOrigins {
    fn default() -> Self {
        Self { origins: RayOrigins::default(), origin_of_fragment: Vec::new(), mixed: [0; PIXELS / 64], run_of_pixel: vec![0; PIXELS] }
    }
}

impl FragmentOrigins {
    /// Collects the origins of a sub-tile.
    pub fn collect(&mut self, subtile: &ShadedSubtile) {
        // Whole pixels, and a list of the others.
        self.origins.restart(RAY_LIFT_M, subtile.first_point());
        self.mixed.fill(0);
        let mut positions: PointRow = [[0.0; SUBTILE_PX]; 3];
        for (number, run) in subtile.buffer.runs.iter().enumerate() {
            let (pixel, count) = (run.pixel(), run.columns().len());
            match run.content {
                RunContent::Surface(surface) => {
                    let surface = &subtile.surfaces[surface as usize];
                    subtile.unprojection.row(pixel, count, &surface.depth, &mut positions);
                    self.origins.set_row(pixel, count, &positions, surface.geometric_normal());
                }
                RunContent::Fragments { .. } => {
                    let index = bucket_index(pixel, BUCKET_PX);
                    self.mixed[index / 64] |= 1 << (index % 64);
                    self.run_of_pixel[index] = number as u32;
                }
            }
        }

        // Fragments, bucket by bucket.
        self.origin_of_fragment.clear();
        self.origin_of_fragment.resize(subtile.buffer.fragments.len(), 0);
        (0..PIXELS / 64).for_each(|word| self.collect_fragments(subtile, word));
    }

    /// Collects the fragments of up to 64 pixels of one bucket.
    fn collect_fragments(&mut self, subtile: &ShadedSubtile, word: usize) {
        let mut rest = self.mixed[word];
        while rest != 0 {
            let index = word * 64 + rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let run = &subtile.buffer.runs[self.run_of_pixel[index] as usize];
            let RunContent::Fragments { first, end } = run.content else { continue };
            for k in first as usize..end as usize {
                let point = subtile.fragment_point(run.pixel(), k);
                self.origin_of_fragment[k] = self.origins.push(index / (BUCKET_PX * BUCKET_PX), &point);
            }
        }
    }
}

/// Collects the origins at the centres of pixels.
pub(super) fn collect_centers(origins: &mut RayOrigins, subtile: &ShadedSubtile, lift_m: f64) {
    let mut positions: PointRow = [[0.0; SUBTILE_PX]; 3];
    let mut is_first = true;
    origins.restart(lift_m, None);
    subtile.for_each_center_run(|pixel, count, surface| {
        if std::mem::take(&mut is_first) {
            origins.restart(lift_m, Some(subtile.center_point(pixel, surface)));
        }
        subtile.unprojection.row(pixel, count, &surface.depth, &mut positions);
        origins.set_row(pixel, count, &positions, surface.geometric_normal());
    });
}
