//! Builds small city models.

use map3d_read::{CITYGML, ReadOptions};

use super::{Folder, ParsedDocument, read_with};

pub fn model(body: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<core:CityModel xmlns:core="http://www.opengis.net/citygml/2.0" xmlns:bldg="http://www.opengis.net/citygml/building/2.0"
 xmlns:gml="http://www.opengis.net/gml" xmlns:app="http://www.opengis.net/citygml/appearance/2.0" xmlns:xlink="http://www.w3.org/1999/xlink"
 xmlns:gen="http://www.opengis.net/citygml/generics/2.0" xmlns:xAL="urn:oasis:names:tc:ciq:xsdschema:xAL:2.0">
<gml:boundedBy><gml:Envelope srsName="EPSG:25832+5783" srsDimension="3"><gml:lowerCorner>0 0 0</gml:lowerCorner></gml:Envelope></gml:boundedBy>
{body}
</core:CityModel>"#
    )
}

pub fn building(body: &str) -> String {
    model(&format!(r#"<core:cityObjectMember><bldg:Building gml:id="b1">{body}</bldg:Building></core:cityObjectMember>"#))
}

pub fn try_text(text: &str, options: &ReadOptions) -> map3d_base::Result<ParsedDocument> {
    let folder = Folder::new("citygml");
    let path = folder.put("town.gml", text);
    read_with(&path, &CITYGML, options)
}

pub fn read_text(text: &str) -> ParsedDocument {
    try_text(text, &ReadOptions::default()).expect("readable")
}

pub fn ring(points: &str) -> String {
    format!("<gml:LinearRing><gml:posList>{points}</gml:posList></gml:LinearRing>")
}

pub fn polygon(id: &str, points: &str) -> String {
    format!(r#"<gml:Polygon gml:id="{id}"><gml:exterior>{}</gml:exterior></gml:Polygon>"#, ring(points))
}

pub fn multi_surface(members: &str) -> String {
    format!("<gml:MultiSurface>{members}</gml:MultiSurface>")
}

pub fn member(inner: &str) -> String {
    format!("<gml:surfaceMember>{inner}</gml:surfaceMember>")
}

/// Returns a square with area 4 at height z.
pub fn square(id: &str, z: u32) -> String {
    polygon(id, &format!("0 0 {z} 2 0 {z} 2 2 {z} 0 2 {z} 0 0 {z}"))
}

pub fn at_lod(lod: u32, inner: &str) -> String {
    format!("<bldg:lod{lod}MultiSurface>{}</bldg:lod{lod}MultiSurface>", multi_surface(&member(inner)))
}

pub fn surface(kind: &str, inner: &str) -> String {
    format!("<bldg:boundedBy><bldg:{kind}>{inner}</bldg:{kind}></bldg:boundedBy>")
}
