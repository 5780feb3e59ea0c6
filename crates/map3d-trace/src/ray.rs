//! Single rays through the same trees, by the same rules (spec/pyramid.md §4). Corners are projected along the ray in float64, each corner the same way
//! in all its triangles, so a ray never slips through a shared edge.

use std::cmp::Ordering;
use std::sync::Arc;

use map3d_base::vec3::{cross, dot, normalized, scale, sub};
use map3d_base::{Box3, DEPTH_UNITS_PER_M, Error, Result, Vec3, ViewAxes, vec3};
use map3d_scene::instances::place;
use map3d_scene::records::{EMPTY, LEAF_BIT};
use map3d_scene::{Chunk, InstanceRecord, Leaf, Node, SceneStore};

use crate::beam::project::{depth_gradient, depth_of_plane};
use crate::beam::shape::{BIAS_MAX, bias};
use crate::cutout::{Cutout, CutoutSample};
use crate::surface::{Placed, Surface, seen_normal};

/// A ray from a local point. `direction` need not be a unit vector; distances are in metres all the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    pub origin: Vec3,
    pub direction: Vec3,
    /// Width in metres over which cut-outs are filtered; a pixel's side for rays that stand for a pixel.
    pub width_m: f64,
}

/// What a ray meets.
#[derive(Clone, Debug)]
pub struct Hit {
    /// Metres along the ray.
    pub distance_m: f64,
    /// Local position.
    pub position: Vec3,
    pub object_id: u32,
    pub rank: u8,
    /// Geometric unit normal of the side that the ray meets, local axes.
    pub normal: Vec3,
    pub chunk: Arc<Chunk>,
    /// Index into `Chunk::triangles`.
    pub triangle: u32,
    /// Index into `SceneStore::instances`.
    pub instance: Option<u32>,
}

/// Ray queries on a scene. Of all that a ray meets, the winner is as in a beam: the least depth − bias, depth counted in units from the ray's origin. A
/// ray along a view's axis that starts on its plane D0 therefore finds what the pixel there shows.
pub struct Rays<'s> {
    scene: &'s SceneStore,
}

/// Less wins.
type Order = (i64, u8, u32, u32, u32, u32);

impl<'s> Rays<'s> {
    pub fn new(scene: &'s SceneStore) -> Self {
        Self { scene }
    }

    /// The surface that wins among those the ray meets at distances ≥ 0.
    pub fn closest(&self, ray: &Ray, cutout: &dyn Cutout) -> Result<Option<Hit>> {
        let mut search = Search { line: Line::new(ray)?, cutout, limit_m: f64::INFINITY, any: false, best: None };
        self.run(&mut search)?;
        Ok(search.best.map(|(_, hit)| hit))
    }

    /// Whether the ray meets anything at a distance in (0, max_m].
    pub fn any_hit(&self, ray: &Ray, max_m: f64, cutout: &dyn Cutout) -> Result<bool> {
        let mut search = Search { line: Line::new(ray)?, cutout, limit_m: max_m, any: true, best: None };
        self.run(&mut search)?;
        Ok(search.best.is_some())
    }

    fn run(&self, search: &mut Search) -> Result<()> {
        let mut numbers = Vec::new();
        let slabs = Slabs::new(search.line.origin, search.line.axes.forward);
        self.scene.candidate_parts(|b| slabs.enter(&grown(b)).is_some_and(|t| t <= search.limit_m), &mut numbers);
        let parts = self.scene.parts();
        let enter = |k: &u32| slabs.enter(&grown(&parts[*k as usize].bounds)).map(|t| (t, *k));
        let mut near: Vec<(f64, u32)> = numbers.iter().filter_map(enter).collect();
        near.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
        for (t, number) in near {
            if !search.can_win(t) {
                break;
            }
            let part = &parts[number as usize];
            let chunk = self.scene.chunk(part.chunk)?;
            let instance = part.instance.map(|k| (k, &self.scene.instances()[k as usize]));
            search.part(&chunk, number, instance);
            if search.any && search.best.is_some() {
                break;
            }
        }
        Ok(())
    }
}

/// A ray with axes across it.
struct Line {
    origin: Vec3,
    axes: ViewAxes,
    width_m: f64,
}

