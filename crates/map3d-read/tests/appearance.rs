//! CityGML appearances: themes, materials, all types of textures, and inheritance.

use crate::documents::{Folder, ParsedDocument, of_format, read_with};
use map3d_base::asset::Wrap;
use map3d_read::{CITYGML, PositionTransformer, ReadOptions};
use serde_json::json;

/// Reads a building `b` with one square from (0 0) to (2 2): polygon `p` in the MultiSurface `s` of the wall `w`.
/// `outside` and `inside`: appearances in the model and in the building.
fn read(outside: &str, inside: &str, options: &ReadOptions) -> ParsedDocument {
    let folder = Folder::new("appearance");
    folder.put_png("t.png", 8, 4, [200, 100, 50, 255]);
    folder.put_png("u.png", 4, 4, [1, 2, 3, 255]);
    folder.put_png("clear.png", 4, 4, [1, 2, 3, 0]);
    folder.put("u.pgw", "0.5\n0\n0\n-0.5\n0.25\n1.75\n");
    let text = format!(
        r##"<CityModel xmlns:gml="g" xmlns:xlink="x"><cityObjectMember><Building gml:id="b">{inside}
        <boundedBy><WallSurface gml:id="w"><lod2MultiSurface><gml:MultiSurface gml:id="s"><gml:surfaceMember>
        <gml:Polygon gml:id="p"><gml:exterior><gml:LinearRing gml:id="r"><gml:posList>0 0 0 2 0 0 2 2 0 0 2 0 0 0 0</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon>
        </gml:surfaceMember></gml:MultiSurface></lod2MultiSurface></WallSurface></boundedBy>
        <lod2Solid><gml:Solid><gml:exterior><gml:CompositeSurface gml:id="c"><gml:surfaceMember xlink:href="#p"/></gml:CompositeSurface></gml:exterior></gml:Solid></lod2Solid>
        </Building></cityObjectMember>{outside}</CityModel>"##
    );
    let path = folder.put("a.gml", text);
    read_with(&path, &CITYGML, options).expect("readable")
}

fn appearance(theme: &str, data: &str) -> String {
    let members: String = data
        .split('|')
        .map(|d| {
            if d.starts_with('#') { format!("<surfaceDataMember xlink:href='{d}'/>") } else { format!("<surfaceDataMember>{d}</surfaceDataMember>") }
        })
        .collect();
    format!("<Appearance><theme>{theme}</theme>{members}</Appearance>")
}

fn member(theme: &str, data: &str) -> String {
    format!("<appearanceMember>{}</appearanceMember>", appearance(theme, data))
}

fn property(theme: &str, data: &str) -> String {
    format!("<appearance>{}</appearance>", appearance(theme, data))
}

fn color(rgb: &str, targets: &[&str]) -> String {
    let targets: String = targets.iter().map(|t| format!("<target>#{t}</target>")).collect();
    format!("<X3DMaterial><diffuseColor>{rgb}</diffuseColor>{targets}</X3DMaterial>")
}

fn texture(more: &str, target: &str, coordinates: &str) -> String {
    format!(
        "<ParameterizedTexture gml:id='tex'><imageURI>t.png</imageURI>{more}<target uri='#{target}'><TexCoordList gml:id='list'><textureCoordinates ring='#r'>{coordinates}</textureCoordinates></TexCoordList></target></ParameterizedTexture>"
    )
}

const UVS: &str = "0 0 1 0 1 1 0 1 0 0";

fn read_with_defaults(outside: &str, inside: &str) -> ParsedDocument {
    read(outside, inside, &ReadOptions::default())
}

fn diffuse(document: &ParsedDocument) -> [f32; 4] {
    document.material_of(0).diffuse
}

const RED: [f32; 4] = [1.0, 0.0, 0.0, 1.0];
const GREEN: [f32; 4] = [0.0, 1.0, 0.0, 1.0];

