//! OBJ and MTL statements, encodings and degenerate cases.

use crate::documents::{Folder, ParsedDocument, is_format_error, is_limit_error, of_format, read_with};
use map3d_base::asset::Wrap;
use map3d_base::vec3::triangle_normal;
use map3d_read::{OBJ, ReadOptions};
use serde_json::json;

fn read_text(name: &str, text: impl AsRef<[u8]>) -> ParsedDocument {
    let folder = Folder::new(name);
    let path = folder.put("house.obj", text);
    read_with(&path, &OBJ, &ReadOptions::default()).expect("readable")
}

const SQUARE: &str = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n";

#[test]
fn faces_are_read_in_every_notation() {
    for (case, faces, triangles, area) in [
        ("triangle", "f 1 2 3\n", 1, 2.0),
        ("quad", "f 1 2 3 4\n", 2, 4.0),
        ("negative", "f -4 -3 -2 -1\n", 2, 4.0),
        ("tabs and spaces", "f\t1  2 \t 3   4  \r\n", 2, 4.0),
        ("no final newline", "f 1 2 3 4", 2, 4.0),
        ("continued line", "f 1 2 \\\n3 \\\r\n 4\n", 2, 4.0),
        ("carriage returns", "f 1 2 3\rf 1 3 4\r", 2, 4.0),
        ("trailing comment", "f 1 2 3 4 # a face\n", 2, 4.0),
        ("repeated vertex", "f 1 1 2 3 3 4 1\n", 2, 4.0),
        ("slashes without numbers", "f 1// 2// 3//\n", 1, 2.0),
        ("clockwise", "f 4 3 2 1\n", 2, 4.0),
    ] {
        let document = read_text("notation", format!("{SQUARE}{faces}"));
        assert_eq!((document.count(), document.area()), (triangles, area), "{case}");
        assert!(document.report.findings.is_empty(), "{case}: {:?}", document.report);
    }
}

#[test]
fn degenerate_faces_are_skipped_and_counted() {
    for (case, faces, reason) in [
        ("one vertex", "f 1\n", "face-with-too-few-vertices"),
        ("two vertices", "f 1 2\n", "face-with-too-few-vertices"),
        ("no vertices", "f\n", "face-with-too-few-vertices"),
        ("one vertex three times", "f 1 1 1\n", "face-with-too-few-vertices"),
        ("on a line", "v 4 0 0\nf 1 2 5\n", "polygon-without-area"),
        ("beyond the end", "f 1 2 9\n", "index-out-of-range"),
        ("zero", "f 0 1 2\n", "index-out-of-range"),
        ("before the first", "f -9 1 2\n", "index-out-of-range"),
        ("words", "f a b c\n", "face-unreadable"),
        ("not a number", "v nan 0 0\nf 1 2 5\n", "coordinate-not-finite"),
        ("infinite", "v inf 0 0\nf 1 2 5\n", "coordinate-not-finite"),
        ("short vertex", "v 1 2\nf 1 2 5\n", "coordinate-not-finite"),
    ] {
        let document = read_text("degenerate", format!("{SQUARE}{faces}f 1 2 3\n"));
        assert_eq!(document.count(), 1, "{case}");
        assert_eq!(document.reported(reason), 1, "{case}: {:?}", document.report);
    }
}

#[test]
fn first_fault_is_an_error_with_strict() {
    let folder = Folder::new("strict");
    let path = folder.put("a.obj", format!("{SQUARE}f 1 2\n"));
    let strict = ReadOptions { strict: true, ..ReadOptions::default() };
    assert!(is_format_error(read_with(&path, &OBJ, &strict), "line 5"));
}

#[test]
fn empty_documents_have_no_objects() {
    for text in ["", "\n", "# nothing\n", SQUARE] {
        let document = read_text("empty", text);
        assert_eq!((document.count(), document.objects.len()), (0, 0));
    }
}

#[test]
fn concave_polygons_keep_area_and_orientation() {
    let document = read_text("concave", "v 0 0 0\nv 4 0 0\nv 4 0 4\nv 2 0 1\nv 0 0 4\nf 1 2 3 4 5\n");
    assert_eq!((document.count(), document.area()), (3, 10.0));
    assert!(document.triangles().iter().all(|t| triangle_normal(t.corners)[1] < 0.0), "oriented like the face");
}

