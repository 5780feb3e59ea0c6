//! Documents that say less or more than they should: collections of web services, dangling targets, ended versions, missing heights, unmarked encodings.

use crate::documents::{Folder, ParsedDocument, of_format, read_with};
use map3d_base::reason::Reason;
use map3d_read::{CITYGML, FileHead, ReadOptions, detect};
use serde_json::{Value, json};

const SPACES: &str = r#"xmlns:wfs="http://www.opengis.net/wfs/2.0" xmlns:gml="http://www.opengis.net/gml" xmlns:bldg="http://www.opengis.net/citygml/building/2.0" xmlns:core="http://www.opengis.net/citygml/2.0" xmlns:app="http://www.opengis.net/citygml/appearance/2.0""#;
const SQUARE: &str = "0 0 5 2 0 5 2 2 5 0 2 5 0 0 5";

fn polygon(id: &str, positions: &str) -> String {
    format!("<gml:Polygon gml:id='{id}'><gml:exterior><gml:LinearRing gml:id='{id}-r'>{positions}</gml:LinearRing></gml:exterior></gml:Polygon>")
}

fn building(id: &str, properties: &str, positions: &str) -> String {
    let polygon = polygon(&format!("{id}-p"), positions);
    format!(
        "<bldg:Building gml:id='{id}'>{properties}<bldg:lod1MultiSurface><gml:MultiSurface><gml:surfaceMember>{polygon}</gml:surfaceMember></gml:MultiSurface></bldg:lod1MultiSurface></bldg:Building>"
    )
}

fn house(id: &str, properties: &str) -> String {
    building(id, properties, &format!("<gml:posList>{SQUARE}</gml:posList>"))
}

fn model(members: &str) -> String {
    format!("<core:CityModel {SPACES}>{members}</core:CityModel>")
}

fn member(content: &str) -> String {
    format!("<core:cityObjectMember>{content}</core:cityObjectMember>")
}

fn read_text(text: impl AsRef<[u8]>, options: &ReadOptions) -> ParsedDocument {
    let folder = Folder::new("odd");
    folder.put_png("t.png", 8, 4, [200, 100, 50, 255]);
    read_with(&folder.put("a.gml", text), &CITYGML, options).expect("readable")
}

fn read(text: &str) -> ParsedDocument {
    read_text(text, &ReadOptions::default())
}

fn names(document: &ParsedDocument) -> Vec<&str> {
    document.objects.iter().map(|object| object.name.as_str()).collect()
}

fn is_citygml(text: &str) -> bool {
    detect(&FileHead::new(text.into())).is_some_and(|format| format.name == "citygml")
}

#[test]
fn answers_of_web_feature_services_are_documents() {
    let (a, b) = (house("a", ""), house("b", ""));
    for (text, expected) in [
        (format!("<wfs:FeatureCollection {SPACES}><wfs:member>{a}</wfs:member><wfs:member>{b}</wfs:member></wfs:FeatureCollection>"), ["a", "b"]),
        (
            format!(
                "<wfs:FeatureCollection {SPACES}><gml:boundedBy/><gml:featureMember>{a}</gml:featureMember><gml:featureMember>{b}</gml:featureMember></wfs:FeatureCollection>"
            ),
            ["a", "b"],
        ),
        (format!("<gml:FeatureCollection {SPACES}><gml:featureMembers>{a}{b}</gml:featureMembers></gml:FeatureCollection>"), ["a", "b"]),
        (
            format!(
                "<ogr:FeatureCollection {SPACES} xmlns:ogr='o'><gml:featureMember>{a}</gml:featureMember><gml:featureMember>{b}</gml:featureMember></ogr:FeatureCollection>"
            ),
            ["a", "b"],
        ),
        (
            format!(
                "<wfs:FeatureCollection {SPACES}><wfs:member><wfs:FeatureCollection><wfs:member>{a}</wfs:member></wfs:FeatureCollection></wfs:member><wfs:member>{b}</wfs:member></wfs:FeatureCollection>"
            ),
            ["a", "b"],
        ),
        (
            format!(
                "<wfs:FeatureCollection {SPACES}><wfs:member><wfs:Tuple><wfs:member>{a}</wfs:member><wfs:member>{b}</wfs:member></wfs:Tuple></wfs:member></wfs:FeatureCollection>"
            ),
            ["a", "b"],
        ),
        (
            format!(
                "<wfs:FeatureCollection {SPACES}><wfs:member>{}</wfs:member></wfs:FeatureCollection>",
                model(&format!("{}{}", member(&a), member(&b)))
            ),
            ["a", "b"],
        ),
    ] {
        assert!(is_citygml(&text), "{text}");
        let document = read(&text);
        assert_eq!((names(&document), document.count()), (expected.to_vec(), 4), "{text}");
        assert_eq!(document.report.findings, [], "{text}");
    }
    for text in ["<wfs:FeatureCollection xmlns:wfs='w'><wfs:member/></wfs:FeatureCollection>", "<FeatureCollection/>", "<html xmlns:c='citygml'/>"] {
        assert!(!is_citygml(text), "{text}");
    }
}