#[test]
fn appearances_may_be_anywhere_and_target_any_ancestor() {
    for target in ["p", "s", "c", "w", "b"] {
        let red = color("1 0 0", &[target]);
        assert_eq!(diffuse(&read_with_defaults(&member("a", &red), "")), RED, "after, {target}");
        assert_eq!(diffuse(&read_with_defaults("", &property("a", &red))), RED, "inside, {target}");
    }
    let nowhere = read_with_defaults(&member("a", &color("1 0 0", &["other"])), "");
    assert_ne!(diffuse(&nowhere), RED);
}

#[test]
fn nearest_appearance_wins_and_textures_win_over_colours() {
    let both = color("0 1 0", &["s"]) + "|" + &color("1 0 0", &["p"]);
    assert_eq!(diffuse(&read_with_defaults(&member("a", &both), "")), RED);
    let inside_first = read_with_defaults(&member("a", &color("0 1 0", &["p"])), &property("a", &color("1 0 0", &["p"])));
    assert_eq!(diffuse(&inside_first), RED, "the building's appearance wins over the model's");
    let textured = read_with_defaults(&member("a", &(color("1 0 0", &["p"]) + "|" + &texture("", "s", UVS))), "");
    assert!(textured.material_of(0).texture.is_some());
    assert_eq!(diffuse(&textured), [1.0; 4]);
}

#[test]
fn first_theme_is_used_unless_another_is_requested() {
    let two = member("summer", &color("1 0 0", &["p"])) + &member("winter", &color("0 1 0", &["p"]));
    let read_theme = |theme: Option<&str>| read(&two, "", &of_format(json!({"theme": theme})));
    assert_eq!(diffuse(&read_theme(None)), RED);
    assert_eq!(diffuse(&read_theme(Some("summer"))), RED);
    assert_eq!(diffuse(&read_theme(Some("winter"))), GREEN);
    assert_eq!(diffuse(&read_theme(Some("spring"))), [0.8, 0.8, 0.8, 1.0]);
    assert!(read_theme(None).report.findings.iter().any(|w| w.message.reason.code() == "theme-used" && w.example == "summer"));
    assert_eq!(read_theme(None).reported("appearance-of-other-theme"), 1);
    let inside = read("", &(property("x", &color("1 0 0", &["p"])) + &property("y", &color("0 1 0", &["p"]))), &ReadOptions::default());
    assert_eq!(diffuse(&inside), RED);
    assert_eq!(
        diffuse(&read_with_defaults("<appearanceMember><Appearance><surfaceDataMember>".to_owned().as_str(), "")),
        [0.8, 0.8, 0.8, 1.0],
        "truncated"
    );
}

#[test]
fn theme_with_the_most_textures_is_the_default() {
    let colors = color("1 0 0", &["p"]) + "|" + &color("1 0 0", &["s"]);
    let photo = texture("", "p", UVS);
    let shared = member("usage", &photo) + &member("photos", "#tex");
    for (outside, inside, textured) in [
        (member("usage", &colors) + &member("photos", &photo), String::new(), true),
        (String::new(), property("usage", &colors) + &property("photos", &photo), true),
        (member("usage", &colors), property("photos", &photo), true),
        (shared, String::new(), true),
    ] {
        let document = read_with_defaults(&outside, &inside);
        assert_eq!(document.material_of(0).texture.is_some(), textured, "{outside}{inside}");
    }
    let requested = of_format(json!({"theme": "usage"}));
    let usage = read(&(member("usage", &colors) + &member("photos", &photo)), "", &requested);
    assert_eq!(diffuse(&usage), RED);
    let unnamed = format!("<appearance><Appearance><surfaceDataMember>{}</surfaceDataMember></Appearance></appearance>", color("1 0 0", &["p"]));
    assert_eq!(diffuse(&read_with_defaults("", &unnamed)), RED, "an appearance without a theme");
}

