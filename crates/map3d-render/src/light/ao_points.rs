//! The points at which ambient occlusion is computed: one for each plane that a quad of two by two pixels shows.

use map3d_base::{RAY_LIFT_M, Vec3};
use map3d_trace::SUBTILE_PX;

use super::quad_planes::QuadPlanes;
use super::ray_origins::RayOrigins;
use super::subtile::{ShadedSubtile, SurfacePoint};
use super::unprojection::PointRow;
use crate::fragments::RunContent;

pub(super) struct AoPoints {
    pub origins: RayOrigins,
    /// Index of each plane's point in `origins`.
    pub origin_of_plane: Vec<u32>,
    /// The planes of whole pixels and of fragments.
    plane_of_pixel: Vec<u32>,
    plane_of_fragment: Vec<u32>,
    planes: QuadPlanes,
}

impl Default for AoPoints {
    fn default() -> Self {
        Self {
            origins: RayOrigins::default(),
            origin_of_plane: Vec::new(),
            plane_of_pixel: vec![0; SUBTILE_PX * SUBTILE_PX],
            plane_of_fragment: Vec::new(),
            planes: QuadPlanes::default(),
        }
    }
}

impl AoPoints {
    /// Returns the plane of whole pixel (i, j).
    pub fn plane_of_pixel(&self, i: usize, j: usize) -> usize {
        self.plane_of_pixel[j * SUBTILE_PX + i] as usize
    }

    pub fn plane_of_fragment(&self, fragment: usize) -> usize {
        self.plane_of_fragment[fragment] as usize
    }

    /// Collects the planes of a sub-tile and their points.
    pub fn collect(&mut self, subtile: &ShadedSubtile) {
        self.planes.clear();
        self.plane_of_fragment.clear();
        let mut positions: PointRow = [[0.0; SUBTILE_PX]; 3];
        for run in &subtile.buffer.runs {
            let (pixel, count) = (run.pixel(), run.columns().len());
            match run.content {
                RunContent::Surface(surface) => {
                    let surface = &subtile.surfaces[surface as usize];
                    subtile.unprojection.row(pixel, count, &surface.depth, &mut positions);
                    self.add_row(pixel, count, &positions, surface.geometric_normal());
                }
                RunContent::Fragments { first, end } => {
                    for k in first as usize..end as usize {
                        let point = subtile.fragment_point(pixel, k);
                        self.plane_of_fragment.push(self.planes.add(pixel, &point, subtile.buffer.fragments[k].samples));
                    }
                }
            }
        }
        self.order_origins();
    }

    fn add_row(&mut self, [i, j]: [usize; 2], count: usize, positions: &PointRow, normal: Vec3) {
        for k in 0..count {
            let point = SurfacePoint { position: [positions[0][k], positions[1][k], positions[2][k]], normal };
            self.plane_of_pixel[j * SUBTILE_PX + i + k] = self.planes.add([i + k, j], &point, 16);
        }
    }

    /// Adds the planes' points to `origins`, in the order that makes packets compact.
    fn order_origins(&mut self) {
        let Self { origins, origin_of_plane, planes, .. } = self;
        origins.restart(RAY_LIFT_M, planes.all.first().map(|plane| plane.point.position));
        origin_of_plane.clear();
        origin_of_plane.resize(planes.all.len(), 0);
        for entry in planes.in_order() {
            let plane = &planes.all[entry.plane as usize];
            origin_of_plane[entry.plane as usize] = origins.push(entry.bucket, &plane.point);
        }
    }
}
