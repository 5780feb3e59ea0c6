//! Broken, hostile or too large CityGML: the fault is counted or an error, everything else is read.

use crate::documents::city_model::{at_lod, building, member, model, multi_surface, polygon, read_text, square, try_text};
use crate::documents::{Folder, is_format_error, is_limit_error, read_with};
use map3d_read::{CITYGML, ReadOptions};
use serde_json::json;

#[test]
fn broken_polygons_are_skipped_and_counted() {
    for (case, points, reason) in [
        ("no points", "", "ring-with-too-few-points"),
        ("one point", "0 0 0", "ring-with-too-few-points"),
        ("two points", "0 0 0 1 1 1 0 0 0", "ring-with-too-few-points"),
        ("one point repeated", "1 1 1 1 1 1 1 1 1 1 1 1", "ring-with-too-few-points"),
        ("on a line", "0 0 0 1 1 1 2 2 2 0 0 0", "polygon-without-area"),
        ("words", "0 0 a 1 1 1 2 2 2", "polygon-coordinates-unreadable"),
        ("numbers left over", "0 0 0 1 1 1 2 2", "polygon-coordinates-unreadable"),
        ("not a number", "0 0 0 nan 1 1 2 2 0 0 0 0", "coordinate-not-finite"),
        ("infinite", "0 0 0 1e999 1 1 2 2 0 0 0 0", "coordinate-not-finite"),
        ("commas", "0,0,0 1,1,1 2,2,0", "polygon-coordinates-unreadable"),
    ] {
        let members = member(&polygon("bad", points)) + &member(&square("good", 1));
        let document = read_text(&building(&format!("<bldg:lod2MultiSurface>{}</bldg:lod2MultiSurface>", multi_surface(&members))));
        assert_eq!((document.count(), document.area()), (2, 4.0), "{case}");
        assert_eq!(document.reported(reason), 1, "{case}: {:?}", document.report);
    }
}

#[test]
fn first_fault_is_an_error_with_strict() {
    let strict = ReadOptions { strict: true, ..ReadOptions::default() };
    let text = building(&at_lod(2, &polygon("p", "0 0 0 1 1 1 0 0 0")));
    assert!(is_format_error(try_text(&text, &strict), "ring with too few points: b1"));
    assert!(try_text(&building(&at_lod(2, &square("p", 1))), &strict).is_ok());
}

#[test]
fn unresolved_and_external_references_are_reported() {
    let body = |href: &str| {
        building(&format!(
            "{}<bldg:lod2Solid><gml:Solid><gml:exterior xlink:href=\"{href}\"/></gml:Solid></bldg:lod2Solid>",
            at_lod(2, &square("a", 1))
        ))
    };
    assert_eq!(read_text(&body("#nothing")).reported("reference-unresolved"), 1);
    assert_eq!(read_text(&body("other.gml#a")).reported("other-file-not-found"), 1);
}

#[test]
fn cycles_of_references_are_skipped_and_counted() {
    let group = |id: &str, inner: &str| format!("<gml:CompositeSurface gml:id='{id}'>{inner}</gml:CompositeSurface>");
    let to = |id: &str| format!("<gml:surfaceMember xlink:href='#{id}'/>");
    let itself = group("a", &(to("a") + &member(&square("p", 1))));
    let two = group("a", &(to("b") + &member(&square("p", 1)))) + &group("b", &to("a"));
    for (case, inner) in [("itself", member(&itself)), ("two", format!("<gml:surfaceMembers>{two}</gml:surfaceMembers>"))] {
        let document = read_text(&building(&format!("<bldg:lod2MultiSurface>{}</bldg:lod2MultiSurface>", multi_surface(&inner))));
        assert_eq!(document.area(), 4.0, "{case}");
        assert!(document.reported("geometry-refers-to-itself") > 0, "{case}");
    }
}

#[test]
fn references_that_double_at_every_level_are_read_in_linear_time() {
    let mut groups = member(&square("p", 1));
    for k in 0..60 {
        let target = if k == 0 { "p".to_owned() } else { format!("g{}", k - 1) };
        let to = format!("<gml:surfaceMember xlink:href='#{target}'/>");
        groups += &member(&format!("<gml:CompositeSurface gml:id='g{k}'>{to}{to}</gml:CompositeSurface>"));
    }
    assert_eq!(read_text(&building(&format!("<bldg:lod2MultiSurface>{}</bldg:lod2MultiSurface>", multi_surface(&groups)))).area(), 4.0);
    let chain: String = (0..20_000)
        .map(|k| member(&format!("<gml:CompositeSurface gml:id='c{k}'><gml:surfaceMember xlink:href='#c{}'/></gml:CompositeSurface>", k + 1)))
        .collect();
    let document =
        read_text(&building(&format!("<bldg:lod2MultiSurface>{}</bldg:lod2MultiSurface>", multi_surface(&(chain + &member(&square("c20000", 1)))))));
    assert_eq!(document.area(), 4.0);
}