#[test]
fn themes_share_surface_data_and_parameterizations_by_xlink() {
    let summer = member(
        "summer",
        &("<X3DMaterial gml:id='m'><diffuseColor>1 0 0</diffuseColor><target>#p</target></X3DMaterial>".to_owned()
            + "|"
            + &texture("", "other", UVS)),
    );
    let winter = |data: &str| member("winter", data);
    let options = of_format(json!({"theme": "winter"}));
    assert_eq!(diffuse(&read(&(summer.clone() + &winter("#m")), "", &options)), RED);
    assert_eq!(diffuse(&read(&(winter("#m") + &summer), "", &options)), RED);
    let sharing = "<ParameterizedTexture><imageURI>u.png</imageURI><target uri='#p' xlink:href='#list'/></ParameterizedTexture>";
    let document = read(&(summer + &winter(sharing)), "", &options);
    assert_eq!(document.triangles()[0].uvs, Some([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]));
}

#[test]
fn colours_and_transparency_are_read() {
    let with = |inner: &str| read_with_defaults(&member("a", &format!("<X3DMaterial>{inner}<target>#p</target></X3DMaterial>")), "");
    assert_eq!(diffuse(&with("")), [0.8, 0.8, 0.8, 1.0]);
    assert_eq!(diffuse(&with("<diffuseColor>0.5 2 nan</diffuseColor><transparency>0.25</transparency>")), [0.5, 1.0, 0.0, 0.75]);
    let opaque = color("1 0 0", &["other"]);
    let clear = "<X3DMaterial><transparency>1</transparency><target>#p</target></X3DMaterial>";
    let invisible = read_with_defaults(&member("a", &format!("{opaque}|{clear}")), "");
    assert_eq!((invisible.count(), invisible.reported("polygon-transparent")), (0, 1));
    assert_eq!(invisible.reported("transparent-surfaces-not-drawn"), 1);
    let back = with("<diffuseColor>1 0 0</diffuseColor><isFront>false</isFront>");
    assert_eq!((diffuse(&back), back.reported("appearance-of-back-side")), (RED, 1), "a surface without a front has the appearance of its back");
    let both = "<X3DMaterial><diffuseColor>0 0 1</diffuseColor><isFront>false</isFront><target>#p</target></X3DMaterial>|".to_owned()
        + &color("1 0 0", &["p"]);
    assert_eq!(diffuse(&read_with_defaults(&member("a", &both), "")), RED);
}

#[test]
fn wrap_modes_and_border_colours_are_read() {
    let border = "<wrapMode>border</wrapMode><borderColor>1 0.5 0 1</borderColor>";
    for (more, wrap, color) in [
        ("", Wrap::Wrap, [0.0; 4]),
        ("<wrapMode>none</wrapMode>", Wrap::None, [0.0; 4]),
        ("<wrapMode>wrap</wrapMode>", Wrap::Wrap, [0.0; 4]),
        ("<wrapMode>mirror</wrapMode>", Wrap::Mirror, [0.0; 4]),
        ("<wrapMode>clamp</wrapMode>", Wrap::Clamp, [0.0; 4]),
        (border, Wrap::Border, [1.0, 0.5, 0.0, 1.0]),
    ] {
        let document = read_with_defaults(&member("a", &texture(more, "p", "5 5 6 5 6 6 5 6 5 5")), "");
        assert_eq!((document.material_of(0).wrap, document.material_of(0).border), (wrap, color));
        let least = document.triangles()[0].uvs.expect("textured")[0];
        let expected = match wrap {
            Wrap::Wrap => [0.0, 0.0],
            Wrap::Mirror => [1.0, 1.0],
            Wrap::Clamp | Wrap::Border | Wrap::None => [5.0, 5.0],
        };
        assert_eq!(least, expected, "{wrap:?}");
    }
}

#[test]
fn equal_surface_data_share_one_material() {
    let document = read_with_defaults(&member("a", &(texture("", "p", UVS) + "|" + &texture("", "q", UVS))), "");
    assert_eq!((document.materials.len(), document.textures.len()), (1, 1));
}

