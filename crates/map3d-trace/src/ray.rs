//! Single rays through the same BVHs by the same rules as beams (spec/pyramid.md §4). Corners are projected along the ray in float64, a shared corner
//! equally in all its triangles, so that no ray slips through a shared edge.

use std::cmp::Ordering;
use std::sync::Arc;

use map3d_base::vec3::{cross, dot, normalized, scale, sub};
use map3d_base::{Box3, DEPTH_UNITS_PER_M, Error, Result, Vec3, ViewAxes, vec3};
use map3d_scene::records::{EMPTY, LEAF_BIT};
use map3d_scene::{Chunk, Leaf, Node, SceneStore};

use crate::cutout::{Cutout, CutoutSample};
use crate::depth_key::{BIAS_MAX, TieBreak, depth_bias};
use crate::part::LoadedPart;
use crate::projection::{ProjectedTriangle, depth_at, depth_gradient};
use crate::surface::{SurfaceAttributes, visible_normal};

/// A ray from a local point. `direction` need not be a unit vector; distances are in metres in any case.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    pub origin: Vec3,
    pub direction: Vec3,
    /// Width in metres over which cut-outs are filtered: a pixel's side for a ray through a pixel.
    pub width_m: f64,
}

/// The surface that a ray hits.
#[derive(Clone, Debug)]
pub struct Hit {
    /// Metres along the ray.
    pub distance_m: f64,
    /// Local position.
    pub position: Vec3,
    pub object_id: u32,
    /// Class rank.
    pub rank: u8,
    /// Geometric unit normal of the side that the ray hits, local axes.
    pub normal: Vec3,
    pub chunk: Arc<Chunk>,
    /// Index into `Chunk::triangles`.
    pub triangle: u32,
    /// Index into `SceneStore::instances`.
    pub instance: Option<u32>,
}

/// Which hits a query for several returns.
pub struct HitQuery<'a> {
    /// Most hits.
    pub count: usize,
    /// Growth of the ray's width per metre.
    pub spread: f64,
    /// Whether a hit of an object at a local position counts.
    pub accepts: &'a dyn Fn(u32, Vec3) -> bool,
}

/// Ray queries on a scene. Among the surfaces on a ray the winner is the same as in a beam: the least depth − bias, with depth in units from the ray's
/// origin. So a ray along a view's axis that starts on the plane D0 finds the surface that the pixel shows.
pub struct Rays<'s> {
    scene: &'s SceneStore,
}

impl<'s> Rays<'s> {
    pub fn new(scene: &'s SceneStore) -> Self {
        Self { scene }
    }

    /// Returns the winner among the surfaces at distances ≥ 0.
    pub fn closest_hit(&self, ray: &Ray, cutout: &dyn Cutout) -> Result<Option<Hit>> {
        let query = HitQuery { count: 1, spread: 0.0, accepts: &|_, _| true };
        Ok(self.first_hits(ray, &query, cutout)?.pop())
    }

    /// Returns the first surfaces at distances ≥ 0, in the order of the visibility rule.
    pub fn first_hits(&self, ray: &Ray, query: &HitQuery, cutout: &dyn Cutout) -> Result<Vec<Hit>> {
        let mut traversal = RayTraversal::new(ray, query, cutout, f64::INFINITY, false)?;
        if query.count > 0 {
            self.traverse_scene(&mut traversal)?;
        }
        Ok(traversal.best.into_iter().map(|ranked| ranked.hit).collect())
    }

    /// Returns whether the ray hits a surface at a distance in (0, max_m].
    pub fn any_hit(&self, ray: &Ray, max_m: f64, cutout: &dyn Cutout) -> Result<bool> {
        let query = HitQuery { count: 1, spread: 0.0, accepts: &|_, _| true };
        let mut traversal = RayTraversal::new(ray, &query, cutout, max_m, true)?;
        self.traverse_scene(&mut traversal)?;
        Ok(traversal.is_finished())
    }