impl Line {
    fn new(ray: &Ray) -> Result<Self> {
        let forward = normalized(ray.direction).filter(|_| ray.origin.iter().all(|v| v.is_finite()));
        let Some(forward) = forward else { return Err(Error::argument("ray: origin must be finite and direction must not be zero")) };
        let right = normalized(cross(forward, [0.0, 0.0, 1.0])).unwrap_or([1.0, 0.0, 0.0]);
        Ok(Self { origin: ray.origin, axes: ViewAxes { right, up: cross(right, forward), forward }, width_m: ray.width_m.max(1e-6) })
    }

    /// Metres right and down of the ray, and depth units along it.
    fn pixel(&self, p: Vec3) -> Vec3 {
        let [x, y, d] = self.axes.uvd_from_local(sub(p, self.origin));
        [x, -y, d * DEPTH_UNITS_PER_M]
    }
}

/// Inside or on an edge, whichever way round; a triangle seen edge-on is not met.
fn is_met(p: &[Vec3; 3]) -> bool {
    let e = |a: usize, b: usize| p[a][0] * p[b][1] - p[a][1] * p[b][0];
    let sides = [e(0, 1), e(1, 2), e(2, 0)];
    let inside = sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0);
    inside && sides.iter().any(|s| *s != 0.0)
}

struct Search<'a> {
    line: Line,
    cutout: &'a dyn Cutout,
    limit_m: f64,
    any: bool,
    best: Option<(Order, Hit)>,
}

/// The part at hand.
struct Visit<'a> {
    chunk: &'a Arc<Chunk>,
    number: u32,
    instance: Option<(u32, &'a InstanceRecord)>,
}

impl Search<'_> {
    /// Whether something at `t` metres or beyond can still win.
    fn can_win(&self, t: f64) -> bool {
        let least = (t * DEPTH_UNITS_PER_M).floor() as i64 - BIAS_MAX - 1;
        t <= self.limit_m && self.best.as_ref().is_none_or(|(order, _)| least <= order.0)
    }

    fn part(&mut self, chunk: &Arc<Chunk>, number: u32, instance: Option<(u32, &InstanceRecord)>) {
        let visit = Visit { chunk, number, instance };
        let slabs = self.slabs_in(chunk, instance.map(|i| &i.1.transform));
        let mut stack = vec![(0.0, 0u32)];
        while let Some((t, child)) = stack.pop() {
            if !self.can_win(t) {
                continue;
            }
            if child & LEAF_BIT != 0 {
                let number = child & !LEAF_BIT;
                self.leaf(&visit, &chunk.leaves()[number as usize]);
                if self.any && self.best.is_some() {
                    return;
                }
            } else {
                push_children(&slabs, &chunk.nodes()[child as usize], &mut stack);
            }
        }
    }

    /// The ray in the frame of the chunk's origin, for boxes; `None` when the placement flattens its prototype.
    fn slabs_in(&self, chunk: &Chunk, transform: Option<&[f64; 12]>) -> Option<Slabs> {
        let (origin, direction) = match transform {
            None => (self.line.origin, self.line.axes.forward),
            Some(t) => unplace(t, self.line.origin, self.line.axes.forward)?,
        };
        Some(Slabs::new(sub(origin, chunk.origin()), direction))
    }

    fn leaf(&mut self, visit: &Visit, leaf: &Leaf) {
        let origin = visit.chunk.origin();
        for lane in (0..8).take_while(|l| leaf.triangle[*l] != EMPTY) {
            let local = [0, 3, 6].map(|c| {
                let p = [0, 1, 2].map(|k| origin[k] + f64::from(leaf.corners[c + k][lane]));
                visit.instance.map_or(p, |i| place(&i.1.transform, p))
            });
            let pixel = local.map(|p| self.line.pixel(p));
            if is_met(&pixel) {
                self.meet(visit, leaf.triangle[lane], &local, &pixel);
            }
        }
    }

    fn meet(&mut self, visit: &Visit, triangle: u32, local: &[Vec3; 3], pixel: &[Vec3; 3]) {
        let depth = depth_of_plane(pixel, 0.0, 0.0);
        let distance_m = depth / DEPTH_UNITS_PER_M;
        let in_reach = if self.any { distance_m > 0.0 && distance_m <= self.limit_m } else { distance_m >= 0.0 };
        if !in_reach {
            return;
        }
        let record = &visit.chunk.triangles()[triangle as usize];
        let gradient = depth_gradient(pixel).unwrap_or([f64::INFINITY, 0.0]);
        let key = (depth + 0.5).floor() as i64 - bias(gradient, record.rank, DEPTH_UNITS_PER_M);
        let object_id = visit.instance.map_or_else(|| visit.chunk.objects()[record.object as usize].id, |i| i.1.object_id);
        let order = (key, u8::MAX - record.rank, object_id, record.source, visit.number, triangle);
        if self.best.as_ref().is_some_and(|b| b.0 <= order) || !self.is_there(visit, triangle, local) {
            return;
        }
        let position = vec3::add(self.line.origin, scale(self.line.axes.forward, distance_m));
        let normal = seen_normal(local, &self.line.axes);
        let (chunk, instance) = (visit.chunk.clone(), visit.instance.map(|i| i.0));
        self.best = Some((order, Hit { distance_m, position, object_id, rank: record.rank, normal, chunk, triangle, instance }));
    }

    /// Not cut out.
    fn is_there(&self, visit: &Visit, triangle: u32, local: &[Vec3; 3]) -> bool {
        let material = &visit.chunk.materials()[visit.chunk.triangles()[triangle as usize].material as usize];
        if !material.is_cutout() {
            return true;
        }
        let pixel = local.map(|p| {
            let [x, y, d] = self.line.pixel(p);
            [x / self.line.width_m, y / self.line.width_m, d]
        });
        let placed = Placed { local: *local, pixel, axes: &self.line.axes };
        let [u, v] = Surface::new(0, visit.chunk, triangle, visit.instance, &placed).uv;
        self.cutout.covers(material, &CutoutSample { uv: [u.at0, v.at0], footprint: [[u.dx, v.dx], [u.dy, v.dy]] })
    }
}