#[test]
fn y_up_is_converted_to_z_up() {
    let folder = Folder::new("up");
    let path = folder.put("a.obj", "v 0 0 0\nv 1 0 0\nv 0 2 0\nvn 0 0 1\nf 1//1 2//1 3//1\n");
    let up = of_format(json!({"up": "y"}));
    let document = read_with(&path, &OBJ, &up).expect("readable");
    assert_eq!(document.triangles()[0].corners, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]]);
    assert_eq!(document.batches[0].normals[0], [[0.0, -1.0, 0.0]; 3]);
}

#[test]
fn large_coordinates_keep_all_digits() {
    let document = read_text(
        "giant",
        "v 691000.123456 5336000.654321 1e2\nv 691001.123456 5336000.654321 1.0E+2\nv 691000.123456 5336001.654321 +100.\nf 1 2 3\n",
    );
    assert_eq!(document.triangles()[0].corners[0], [691_000.123_456, 5_336_000.654_321, 100.0]);
}

#[test]
fn split_makes_one_object_per_file_or_group() {
    let folder = Folder::new("split");
    let text = format!("{SQUARE}f 1 2 3\ng a\nf 1 2 3\no b c\nf 1 2 3\ng a\nf 1 3 4\ng unused\n");
    let path = folder.put("my house.obj", text);
    let whole = read_with(&path, &OBJ, &ReadOptions::default()).expect("readable");
    let names = |r: &ParsedDocument| r.objects.iter().map(|o| o.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&whole), ["my house"]);
    assert_eq!(whole.objects[0].class, "generic");
    let split = of_format(json!({"split": "group"}));
    let groups = read_with(&path, &OBJ, &split).expect("readable");
    assert_eq!(names(&groups), ["my house", "a", "b c"]);
    assert_eq!(groups.triangles().iter().map(|t| t.object).collect::<Vec<_>>(), [0, 1, 2, 1]);
}

#[test]
fn faces_may_precede_their_vertices() {
    let document = read_text("forward", format!("f 1 2 3\nf 1 2 7\n{SQUARE}f 1 3 4\n"));
    assert_eq!((document.count(), document.area()), (2, 4.0));
    assert_eq!(document.reported("index-out-of-range"), 1);
}

#[test]
fn text_is_read_in_every_encoding() {
    let text = format!("mtllib ä.mtl\n{SQUARE}usemtl Müller\nf 1 2 3 4\n");
    let mtl = "newmtl Müller\nKd 1 0.5 0\n";
    let utf16 = |text: &str, little: bool, mark: bool| -> Vec<u8> {
        let units = mark.then_some(0xFEFF).into_iter().chain(text.encode_utf16());
        units.flat_map(|u: u16| if little { u.to_le_bytes() } else { u.to_be_bytes() }).collect()
    };
    let latin = |text: &str| -> Vec<u8> { text.chars().map(|c| c as u8).collect() };
    let marked = |text: &str| [&[0xEF, 0xBB, 0xBF], text.as_bytes()].concat();
    type Encode<'a> = &'a dyn Fn(&str) -> Vec<u8>;
    let encodings: [(&str, Encode); 7] = [
        ("utf-8", &|t| t.as_bytes().to_vec()),
        ("utf-8 with mark", &marked),
        ("latin-1", &latin),
        ("utf-16le", &|t| utf16(t, true, true)),
        ("utf-16be", &|t| utf16(t, false, true)),
        ("utf-16le without mark", &|t| utf16(t, true, false)),
        ("utf-16be without mark", &|t| utf16(t, false, false)),
    ];
    for (name, encode) in encodings {
        let folder = Folder::new("encoding");
        folder.put("ä.mtl", encode(mtl));
        let path = folder.put("a.obj", encode(&text));
        let document = read_with(&path, &OBJ, &ReadOptions::default()).expect("readable");
        assert_eq!(document.count(), 2, "{name}");
        assert_eq!(document.material_of(0).diffuse, [1.0, 0.5, 0.0, 1.0], "{name}: {:?}", document.report);
    }
}

fn read_with_material(name: &str, mtl: &str, faces: &str) -> ParsedDocument {
    let folder = Folder::new(name);
    folder.put("a.mtl", mtl);
    folder.put_png("t.png", 4, 2, [9, 8, 7, 255]);
    folder.put_png("t x.png", 4, 2, [9, 8, 7, 0]);
    folder.put_png("deep/t.png", 2, 2, [1, 1, 1, 255]);
    let path = folder.put("a.obj", format!("mtllib a.mtl\n{SQUARE}vt 0 0\nvt 1 0\nvt 1 1\nvt -3.25 5.5\nusemtl m\n{faces}"));
    read_with(&path, &OBJ, &ReadOptions::default()).expect("readable")
}