    /// Traverses the parts that the ray enters, nearest first.
    fn traverse_scene(&self, traversal: &mut RayTraversal) -> Result<()> {
        // Find the parts whose boxes the ray enters.
        let mut numbers = Vec::new();
        let slabs = Slabs::new(traversal.ray.origin, traversal.ray.axes.forward);
        self.scene.candidate_parts(|b| slabs.enter(&grow(b)).is_some_and(|t| t <= traversal.limit_m), &mut numbers);
        let parts = self.scene.parts();
        let enter = |k: &u32| slabs.enter(&grow(&parts[*k as usize].bounds)).map(|t| (t, *k));
        let mut entered: Vec<(f64, u32)> = numbers.iter().filter_map(enter).collect();
        entered.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));

        // Traverse each until no other can win.
        for (t, number) in entered {
            if !traversal.can_win(t) {
                break;
            }
            traversal.traverse_part(&LoadedPart::load(self.scene, number)?);
            if traversal.is_finished() {
                break;
            }
        }
        Ok(())
    }
}

/// A ray with axes across it.
struct RayAxes {
    origin: Vec3,
    axes: ViewAxes,
    width_m: f64,
}

impl RayAxes {
    fn new(ray: &Ray) -> Result<Self> {
        let forward = normalized(ray.direction).filter(|_| ray.origin.iter().all(|v| v.is_finite()));
        let Some(forward) = forward else { return Err(Error::argument("ray: origin must be finite and direction must not be zero")) };
        let right = normalized(cross(forward, [0.0, 0.0, 1.0])).unwrap_or([1.0, 0.0, 0.0]);
        Ok(Self { origin: ray.origin, axes: ViewAxes { right, up: cross(right, forward), forward }, width_m: ray.width_m.max(1e-6) })
    }

    /// Returns metres right and down of the ray, and depth units along it.
    fn project(&self, p: Vec3) -> Vec3 {
        let [x, y, d] = self.axes.uvd_from_local(sub(p, self.origin));
        [x, -y, d * DEPTH_UNITS_PER_M]
    }
}

/// Returns whether the ray passes inside a projected triangle or on its edge, for either winding; never for a triangle seen edge-on.
fn contains_ray(p: &[Vec3; 3]) -> bool {
    let e = |a: usize, b: usize| p[a][0] * p[b][1] - p[a][1] * p[b][0];
    let edges = [e(0, 1), e(1, 2), e(2, 0)];
    let inside = edges.iter().all(|s| *s >= 0.0) || edges.iter().all(|s| *s <= 0.0);
    inside && edges.iter().any(|s| *s != 0.0)
}

/// The order of hits in the visibility rule; the least wins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct HitOrder {
    /// depth − bias.
    depth_key: i64,
    tie_break: TieBreak,
}

struct RankedHit {
    order: HitOrder,
    hit: Hit,
}

/// A node or leaf on the traversal stack, and the distance at which the ray enters its box.
struct RayEntry {
    near_m: f64,
    child: u32,
}

struct RayTraversal<'a> {
    ray: RayAxes,
    query: &'a HitQuery<'a>,
    cutout: &'a dyn Cutout,
    limit_m: f64,
    /// The first hit finishes the ray.
    any: bool,
    /// In order; at most `query.count`.
    best: Vec<RankedHit>,
}

impl<'a> RayTraversal<'a> {
    fn new(ray: &Ray, query: &'a HitQuery<'a>, cutout: &'a dyn Cutout, limit_m: f64, any: bool) -> Result<Self> {
        Ok(Self { ray: RayAxes::new(ray)?, query, cutout, limit_m, any, best: Vec::new() })
    }

    fn is_finished(&self) -> bool {
        self.any && !self.best.is_empty()
    }

    /// Returns the last hit if no more can be kept without dropping it.
    fn last_kept(&self) -> Option<&HitOrder> {
        self.best.last().map(|ranked| &ranked.order).filter(|_| self.best.len() >= self.query.count)
    }

