//! Parses the appearance in a `TexturedSurface` of CityGML 0.4 and 1.0.

use map3d_base::Result;
use map3d_base::asset::Wrap;

use super::appearance_parser::parse_transparency;
use super::coordinates::parse_numbers;
use super::xml_reader::XmlReader;
use crate::city_model::appearance::{SurfaceDataKind, TexturePlacement, TextureProperties};
use crate::city_model::geometry_arena::{NodeId, OwnAppearance};

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