#[test]
fn objects_before_malformed_xml_are_read() {
    let whole = model(
        &(0..3)
            .map(|k| {
                format!("<core:cityObjectMember><bldg:Building gml:id='b{k}'>{}</bldg:Building></core:cityObjectMember>", at_lod(2, &square("p", k)))
            })
            .collect::<String>(),
    );
    assert_eq!(read_text(&whole).objects.len(), 3);
    let cut = whole.rfind("posList").expect("a posList");
    let strict = ReadOptions { strict: true, ..ReadOptions::default() };
    for text in [whole[..cut].to_owned(), format!("{}wrong{}", &whole[..cut], &whole[cut + 7..]), format!("{}<{}", &whole[..cut], &whole[cut..])] {
        let document = read_text(&text);
        assert_eq!((document.objects.len(), document.count()), (2, 4));
        assert_eq!(document.reported("document-broken"), 1, "{:?}", document.report);
        assert!(is_format_error(try_text(&text, &strict), "byte"));
    }
}

#[test]
fn documents_without_a_city_model_are_an_error() {
    for text in ["", "text", "<html/>", "<?xml version='1.0'?>", "<!-- -->", "<CityModel", "<a><CityModel/></a>"] {
        assert!(try_text(text, &ReadOptions::default()).is_err(), "{text}");
    }
}

#[test]
fn document_types_and_custom_entities_are_an_error() {
    let entity = building("<gml:name>&secret;</gml:name>");
    assert!(is_format_error(try_text(&entity, &ReadOptions::default()), "entity &secret;"));
    let dtd = "<!DOCTYPE a [<!ENTITY x SYSTEM \"file:///etc/passwd\">]><CityModel/>";
    assert!(is_format_error(try_text(dtd, &ReadOptions::default()), "document type"));
}

#[test]
fn elements_may_nest_up_to_the_limit() {
    // Four levels: root, member, building, property.
    let nested = |n: usize| {
        format!("<CityModel><cityObjectMember><Building><x>{}{}</x></Building></cityObjectMember></CityModel>", "<y>".repeat(n), "</y>".repeat(n))
    };
    assert!(try_text(&nested(252), &ReadOptions::default()).is_ok());
    assert!(is_limit_error(try_text(&nested(253), &ReadOptions::default()), "XML depth"));
    let deep = |n: usize| {
        let open = "<gml:CompositeSurface><gml:surfaceMember>".repeat(n);
        let close = "</gml:surfaceMember></gml:CompositeSurface>".repeat(n);
        building(&format!("<bldg:lod2MultiSurface>{open}{}{close}</bldg:lod2MultiSurface>", square("p", 1)))
    };
    assert_eq!(try_text(&deep(120), &ReadOptions::default()).expect("readable").area(), 4.0);
    assert!(is_limit_error(try_text(&deep(10_000), &ReadOptions::default()), "XML depth"));
}

#[test]
fn limits_are_inclusive() {
    let text = building(&at_lod(2, &(square("a", 1) + &square("b", 2))));
    for (limit, is_ok) in [(4, true), (3, false)] {
        let result = try_text(&text, &ReadOptions { max_triangles: limit, ..ReadOptions::default() });
        assert!(if is_ok { result.is_ok() } else { is_limit_error(result, "max_triangles") });
    }
    for (limit, triangles) in [(4, 4), (3, 0)] {
        let document = try_text(&text, &ReadOptions { max_ring_vertices: limit, ..ReadOptions::default() }).expect("readable");
        assert_eq!(document.count(), triangles);
    }
    let small = ReadOptions { max_object_bytes: 100, ..ReadOptions::default() };
    assert!(is_limit_error(try_text(&text, &small), "max_object_bytes"));
}