    /// Returns whether a surface at `t` metres or beyond can still win.
    fn can_win(&self, t: f64) -> bool {
        let least_key = (t * DEPTH_UNITS_PER_M).floor() as i64 - BIAS_MAX - 1;
        t <= self.limit_m && self.last_kept().is_none_or(|last| least_key <= last.depth_key)
    }

    fn traverse_part(&mut self, part: &LoadedPart) {
        let slabs = self.slabs_in(part);
        let mut stack = vec![RayEntry { near_m: 0.0, child: 0 }];
        while let Some(RayEntry { near_m, child }) = stack.pop() {
            if !self.can_win(near_m) {
                continue;
            }
            if child & LEAF_BIT != 0 {
                self.intersect_leaf(part, &part.chunk.leaves()[(child & !LEAF_BIT) as usize]);
                if self.is_finished() {
                    return;
                }
            } else {
                push_children(&slabs, &part.chunk.nodes()[child as usize], &mut stack);
            }
        }
    }

    /// Returns the ray in the frame of the chunk's origin, or `None` if the placement flattens its prototype.
    fn slabs_in(&self, part: &LoadedPart) -> Option<Slabs> {
        let (origin, direction) = match part.transform() {
            None => (self.ray.origin, self.ray.axes.forward),
            Some(t) => transform_to_prototype(t, self.ray.origin, self.ray.axes.forward)?,
        };
        Some(Slabs::new(sub(origin, part.chunk.origin()), direction))
    }

    fn intersect_leaf(&mut self, part: &LoadedPart, leaf: &Leaf) {
        for lane in (0..8).take_while(|l| leaf.triangle[*l] != EMPTY) {
            let local = part.triangle_corners(leaf, lane);
            let pixel = local.map(|p| self.ray.project(p));
            if contains_ray(&pixel) {
                self.consider_hit(part, leaf.triangle[lane], &local, &pixel);
            }
        }
    }

    /// Keeps a triangle that the ray passes through if it is the best so far.
    fn consider_hit(&mut self, part: &LoadedPart, triangle: u32, local: &[Vec3; 3], pixel: &[Vec3; 3]) {
        // Distance along the ray.
        let depth = depth_at(pixel, 0.0, 0.0);
        let distance_m = depth / DEPTH_UNITS_PER_M;
        let is_within = if self.any { distance_m > 0.0 && distance_m <= self.limit_m } else { distance_m >= 0.0 };
        if !is_within {
            return;
        }

        // The visibility rule.
        let record = &part.chunk.triangles()[triangle as usize];
        let gradient = depth_gradient(pixel).unwrap_or([f64::INFINITY, 0.0]);
        let depth_key = (depth + 0.5).floor() as i64 - depth_bias(gradient, record.rank, [DEPTH_UNITS_PER_M; 2]);
        let object_id = part.object_id(record);
        let order = HitOrder { depth_key, tie_break: TieBreak::new(record.rank, object_id, record.source, part.number, triangle) };
        if self.last_kept().is_some_and(|last| *last <= order) {
            return;
        }
        let position = vec3::add(self.ray.origin, scale(self.ray.axes.forward, distance_m));
        if !(self.query.accepts)(object_id, position) || !self.is_covered(part, triangle, local, distance_m) {
            return;
        }

        // Keep the hit in its place.
        let normal = visible_normal(local, self.ray.axes.forward);
        let (chunk, instance) = (part.chunk.clone(), part.instance.as_ref().map(|i| i.number));
        let hit = Hit { distance_m, position, object_id, rank: record.rank, normal, chunk, triangle, instance };
        let at = self.best.partition_point(|ranked| ranked.order <= order);
        self.best.insert(at, RankedHit { order, hit });
        self.best.truncate(self.query.count);
    }

