//! What a view shows of a scene: half-spaces that cut triangles, and a selection of objects. Triangles are cut in local coordinates. An edge that two
//! triangles share is cut at the same point in both, so that no crack appears.

use std::sync::Arc;

use map3d_base::vec3::{add, dot, scale, sub};
use map3d_base::{Box3, Camera, CameraKind, Projection, Vec3};

/// Points with `a·x + b·y + c·z + d` ≥ 0.
pub(crate) type HalfSpace = [f64; 4];

/// Triangles beyond this distance from the image are cut, so that their corners fit the fast path of the rasteriser.
const GUARD_PX: f64 = 32_768.0;
/// Parts within this distance of a plane are cut by it, in the plane's unit (metres at most).
const MARGIN: f64 = 1e-3;
/// Most corners of a triangle that all planes have cut.
const CORNERS_MAX: usize = 16;

/// The visible space and the selected objects of a view.
#[derive(Clone, Debug, Default)]
pub struct ViewClip {
    planes: Vec<HalfSpace>,
    /// Sorted ids; `None`: all objects.
    objects: Option<Arc<[u32]>>,
}

impl ViewClip {
    /// Returns the space between a camera's near and far distance, within a local box. `objects`: sorted ids.
    pub fn new(camera: &Camera, view: &Projection, cut: Option<&Box3>, objects: Option<Arc<[u32]>>) -> Self {
        // Clip at near and far distance
        let forward = camera.axes.forward;
        let distance = dot(forward, camera.position);
        let mut planes = vec![half_space(forward, -(distance + camera.near_m)), half_space(scale(forward, -1.0), distance + camera.far_m)];

        // Clip far beside the image
        planes.extend(guards(camera, view));

        // Clip at the box
        for axis in 0..3 {
            let Some(cut) = cut else { break };
            let unit = |sign: f64| {
                let mut normal = [0.0; 3];
                normal[axis] = sign;
                normal
            };
            planes.push(half_space(unit(1.0), -cut.lo[axis]));
            planes.push(half_space(unit(-1.0), cut.hi[axis]));
        }
        Self { planes, objects }
    }

    /// Returns whether a point is inside all planes.
    pub fn contains(&self, local: Vec3) -> bool {
        self.planes.iter().all(|plane| distance(plane, local) >= 0.0)
    }

    pub fn selects(&self, id: u32) -> bool {
        self.objects.as_ref().is_none_or(|ids| ids.binary_search(&id).is_ok())
    }

    /// Returns the planes that may cut a part with a local box; `None` if all of it is outside.
    pub(crate) fn for_part(&self, bounds: &Box3) -> Option<PartClip> {
        let (center, half) = (bounds.center(), bounds.half_extents());
        let mut planes = Vec::new();
        for plane in &self.planes {
            // Project the box onto the plane's normal
            let reach = (0..3).map(|k| plane[k].abs() * half[k]).sum::<f64>() + MARGIN;
            let middle = distance(plane, center);

            // Drop a part outside, and planes that contain all of it
            if middle < -reach {
                return None;
            }
            if middle < reach {
                planes.push(*plane);
            }
        }
        Some(PartClip { planes, objects: self.objects.clone() })
    }
}

fn half_space(normal: Vec3, constant: f64) -> HalfSpace {
    [normal[0], normal[1], normal[2], constant]
}

/// Returns half-spaces that reach `GUARD_PX` beyond the image.
fn guards(camera: &Camera, view: &Projection) -> Vec<HalfSpace> {
    // Enlarge the window
    let window = camera.window;
    let margin = camera.pixel().map(|side| side * GUARD_PX);
    let (left, right) = (window.left - margin[0], window.right + margin[0]);
    let (bottom, top) = (window.bottom - margin[1], window.top + margin[1]);

    // Put a plane through each of its edges
    let flip = |plane: HalfSpace| plane.map(|c| -c);
    match (camera.kind, view) {
        (CameraKind::Perspective, Projection::Perspective(p)) => vec![p.beside(left), flip(p.beside(right)), p.above(bottom), flip(p.above(top))],
        _ => {
            let axes = &camera.axes;
            let [u, v, _] = axes.uvd_from_local(camera.position);
            let beside = |axis: Vec3, least: f64| half_space(axis, -least);
            vec![beside(axes.right, u + left), flip(beside(axes.right, u + right)), beside(axes.up, v + bottom), flip(beside(axes.up, v + top))]
        }
    }
}