#[test]
fn appearances_in_a_nested_model_are_used() {
    let red = "<app:appearanceMember><app:Appearance><app:theme>t</app:theme><app:surfaceDataMember><app:X3DMaterial><app:diffuseColor>1 0 0</app:diffuseColor><app:target>#a-p</app:target></app:X3DMaterial></app:surfaceDataMember></app:Appearance></app:appearanceMember>";
    let nested = model(&format!("{}{red}", member(&house("a", ""))));
    let document = read(&format!("<wfs:FeatureCollection {SPACES}><wfs:member>{nested}</wfs:member></wfs:FeatureCollection>"));
    assert_eq!(document.material_of(0).diffuse, [1.0, 0.0, 0.0, 1.0]);
}

fn textured(target: &str, ring: &str) -> String {
    format!(
        "<app:appearanceMember><app:Appearance><app:theme>t</app:theme><app:surfaceDataMember><app:ParameterizedTexture><app:imageURI>t.png</app:imageURI><app:target uri='#{target}'><app:TexCoordList><app:textureCoordinates ring='#{ring}'>0 0 1 0 1 1 0 1 0 0</app:textureCoordinates></app:TexCoordList></app:target></app:ParameterizedTexture></app:surfaceDataMember></app:Appearance></app:appearanceMember>"
    )
}

#[test]
fn targets_that_name_a_ring_are_drawn_and_dangling_ones_counted() {
    for (target, ring, textures, ring_notes, missing) in [
        ("a-p", "a-p-r", 1, 0, 0),
        ("a-p-r", "a-p-r", 1, 1, 0),
        ("a-p", "a-p", 1, 0, 0),
        ("a-p", "nothing", 1, 0, 0),
        ("a-p-r", "nothing", 1, 1, 0),
        ("a-p_X", "a-p-r_X", 0, 0, 1),
        ("a", "nothing", 0, 0, 0),
    ] {
        for text in
            [format!("{}{}", member(&house("a", "")), textured(target, ring)), format!("{}{}", textured(target, ring), member(&house("a", "")))]
        {
            let document = read(&model(&text));
            let drawn = usize::from(document.material_of(0).texture.is_some());
            let found = (drawn, document.reported("appearance-target-is-ring"), document.reported("appearance-target-missing"));
            assert_eq!(found, (textures, ring_notes, missing), "{target} {ring}");
        }
    }
    let missing = read(&model(&format!("{}{}{}", member(&house("a", "")), textured("x", "y"), textured("z", "y"))));
    let finding = missing.report.findings.iter().find(|f| f.message.reason == Reason::AppearanceTargetMissing).expect("a finding");
    assert_eq!((finding.count, finding.example.as_str()), (2, "t.png"));
}

#[test]
fn targets_in_parts_that_are_not_drawn_are_not_missing() {
    let levels = |lod: u8| {
        format!(
            "<bldg:lod{lod}MultiSurface><gml:MultiSurface><gml:surfaceMember>{}</gml:surfaceMember></gml:MultiSurface></bldg:lod{lod}MultiSurface>",
            polygon(&format!("p{lod}"), &format!("<gml:posList>{SQUARE}</gml:posList>"))
        )
    };
    let text = format!("<bldg:Building gml:id='a'>{}{}</bldg:Building>", levels(1), levels(2));
    let document = read(&model(&format!("{}{}{}", member(&text), textured("p1", "p1-r"), textured("p2", "p2-r"))));
    assert_eq!((document.textures.len(), document.reported("appearance-target")), (1, 0));
}