    /// Returns whether the ray hits a triangle where it is not cut out.
    fn is_covered(&self, part: &LoadedPart, triangle: u32, local: &[Vec3; 3], distance_m: f64) -> bool {
        let material = &part.chunk.materials()[part.chunk.triangles()[triangle as usize].material as usize];
        if !material.is_cutout() {
            return true;
        }
        let width_m = self.ray.width_m + self.query.spread * distance_m;
        let pixel = local.map(|p| {
            let [x, y, d] = self.ray.project(p);
            [x / width_m, y / width_m, d]
        });
        let projected = ProjectedTriangle { local: *local, pixel, forward: self.ray.axes.forward };
        let [u, v] = SurfaceAttributes::new(part, 0, triangle, &projected).uv;
        self.cutout.covers(material, &CutoutSample { uv: [u.at0, v.at0], footprint: [[u.dx, v.dx], [u.dy, v.dy]] })
    }
}

/// Pushes the children that the ray enters, the nearest on top; all of them if there are no slabs.
fn push_children(slabs: &Option<Slabs>, node: &Node, stack: &mut Vec<RayEntry>) {
    let first = stack.len();
    for k in (0..8).filter(|k| node.child[*k] != EMPTY) {
        let b = [0, 1, 2, 3, 4, 5].map(|a| f64::from(node.bounds[a][k]));
        let bounds = grow(&Box3 { lo: [b[0], b[1], b[2]], hi: [b[3], b[4], b[5]] });
        let enter = slabs.as_ref().map_or(Some(0.0), |s| s.enter(&bounds));
        stack.extend(enter.map(|near_m| RayEntry { near_m, child: node.child[k] }));
    }
    stack[first..].sort_unstable_by(|a, b| (b.near_m, b.child).partial_cmp(&(a.near_m, a.child)).unwrap_or(Ordering::Equal));
}

/// Returns the box with a margin for rounding.
fn grow(b: &Box3) -> Box3 {
    const MARGIN_M: f64 = 1e-6;
    let moved = |v: f64, sign: f64| v + sign * (MARGIN_M + v.abs() * 1e-12);
    Box3 { lo: b.lo.map(|v| moved(v, -1.0)), hi: b.hi.map(|v| moved(v, 1.0)) }
}

/// A ray for intersection with axis-aligned boxes.
struct Slabs {
    origin: Vec3,
    inverse: Vec3,
}

impl Slabs {
    /// `direction` need not be a unit vector; its length is the unit of ray parameters.
    fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, inverse: direction.map(|d| if d.abs() < 1e-200 { 1e200f64.copysign(d) } else { 1.0 / d }) }
    }

    /// Returns the parameter ≥ 0 at which the ray enters a box, or `None` if it misses.
    fn enter(&self, b: &Box3) -> Option<f64> {
        let (mut from, mut to) = (0f64, f64::INFINITY);
        for k in 0..3 {
            let (a, b) = ((b.lo[k] - self.origin[k]) * self.inverse[k], (b.hi[k] - self.origin[k]) * self.inverse[k]);
            from = from.max(a.min(b));
            to = to.min(a.max(b));
        }
        // A margin, so that a rounding error along the ray does not lose a box.
        (from * (1.0 - 1e-12) <= to * (1.0 + 1e-12)).then_some(from * (1.0 - 1e-12))
    }
}

/// Returns origin and direction in a prototype's frame. Parameters along the ray remain metres in the local frame.
fn transform_to_prototype(t: &[f64; 12], origin: Vec3, direction: Vec3) -> Option<(Vec3, Vec3)> {
    let column = |k: usize| [t[k], t[k + 4], t[k + 8]];
    let (a, b, c) = (column(0), column(1), column(2));
    let rows = [cross(b, c), cross(c, a), cross(a, b)];
    let inverse = 1.0 / dot(a, rows[0]);
    let multiply = |v: Vec3| rows.map(|r| dot(r, v) * inverse);
    let (origin, direction) = (multiply(sub(origin, column(3))), multiply(direction));
    origin.iter().chain(&direction).all(|v| v.is_finite()).then_some((origin, direction))
}