#[test]
fn documents_in_other_encodings_are_read() {
    let text = building("<gml:name>Mühle</gml:name>");
    let latin: Vec<u8> = text.replace("UTF-8", "ISO-8859-1").chars().map(|c| c as u8).collect();
    let utf16: Vec<u8> =
        "\u{feff}".chars().chain(text.replace("UTF-8", "UTF-16").chars()).collect::<String>().encode_utf16().flat_map(u16::to_le_bytes).collect();
    let mislabelled: Vec<u8> = text.chars().map(|c| c as u8).collect();
    let with_bom = [&[0xEF, 0xBB, 0xBF], text.as_bytes()].concat();
    for (bytes, name) in [(text.clone().into_bytes(), "Mühle"), (latin, "Mühle"), (utf16, "Mühle"), (with_bom, "Mühle"), (mislabelled, "Mühle")]
    {
        let folder = Folder::new("encodings");
        let path = folder.put("a.gml", bytes);
        let document = read_with(&path, &CITYGML, &ReadOptions::default()).expect("readable");
        assert_eq!(document.objects[0].attributes["name"], json!(name));
    }
}

#[test]
fn complete_polygons_before_the_end_of_a_cut_document_are_read() {
    let squares: String = (0..30).map(|k| member(&square(&format!("p{k}"), k)) + "\n").collect();
    let text = building(&format!("<bldg:lod2MultiSurface>{}</bldg:lod2MultiSurface>", multi_surface(&squares)));
    let polygon = text.find("\"p20\"").expect("the polygon");
    let cut = polygon + text[polygon..].find("</gml:posList>").expect("its positions");
    let wrong = format!("{}</gml:wrong>{}", &text[..cut], &text[cut + "</gml:posList>".len()..]);
    for (broken, what) in [(text[..cut].to_owned(), "the document ends inside"), (wrong, "gml:wrong")] {
        let document = read_text(&broken);
        assert_eq!((document.objects.len(), document.count(), document.area()), (1, 40, 80.0));
        let warning = document.report.findings.iter().find(|w| w.message.reason.code() == "document-broken").expect("a warning");
        let line = broken[..cut].matches('\n').count() + 1;
        assert!(warning.example.contains(&format!(", line {line} (")) && warning.example.contains(what), "{}", warning.example);
    }
    let exact = read_text(&text[..cut]).report.findings[0].example.clone();
    assert!(exact.starts_with(&format!("at byte {cut}, line")), "{exact}");
}

#[test]
fn colours_before_the_end_of_a_cut_document_are_used() {
    let material = |id: &str| {
        format!(
            "<app:surfaceDataMember><app:X3DMaterial><app:diffuseColor>1 0 0</app:diffuseColor><app:target>#{id}</app:target></app:X3DMaterial></app:surfaceDataMember>"
        )
    };
    let appearances = format!("<app:appearanceMember><app:Appearance><app:theme>t</app:theme>{}{}", material("p"), material("other"));
    let text = building(&at_lod(2, &square("p", 1))).replace("</core:CityModel>", &appearances);
    for cut in [text.len(), text.len() - 20] {
        let document = read_text(&text[..cut]);
        assert_eq!((document.count(), document.material_of(0).diffuse), (2, [1.0, 0.0, 0.0, 1.0]));
        assert_eq!(document.reported("document-broken"), 1);
    }
}

#[test]
fn faults_of_the_encoding_are_reported() {
    let text = building("<gml:name>Mühle am Bach</gml:name>");
    let latin: Vec<u8> = text.chars().map(|c| c as u8).collect();
    let zeros = text.replace("am Bach", "am\0 Bach\0").into_bytes();
    let unknown = text.replace("UTF-8", "KLINGON").into_bytes();
    let at = text.find('ü').expect("the letter");
    for (bytes, reason, example) in [
        (text.clone().into_bytes(), "", String::new()),
        (latin, "not-utf-8-as-declared", format!("byte {at}")),
        (zeros, "zero-bytes-left-out", format!("byte {}", at + "ühle am".len())),
        (unknown, "encoding-unknown", "KLINGON".to_owned()),
    ] {
        let folder = Folder::new("encodings");
        let path = folder.put("a.gml", bytes);
        let document = read_with(&path, &CITYGML, &ReadOptions::default()).expect("readable");
        assert_eq!(document.objects[0].attributes["name"], json!("Mühle am Bach"), "{reason}");
        let found: Vec<(&str, &str)> = document.report.findings.iter().map(|w| (w.message.reason.code(), w.example.as_str())).collect();
        let expected: Vec<(&str, &str)> = if reason.is_empty() { vec![] } else { vec![(reason, example.as_str())] };
        assert_eq!(found, expected);
        let strict = ReadOptions { strict: true, ..ReadOptions::default() };
        assert_eq!(read_with(&path, &CITYGML, &strict).is_ok(), reason.is_empty(), "{reason}");
    }
}
