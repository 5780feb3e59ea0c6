//! References between the files of a folder: geometry, prototypes and appearances.

use std::fs;
use std::path::Path;

use crate::documents::{Folder, ParsedDocument, is_format_error, of_format, read_with};
use map3d_read::{CITYGML, ReadOptions};
use serde_json::json;

fn read(path: &Path, options: &ReadOptions) -> ParsedDocument {
    read_with(path, &CITYGML, options).expect("readable")
}

fn read_in(folder: &Folder, name: &str) -> ParsedDocument {
    read(&folder.0.join(name), &ReadOptions { folder: Some(folder.0.clone()), ..ReadOptions::default() })
}

fn model(body: &str) -> String {
    format!("<CityModel xmlns:gml='g' xmlns:xlink='x'>{body}</CityModel>")
}

fn building(id: &str, members: &str) -> String {
    format!(
        "<cityObjectMember><Building gml:id='{id}'><lod2MultiSurface><gml:MultiSurface>{members}</gml:MultiSurface></lod2MultiSurface></Building></cityObjectMember>"
    )
}

/// Returns a square with sides of 2 at x, as a surface member.
fn square(id: &str, x: u32) -> String {
    let end = x + 2;
    format!(
        "<gml:surfaceMember><gml:Polygon gml:id='{id}'><gml:exterior><gml:LinearRing gml:id='{id}-ring'><gml:posList>\
         {x} 0 0 {end} 0 0 {end} 2 0 {x} 2 0 {x} 0 0</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>"
    )
}

fn link(href: &str) -> String {
    format!("<gml:surfaceMember xlink:href='{href}'/>")
}

fn group(id: &str, members: &str) -> String {
    format!("<gml:surfaceMember><gml:CompositeSurface gml:id='{id}'>{members}</gml:CompositeSurface></gml:surfaceMember>")
}

/// Returns an appearance that textures a square.
fn texture(image: &str, uri: &str, ring: &str) -> String {
    format!(
        "<appearanceMember><Appearance><theme>t</theme><surfaceDataMember><ParameterizedTexture><imageURI>{image}</imageURI>\
         <target uri='{uri}'><TexCoordList><textureCoordinates ring='{ring}'>0 0 1 0 1 1 0 1 0 0</textureCoordinates></TexCoordList></target>\
         </ParameterizedTexture></surfaceDataMember></Appearance></appearanceMember>"
    )
}

fn texture_of(document: &ParsedDocument, triangle: usize) -> Option<&str> {
    document.material_of(triangle).texture.as_ref().map(|_| document.material_of(triangle).name.as_str())
}

#[test]
fn geometry_of_another_file_is_drawn_with_its_textures_and_its_coordinate_system() {
    let folder = Folder::new("references");
    folder.put_png("library/images/red.png", 2, 2, [255, 0, 0, 255]);
    let envelope = |name: &str| format!("<gml:boundedBy><gml:Envelope srsName='{name}'/></gml:boundedBy>");
    folder.put("a.gml", model(&(envelope("EPSG:25832") + &building("a", &(square("p", 0) + &link("library/b%20b.gml#s"))))));
    let shared = building("b", &(group("s", &(square("p", 10) + &link("#q"))) + &square("q", 20) + &square("unused", 30)));
    folder.put("library/b b.gml", model(&(envelope("EPSG:31468") + &shared + &texture("images/red.png", "#p", "#p-ring"))));
    let document = read_in(&folder, "a.gml");
    let low = |triangle: usize| document.triangles()[triangle].corners.iter().map(|c| c[0]).fold(f64::INFINITY, f64::min);
    let drawn: Vec<_> = (0..document.count()).map(|t| (low(t), texture_of(&document, t))).collect();
    let red = Some("library/images/red.png");
    assert_eq!(drawn, [(0.0, None), (0.0, None), (10.0, red), (10.0, red), (20.0, None), (20.0, None)]);
    assert_eq!(document.triangles()[2].uvs.expect("coordinates")[0], [0.0, 0.0]);
    let crs: Vec<_> = document.batches.iter().map(|b| document.crs_names[b.crs as usize].as_deref()).collect();
    assert_eq!(crs, [Some("EPSG:25832"), Some("EPSG:31468")]);
    assert!(document.triangles().iter().all(|t| t.object == 0));
    assert_eq!(document.report.findings.len(), 0, "{:?}", document.report.findings);
}

