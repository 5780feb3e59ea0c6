//! Laws of `gml:Tin`: one without triangles is the Delaunay triangulation of its control points; one with triangles is what it says.

use crate::documents::city_model::{model, read_text, try_text};
use crate::documents::is_limit_error;
use map3d_read::ReadOptions;

const CORNERS: &str = "0 0 0 10 0 1 10 10 2 0 10 3";

fn relief(tin: &str) -> String {
    model(&format!(
        "<core:cityObjectMember><dem:ReliefFeature gml:id='r' xmlns:dem='d'><dem:lod>2</dem:lod><dem:reliefComponent>\
         <dem:TINRelief><dem:lod>2</dem:lod><dem:tin>{tin}</dem:tin></dem:TINRelief></dem:reliefComponent></dem:ReliefFeature></core:cityObjectMember>"
    ))
}

fn control(points: &str) -> String {
    format!("<gml:controlPoint><gml:posList>{points}</gml:posList></gml:controlPoint>")
}

fn line(property: &str, points: &str) -> String {
    format!("<gml:{property}><gml:LineStringSegment><gml:posList>{points}</gml:posList></gml:LineStringSegment></gml:{property}>")
}

fn tin(body: &str) -> String {
    relief(&format!("<gml:Tin gml:id='t'>{body}</gml:Tin>"))
}

fn plan_area(text: &str) -> f64 {
    let document = read_text(text);
    let area = |[a, b, c]: [[f64; 3]; 3]| ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0;
    document.triangles().iter().map(|t| area(t.corners)).sum()
}

#[test]
fn control_points_become_triangles() {
    for empty in ["", "<gml:trianglePatches/>", "<gml:patches></gml:patches>"] {
        let document = read_text(&tin(&format!("{empty}{}", control(CORNERS))));
        assert_eq!(document.count(), 2, "{empty}");
        assert_eq!(document.objects[0].lod.as_deref(), Some("2"));
        assert!(document.report.findings.is_empty(), "{:?}", document.report);
    }
    let positions =
        "<gml:pos>0 0 0</gml:pos><gml:pointProperty><gml:Point><gml:pos>4 0 0</gml:pos></gml:Point></gml:pointProperty><gml:pos>0 4 0</gml:pos>";
    assert_eq!(plan_area(&tin(&format!("<gml:controlPoint>{positions}</gml:controlPoint>"))), 8.0);
    assert_eq!(plan_area(&tin("<gml:controlPoint><gml:coordinates>0,0,0 4,0,0 0,4,0</gml:coordinates></gml:controlPoint>")), 8.0);
}

#[test]
fn a_tin_with_triangles_keeps_them() {
    let triangle = "<gml:Triangle><gml:exterior><gml:LinearRing><gml:posList>0 0 0 1 0 0 0 1 0 0 0 0</gml:posList></gml:LinearRing></gml:exterior></gml:Triangle>";
    let patches = format!("<gml:trianglePatches>{triangle}</gml:trianglePatches>");
    let lines = line("breakLines", "0 0 0 5 5 5") + &line("stopLines", "0 0 0 5 5 5");
    let document = read_text(&tin(&format!("{patches}{lines}<gml:maxLength uom='m'>0.1</gml:maxLength>{}", control(CORNERS))));
    assert_eq!((document.count(), document.reported("points-and-lines")), (1, 2));
    let document = read_text(&relief(&format!("<gml:TriangulatedSurface>{patches}{}</gml:TriangulatedSurface>", control(CORNERS))));
    assert_eq!(document.count(), 1);
}

#[test]
fn break_lines_stop_lines_and_the_longest_side_shape_the_tin() {
    // Delaunay would connect the near corners 1 and 3; the break line connects the far ones, 0 and 2.
    let kite = "0 0 0 9 3 1 20 20 0 3 9 1";
    let has_ridge = |text: &str| read_text(text).triangles().iter().all(|t| t.corners.contains(&[0.0; 3]) && t.corners.contains(&[20.0, 20.0, 0.0]));
    assert!(!has_ridge(&tin(&control(kite))) && has_ridge(&tin(&(line("breakLines", "0 0 0 20 20 0") + &control(kite)))));
    let stop = read_text(&tin(&(line("stopLines", "8 4 0 12 9 0") + &control(kite))));
    assert_eq!((stop.count(), stop.reported("tin-triangle-at-stop-line")), (1, 1), "{:?}", stop.report);
    let far = format!("{CORNERS} 500 5 0");
    for (length, skipped) in [("<gml:maxLength uom='m'>20</gml:maxLength>", 1), ("<gml:maxLength uom='urn:x#km'>0.02</gml:maxLength>", 1), ("", 0)] {
        let document = read_text(&tin(&(length.to_owned() + &control(&far))));
        assert_eq!(document.reported("tin-triangle-too-long"), skipped, "{length}");
        assert_eq!(document.count() as u64, 3 - skipped, "{length}");
    }
    let document = read_text(&tin(&(control(CORNERS) + "<gml:maxLength uom='m'>long</gml:maxLength>")));
    assert_eq!((document.count(), document.reported("tin-max-length-invalid")), (2, 1));
}

