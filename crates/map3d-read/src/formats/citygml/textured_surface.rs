//! `TexturedSurface` of CityGML 0.4 and 1.0: a surface that contains its material or texture.

use map3d_base::Result;
use map3d_base::asset::Wrap;

use super::appearance_parser::parse_transparency;
use super::coordinates::parse_numbers;
use super::xml_reader::XmlReader;
use crate::city_model::appearance::{
    Appearances, Parameterization, Resolution, RingTexCoords, SurfaceData, SurfaceDataKind, TexturePlacement, TextureProperties,
};
use crate::city_model::geometry_arena::{GeometryArena, NO_NODE, NodeId, NodeKind};
use crate::city_model::ids::{self, Id, hash_id};

/// The appearance inside a textured surface.
pub struct OwnAppearance {
    /// The textured surface.
    node: NodeId,
    is_front: bool,
    kind: SurfaceDataKind,
    /// One pair per point of the rings, in their order.
    uvs: Vec<f64>,
}

/// Reads the current `appearance` property of a textured surface; returns `None` if it holds neither a material nor a texture.
pub fn read_own_appearance(xml: &mut XmlReader, node: NodeId) -> Result<Option<OwnAppearance>> {
    let is_front = xml.attribute("orientation").is_none_or(|o| o.trim() != "-");
    let mut found = None;
    while xml.next_child()? {
        let (kind, uvs) = match xml.local_name() {
            "SimpleTexture" => read_texture(xml)?,
            "Material" => (Some(read_material(xml)?), Vec::new()),
            _ => {
                xml.skip()?;
                continue;
            }
        };
        found = kind.map(|kind| OwnAppearance { node, is_front, kind, uvs }).or(found);
    }
    Ok(found)
}

fn read_texture(xml: &mut XmlReader) -> Result<(Option<SurfaceDataKind>, Vec<f64>)> {
    let (mut image, mut wrap, mut uvs) = (String::new(), Wrap::None, Vec::new());
    while xml.next_child()? {
        match xml.local_name() {
            "textureMap" => image = xml.read_text()?,
            "repeat" => wrap = if matches!(xml.read_text()?.as_str(), "1" | "true") { Wrap::Wrap } else { Wrap::None },
            "textureCoordinates" => {
                if parse_numbers(&xml.read_text()?, &mut uvs).is_none() {
                    uvs.clear();
                }
            }
            _ => xml.skip()?,
        }
    }
    let properties = TextureProperties { image, wrap, border: [0.0; 4], placement: TexturePlacement::Parameterized, crs_name: None };
    Ok((Some(SurfaceDataKind::Texture(properties)).filter(|_| !uvs.is_empty()), uvs))
}

fn read_material(xml: &mut XmlReader) -> Result<SurfaceDataKind> {
    let (mut color, mut transparency) = ([0.8; 3], None);
    while xml.next_child()? {
        match xml.local_name() {
            "diffuseColor" => {
                let mut values = Vec::new();
                let parsed = parse_numbers(&xml.read_text()?, &mut values);
                if let (Some(()), [r, g, b, ..]) = (parsed, &values[..]) {
                    color = [*r, *g, *b].map(|v| if v.is_finite() { v.clamp(0.0, 1.0) as f32 } else { 0.0 });
                }
            }
            "transparency" => transparency = parse_transparency(&xml.read_text()?),
            _ => xml.skip()?,
        }
    }
    Ok(SurfaceDataKind::X3DMaterial { color, transparency })
}

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
