//! Files that write opacity where the format wants transparency: decided for the whole file, and said.

use crate::documents::city_model::{at_lod, building, square, try_text};
use crate::documents::{Folder, ParsedDocument, read_with};
use map3d_read::{OBJ, ReadOptions, Transparency};

/// Reads a building with two squares; `values`: the transparency of their materials, empty for none.
fn read_city(values: [&str; 2], transparency: Transparency, outside: bool) -> ParsedDocument {
    let material = |k: usize| {
        let value = if values[k].is_empty() { String::new() } else { format!("<app:transparency>{}</app:transparency>", values[k]) };
        format!("<app:surfaceDataMember><app:X3DMaterial>{value}<app:target>#p{k}</app:target></app:X3DMaterial></app:surfaceDataMember>")
    };
    let appearance = format!("<app:Appearance><app:theme>t</app:theme>{}{}</app:Appearance>", material(0), material(1));
    let squares = at_lod(2, &(square("p0", 1) + &square("p1", 2)));
    let inside = if outside { String::new() } else { format!("<app:appearance>{appearance}</app:appearance>") };
    let mut text = building(&(squares + &inside));
    if outside {
        let end = text.rfind("</core:CityModel>").expect("the end of the model");
        text.insert_str(end, &format!("<app:appearanceMember>{appearance}</app:appearanceMember>"));
    }
    try_text(&text, &ReadOptions { transparency, ..ReadOptions::default() }).expect("readable")
}

/// Returns the opacity of the material of each drawn square.
fn opacities(document: &ParsedDocument) -> Vec<f32> {
    (0..document.count()).step_by(2).map(|t| document.material_of(t).diffuse[3]).collect()
}

#[test]
fn transparency_of_a_city_is_decided_for_the_whole_file() {
    use Transparency::{AsIs, Auto, Inverted};
    for outside in [false, true] {
        for (values, option, expected, said) in [
            (["1.0", "0.5"], Auto, vec![1.0, 0.5], true),
            (["1", "1"], Auto, vec![1.0, 1.0], true),
            (["1.0", "0.5"], AsIs, vec![0.5], false),
            (["1.0", "0.5"], Inverted, vec![1.0, 0.5], false),
            (["1.0", "0.0"], Auto, vec![1.0], false),
            (["1.0", ""], Auto, vec![1.0], false),
            (["0.5", "0.75"], Auto, vec![0.5, 0.25], false),
            (["0.0", "1.0"], Inverted, vec![1.0], false),
            (["", "0.25"], Inverted, vec![1.0, 0.25], false),
            (["nan", "x"], Auto, vec![1.0, 1.0], false),
        ] {
            let document = read_city(values, option, outside);
            assert_eq!(opacities(&document), expected, "{values:?} {option:?} outside: {outside}");
            assert_eq!(document.reported("transparency-read-as-opacity"), u64::from(said), "{values:?} {option:?}");
            let missing = 2 - expected.len() as u64;
            assert_eq!((document.reported("polygon-transparent"), document.reported("transparent-surfaces-not-drawn")), (missing, missing.min(1)));
        }
    }
}

#[test]
fn the_option_that_draws_invisible_surfaces_is_named() {
    let example = |document: &ParsedDocument, reason: &str| {
        document.report.findings.iter().find(|w| w.message.reason.code() == reason).map(|w| w.example.clone()).unwrap_or_default()
    };
    let not_drawn = "transparent-surfaces-not-drawn";
    assert_eq!(example(&read_city(["1", "0"], Transparency::Auto, true), not_drawn), "1; --transparency inverted draws them");
    assert_eq!(example(&read_city(["1", "0"], Transparency::Inverted, true), not_drawn), "1; --transparency as-is draws them");
    assert_eq!(
        example(&read_city(["1", "0.5"], Transparency::Auto, true), "transparency-read-as-opacity"),
        "1 of 2 materials would be invisible, and none opaque; --transparency as-is draws them so"
    );
}

#[test]
fn transparency_of_a_material_library_is_decided_for_the_whole_library() {
    use Transparency::{AsIs, Auto, Inverted};
    for (library, option, expected) in [
        ("newmtl a\nd 0\nnewmtl b\nd 0.5\n", Auto, vec![1.0, 0.5]),
        ("newmtl a\nTr 1\nnewmtl b\nTr 1\n", Auto, vec![1.0, 1.0]),
        ("newmtl a\nd 0\nnewmtl b\nd 0.5\n", AsIs, vec![0.5]),
        ("newmtl a\nd 0\nnewmtl b\nd 1\n", Auto, vec![1.0]),
        ("newmtl a\nd 0\nnewmtl b\nKd 1 0 0\n", Auto, vec![1.0]),
        ("newmtl a\nd 0\nnewmtl b\nd 1\n", Inverted, vec![1.0]),
    ] {
        let folder = Folder::new("transparency");
        folder.put("m.mtl", library);
        let text = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl a\nf 1 2 3 4\nusemtl b\nf 4 3 2 1\n";
        let path = folder.put("a.obj", text);
        let document = read_with(&path, &OBJ, &ReadOptions { transparency: option, ..ReadOptions::default() }).expect("readable");
        assert_eq!(opacities(&document), expected, "{library} {option:?}");
        assert_eq!(document.reported("transparency-read-as-opacity"), u64::from(option == Auto && expected.len() == 2), "{library}");
        assert_eq!(document.reported("face-transparent"), 2 - expected.len() as u64, "{library}");
    }
}

#[test]
fn options_name_the_three_ways() {
    for (text, expected) in [("as-is", Transparency::AsIs), ("inverted", Transparency::Inverted), ("auto", Transparency::Auto)] {
        let options = ReadOptions::from_json(&format!("{{\"transparency\": \"{text}\"}}")).expect("valid");
        assert_eq!(options.transparency, expected);
    }
    assert!(ReadOptions::from_json("{\"transparency\": \"other\"}").is_err());
}
