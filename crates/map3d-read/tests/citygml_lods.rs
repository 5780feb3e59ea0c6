//! Levels of detail that do not mix, and interiors.

use crate::documents::city_model::{at_lod, building, member, multi_surface, polygon, read_text, square, surface, try_text};
use crate::documents::{ParsedDocument, of_format};
use map3d_base::asset::Rank;
use serde_json::json;

/// Returns a triangle of area 0.5 at height z.
fn half(id: &str, z: u32) -> String {
    polygon(id, &format!("0 0 {z} 1 0 {z} 0 1 {z} 0 0 {z}"))
}

fn installation(inner: &str) -> String {
    format!("<bldg:outerBuildingInstallation><bldg:BuildingInstallation>{inner}</bldg:BuildingInstallation></bldg:outerBuildingInstallation>")
}

fn window(inner: &str) -> String {
    format!("<bldg:opening><bldg:Window>{inner}</bldg:Window></bldg:opening>")
}

fn area_of(document: &ParsedDocument, rank: Rank) -> f64 {
    document.triangles().iter().filter(|t| t.rank == rank).map(|t| crate::documents::compute_area(t.corners)).sum()
}

#[test]
fn installations_of_two_levels_are_not_both_converted() {
    let (coarse, fine) = (installation(&at_lod(2, &square("c", 5))), installation(&at_lod(3, &half("f", 5))));
    let walls = |lod: u32| at_lod(lod, &square("wall", 1));
    for (shell, installations, expected) in [
        (walls(3), coarse.clone() + &fine, 0.5),
        (walls(2), coarse.clone() + &fine, 4.0),
        (walls(1), coarse.clone() + &fine, 0.5),
        (walls(3), coarse.clone(), 4.0),
        (walls(1), fine.clone(), 0.5),
        (walls(2) + &walls(3).replace("wall", "w3"), installation(&(at_lod(2, &square("c", 5)) + &at_lod(3, &half("f", 5)))), 0.5),
    ] {
        let document = read_text(&building(&(shell + &installations)));
        assert_eq!((area_of(&document, Rank::Installation), area_of(&document, Rank::Other)), (expected, 4.0));
    }
}

#[test]
fn surfaces_and_openings_of_installations_have_the_level_of_their_installations() {
    let dormer =
        installation(&(at_lod(2, &square("body", 5)) + &surface("RoofSurface", &(at_lod(3, &half("roof", 6)) + &window(&at_lod(3, &half("w", 7)))))));
    let at = |lod: u32| {
        let document = read_text(&building(&(at_lod(lod, &square("wall", 1)) + &dormer)));
        (area_of(&document, Rank::Installation), area_of(&document, Rank::Opening))
    };
    assert_eq!((at(2), at(3), at(1)), ((4.0, 0.0), (0.5, 0.5), (0.5, 0.5)));
}

#[test]
fn openings_of_two_levels_are_not_both_converted() {
    let wall = |lods: &[u32], windows: &str| {
        let walls: String = lods.iter().map(|lod| at_lod(*lod, &square(&format!("wall{lod}"), 1))).collect();
        let document = read_text(&building(&surface("WallSurface", &(walls + windows))));
        area_of(&document, Rank::Opening)
    };
    let (three, four) = (window(&at_lod(3, &square("three", 2))), window(&at_lod(4, &half("four", 3))));
    let both = three.clone() + &four;
    assert_eq!([wall(&[3], &both), wall(&[3, 4], &both), wall(&[2], &both)], [4.0, 0.5, 0.5]);
    assert_eq!([wall(&[3, 4], &three), wall(&[2], &three)], [4.0, 4.0], "openings of one level only are converted");
}

#[test]
fn an_object_replaced_by_finer_parts_keeps_no_coarser_installations() {
    let part = format!(
        "<bldg:consistsOfBuildingPart><bldg:BuildingPart gml:id='p'>{}</bldg:BuildingPart></bldg:consistsOfBuildingPart>",
        at_lod(2, &square("a", 1))
    );
    for (installations, expected) in [
        (at_lod(1, &square("one", 5)), 0.0),
        (at_lod(2, &half("two", 5)), 0.5),
        (at_lod(1, &square("one", 5)) + &at_lod(2, &half("two", 5)), 0.5),
        (at_lod(3, &half("three", 5)), 0.5),
    ] {
        let document = read_text(&building(&(at_lod(1, &square("whole", 0)) + &installation(&installations) + &part)));
        assert_eq!((area_of(&document, Rank::Installation), document.area()), (expected, 4.0 + expected));
    }
}

#[test]
fn a_requested_level_is_that_of_every_feature() {
    let body = at_lod(2, &square("w2", 1)) + &at_lod(3, &half("w3", 1)) + &installation(&at_lod(3, &half("i", 5)));
    for (lod, expected) in [("2", 4.0), ("3", 1.0), ("1", 0.0)] {
        let options = of_format(json!({"lod": lod}));
        assert_eq!(try_text(&building(&body), &options).expect("readable").area(), expected);
    }
}

fn with_interiors(text: &str) -> ParsedDocument {
    try_text(text, &of_format(json!({"interiors": true}))).expect("readable")
}