#[test]
fn prototypes_of_another_file_are_placed() {
    let folder = Folder::new("references");
    let tree = |id: &str, x: u32| {
        format!(
            "<cityObjectMember><SolitaryVegetationObject gml:id='{id}'><lod2ImplicitRepresentation><ImplicitGeometry>\
             <relativeGMLGeometry xlink:href='trees.gml#oak'/><referencePoint><gml:Point><gml:pos>{x} 0 0</gml:pos></gml:Point></referencePoint>\
             </ImplicitGeometry></lod2ImplicitRepresentation></SolitaryVegetationObject></cityObjectMember>"
        )
    };
    folder.put("a.gml", model(&(tree("a", 5) + &tree("b", 7))));
    folder.put("trees.gml", format!("<Library xmlns:gml='g'><gml:MultiSurface gml:id='oak'>{}</gml:MultiSurface></Library>", square("p", 0)));
    let document = read_in(&folder, "a.gml");
    assert_eq!(document.instances.iter().map(|i| (i.prototype, i.transform[3])).collect::<Vec<_>>(), [(1, 5.0), (1, 7.0)]);
    assert_eq!((document.count(), document.report.findings.len()), (2, 0));
    fs::remove_file(folder.0.join("trees.gml")).expect("remove");
    let without = read_in(&folder, "a.gml");
    assert_eq!((without.reported("implicit-geometry-without-prototype"), without.reported("other-file-not-found")), (2, 2));
}

#[test]
fn appearances_of_another_file_texture_the_surfaces_they_target() {
    let folder = Folder::new("references");
    folder.put_png("images/red.png", 2, 2, [255, 0, 0, 255]);
    let a = folder.put("tiles/a.gml", model(&building("a", &(square("p", 0) + &square("q", 4)))));
    let photos = ["#p-ring", "../tiles/a.gml#p-ring"].map(|ring| texture("../images/red.png", "../tiles/a.gml#p", ring));
    let nowhere = texture("../images/red.png", "../tiles/a.gml#nowhere", "#r") + &texture("../images/red.png", "b.gml#p", "#r");
    for (k, photo) in photos.iter().enumerate() {
        let photos = folder.put(&format!("photos/{k}.gml"), model(&(photo.clone() + &nowhere)));
        let options = ReadOptions { folder: Some(folder.0.clone()), ..of_format(json!({"appearance_files": [photos, a]})) };
        let document = read(&a, &options);
        let red = Some("../photos/../images/red.png");
        assert_eq!((0..4).map(|t| texture_of(&document, t)).collect::<Vec<_>>(), [red, red, None, None]);
        assert_eq!(document.reported("appearance-target-not-found"), 1);
        let named = |text: &str| document.report.findings.iter().any(|w| w.example == text);
        assert!(named("../tiles/a.gml#nowhere") && named("b.gml#p"), "{:?}", document.report.findings);
        assert_eq!(document.report.findings.len(), 2);
    }
    let alone = read(&a, &ReadOptions { folder: Some(folder.0.clone()), ..ReadOptions::default() });
    assert_eq!((0..4).filter_map(|t| texture_of(&alone, t)).count(), 0);
}

#[test]
fn a_file_with_appearances_for_another_one_says_so() {
    let folder = Folder::new("references");
    folder.put("b.gml", model(""));
    folder.put("a.gml", model(&(building("a", &square("p", 0)) + &texture("red.png", "b.gml#p", "#r") + &texture("red.png", "none.gml#p", "#r"))));
    let document = read_in(&folder, "a.gml");
    assert_eq!(document.reported("appearance-for-other-file"), 1);
    assert_eq!(document.reported("other-file-not-found"), 1);
}

#[test]
fn references_that_lead_nowhere_are_counted_by_name() {
    let folder = Folder::new("references");
    folder.put("elsewhere/c.gml", model(&building("c", &square("p", 0))));
    folder.put("city/broken.gml", model(&building("c", &square("p", 20))).split("</gml:posList>").next().expect("text"));
    folder.put("city/doctype.gml", "<!DOCTYPE a><CityModel/>");
    folder.put("city/b.gml", model(&building("b", &(square("p", 10) + &group("deep", &link("c.gml#x"))))));
    for (href, reason, named) in [
        ("none.gml#p", "other-file-not-found", "none.gml#p"),
        ("../elsewhere/c.gml#p", "other-file-outside-folder", "../elsewhere/c.gml#p"),
        ("https://example.org/c.gml#p", "other-file-url-not-fetched", "https://example.org/c.gml#p"),
        ("b.gml#none", "other-file-without-geometry", "b.gml#none"),
        ("b.gml#deep", "other-file-not-found", "c.gml#x"),
        ("broken.gml#none", "other-file-without-geometry", "broken.gml#none"),
        ("doctype.gml#none", "other-file-without-geometry", "doctype.gml#none"),
    ] {
        let path = folder.put("city/a.gml", model(&building("a", &(square("p", 0) + &link(href)))));
        let options = ReadOptions { folder: Some(folder.0.join("city")), ..ReadOptions::default() };
        let document = read(&path, &options);
        assert_eq!((document.count(), document.reported(reason)), (2, 1), "{href}: {:?}", document.report.findings);
        assert!(
            document.report.findings.iter().any(|w| w.message.reason.code() == reason && w.example == named),
            "{href}: {:?}",
            document.report.findings
        );
        assert_eq!(document.reported("other-file-broken"), u64::from(href.starts_with(['b', 'd']) && !href.starts_with("b.gml")), "{href}");
        let strict = ReadOptions { strict: true, ..options };
        assert!(is_format_error(read_with(&path, &CITYGML, &strict), ""), "{href}");
    }
}