#[test]
fn rings_without_valid_texture_coordinates_fall_back_to_the_colour() {
    for (coordinates, textured) in [(UVS, true), ("0 0 1 0 1 1 0 1", true), ("0 0 1 0 1 1", false), ("0 0 1 0 1", false), ("a b", false), ("", false)]
    {
        let document = read_with_defaults(&member("a", &(texture("", "p", coordinates) + "|" + &color("1 0 0", &["p"]))), "");
        assert_eq!(document.material_of(0).texture.is_some(), textured, "{coordinates}: {:?}", document.report);
        assert!(textured || diffuse(&document) == RED);
        assert!(textured || document.reported("texture") > 0);
    }
    let without_number_sign = texture("", "p", UVS).replace("'#p'", "'p'").replace("'#r'", "'r'");
    assert!(read_with_defaults(&member("a", &without_number_sign), "").material_of(0).texture.is_some());
}

#[test]
fn missing_images_fall_back_to_the_colour() {
    let missing = texture("", "p", UVS).replace("t.png", "nowhere.png");
    let document = read_with_defaults(&member("a", &(missing + "|" + &color("1 0 0", &["p"]))), "");
    assert_eq!((diffuse(&document), document.reported("image-file-not-found")), (RED, 1));
}

#[test]
fn transparent_texels_make_a_cutout_material() {
    let document = read_with_defaults(&member("a", &texture("", "p", UVS).replace("t.png", "clear.png")), "");
    assert!(document.material_of(0).cutout);
}

#[test]
fn texture_coordinates_are_computed_by_matrix() {
    let generated = "<ParameterizedTexture><imageURI>t.png</imageURI><wrapMode>clamp</wrapMode><target uri='#p'><TexCoordGen><worldToTexture>0.5 0 0 0.25 0 0.25 0 0 0 0 0 1</worldToTexture></TexCoordGen></target></ParameterizedTexture>";
    let document = read_with_defaults(&member("a", generated), "");
    assert_eq!(document.triangles()[0].uvs, Some([[0.25, 0.0], [1.25, 0.0], [1.25, 0.5]]));
    let perspective = generated.replace("0 0 0 1<", "0 0 0 2<");
    assert_eq!(read_with_defaults(&member("a", &perspective), "").triangles()[0].uvs, Some([[0.125, 0.0], [0.625, 0.0], [0.625, 0.25]]));
    let short = generated.replace("0 0 0 1<", "0 0 0<");
    assert!(read_with_defaults(&member("a", &short), "").material_of(0).texture.is_none());
}