#[test]
fn versions_that_have_ended_are_left_out_unless_their_date_is_requested() {
    let old = house("old", "<core:creationDate>2001-01-01</core:creationDate><core:terminationDate>2010-06-30</core:terminationDate>");
    let new = house("new", "<core:creationDate>2010-06-30</core:creationDate>");
    let planned = house("planned", "<core:validFrom>2990-01-01T00:00:00</core:validFrom><core:validTo>9999-12-31T00:00:00</core:validTo>");
    let text = model(&[&old, &new, &planned].map(|one| member(one)).concat());
    for (at, expected, ended, others) in [
        (None, &["new", "planned"][..], 1, 0),
        (Some("2005-01-01"), &["old"], 0, 2),
        (Some("2010-06-30"), &["new"], 0, 2),
        (Some("1990-01-01"), &[], 0, 3),
        (Some("2990-01-01T12:00:00Z"), &["new", "planned"], 0, 1),
    ] {
        let document = read_text(&text, &of_format(json!({"at": at})));
        assert_eq!((names(&document), document.count()), (expected.to_vec(), 2 * expected.len()), "{at:?}");
        assert_eq!((document.reported("version-ended"), document.reported("version-of-other-date")), (ended, others), "{at:?}");
    }
    let earlier = read_text(&text, &of_format(json!({"versions_on": "2010-06-29"})));
    assert_eq!((names(&earlier), earlier.reported("version-ended")), (vec!["old", "new", "planned"], 0));
    for options in [json!({"at": "soon"}), json!({"versions_on": "soon"})] {
        assert!(map3d_read::open(&Folder::new("at").put("a.gml", &text), &CITYGML, &of_format(options)).is_err());
    }
}

#[test]
fn parts_end_alone_and_what_others_refer_to_is_drawn_for_them() {
    let part = |id: &str, end: &str, geometry: &str| {
        format!(
            "<bldg:consistsOfBuildingPart><bldg:BuildingPart gml:id='{id}'>{end}<bldg:lod1MultiSurface><gml:MultiSurface>{geometry}</gml:MultiSurface></bldg:lod1MultiSurface></bldg:BuildingPart></bldg:consistsOfBuildingPart>"
        )
    };
    let end = "<core:validTo>2011-01-01T00:00:00</core:validTo>";
    let own = |id: &str| format!("<gml:surfaceMember>{}</gml:surfaceMember>", polygon(id, &format!("<gml:posList>{SQUARE}</gml:posList>")));
    let parts = format!("<bldg:Building gml:id='a'>{}{}</bldg:Building>", part("p1", end, &own("g1")), part("p2", "", &own("g2")));
    let other = "<bldg:Building gml:id='b'><bldg:lod1MultiSurface><gml:MultiSurface><gml:surfaceMember xlink:href='#g1' xmlns:xlink='x'/></gml:MultiSurface></bldg:lod1MultiSurface></bldg:Building>";
    let document = read(&model(&format!("{}{}", member(&parts), member(other))));
    assert_eq!((names(&document), document.count(), document.reported("version-ended")), (vec!["a", "p2", "b"], 4, 1));
}