#[test]
fn interiors_are_counted_by_polygon_and_drawn_on_request() {
    let floor =
        format!("<bldg:boundedBy><bldg:FloorSurface>{}</bldg:FloorSurface></bldg:boundedBy>", at_lod(4, &(square("f1", 2) + &square("f2", 3))));
    let table = format!(
        "<bldg:interiorFurniture><bldg:BuildingFurniture><bldg:lod4Geometry>{}</bldg:lod4Geometry></bldg:BuildingFurniture></bldg:interiorFurniture>",
        multi_surface(&member(&square("t", 4)))
    );
    let room = format!("<bldg:interiorRoom><bldg:Room>{floor}{table}</bldg:Room></bldg:interiorRoom>");
    let inner = format!(
        "<bldg:interiorBuildingInstallation><bldg:IntBuildingInstallation>{}</bldg:IntBuildingInstallation></bldg:interiorBuildingInstallation>",
        at_lod(4, &square("stairs", 5))
    );
    let text = building(&(at_lod(4, &half("wall", 1)) + &room + &inner));
    let document = read_text(&text);
    assert_eq!((document.area(), document.reported("polygon-of-interior")), (0.5, 4));
    let said = document.report.findings.iter().find(|w| w.message.reason.code() == "interiors-not-drawn").map(|w| w.example.as_str());
    assert_eq!(said, Some("4; --interiors draws them"));
    let document = with_interiors(&text);
    assert_eq!((document.area(), document.reported("polygon-of-interior"), document.reported("interiors")), (16.5, 0, 0));
    assert_eq!(with_interiors(&building(&at_lod(4, &square("w", 1)))).area(), 4.0);
    assert!(document.triangles().iter().all(|t| t.object == 0), "rooms belong to their building");
}

#[test]
fn polygons_that_the_outside_has_too_are_no_interiors() {
    let room = "<bldg:interiorRoom><bldg:Room><bldg:lod4MultiSurface><gml:MultiSurface><gml:surfaceMember xlink:href='#w'/></gml:MultiSurface></bldg:lod4MultiSurface></bldg:Room></bldg:interiorRoom>";
    let document = read_text(&building(&(at_lod(4, &square("w", 1)) + room)));
    assert_eq!((document.area(), document.reported("polygon-of-interior")), (4.0, 0));
}

#[test]
fn interiors_of_version_3_are_known() {
    let at = |id: &str| format!("<core:lod2MultiSurface>{}</core:lod2MultiSurface>", multi_surface(&member(&square(id, 2))));
    let rooms = [
        format!("<bldg:buildingRoom><bldg:BuildingRoom>{}</bldg:BuildingRoom></bldg:buildingRoom>", at("a")),
        format!(
            "<bldg:buildingRoom><bldg:BuildingRoom><core:boundary><con:InteriorWallSurface>{}</con:InteriorWallSurface></core:boundary></bldg:BuildingRoom></bldg:buildingRoom>",
            at("b")
        ),
        format!(
            "<bldg:buildingInstallation><bldg:BuildingInstallation><core:boundary><con:WallSurface>{}</con:WallSurface></core:boundary><con:relationToConstruction>inside</con:relationToConstruction></bldg:BuildingInstallation></bldg:buildingInstallation>",
            at("c")
        ),
        format!("<bldg:buildingSubdivision><bldg:Storey>{}</bldg:Storey></bldg:buildingSubdivision>", at("d")),
        format!("<brid:bridgeRoom><brid:BridgeRoom>{}</brid:BridgeRoom></brid:bridgeRoom>", at("e")),
        format!("<tun:hollowSpace><tun:HollowSpace>{}</tun:HollowSpace></tun:hollowSpace>", at("f")),
    ];
    for room in &rooms {
        let text = building(&(format!("<core:lod2MultiSurface>{}</core:lod2MultiSurface>", multi_surface(&member(&half("wall", 1)))) + room));
        let document = read_text(&text);
        assert_eq!((document.area(), document.reported("polygon-of-interior")), (0.5, 1), "{room}");
        assert_eq!(with_interiors(&text).area(), 4.5, "{room}");
    }
    let outside = rooms[2].replace("inside", "bothInsideAndOutside");
    assert_eq!(read_text(&building(&outside)).area(), 4.0);
}

#[test]
fn attributes_of_storeys_and_units_are_those_of_their_building() {
    let unit = "<bldg:buildingSubdivision><bldg:BuildingUnit><ade:owner>Smith</ade:owner></bldg:BuildingUnit></bldg:buildingSubdivision>";
    let room = "<bldg:buildingRoom><bldg:BuildingRoom><bldg:class>kitchen</bldg:class></bldg:BuildingRoom></bldg:buildingRoom>";
    let document = read_text(&building(&(unit.to_owned() + room)));
    let names: Vec<&str> = document.objects[0].attributes.keys().map(String::as_str).collect();
    assert_eq!(names, ["buildingSubdivision/BuildingUnit/owner"]);
}

#[test]
fn a_document_with_nothing_at_the_requested_level_says_what_it_has() {
    let text = building(&(at_lod(1, &square("a", 0)) + &at_lod(3, &square("b", 1))));
    for (lod, expected) in [("2", Some("2; the file has 1, 3")), ("1", None), ("3", None)] {
        let document = try_text(&text, &of_format(json!({"lod": lod}))).expect("readable");
        let said = document.report.findings.iter().find(|w| w.message.reason.code() == "nothing-at-lod").map(|w| w.example.as_str());
        assert_eq!((said, document.count()), (expected, if expected.is_some() { 0 } else { 2 }), "{lod}");
    }
}
