//! Where ambient occlusion is found: a point for each plane that two by two pixels show.

use map3d_base::RAY_LIFT_M;
use map3d_trace::SUBTILE_PX;

use super::place::Row;
use super::planes::Planes;
use super::points::Points;
use super::subtile::Subtile;
use crate::seen::Shows;

pub(super) struct Quads {
    pub points: Points,
    /// Of each plane, where its point is.
    pub places: Vec<u32>,
    /// The planes of whole pixels, and those of shares.
    of_pixel: Vec<u32>,
    of_share: Vec<u32>,
    planes: Planes,
}

impl Default for Quads {
    fn default() -> Self {
        let of_pixel = vec![0; SUBTILE_PX * SUBTILE_PX];
        Self { points: Points::default(), places: Vec::new(), of_pixel, of_share: Vec::new(), planes: Planes::default() }
    }
}

impl Quads {
    /// The plane of whole pixel (i, j).
    pub fn of_pixel(&self, i: usize, j: usize) -> usize {
        self.of_pixel[j * SUBTILE_PX + i] as usize
    }

    /// The plane of a share.
    pub fn of_share(&self, share: usize) -> usize {
        self.of_share[share] as usize
    }

    pub fn take(&mut self, sub: &Subtile) {
        self.planes.clear();
        self.of_share.clear();
        let mut at: Row = [[0.0; SUBTILE_PX]; 3];
        for run in &sub.seen.runs {
            let (pixel, count) = ([run.columns().start, run.row.into()], run.columns().len());
            match run.shows {
                Shows::One(surface) => {
                    let surface = &sub.shaded[surface as usize];
                    sub.locator.row(pixel, count, &surface.depth, &mut at);
                    self.add_row(pixel, count, &at, surface.geometric_normal());
                }
                Shows::Several { first, end } => {
                    for k in first as usize..end as usize {
                        let (at, normal) = sub.share(pixel, k);
                        self.of_share.push(self.planes.add(pixel, at, normal, sub.seen.shares[k].samples));
                    }
                }
            }
        }
        self.place();
    }

    fn add_row(&mut self, [i, j]: [usize; 2], count: usize, at: &Row, normal: [f64; 3]) {
        for k in 0..count {
            let plane = self.planes.add([i + k, j], [at[0][k], at[1][k], at[2][k]], normal, 16);
            self.of_pixel[j * SUBTILE_PX + i + k] = plane;
        }
    }

    fn place(&mut self) {
        let Self { points, places, planes, .. } = self;
        points.restart(RAY_LIFT_M, planes.all.first().map(|plane| plane.at));
        places.clear();
        places.resize(planes.all.len(), 0);
        for (bucket, number) in planes.in_order() {
            let plane = &planes.all[number as usize];
            places[number as usize] = points.add(bucket, plane.at, plane.normal);
        }
    }
}
