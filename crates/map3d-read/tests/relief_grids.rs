//! Laws of RasterReliefs: heights in the document are triangles at the grid's points; a raster file is handed on with its place; nothing is lost
//! without a word.

use crate::documents::city_model::{model, read_text, try_text};
use crate::documents::{Folder, of_format};
use map3d_read::{CITYGML, ReadOptions, open};
use serde_json::json;

const DOMAIN: &str = "<gml:limits><gml:GridEnvelope><gml:low>0 0</gml:low><gml:high>2 1</gml:high></gml:GridEnvelope></gml:limits>\
     <gml:axisName>x</gml:axisName><gml:axisName>y</gml:axisName><gml:origin><gml:Point srsName='EPSG:25832'><gml:pos>100 200</gml:pos></gml:Point></gml:origin>\
     <gml:offsetVector>10 0</gml:offsetVector><gml:offsetVector>0 5</gml:offsetVector>";

fn relief(domain: &str, range: &str, extent: &str) -> String {
    model(&format!(
        "<core:cityObjectMember><dem:ReliefFeature gml:id='r' xmlns:dem='d'><dem:lod>2</dem:lod><dem:reliefComponent><dem:RasterRelief gml:id='c'>\
         <dem:lod>2</dem:lod>{extent}<dem:grid><gml:RectifiedGridCoverage><gml:rectifiedGridDomain><gml:RectifiedGrid dimension='2'>{domain}</gml:RectifiedGrid>\
         </gml:rectifiedGridDomain><gml:rangeSet>{range}</gml:rangeSet></gml:RectifiedGridCoverage></dem:grid></dem:RasterRelief></dem:reliefComponent>\
         </dem:ReliefFeature></core:cityObjectMember>"
    ))
}

fn inline(heights: &str) -> String {
    format!("<gml:DataBlock><gml:rangeParameters/><gml:tupleList>{heights}</gml:tupleList></gml:DataBlock>")
}

fn file(name: &str) -> String {
    format!("<gml:File><gml:rangeParameters/><gml:fileName>{name}</gml:fileName><gml:fileStructure>Record Interleaved</gml:fileStructure></gml:File>")
}

/// Returns position → height of all corners, in whole metres.
fn corners(text: &str) -> Vec<[i64; 3]> {
    let mut found: Vec<[i64; 3]> = read_text(text).triangles().iter().flat_map(|t| t.corners).map(|p| p.map(|v| v as i64)).collect();
    found.sort_unstable();
    found.dedup();
    found
}