/// Children that the ray meets, the nearest on top; all of them without slabs.
fn push_children(slabs: &Option<Slabs>, node: &Node, stack: &mut Vec<(f64, u32)>) {
    let first = stack.len();
    for k in (0..8).filter(|k| node.child[*k] != EMPTY) {
        let b = [0, 1, 2, 3, 4, 5].map(|a| f64::from(node.bounds[a][k]));
        let bounds = grown(&Box3 { lo: [b[0], b[1], b[2]], hi: [b[3], b[4], b[5]] });
        let enter = slabs.as_ref().map_or(Some(0.0), |s| s.enter(&bounds));
        stack.extend(enter.map(|t| (t, node.child[k])));
    }
    stack[first..].sort_unstable_by(|a, b| b.partial_cmp(a).unwrap_or(Ordering::Equal));
}

/// With room for rounding.
fn grown(b: &Box3) -> Box3 {
    const ROOM_M: f64 = 1e-6;
    let grow = |v: f64, sign: f64| v + sign * (ROOM_M + v.abs() * 1e-12);
    Box3 { lo: b.lo.map(|v| grow(v, -1.0)), hi: b.hi.map(|v| grow(v, 1.0)) }
}

/// A ray against axis-aligned boxes.
struct Slabs {
    origin: Vec3,
    inverse: Vec3,
}

impl Slabs {
    /// `direction` need not be a unit vector; parameters count in its lengths.
    fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, inverse: direction.map(|d| if d.abs() < 1e-200 { 1e200f64.copysign(d) } else { 1.0 / d }) }
    }

    /// Where the ray enters a box, at 0 or beyond.
    fn enter(&self, b: &Box3) -> Option<f64> {
        let (mut from, mut to) = (0f64, f64::INFINITY);
        for k in 0..3 {
            let (a, b) = ((b.lo[k] - self.origin[k]) * self.inverse[k], (b.hi[k] - self.origin[k]) * self.inverse[k]);
            from = from.max(a.min(b));
            to = to.min(a.max(b));
        }
        // A rounding error along the ray must not lose a box.
        (from * (1.0 - 1e-12) <= to * (1.0 + 1e-12)).then_some(from * (1.0 - 1e-12))
    }
}

/// Origin and direction in a prototype's frame; parameters along the ray stay metres in the local frame.
fn unplace(t: &[f64; 12], origin: Vec3, direction: Vec3) -> Option<(Vec3, Vec3)> {
    let column = |k: usize| [t[k], t[k + 4], t[k + 8]];
    let (a, b, c) = (column(0), column(1), column(2));
    let rows = [cross(b, c), cross(c, a), cross(a, b)];
    let inverse = 1.0 / dot(a, rows[0]);
    let moved = sub(origin, column(3));
    let turn = |v: Vec3| rows.map(|r| dot(r, v) * inverse);
    let (origin, direction) = (turn(moved), turn(direction));
    origin.iter().chain(&direction).all(|v| v.is_finite()).then_some((origin, direction))
}
