//! Each geometry is in the coordinate system that the nearest element above it names.

use crate::documents::ParsedDocument;
use crate::documents::city_model::{model, read_text};

fn member(body: &str) -> String {
    format!(r#"<core:cityObjectMember><bldg:Building gml:id="b">{body}</bldg:Building></core:cityObjectMember>"#)
}

fn envelope(name: &str) -> String {
    format!(r#"<gml:boundedBy><gml:Envelope srsName="{name}"><gml:lowerCorner>0 0 0</gml:lowerCorner></gml:Envelope></gml:boundedBy>"#)
}

/// Returns a level of detail with a square at x; `on`: attributes of MultiSurface, Polygon, LinearRing and posList.
fn square(lod: u32, x: u32, on: [&str; 4]) -> String {
    let [multi_surface, polygon, ring, list] = on;
    let points = format!("{x} 0 0 {} 0 0 {} 2 0 {x} 2 0 {x} 0 0", x + 2, x + 2);
    format!(
        "<bldg:lod{lod}MultiSurface><gml:MultiSurface {multi_surface}><gml:surfaceMember><gml:Polygon {polygon}><gml:exterior>\
         <gml:LinearRing {ring}><gml:posList {list}>{points}</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>\
         </gml:MultiSurface></bldg:lod{lod}MultiSurface>"
    )
}

/// Returns the names of the coordinate systems of the batches, and where their triangles begin in x.
fn systems(document: &ParsedDocument) -> Vec<(&str, f64)> {
    let low = |batch: &map3d_base::asset::Batch| batch.positions.iter().map(|p| p[0]).fold(f64::INFINITY, f64::min);
    let name = |batch: &map3d_base::asset::Batch| document.crs_names[batch.crs as usize].as_deref().unwrap_or_default();
    document.batches.iter().filter(|b| b.prototype == 0).map(|b| (name(b), low(b))).collect()
}

#[test]
fn geometry_has_the_system_of_the_nearest_element_that_names_one() {
    let own = r#"srsName="EPSG:31467""#;
    for on in [[own, "", "", ""], ["", own, "", ""], ["", "", own, ""], ["", "", "", own], [r#"srsName="EPSG:4326""#, own, "", ""]] {
        let document = read_text(&model(&member(&square(2, 0, on))));
        assert_eq!(systems(&document), [("EPSG:31467", 0.0)], "{on:?}");
        assert_eq!(document.srs_name.as_deref(), Some("EPSG:25832+5783"), "the document's is the first");
        assert!(document.report.findings.is_empty());
    }
    assert_eq!(systems(&read_text(&model(&member(&square(2, 0, [r#"srsName=" ""#, "", "", ""]))))), [("EPSG:25832+5783", 0.0)]);
}

#[test]
fn envelopes_of_features_count_for_what_is_in_them() {
    let part =
        format!("<bldg:consistsOfBuildingPart><bldg:BuildingPart>{}</bldg:BuildingPart></bldg:consistsOfBuildingPart>", square(2, 40, [""; 4]));
    let wall = format!("<bldg:boundedBy><bldg:WallSurface>{}</bldg:WallSurface></bldg:boundedBy>", square(2, 50, [""; 4]));
    let first = member(&format!("{}{}{part}{wall}", envelope("EPSG:31467"), square(2, 60, [""; 4])));
    let second = member(&square(2, 10, [""; 4]));
    let document = read_text(&model(&(first + &second)));
    assert_eq!(systems(&document), [("EPSG:31467", 40.0), ("EPSG:25832+5783", 10.0)]);
    assert_eq!((document.count(), document.area()), (8, 16.0));
}

#[test]
fn the_envelope_of_the_model_counts_where_another_system_comes_first() {
    let text = format!(
        "<CityModel xmlns:bldg='b' xmlns:gml='g' xmlns:core='c'><name srsName='EPSG:4326'/>{}{}</CityModel>",
        envelope("EPSG:25832"),
        member(&square(2, 0, [""; 4]))
    );
    assert_eq!(systems(&read_text(&text)), [("EPSG:25832", 0.0)]);
    let none = format!("<CityModel xmlns:bldg='b' xmlns:gml='g' xmlns:core='c'>{}</CityModel>", member(&square(2, 0, [""; 4])));
    let document = read_text(&none);
    assert_eq!((document.crs_names.clone(), systems(&document)), (vec![None], vec![("", 0.0)]));
}

#[test]
fn spellings_of_one_system_are_one() {
    let name = r#"srsName="urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::5783""#;
    let document = read_text(&model(&member(&square(2, 0, [name, "", "", ""]))));
    assert_eq!((systems(&document), document.crs_names.len()), (vec![("EPSG:25832+5783", 0.0)], 1));
}

#[test]
fn batches_of_alternating_systems_do_not_become_small() {
    let members: String = (0..40).map(|k| member(&square(2, k, [if k % 2 == 0 { "" } else { r#"srsName="EPSG:31467""# }, "", "", ""]))).collect();
    let document = read_text(&model(&members));
    assert_eq!(systems(&document), [("EPSG:25832+5783", 0.0), ("EPSG:31467", 1.0)]);
    assert_eq!(document.count(), 80);
}

#[test]
fn polygons_in_two_systems_are_skipped() {
    let hole = r#"<gml:interior><gml:LinearRing srsName="EPSG:31467"><gml:posList>1 0 0 1 1 0 2 1 0 1 0 0</gml:posList></gml:LinearRing></gml:interior></gml:Polygon>"#;
    let document = read_text(&model(&member(&square(2, 0, [""; 4]).replace("</gml:Polygon>", hole))));
    assert_eq!((document.count(), document.reported("polygon-in-several-crs")), (0, 1));
    let points = ["0 0 0", "2 0 0", "2 2 0", "0 0 0"]
        .map(|p| format!("<gml:pointProperty><gml:Point srsName='EPSG:31467'><gml:pos>{p}</gml:pos></gml:Point></gml:pointProperty>"));
    let ring = format!("<gml:Polygon><gml:exterior><gml:LinearRing>{}</gml:LinearRing></gml:exterior></gml:Polygon>", points.concat());
    let of = |ring: &str| read_text(&model(&member(&format!("<bldg:lod2MultiSurface>{ring}</bldg:lod2MultiSurface>"))));
    assert_eq!(systems(&of(&ring)), [("EPSG:31467", 0.0)], "points name it");
    assert_eq!(of(&ring.replacen("EPSG:31467", "EPSG:31468", 1)).reported("polygon-in-several-crs"), 1);
}

#[test]
fn more_systems_than_the_limit_are_skipped() {
    let members: String = (0..40).map(|k| member(&square(2, k, [&format!(r#"srsName="EPSG:{}""#, 2000 + k), "", "", ""]))).collect();
    let document = read_text(&model(&members));
    assert_eq!((document.crs_names.len(), document.count()), (32, 62));
    assert_eq!(document.reported("polygon-crs-too-many"), 9);
}

#[test]
fn placements_have_the_system_of_their_reference_point() {
    let shape = r#"><gml:MultiSurface gml:id="shape" srsName="EPSG:4326"><gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing>
        <gml:posList>0 0 0 2 0 0 2 0 2 0 0 0</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember></gml:MultiSurface>"#;
    let same = r##" xlink:href="#shape">"##;
    let tree = |id: &str, geometry: &str, point: &str, head: &str| {
        format!(
            r#"<core:cityObjectMember><SolitaryVegetationObject gml:id="{id}">{head}<lod2ImplicitRepresentation><core:ImplicitGeometry>
             <core:relativeGMLGeometry{geometry}</core:relativeGMLGeometry>
             <core:referencePoint><gml:Point {point}><gml:pos>5 6 7</gml:pos></gml:Point></core:referencePoint></core:ImplicitGeometry>
             </lod2ImplicitRepresentation></SolitaryVegetationObject></core:cityObjectMember>"#
        )
    };
    let members = tree("t0", shape, r#"srsName="EPSG:31467""#, "") + &tree("t1", same, "", "") + &tree("t2", same, "", &envelope("EPSG:31468"));
    let document = read_text(&model(&members));
    let names: Vec<_> = document.instance_crs.iter().map(|k| document.crs_names[*k as usize].as_deref().unwrap_or_default()).collect();
    assert_eq!(names, ["EPSG:31467", "EPSG:25832+5783", "EPSG:31468"]);
    assert_eq!((document.instances.len(), document.count(), document.area()), (3, 1, 2.0), "a prototype is in a frame of its own");
    assert!(document.batches.iter().all(|b| b.crs == 0));
}