#[test]
fn cycles_of_files_are_refused_for_each_reference() {
    let folder = Folder::new("references");
    folder.put("a.gml", model(&building("a", &(square("p", 0) + &group("x", &link("b.gml#y"))))));
    folder.put("b.gml", model(&building("b", &group("y", &(square("p", 10) + &link("a.gml#x") + &link("b.gml#y"))))));
    let document = read_in(&folder, "a.gml");
    assert_eq!(document.count(), 4, "both squares");
    assert_eq!(document.reported("geometry-refers-to-itself"), 2);
    let back = model(&building("b", &(group("y", &link("a.gml#p")) + &square("p", 10))));
    folder.put("b.gml", back);
    assert_eq!(read_in(&folder, "a.gml").reported("geometry-refers-to-itself"), 0, "the way back to another surface is no cycle");
}

#[test]
fn chains_have_a_limit() {
    let folder = Folder::new("references");
    let count = |links: usize| {
        for k in 0..links {
            folder.put(&format!("{k}.gml"), model(&building("b", &(square("p", 10 * k as u32) + &group("x", &link(&format!("{}.gml#x", k + 1)))))));
        }
        folder.put(&format!("{links}.gml"), model(&building("b", &group("x", &square("end", 500)))));
        let document = read_in(&folder, "0.gml");
        (document.count(), document.reported("other-file-chain-too-long"))
    };
    assert_eq!(count(16), (4, 0));
    assert_eq!(count(17), (2, 1));
}

#[test]
fn very_long_references_are_shortened() {
    let folder = Folder::new("references");
    folder.put("b.gml", model(""));
    let long = "x".repeat(1 << 20);
    folder.put("a.gml", model(&building("a", &(square("p", 0) + &link(&format!("b.gml#{long}")) + &link(&format!("{long}.gml#p"))))));
    let document = read_in(&folder, "a.gml");
    let found: Vec<_> = document.report.findings.iter().map(|w| (w.message.reason.code(), w.example.len() <= 256)).collect();
    assert_eq!(document.count(), 2);
    assert!(found.contains(&("other-file-without-geometry", true)), "{found:?}");
    assert!(found.iter().any(|(reason, _)| *reason == "other-file-name-invalid"), "{found:?}");
}

#[test]
fn a_reference_to_the_file_itself_by_its_name_is_one_inside_it() {
    let folder = Folder::new("references");
    folder
        .put("a.gml", model(&(building("a", &link("a.gml#q")) + &building("b", &group("y", &link("./a.gml#q"))) + &building("c", &square("q", 0)))));
    let document = read_in(&folder, "a.gml");
    assert_eq!((document.count(), document.report.findings.len()), (2, 0), "{:?}", document.report.findings);
}

#[test]
fn a_part_in_another_file_is_counted_and_other_references_are_not() {
    let folder = Folder::new("references-parts");
    let part = "<boundedBy xlink:href='walls.gml#w1'/><boundedBy xlink:href='#w2'/><externalLink xlink:href='other.gml#x'/>";
    let body = building("a", &square("p", 0)).replace("</Building>", &format!("{part}</Building>"));
    folder.put("a.gml", model(&body));
    folder.put("walls.gml", model(&building("w", &square("w1", 10))));
    let document = read_in(&folder, "a.gml");
    assert_eq!(document.count(), 2);
    let counted = document.report.findings.iter().find(|w| w.message.reason.code() == "part-in-other-file").expect("counted");
    assert_eq!((counted.count, counted.example.as_str()), (1, "walls.gml#w1"));
}
