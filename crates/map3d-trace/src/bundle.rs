//! Bundles: up to 64 parallel rays at once, for shadows, ambient occlusion and what lies behind. A bundle goes down the trees as one box; triangles are
//! tested against all of its rays, in coordinates along and across them (spec/pyramid.md §10).
//!
//! `Surroundings` keeps what rays from some part of the scene can meet, `Bundles` sees it along one direction, a `Patch` is where a bundle starts.

mod descent;
mod dispatch;
mod patch;
mod rays;
mod view;

use std::sync::Arc;

use map3d_base::vec3::{cross, dot, normalized};
use map3d_base::{Box3, Error, Isa, RAY_LIFT_M, Result, Vec3, ViewAxes};
use map3d_scene::lattice::{STEPS_PER_M, snap};
use map3d_scene::{Chunk, InstanceRecord, SceneStore};

use crate::beam::boxes::BoxMap;
use crate::cutout::Cutout;
use descent::{Descent, Met};
pub use patch::{Openness, Patch, RAYS};
use rays::{Aim, RayLanes};
use view::{Crowd, PartView};

/// A part that rays may meet.
pub(crate) struct NearPart {
    pub chunk: Arc<Chunk>,
    pub instance: Option<(u32, InstanceRecord)>,
}

/// The parts of a scene around a patch of it, opened.
pub struct Surroundings {
    /// Rays and corners are taken relative to this lattice point.
    center: Vec3,
    parts: Vec<NearPart>,
    crowd: Crowd,
}

impl Surroundings {
    /// The lattice point next to a local point.
    pub fn center_near(p: Vec3) -> Vec3 {
        snap(p).map(|v| v as f64 / STEPS_PER_M)
    }

    /// `center`: a local lattice point, near where the rays start; `meets`: whether they can meet anything in a local box. Fails for another center, and
    /// for a chunk that cannot be read.
    pub fn gather(scene: &SceneStore, center: Vec3, mut meets: impl FnMut(&Box3) -> bool) -> Result<Self> {
        if Self::center_near(center) != center {
            return Err(Error::argument(format!("bundle around {center:?}: no point of the lattice")));
        }
        let mut numbers = Vec::new();
        scene.candidate_parts(&mut meets, &mut numbers);
        numbers.sort_unstable();
        let all = scene.parts();
        numbers.retain(|k| meets(&all[*k as usize].bounds));
        let open = |k: &u32| {
            let part = &all[*k as usize];
            let instance = part.instance.map(|i| (i, scene.instances()[i as usize]));
            scene.chunk(part.chunk).map(|chunk| NearPart { chunk, instance })
        };
        let parts = numbers.iter().map(open).collect::<Result<Vec<_>>>()?;
        let crowd = Crowd::new(center, numbers.iter().map(|k| &all[*k as usize].bounds));
        Ok(Self { center, parts, crowd })
    }

    /// All that lies within `radius_m` of a local box.
    pub fn within(scene: &SceneStore, center: Vec3, bounds: &Box3, radius_m: f64) -> Result<Self> {
        let meets = |b: &Box3| (0..3).all(|k| b.lo[k] <= bounds.hi[k] + radius_m && b.hi[k] >= bounds.lo[k] - radius_m);
        Self::gather(scene, center, meets)
    }

    /// All that rays of a direction can meet that start in a local box, or `RAY_LIFT_M` beside it.
    pub fn ahead(scene: &SceneStore, center: Vec3, bounds: &Box3, direction: Vec3) -> Result<Self> {
        let axes = across(direction)?;
        let span = |axis: Vec3, b: &Box3| {
            let (middle, half) = (dot(axis, b.center()), b.half_extents());
            let half = (0..3).map(|k| axis[k].abs() * half[k]).sum::<f64>() + RAY_LIFT_M;
            [middle - half, middle + half]
        };
        let meets = |b: &Box3| {
            let [right, up, along] = [axes.right, axes.up, axes.forward].map(|a| (span(a, b), span(a, bounds)));
            let both = |(a, b): ([f64; 2], [f64; 2])| a[0] <= b[1] && a[1] >= b[0];
            both(right) && both(up) && along.0[1] >= along.1[0]
        };
        Self::gather(scene, center, meets)
    }

    /// Local; what patches count from.
    pub fn center(&self) -> Vec3 {
        self.center
    }

