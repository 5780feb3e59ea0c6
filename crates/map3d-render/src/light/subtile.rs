//! A sub-tile in hand: what its pixels show, and where that lies.

use map3d_base::Vec3;
use map3d_trace::visbuf::{MIXED, NOTHING};
use map3d_trace::{Cutout, SUBTILE_PX, VisBuf};

use super::place::{Locator, Place};
use crate::paint::Shaded;
use crate::seen::{Seen, Shows};
use crate::shade::Shader;

pub(super) struct Subtile<'a> {
    pub vis: &'a VisBuf,
    pub shader: &'a Shader,
    pub seen: &'a Seen,
    pub shaded: &'a [Shaded],
    pub place: Place,
    pub locator: Locator,
    pub cutout: &'a dyn Cutout,
}

impl Subtile<'_> {
    /// Local point and geometric normal of a share of pixel (i, j).
    pub fn share(&self, [i, j]: [usize; 2], share: usize) -> (Vec3, Vec3) {
        let share = &self.seen.shares[share];
        let surface = &self.shaded[share.surface as usize];
        let [x, y] = [i as f64 + f64::from(share.at[0]) / 256.0, j as f64 + f64::from(share.at[1]) / 256.0];
        (self.locator.at(x, y, &surface.depth), surface.geometric_normal())
    }

    /// The first point, in the order of pixels; `None`: the sub-tile shows nothing.
    pub fn first(&self) -> Option<Vec3> {
        let run = self.seen.runs.first()?;
        let pixel = [run.first, run.row].map(usize::from);
        Some(match run.shows {
            Shows::One(surface) => self.center(pixel, &self.shaded[surface as usize]),
            Shows::Several { first, .. } => self.share(pixel, first as usize).0,
        })
    }

    /// Local point of a surface at the centre of pixel (i, j).
    pub fn center(&self, [i, j]: [usize; 2], surface: &Shaded) -> Vec3 {
        self.locator.at(i as f64 + 0.5, j as f64 + 0.5, &surface.depth)
    }

    /// The runs of pixels whose centres show one surface: first pixel (i, j), how many, which.
    pub fn center_runs(&self, mut each: impl FnMut([usize; 2], usize, &Shaded)) {
        for j in 0..SUBTILE_PX {
            let row = self.vis.row(j);
            let slot = |i: usize| if row[i] == MIXED { self.vis.mixed(i, j)[0] } else { row[i] };
            let mut first = 0;
            while first < SUBTILE_PX {
                let (shown, mut end) = (slot(first), first + 1);
                while end < SUBTILE_PX && slot(end) == shown {
                    end += 1;
                }
                if shown != NOTHING {
                    each([first, j], end - first, self.shader.surface_of(shown));
                }
                first = end;
            }
        }
    }
}