#[test]
fn surfaces_without_heights_are_named_and_marked() {
    let flat = ["<gml:posList srsDimension='2'>0 0 2 0 2 2 0 2 0 0</gml:posList>", "<gml:posList>0 0 2 0 2 2 0 2 0 0</gml:posList>"];
    let pos = "<gml:pos>0 0</gml:pos><gml:pos>2 0</gml:pos><gml:pos>2 2</gml:pos><gml:pos>0 2</gml:pos><gml:pos>0 0</gml:pos>";
    let coordinates = "<gml:coordinates>0,0 2,0 2,2 0,2 0,0</gml:coordinates>";
    for positions in [flat[0], flat[1], pos, coordinates] {
        let document = read(&model(&member(&building("a", "", positions))));
        assert_eq!((document.count(), document.reported("polygon-without-height"), document.objects[0].without_height), (2, 1, true), "{positions}");
    }
    let solid = read(&model(&member(&house("a", ""))));
    assert_eq!((solid.report.findings.len(), solid.objects[0].without_height), (0, false));
    let both = building("a", "", flat[0]).replace(
        "</gml:surfaceMember>",
        &format!("</gml:surfaceMember><gml:surfaceMember>{}</gml:surfaceMember>", polygon("q", &format!("<gml:posList>{SQUARE}</gml:posList>"))),
    );
    let mixed = read(&model(&member(&both)));
    assert_eq!((mixed.count(), mixed.reported("polygon-without-height"), mixed.objects[0].without_height), (4, 1, false));
    let line = serde_json::to_value(&mixed.objects[0]).expect("plain data");
    assert_eq!(line.get("without_height"), None, "only where it is true");
}

#[test]
fn units_other_than_metres_stay_with_attributes() {
    let properties = "<bldg:measuredHeight uom='ft'>30.0</bldg:measuredHeight><gen:measureAttribute name='area' xmlns:gen='g'><gen:value uom='m2'>80</gen:value></gen:measureAttribute><gen:measureAttribute name='width' xmlns:gen='g'><gen:value uom='#m'>8</gen:value></gen:measureAttribute><gen:genericAttribute xmlns:gen='g'><gen:MeasureAttribute><gen:name>flow</gen:name><gen:value uom='urn:ogc:def:uom:UCUM::l/s'>3</gen:value></gen:MeasureAttribute></gen:genericAttribute>";
    let document = read(&model(&member(&house("a", properties))));
    let attributes: Value = serde_json::to_value(&document.objects[0].attributes).expect("plain data");
    assert_eq!(attributes, json!({"measuredHeight": 30.0, "measuredHeight/unit": "ft", "area": 80, "width": 8, "flow": 3, "flow/unit": "l/s"}));
}

#[test]
fn utf_16_is_read_without_a_mark_whatever_its_letters() {
    let text = model(&member(&house("a", &format!("<gml:name>{}</gml:name>", "東京都千代田区一丁目".repeat(800)))));
    let declared = format!("<?xml version='1.0' encoding='UTF-8'?>\n{text}");
    for text in [&text, &declared, &format!("\n {text}")] {
        for to_bytes in [u16::to_le_bytes as fn(u16) -> [u8; 2], u16::to_be_bytes] {
            let bytes: Vec<u8> = text.encode_utf16().flat_map(to_bytes).collect();
            assert!(detect(&FileHead::new(bytes[..bytes.len().min(map3d_read::HEAD_BYTES)].to_vec())).is_some());
            let document = read_text(&bytes, &ReadOptions::default());
            assert_eq!((names(&document), document.count()), (vec!["a"], 2));
        }
    }
}

#[test]
fn a_theme_whose_images_are_missing_does_not_win() {
    let theme = |name: &str, image: &str| textured("a-p", "a-p-r").replace("<app:theme>t<", &format!("<app:theme>{name}<")).replace("t.png", image);
    let building = |appearances: &str| house("a", &appearances.replace("appearanceMember", "appearance"));
    for text in [
        format!("{}{}{}", theme("lost", "lost.png"), theme("photos", "t.png"), member(&house("a", ""))),
        member(&building(&format!("{}{}", theme("lost", "lost.png"), theme("photos", "t.png")))),
    ] {
        let document = read(&model(&text));
        assert_eq!(document.textures.len(), 1, "{text}");
        let said: Vec<&str> = document.report.findings.iter().map(|f| f.example.as_str()).collect();
        assert!(said.contains(&"lost: lost.png") && said.contains(&"photos"), "{said:?}");
        assert_eq!(document.reported("theme-without-images"), 1);
        let requested = read_text(model(&text), &of_format(json!({"theme": "lost"})));
        assert_eq!((requested.textures.len(), requested.reported("image-file-not-found"), requested.reported("theme-without-images")), (0, 1, 0));
    }
}
