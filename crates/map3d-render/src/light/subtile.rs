//! A shaded sub-tile as input of light: its visible surfaces and their local points.

use map3d_base::Vec3;
use map3d_trace::{Cutout, MIXED, NOTHING, SUBTILE_PX, VisBuf};

use super::unprojection::{SubtilePosition, Unprojection};
use crate::fragments::{FragmentBuffer, RunContent};
use crate::material::PreparedSurface;
use crate::shade::Shader;

pub(super) struct ShadedSubtile<'a> {
    pub vis: &'a VisBuf,
    pub shader: &'a Shader,
    pub buffer: &'a FragmentBuffer,
    pub surfaces: &'a [PreparedSurface],
    pub position: SubtilePosition,
    pub unprojection: Unprojection,
    pub cutout: &'a dyn Cutout,
}

/// A local point and the geometric unit normal of its surface.
#[derive(Clone, Copy)]
pub(super) struct SurfacePoint {
    pub position: Vec3,
    pub normal: Vec3,
}

impl ShadedSubtile<'_> {
    /// Returns the centroid of a fragment of pixel (i, j).
    pub fn fragment_point(&self, [i, j]: [usize; 2], fragment: usize) -> SurfacePoint {
        let fragment = &self.buffer.fragments[fragment];
        let surface = &self.surfaces[fragment.surface as usize];
        let [x, y] = [i as f64 + f64::from(fragment.centroid[0]) / 256.0, j as f64 + f64::from(fragment.centroid[1]) / 256.0];
        SurfacePoint { position: self.unprojection.point(x, y, &surface.depth), normal: surface.geometric_normal() }
    }

    /// Returns the local point of a surface at the centre of pixel (i, j).
    pub fn center_point(&self, [i, j]: [usize; 2], surface: &PreparedSurface) -> Vec3 {
        self.unprojection.point(i as f64 + 0.5, j as f64 + 0.5, &surface.depth)
    }

    /// Returns the first local point in the order of pixels, or `None` for an empty sub-tile.
    pub fn first_point(&self) -> Option<Vec3> {
        let run = self.buffer.runs.first()?;
        Some(match run.content {
            RunContent::Surface(surface) => self.center_point(run.pixel(), &self.surfaces[surface as usize]),
            RunContent::Fragments { first, .. } => self.fragment_point(run.pixel(), first as usize).position,
        })
    }

    /// Returns the depth in units of the first point.
    pub fn first_depth(&self) -> Option<f64> {
        let run = self.buffer.runs.first()?;
        let surface = match run.content {
            RunContent::Surface(surface) => surface,
            RunContent::Fragments { first, .. } => self.buffer.fragments[first as usize].surface,
        };
        let [i, j] = run.pixel();
        Some(self.surfaces[surface as usize].depth.at(i as f64 + 0.5, j as f64 + 0.5))
    }

    /// Calls `visit` for each run of pixels whose centres show one surface: first pixel (i, j), number of pixels, surface.
    pub fn for_each_center_run(&self, mut visit: impl FnMut([usize; 2], usize, &PreparedSurface)) {
        for j in 0..SUBTILE_PX {
            let row = self.vis.row(j);
            let slot_of = |i: usize| if row[i] == MIXED { self.vis.mixed(i, j)[0] } else { row[i] };
            let mut first = 0;
            while first < SUBTILE_PX {
                let (slot, mut end) = (slot_of(first), first + 1);
                while end < SUBTILE_PX && slot_of(end) == slot {
                    end += 1;
                }
                if slot != NOTHING {
                    visit([first, j], end - first, self.shader.surface_of_slot(slot));
                }
                first = end;
            }
        }
    }
}