/// Returns the signed distance of a point times the length of the plane's normal; positive inside.
#[inline(always)]
fn distance(plane: &HalfSpace, p: Vec3) -> f64 {
    plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2] + plane[3]
}

/// The planes that cut a part, and the selected objects.
#[derive(Clone, Debug)]
pub(crate) struct PartClip {
    planes: Vec<HalfSpace>,
    objects: Option<Arc<[u32]>>,
}

impl PartClip {
    /// Returns whether all of the part is drawn as it is.
    pub fn is_trivial(&self) -> bool {
        self.planes.is_empty() && self.objects.is_none()
    }

    pub fn selects(&self, id: u32) -> bool {
        self.objects.as_ref().is_none_or(|ids| ids.binary_search(&id).is_ok())
    }

    /// Returns whether a triangle is inside all planes.
    pub fn contains(&self, corners: &[Vec3; 3]) -> bool {
        self.planes.iter().all(|plane| corners.iter().all(|p| distance(plane, *p) >= 0.0))
    }

    /// Returns the polygon that the planes leave of a triangle; fewer than three corners for none.
    pub fn cut(&self, corners: &[Vec3; 3]) -> Polygon {
        let mut polygon = Polygon { corners: [[0.0; 3]; CORNERS_MAX], count: 3 };
        polygon.corners[..3].copy_from_slice(corners);
        for plane in &self.planes {
            polygon = polygon.cut(plane);
            if polygon.count < 3 {
                break;
            }
        }
        polygon
    }
}

/// A convex polygon.
pub(crate) struct Polygon {
    corners: [Vec3; CORNERS_MAX],
    count: usize,
}

impl Polygon {
    pub fn corners(&self) -> &[Vec3] {
        &self.corners[..self.count]
    }

    /// Returns the part in a half-space, by the algorithm of Sutherland and Hodgman.
    fn cut(&self, plane: &HalfSpace) -> Self {
        let mut out = Self { corners: [[0.0; 3]; CORNERS_MAX], count: 0 };
        let mut push = |p: Vec3| {
            if out.count < CORNERS_MAX {
                out.corners[out.count] = p;
                out.count += 1;
            }
        };
        for k in 0..self.count {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % self.count]);
            let (da, db) = (distance(plane, a), distance(plane, b));
            // Keep a corner inside
            if da >= 0.0 {
                push(a);
            }
            // Add the point where the edge crosses the plane
            match (da >= 0.0, db >= 0.0) {
                (true, false) => push(crossing(a, da, b, db)),
                (false, true) => push(crossing(b, db, a, da)),
                _ => {}
            }
        }
        out
    }
}

/// Returns the point of an edge on a plane. The order of the arguments, inside first, makes it the same for both triangles that share the edge.
fn crossing(inside: Vec3, d_inside: f64, outside: Vec3, d_outside: f64) -> Vec3 {
    add(inside, scale(sub(outside, inside), d_inside / (d_inside - d_outside)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_box() -> PartClip {
        let planes = vec![
            [1.0, 0.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0, 1.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, -1.0, 0.0, 1.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, -1.0, 1.0],
        ];
        PartClip { planes, objects: None }
    }

    #[test]
    fn a_triangle_is_cut_to_a_box() {
        let clip = unit_box();
        let inside = [[0.1, 0.1, 0.5], [0.9, 0.1, 0.5], [0.1, 0.9, 0.5]];
        assert!(clip.contains(&inside) && clip.cut(&inside).corners() == inside);
        let large = [[-5.0, -5.0, 0.5], [9.0, -5.0, 0.5], [-5.0, 9.0, 0.5]];
        let cut = clip.cut(&large);
        assert_eq!(cut.corners().len(), 4, "{:?}", cut.corners());
        assert!(cut.corners().iter().all(|p| p.iter().all(|c| (-1e-12..=1.0 + 1e-12).contains(c))));
        assert!(clip.cut(&[[2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [2.0, 1.0, 0.0]]).corners().len() < 3);
    }

    #[test]
    fn triangles_that_share_an_edge_share_its_cut() {
        let clip = unit_box();
        let (a, b) = ([0.3, 0.2, 0.1], [7.1, 3.3, 0.9]);
        let (left, right) = (clip.cut(&[a, b, [0.1, 0.8, 0.5]]), clip.cut(&[b, a, [0.9, 0.0, 0.2]]));
        let shared = left.corners().iter().filter(|p| right.corners().contains(p)).count();
        assert_eq!(shared, 2, "{:?} {:?}", left.corners(), right.corners());
    }
}
