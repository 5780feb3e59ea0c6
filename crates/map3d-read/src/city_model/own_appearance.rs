//! Appearances of surfaces that contain their material or texture, such as the `TexturedSurface` of CityGML 0.4 and 1.0.

use super::appearance::{Appearances, Parameterization, Resolution, RingTexCoords, SurfaceData};
use super::geometry_arena::{GeometryArena, NO_NODE, NodeId, NodeKind, OwnAppearance};
use super::ids::{self, Id, hash_id};

/// Adds the appearances inside textured surfaces to those of the city object, as if they targeted these surfaces in the selected theme.
pub fn add_own_appearances(geometry: &mut GeometryArena, appearances: &mut Appearances) {
    for OwnAppearance { node, is_front, kind, uvs } in std::mem::take(&mut geometry.own_appearances) {
        let surface_data = SurfaceData { kind, is_front, in_theme: true, resolution: Resolution::Unresolved };
        let number = appearances.add_surface_data(ids::NONE, surface_data);
        let parameterization = if uvs.is_empty() { Parameterization::None } else { add_tex_coords(geometry, node, &uvs, appearances) };
        let id = &mut geometry.nodes[node as usize].id;
        *id = synthesize(*id, "surface", node);
        appearances.bind(*id, number, parameterization);
    }
}

/// Returns an id, a new one in place of none. No gml:id has a space.
fn synthesize(id: Id, kind: &str, number: u32) -> Id {
    if id == ids::NONE { hash_id(&format!("textured {kind} {number}")) } else { id }
}

/// Assigns the coordinates to the rings of the polygon in a textured surface: a pair for each point, or for each but the closing ones.
fn add_tex_coords(geometry: &mut GeometryArena, node: NodeId, uvs: &[f64], appearances: &mut Appearances) -> Parameterization {
    let first = appearances.rings.len();
    let mut pairs = uvs.as_chunks::<2>().0.iter().map(|uv| uv.map(|v| v as f32));
    if let Some(rings) = find_polygon_rings(geometry, node) {
        let points: usize = geometry.rings[rings.clone()].iter().map(|ring| (ring.end - ring.start) as usize).sum();
        let omitted = usize::from(pairs.len() < points);
        for number in rings {
            let ring = &mut geometry.rings[number];
            ring.id = synthesize(ring.id, "ring", number as u32);
            let start = appearances.uvs.len() as u32;
            appearances.uvs.extend(pairs.by_ref().take((ring.end - ring.start) as usize - omitted.min((ring.end - ring.start) as usize)));
            let count = appearances.uvs.len() as u32 - start;
            if count > 0 {
                appearances.rings.push(RingTexCoords { ring: ring.id, start, count });
            }
        }
    }
    appearances.finish_tex_coord_list(first)
}

/// Returns the rings of the first polygon at or below a node.
fn find_polygon_rings(geometry: &GeometryArena, mut node: NodeId) -> Option<std::ops::Range<usize>> {
    while node != NO_NODE {
        match geometry.node(node).kind {
            NodeKind::Polygon { first_ring, rings } => return Some(first_ring as usize..(first_ring + rings) as usize),
            NodeKind::Group => node = geometry.node(node).first_child,
            NodeKind::XLink(_) => return None,
        }
    }
    None
}