#[test]
fn georeferenced_textures_use_reference_point_or_world_file() {
    let georeferenced = |more: &str| {
        format!("<GeoreferencedTexture><imageURI>u.png</imageURI><wrapMode>none</wrapMode>{more}<target>#p</target></GeoreferencedTexture>")
    };
    let point = "<referencePoint><gml:Point><gml:pos>0.25 1.75</gml:pos></gml:Point></referencePoint><orientation>0.5 0 0 -0.5</orientation>";
    for more in [point, ""] {
        let document = read_with_defaults(&member("a", &georeferenced(more)), "");
        assert_eq!(document.triangles()[0].uvs, Some([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), "{more}");
    }
    let unplaced = read_with_defaults(&member("a", &georeferenced("").replace("u.png", "t.png")), "");
    assert!(unplaced.material_of(0).texture.is_none());
    assert_eq!(unplaced.reported("georeferenced-texture-without-place"), 1);
}

#[test]
fn georeferenced_textures_lie_in_their_place_where_the_document_has_the_northing_first() {
    let folder = Folder::new("northing-first");
    folder.put_png("u.png", 4, 4, [1, 2, 3, 255]);
    folder.put("u.pgw", "0.5\n0\n0\n-0.5\n1000.25\n51.75\n");
    let uvs = |corners: [[u32; 2]; 4]| {
        let numbers: Vec<String> = corners.iter().chain(&corners[..1]).map(|[x, y]| format!("{x} {y} 0")).collect();
        let text = format!(
            "<CityModel xmlns:gml='g'><cityObjectMember><Building gml:id='b'><lod1MultiSurface><gml:MultiSurface><gml:surfaceMember>\
             <gml:Polygon gml:id='p'><gml:exterior><gml:LinearRing><gml:posList>{}</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon>\
             </gml:surfaceMember></gml:MultiSurface></lod1MultiSurface></Building></cityObjectMember>{}</CityModel>",
            numbers.join(" "),
            member("a", "<GeoreferencedTexture><imageURI>u.png</imageURI><wrapMode>none</wrapMode><target>#p</target></GeoreferencedTexture>")
        );
        let document = read_with(&folder.put("a.gml", text), &CITYGML, &ReadOptions::default()).expect("readable");
        document.triangles()[0].uvs
    };
    let expected = Some([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
    assert_eq!(uvs([[1000, 50], [1002, 50], [1002, 52], [1000, 52]]), expected);
    assert_eq!(uvs([[50, 1000], [50, 1002], [52, 1002], [52, 1000]]), expected);
    assert_ne!(uvs([[3000, 50], [3002, 50], [3002, 52], [3000, 52]]), expected, "beyond the image in both orders");
}

#[test]
fn a_reference_point_in_another_system_is_used_only_where_the_places_agree() {
    let texture = |name: &str, at: &str| {
        let point = format!("<referencePoint><gml:Point srsName='{name}'><gml:pos>{at}</gml:pos></gml:Point></referencePoint>");
        let data = format!("<imageURI>u.png</imageURI><wrapMode>none</wrapMode>{point}<orientation>0.5 0 0 -0.5</orientation><target>#p</target>");
        let envelope = "<boundedBy><gml:Envelope srsName='EPSG:25832+5783'/></boundedBy>";
        read_with_defaults(&(member("a", &format!("<GeoreferencedTexture>{data}</GeoreferencedTexture>")) + envelope), "")
    };
    for (name, at, used) in [
        ("EPSG:25832", "0.25 1.75", true),
        ("urn:ogc:def:crs:EPSG::25832", "9000 1.75", true),
        ("EPSG:5555", "0.25 1.75", true),
        ("EPSG:25833", "-430000 1.75", false),
        ("EPSG:25833", "0.25 90000", false),
    ] {
        let document = texture(name, at);
        assert_eq!((document.material_of(0).texture.is_some(), document.count()), (used, 2), "{name} {at}");
        assert_eq!(document.reported("georeferenced-texture-in"), u64::from(!used), "{name} {at}");
    }
}

#[test]
fn a_texture_in_another_system_is_transformed_to_that_of_the_surface() {
    // Surfaces at x, y; the other system has 1000 + 2 y, 500 - x, bent by `bend`.
    let read = |name: &str, bend: f64| {
        let point = format!("<referencePoint><gml:Point srsName='{name}'><gml:pos>1003.5 499.75</gml:pos></gml:Point></referencePoint>");
        let data = format!("<imageURI>u.png</imageURI><wrapMode>none</wrapMode>{point}<orientation>0 -1 -0.5 0</orientation><target>#p</target>");
        let envelope = "<boundedBy><gml:Envelope srsName='EPSG:25832+5783'/></boundedBy>";
        let convert = move |source: &str, target: &str, positions: &[[f64; 2]]| {
            assert_eq!(target, "EPSG:25832+5783");
            let known = source == "EPSG:31468";
            Ok(known.then(|| positions.iter().map(|[x, y]| [500.0 - y + bend * (x - 1002.0).powi(2), (x - 1000.0) / 2.0]).collect()))
        };
        let options = ReadOptions { transform: Some(PositionTransformer::new(convert)), ..ReadOptions::default() };
        read(&(member("a", &format!("<GeoreferencedTexture>{data}</GeoreferencedTexture>")) + envelope), "", &options)
    };
    let exact = read("EPSG:31468", 0.0);
    assert_eq!(exact.triangles()[0].uvs, Some([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]));
    assert!(exact.report.findings.is_empty(), "{:?}", exact.report.findings);
    let nearly = read("EPSG:31468", 0.01).triangles()[0].uvs.expect("textured");
    assert!(nearly.as_flattened().iter().zip([0.0, 0.0, 1.0, 0.0, 1.0, 1.0]).all(|(got, expected)| (got - expected).abs() < 0.1), "{nearly:?}");
    for bend in [1.0, f64::NAN] {
        let bent = read("EPSG:31468", bend);
        assert!(bent.material_of(0).texture.is_none(), "{bend}");
        assert_eq!(bent.reported("georeferenced-texture-inexact"), 1, "{bend}");
    }
    let unknown = read("EPSG:9999", 0.0);
    assert_eq!((unknown.material_of(0).texture.is_some(), unknown.reported("georeferenced-texture-in-other-crs") > 0), (false, true));
}

#[test]
fn texture_coordinates_of_polygons_with_holes_stay_with_their_points() {
    let folder = Folder::new("holes");
    folder.put_png("t.png", 8, 8, [1, 1, 1, 255]);
    // u = x / 10, v = y / 10 on every ring, and therefore on every triangle.
    let (outer, inner) = ("0 0 10 0 10 10 0 10 0 0", "2 2 2 5 5 5 5 2 2 2");
    let to_3d = |flat: &str| flat.split(' ').collect::<Vec<_>>().chunks(2).map(|p| format!("{} {} 3", p[0], p[1])).collect::<Vec<_>>().join(" ");
    let tenth = |flat: &str| flat.split(' ').map(|v| (v.parse::<f64>().expect("a number") / 10.0).to_string()).collect::<Vec<_>>().join(" ");
    let text = format!(
        "<CityModel xmlns:gml='g'><cityObjectMember><Building><lod2MultiSurface><gml:Polygon gml:id='p'><gml:exterior><gml:LinearRing gml:id='r0'><gml:posList>{}</gml:posList></gml:LinearRing></gml:exterior>\
         <gml:interior><gml:LinearRing gml:id='r1'><gml:posList>{}</gml:posList></gml:LinearRing></gml:interior></gml:Polygon></lod2MultiSurface></Building></cityObjectMember>\
         <appearanceMember><Appearance><surfaceDataMember><ParameterizedTexture><imageURI>t.png</imageURI><wrapMode>clamp</wrapMode><target uri='#p'><TexCoordList><textureCoordinates ring='#r1'>{}</textureCoordinates>\
         <textureCoordinates ring='#r0'>{}</textureCoordinates></TexCoordList></target></ParameterizedTexture></surfaceDataMember></Appearance></appearanceMember></CityModel>",
        to_3d(outer),
        to_3d(inner),
        tenth(inner),
        tenth(outer),
    );
    let path = folder.put("a.gml", text);
    let document = read_with(&path, &CITYGML, &ReadOptions::default()).expect("readable");
    assert_eq!((document.count(), document.area()), (8, 91.0));
    for t in document.triangles() {
        for (corner, uv) in t.corners.iter().zip(t.uvs.expect("textured")) {
            assert_eq!([(corner[0] / 10.0) as f32, (corner[1] / 10.0) as f32], uv);
        }
    }
}

#[test]
fn appearances_over_the_limit_are_an_error() {
    let folder = Folder::new("limit");
    let path = folder.put("a.gml", format!("<CityModel>{}</CityModel>", member("a", &texture("", "p", UVS))));
    let options = ReadOptions { max_appearance_bytes: 10, ..ReadOptions::default() };
    assert!(crate::documents::is_limit_error(read_with(&path, &CITYGML, &options), "max_appearance_bytes"));
}

#[test]
fn a_theme_that_the_document_does_not_have_is_named_with_those_that_it_has() {
    let themes = member("summer", &color("1 0 0", &["p"])) + &member("winter", &color("0 1 0", &["p"]));
    let said = |theme: &str, outside: &str| {
        let document = read(outside, "", &of_format(json!({"theme": theme})));
        document.report.findings.into_iter().find(|w| w.message.reason.code() == "theme-not-in-file").map(|w| w.example)
    };
    assert_eq!(said("autumn", &themes).as_deref(), Some("autumn; the file has summer, winter"));
    assert_eq!((said("winter", &themes), said("autumn", "")), (None, None), "a document without themes has nothing to choose");
}