#[test]
fn materials_are_read_from_the_library() {
    for (mtl, diffuse) in [
        ("newmtl m\nKd 0.25 0.5 1\n", [0.25, 0.5, 1.0, 1.0]),
        ("newmtl m\nKd 0.5\nd 0.25\n", [0.5, 0.5, 0.5, 0.25]),
        ("newmtl m\nKd 1 1 1\nTr 0.25\n", [1.0, 1.0, 1.0, 0.75]),
        ("newmtl m\nKd 1 1 1\nd -halo 0.5\n", [1.0, 1.0, 1.0, 0.5]),
        ("newmtl m\nKd xyz 1 1 1\n", [0.8, 0.8, 0.8, 1.0]),
        ("newmtl m\nKd 7 -1 nan\n", [1.0, 0.0, 0.8, 1.0]),
        ("newmtl m\n", [0.8, 0.8, 0.8, 1.0]),
        ("newmtl m\nKd 1 0 0\nnewmtl m\nKd 0 1 0\n", [1.0, 0.0, 0.0, 1.0]),
        ("newmtl other\nKd 1 0 0\n", [0.8, 0.8, 0.8, 1.0]),
    ] {
        let document = read_with_material("kd", mtl, "f 1 2 3\n");
        assert_eq!(document.material_of(0).diffuse, diffuse, "{mtl}");
        assert!(document.material_of(0).texture.is_none());
    }
}

#[test]
fn fully_transparent_faces_are_skipped() {
    let document = read_with_material("invisible", "newmtl m\nd 0\nnewmtl other\nd 1\n", "f 1 2 3\n");
    assert_eq!((document.count(), document.reported("face-transparent")), (0, 1));
}

#[test]
fn texture_map_options_are_applied() {
    for (map, wrap, uvs) in [
        ("map_Kd t.png", Wrap::Wrap, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]),
        ("map_Kd -clamp on t.png", Wrap::Clamp, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]),
        ("map_kd -s 2 4 1 -o 0.25 t.png", Wrap::Wrap, [[0.25, 0.0], [2.25, 0.0], [2.25, 4.0]]),
        ("map_Kd -o 1 2 3 -clamp on t.png", Wrap::Clamp, [[1.0, 2.0], [2.0, 2.0], [2.0, 3.0]]),
    ] {
        let document = read_with_material("maps", &format!("newmtl m\n{map}\n"), "f 1/1 2/2 3/3\n");
        let material = document.material_of(0);
        assert_eq!((material.wrap, material.diffuse, material.cutout), (wrap, [1.0; 4], false), "{map}");
        assert_eq!(material.texture.as_deref(), Some(document.textures[0].key.as_str()));
        assert_eq!(document.triangles()[0].uvs, Some(uvs), "{map}");
    }
}

#[test]
fn negative_texture_coordinates_are_shifted_by_whole_numbers() {
    let document = read_with_material("shift", "newmtl m\nmap_Kd t.png\n", "f 1/4 2/2 3/3\n");
    assert_eq!(document.triangles()[0].uvs, Some([[0.75, 5.5], [5.0, 0.0], [5.0, 1.0]]));
}

#[test]
fn transparent_texels_and_opacity_maps_make_cutout_materials() {
    let document = read_with_material("alpha", "newmtl m\nmap_Kd \"t x.png\"\n", "f 1/1 2/2 3/3\n");
    assert!(document.material_of(0).cutout && document.material_of(0).alpha.is_none());
    let document = read_with_material("map_d", "newmtl m\nmap_Kd t.png\nmap_d t x.png\n", "f 1/1 2/2 3/3\n");
    assert!(document.material_of(0).cutout && document.material_of(0).alpha.is_some());
    let document = read_with_material("map_d same", "newmtl m\nmap_Kd t x.png\nmap_d t x.png\n", "f 1/1 2/2 3/3\n");
    assert!(document.material_of(0).cutout && document.material_of(0).alpha.is_none());
}

#[test]
fn faces_without_texture_coordinates_use_the_colour() {
    let document = read_with_material("plain", "newmtl m\nKd 1 0 0\nmap_Kd t.png\n", "f 1/1 2/2 3/3\nf 1 2 3\n");
    assert!(document.material_of(0).texture.is_some());
    assert!(document.material_of(1).texture.is_none());
    assert_eq!(document.material_of(1).diffuse, [1.0, 0.0, 0.0, 1.0]);
}