    /// Rays meet nothing.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// For rays along a local direction of any length. `width_m`: over which cut-outs are filtered. Fails for a direction of zero, and for an instruction
    /// set that this machine does not have.
    pub fn along(&self, direction: Vec3, width_m: f64, isa: Isa) -> Result<Bundles<'_>> {
        let axes = across(direction)?;
        if !Isa::available().contains(&isa) {
            return Err(Error::argument(format!("{isa:?}: this machine does not have it")));
        }
        let views = self.parts.iter().map(|p| PartView::new(p, self.center, &axes)).collect();
        let crowd = self.crowd.map(&axes);
        Ok(Bundles { around: self, axes, width_m: width_m.max(1e-6), isa, crowd, views, rays: RayLanes::new(), stack: Vec::new(), met: Vec::new() })
    }
}

/// A direction with axes across it.
fn across(direction: Vec3) -> Result<ViewAxes> {
    let Some(forward) = normalized(direction) else { return Err(Error::argument("bundle: its direction must not be zero")) };
    let right = normalized(cross(forward, [0.0, 0.0, 1.0])).unwrap_or([1.0, 0.0, 0.0]);
    Ok(ViewAxes { right, up: cross(right, forward), forward })
}

/// Which rays of a bundle were sent, and which of them met something; bit k for point k.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shadow {
    pub sent: u64,
    pub hit: u64,
}

/// What the rays of a bundle meet first.
#[derive(Clone, Debug)]
pub struct Nearest {
    /// Index into `triangles`; `None`: nothing.
    pub of_point: [Option<u32>; RAYS],
    /// Local corners.
    pub triangles: Vec<[Vec3; 3]>,
}

/// Traces bundles of one direction.
pub struct Bundles<'a> {
    around: &'a Surroundings,
    axes: ViewAxes,
    width_m: f64,
    isa: Isa,
    crowd: BoxMap,
    views: Vec<PartView>,
    rays: RayLanes,
    stack: Vec<descent::Entry>,
    met: Vec<Met>,
}

impl Bundles<'_> {
    /// Sends a ray from each point whose surface faces the direction; it meets what lies up to `far_m` ahead.
    pub fn any_hit(&mut self, patch: &Patch, far_m: f64, cutout: &dyn Cutout) -> Shadow {
        self.run::<true>(patch, [0.0, far_m], true, cutout, None)
    }

    /// Sends the same rays, and adds to each point's openness the cosine between its normal and its ray: to `all` as it is, to `open` times the square of
    /// how far the ray comes, as a share of `far_m`.
    pub fn add_open(&mut self, patch: &Patch, far_m: f64, cutout: &dyn Cutout, openness: &mut Openness) {
        self.run::<false>(patch, [0.0, far_m], true, cutout, Some(openness));
    }

    /// Sends a ray from each point, and finds the triangle that it meets first beyond `near_m`.
    pub fn nearest(&mut self, patch: &Patch, near_m: f64, cutout: &dyn Cutout) -> Nearest {
        self.run::<false>(patch, [near_m, f64::INFINITY], false, cutout, None);
        let mut out = Nearest { of_point: [None; RAYS], triangles: Vec::new() };
        let mut places = vec![None; self.met.len()];
        for (k, of_point) in out.of_point.iter_mut().enumerate() {
            let Some(met) = self.rays.found(k) else { continue };
            *of_point = *places[met as usize].get_or_insert_with(|| {
                out.triangles.push(self.corners(&self.met[met as usize]));
                Some(out.triangles.len() as u32 - 1)
            });
        }
        out
    }

    fn run<const ANY: bool>(
        &mut self,
        patch: &Patch,
        [near_m, far_m]: [f64; 2],
        facing: bool,
        cutout: &dyn Cutout,
        openness: Option<&mut Openness>,
    ) -> Shadow {
        let rows = [self.axes.right, self.axes.up, self.axes.forward].map(|r| r.map(|v| v as f32));
        let aim = Aim { rows, near_m: near_m as f32, far_m: far_m as f32, facing };
        let Self { around, axes, width_m, isa, crowd, views, rays, stack, met } = self;
        met.clear();
        let crowd = (crowd as &BoxMap, around.crowd.nodes.as_slice());
        let mut shadow = Shadow::default();
        let descent = Descent {
            parts: &around.parts,
            crowd,
            center: around.center,
            axes,
            width_m: *width_m,
            views,
            rays,
            stack,
            met,
            cutout,
            patch,
            aim: &aim,
            openness,
            shadow: &mut shadow,
        };
        dispatch::run::<ANY>(descent, *isa);
        shadow
    }

    fn corners(&self, met: &Met) -> [Vec3; 3] {
        descent::local_corners(&self.around.parts[met.part as usize], met.leaf, met.lane as usize)
    }
}