#[test]
fn a_broken_tin_is_skipped_and_counted() {
    let crs = "<gml:controlPoint><gml:posList srsName='EPSG:25833'>0 0 0 1 0 0 0 1 0</gml:posList></gml:controlPoint>";
    for (case, body, reason) in [
        ("nothing", String::new(), "tin-with-too-few-points"),
        ("no point", control(""), "tin-with-too-few-points"),
        ("two points", control("0 0 0 1 0 0"), "tin-with-too-few-points"),
        ("one place", control("1 1 0 1 1 0 1 1 0"), "tin-with-too-few-points"),
        ("a line", control("0 0 0 1 1 0 2 2 5"), "tin-points-on-a-line"),
        ("words", control("0 0 a 1 1 0 2 2 5"), "tin-coordinates-unreadable"),
        ("numbers left over", control("0 0 0 1 0 0 0 1"), "tin-coordinates-unreadable"),
        ("another system", control(CORNERS) + crs, "tin-in-several-crs"),
        ("huge", control("0 0 0 1e300 0 0 0 1e300 0"), "tin-not-triangulated"),
    ] {
        let document = try_text(&tin(&body), &ReadOptions::default()).expect("readable");
        assert_eq!((document.count(), document.reported(reason)), (0, 1), "{case}: {:?}", document.report);
        assert!(try_text(&tin(&body), &ReadOptions { strict: true, ..ReadOptions::default() }).is_err(), "{case}");
    }
}

#[test]
fn single_broken_points_cost_themselves() {
    let document = read_text(&tin(&control(&format!("nan 0 0 {CORNERS} 1e999 0 0 0 0 inf"))));
    assert_eq!((document.count(), document.reported("tin-point-not-finite")), (2, 3), "{:?}", document.report);
    let document = read_text(&tin(&control(&format!("{CORNERS} {CORNERS} 0 0 77"))));
    assert_eq!((document.count(), document.reported("tin-heights-differ")), (2, 1), "{:?}", document.report);
    let crossing = line("breakLines", "0 0 0 10 10 2") + &line("breakLines", "10 0 1 0 10 3 nan 0 0 4 4 4");
    let document = read_text(&tin(&(crossing + &control(CORNERS))));
    assert_eq!(document.reported("tin-break-lines-cross"), 1, "{:?}", document.report);
}

#[test]
fn coordinate_systems_of_control_points_are_kept() {
    let document = read_text(&tin("<gml:controlPoint><gml:posList srsName='EPSG:25833'>0 0 0 1 0 0 0 1 0</gml:posList></gml:controlPoint>"));
    assert_eq!(document.crs_names[document.batches[0].crs as usize].as_deref(), Some("EPSG:25833"));
    let degrees = "<gml:controlPoint><gml:posList srsName='EPSG:4979'>48 11 500 48.001 11 500 48 11.001 500</gml:posList></gml:controlPoint>";
    let length = |metres: u32| format!("<gml:maxLength uom='m'>{metres}</gml:maxLength>");
    assert_eq!(read_text(&tin(&(length(200) + degrees))).count(), 1, "degrees are about 111 km");
    assert_eq!(read_text(&tin(&(length(100) + degrees))).count(), 0);
}

#[test]
fn the_limits_of_geometry_hold_for_control_points() {
    let many: String = (0..2_000).map(|k| format!("{} {} 0 ", k % 50, k / 50)).collect();
    let options = |max_object_bytes| ReadOptions { max_object_bytes, ..ReadOptions::default() };
    assert!(is_limit_error(try_text(&tin(&control(&many)), &options(40_000)), "max_object_bytes"), "points");
    assert!(is_limit_error(try_text(&tin(&control(&many)), &options(200_000)), "max_object_bytes"), "triangles");
    assert_eq!(try_text(&tin(&control(&many)), &options(2_000_000)).expect("readable").count(), 2 * 49 * 39);
}

#[test]
fn appearances_may_target_the_tin() {
    let material = "<app:appearance><app:Appearance><app:theme>a</app:theme><app:surfaceDataMember><app:X3DMaterial>\
        <app:diffuseColor>1 0 0</app:diffuseColor><app:target>#t</app:target></app:X3DMaterial></app:surfaceDataMember></app:Appearance></app:appearance>";
    let text =
        tin(&control(CORNERS)).replace("<dem:lod>2</dem:lod><dem:reliefComponent>", &format!("{material}<dem:lod>2</dem:lod><dem:reliefComponent>"));
    let document = read_text(&text);
    assert!(document.triangles().iter().all(|t| document.materials[t.material as usize].diffuse == [1.0, 0.0, 0.0, 1.0]));
}
