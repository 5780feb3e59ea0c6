//! The `dem:extent` of a relief: polygons outside of which it is not valid.

use map3d_base::Vec3;

use crate::city_model::geometry_arena::{GeometryArena, NodeId};

/// The rings of the polygons; a point in an odd number of them is inside.
pub struct ReliefExtent {
    rings: Vec<Vec<[f64; 2]>>,
}

impl ReliefExtent {
    /// `nodes`: the first node of the extent, and the one after the last.
    pub fn new(geometry: &GeometryArena, (first, end): (NodeId, NodeId)) -> Self {
        let rings = (first..end).flat_map(|node| geometry.polygon_rings(geometry.node(node).kind));
        Self { rings: rings.map(|ring| geometry.ring_points(ring).iter().map(|p| [p[0], p[1]]).collect()).collect() }
    }

    /// Whether the centroid of a triangle is inside.
    pub fn contains(&self, triangle: [Vec3; 3]) -> bool {
        let [x, y] = [0, 1].map(|k| triangle.iter().map(|p| p[k]).sum::<f64>() / 3.0);
        let crosses = |[ax, ay]: [f64; 2], [bx, by]: [f64; 2]| (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax);
        let edges = self.rings.iter().flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)));
        edges.filter(|(a, b)| crosses(**a, **b)).count() % 2 == 1
    }
}