#[test]
fn missing_files_are_reported_and_the_geometry_is_read() {
    let folder = Folder::new("missing");
    folder.put("b.mtl", "newmtl m\nKd 1 0 0\nmap_Kd nowhere.png\n");
    let path = folder.put("a.obj", format!("mtllib nowhere.mtl b.mtl\n{SQUARE}vt 0 0\nusemtl m\nf 1/1 2/1 3/1\nusemtl unknown\nf 1/1 3/1 4/1\n"));
    let document = read_with(&path, &OBJ, &ReadOptions::default()).expect("readable");
    assert_eq!(document.count(), 2);
    assert_eq!(document.reported("material-library-not-found"), 1);
    assert_eq!(document.reported("image-file-not-found"), 1);
    assert_eq!(document.reported("material-not-defined"), 1);
    assert_eq!(document.material_of(0).diffuse, [1.0, 0.0, 0.0, 1.0]);
}

#[test]
fn library_names_may_contain_spaces_and_folders() {
    let folder = Folder::new("libraries");
    folder.put("my lib.mtl", "newmtl a\nKd 1 0 0\n");
    folder.put("sub/two.mtl", "newmtl b\nmap_Kd t.png\n");
    folder.put_png("sub/t.png", 3, 3, [1, 2, 3, 255]);
    let path = folder.put(
        "a.obj",
        format!("mtllib my lib.mtl\nmtllib sub\\TWO.mtl\n{SQUARE}vt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1 2 3\nusemtl b\nf 1/1 2/2 3/3\n"),
    );
    let document = read_with(&path, &OBJ, &ReadOptions::default()).expect("readable");
    assert_eq!(document.material_of(0).diffuse, [1.0, 0.0, 0.0, 1.0]);
    assert!(document.material_of(1).texture.is_some(), "{:?}", document.report);
}

#[test]
fn vertex_colours_become_face_colours() {
    let document = read_text("colours", "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n");
    assert_eq!(document.material_of(0).diffuse, [1.0, 0.0, 0.0, 1.0]);
    assert_ne!(document.material_of(1).diffuse, [1.0, 0.0, 0.0, 1.0]);
    let bytes = read_text("colours", "v 0 0 0 255 0 0\nv 1 0 0 255 0 0\nv 0 1 0 255 0 0\nf 1 2 3\n");
    assert_eq!(bytes.material_of(0).diffuse, [1.0, 0.0, 0.0, 1.0]);
}

#[test]
fn points_and_lines_are_counted() {
    let document = read_text("lines", format!("{SQUARE}p 1\nl 1 2 3\nf 1 2 3\n"));
    assert_eq!((document.count(), document.reported("points-and-lines")), (1, 2));
}

#[test]
fn large_documents_are_split_into_batches() {
    let n = 300;
    let mut text = String::new();
    for y in 0..=n {
        for x in 0..=n {
            text += &format!("v {x} {y} {}\n", (x * y) % 7);
        }
    }
    for y in 0..n {
        for x in 0..n {
            let v = y * (n + 1) + x + 1;
            text += &format!("f {v} {} {}\nf {v} {} {}\n", v + 1, v + n + 2, v + n + 2, v + n + 1);
        }
    }
    let document = read_text("large", text);
    assert!(document.batches.len() > 1);
    assert_eq!(document.count(), 2 * n * n);
    let flat: f64 = document.triangles().iter().map(|t| triangle_normal(t.corners)[2] / 2.0).sum();
    assert_eq!(flat, (n * n) as f64);
}

#[test]
fn limits_are_inclusive() {
    let folder = Folder::new("limits");
    let path = folder.put("a.obj", format!("{SQUARE}f 1 2 3 4\nf 1 2 3\n"));
    for (limit, is_ok) in [(3, true), (2, false)] {
        let options = ReadOptions { max_triangles: limit, ..ReadOptions::default() };
        let result = read_with(&path, &OBJ, &options);
        assert_eq!(result.is_ok(), is_ok);
        assert!(is_ok || is_limit_error(result, "max_triangles"));
    }
    for (limit, triangles) in [(4, 3), (3, 1)] {
        let options = ReadOptions { max_ring_vertices: limit, ..ReadOptions::default() };
        let document = read_with(&path, &OBJ, &options).expect("readable");
        assert_eq!(document.count(), triangles);
        assert_eq!(document.reported("face-over-limit"), u64::from(triangles == 1));
    }
}