#[test]
fn heights_in_the_document_are_triangles_at_the_points_of_the_grid() {
    let text = relief(DOMAIN, &inline("1 2 3 4 5 6"), "");
    assert_eq!(corners(&text), [[100, 200, 1], [100, 205, 4], [110, 200, 2], [110, 205, 5], [120, 200, 3], [120, 205, 6]]);
    let document = read_text(&text);
    assert_eq!((document.count(), document.objects[0].lod.as_deref()), (4, Some("2")));
    assert!(document.report.findings.is_empty(), "{:?}", document.report);
    let upwards = |[a, b, c]: [[f64; 3]; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0;
    assert!(document.triangles().iter().all(|t| upwards(t.corners)));
    let down = DOMAIN.replace("0 5</gml:offsetVector>", "0 -5</gml:offsetVector>");
    assert!(read_text(&relief(&down, &inline("1 2 3 4 5 6"), "")).triangles().iter().all(|t| upwards(t.corners)), "facing up in any order");
}

#[test]
fn the_sequence_rule_says_how_heights_run_over_the_grid() {
    for (order, heights) in
        [("+x+y", "1 2 3 4 5 6"), ("+x-y", "4 5 6 1 2 3"), ("-x+y", "3 2 1 6 5 4"), ("+y+x", "1 4 2 5 3 6"), ("-y-x", "6 3 5 2 4 1")]
    {
        let rule = format!(
            "<gml:coverageFunction><gml:GridFunction><gml:sequenceRule order='{order}'>Linear</gml:sequenceRule></gml:GridFunction></gml:coverageFunction>"
        );
        let text = relief(DOMAIN, &(inline(heights) + &rule), "");
        assert_eq!(corners(&text), [[100, 200, 1], [100, 205, 4], [110, 200, 2], [110, 205, 5], [120, 200, 3], [120, 205, 6]], "{order}");
    }
    let first = DOMAIN.replace("<gml:low>0 0", "<gml:low>1 1").replace("<gml:high>2 1", "<gml:high>3 2");
    assert_eq!(corners(&relief(&first, &inline("1 2 3 4 5 6"), ""))[0], [110, 205, 1], "grid coordinates count from the origin");
}

#[test]
fn gaps_have_no_triangles_and_are_counted() {
    for gap in ["missing", "-999999", "nan", "inf"] {
        let document = read_text(&relief(DOMAIN, &inline(&format!("{gap} 2 3 4 5 6")), ""));
        assert_eq!((document.count(), document.reported("grid-points-without-height")), (3, 1), "{gap}");
    }
}

#[test]
fn an_extent_bounds_the_heights() {
    let ring = "<dem:extent><gml:Polygon><gml:exterior><gml:LinearRing><gml:posList>100 200 0 110 200 0 110 205 0 100 205 0 100 200 0</gml:posList>\
         </gml:LinearRing></gml:exterior></gml:Polygon></dem:extent>";
    let document = read_text(&relief(DOMAIN, &inline("1 2 3 4 5 6"), ring));
    assert_eq!((document.count(), document.reported("relief-triangle-outside-extent")), (2, 2));
    assert!(document.triangles().iter().all(|t| t.corners.iter().all(|p| p[0] <= 110.0)), "the extent itself is not drawn");
}

#[test]
fn an_unusable_grid_says_why() {
    let numbers = inline("1 2 3 4 5 6");
    let rule = "<gml:sequenceRule>Boustrophedonic</gml:sequenceRule>";
    for (domain, range, reason) in [
        (DOMAIN.to_owned(), String::new(), "relief-grid-without-heights"),
        (DOMAIN.to_owned(), inline("1 2 3"), "relief-grid-heights-do-not-fit"),
        (DOMAIN.to_owned(), numbers.clone() + rule, "relief-grid-order-not-read"),
        (DOMAIN.replace("0 5</gml:off", "20 0</gml:off"), numbers.clone(), "relief-grid-without-area"),
        (DOMAIN.replace("0 5</gml:off", "0 nan</gml:off"), numbers.clone(), "relief-grid-without-area"),
        (DOMAIN.replace("<gml:high>2 1", "<gml:high>2 0"), numbers.clone(), "relief-grid-too-small"),
        (DOMAIN.replace("<gml:high>2 1", "<gml:high>1e300 1e300"), numbers.clone(), "relief-grid-too-small"),
        (DOMAIN.replace("<gml:pos>100 200", "<gml:pos>100"), numbers.clone(), "relief-grid-incomplete"),
        (String::new(), numbers.clone(), "relief-grid-incomplete"),
        (DOMAIN.to_owned(), file("none.tif"), "relief-file-not-found"),
        (DOMAIN.to_owned(), file("../none.tif"), "relief-file-outside-folder"),
        (DOMAIN.to_owned(), file("https://example.org/dem.tif"), "relief-url-not-fetched"),
    ] {
        let document = read_text(&relief(&domain, &range, ""));
        assert_eq!((document.count(), document.reported(reason)), (0, 1), "{reason}: {:?}", document.report);
    }
    for (max_object_bytes, heights) in [(500, numbers), (1000, inline(&"1 ".repeat(100)))] {
        let limits = ReadOptions { max_object_bytes, ..ReadOptions::default() };
        let document = try_text(&relief(DOMAIN, &heights, ""), &limits).expect("counted");
        assert_eq!(document.reported("relief-grid-with-too-many-heights"), 1, "{max_object_bytes}");
    }
}

#[test]
fn a_raster_file_is_handed_on_with_its_place() {
    let folder = Folder::new("relief-grids");
    folder.put("dem.tif", b"II*\0");
    let path = folder.put(
        "town.gml",
        relief(&DOMAIN.replace("<gml:low>0 0", "<gml:low>0 -1"), &(file("DEM.tif") + "<gml:sequenceRule order='+x-y'>Linear</gml:sequenceRule>"), "")
            .as_bytes(),
    );
    let mut document = open(&path, &CITYGML, &ReadOptions::default()).expect("a document");
    while document.next_batch().expect("readable").is_some() {}
    let [grid] = document.grids() else { panic!("one grid") };
    assert_eq!((grid.object.as_str(), grid.columns, grid.rows, grid.crs.as_deref()), ("r", 3, 3, Some("EPSG:25832")));
    assert_eq!((grid.first, grid.column_step, grid.row_step), ([100.0, 205.0], [10.0, 0.0], [0.0, -5.0]));
    assert!(grid.file.ends_with("dem.tif"));
    assert_eq!(document.report().findings[0].message.reason.code(), "file-name-case-differs");
}

#[test]
fn only_the_raster_of_the_selected_level_is_handed_on() {
    let folder = Folder::new("relief-levels");
    folder.put("dem.tif", b"II*\0");
    let both = relief(DOMAIN, &file("dem.tif"), "").replace(
        "</dem:RasterRelief>",
        "</dem:RasterRelief></dem:reliefComponent><dem:reliefComponent><dem:RasterRelief><dem:lod>3</dem:lod><dem:grid>\
         <gml:RectifiedGridCoverage><gml:RectifiedGrid/></gml:RectifiedGridCoverage></dem:grid></dem:RasterRelief>",
    );
    let both = both.replace("<gml:RectifiedGrid/>", &format!("<gml:RectifiedGrid>{DOMAIN}</gml:RectifiedGrid>{}", inline("1 2 3 4 5 6")));
    let path = folder.put("town.gml", both.as_bytes());
    for (lod, grids) in [(None, 0), (Some("2"), 1), (Some("3"), 0)] {
        let options = of_format(json!({"lod": lod}));
        let mut document = open(&path, &CITYGML, &options).expect("a document");
        while document.next_batch().expect("readable").is_some() {}
        assert_eq!(document.grids().len(), grids, "{lod:?}");
    }
}
