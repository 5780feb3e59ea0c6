//! Randomly damaged documents give an error or a document, never a panic.

use std::time::Instant;

use crate::documents::random::Random;
use crate::documents::{Folder, of_format, read_with};
use map3d_read::{CITYGML, OBJ, ReadOptions, SourceFormat};
use serde_json::json;

const CITY: &str = include_str!("data/all_constructs.gml");
const HOUSE: &str = include_str!("data/all_statements.obj");
const LIBRARY: &str = include_str!("data/all_statements.mtl");

fn damage(text: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = text.to_vec();
    let at = random.below(bytes.len());
    let length = 1 + random.below(200.min(bytes.len() - at));
    match random.below(6) {
        0 => bytes.truncate(at),
        1 => bytes[at] = random.below(256) as u8,
        2 => drop(bytes.drain(at..at + length)),
        3 => {
            let piece = bytes[at..at + length].to_vec();
            let to = random.below(bytes.len());
            bytes.splice(to..to, piece);
        }
        4 => bytes[at..at + length].fill(b"0 9<>\"-#&/"[random.below(10)]),
        _ => {
            let digits: Vec<usize> = (0..bytes.len()).filter(|i| bytes[*i].is_ascii_digit()).collect();
            for _ in 0..8 {
                bytes[digits[random.below(digits.len())]] = b"0123456789-.e"[random.below(13)];
            }
        }
    }
    bytes
}

fn read_quickly(path: &std::path::Path, format: &SourceFormat, options: &ReadOptions) {
    let start = Instant::now();
    let _ = read_with(path, format, options);
    assert!(start.elapsed().as_secs() < 10, "{}", path.display());
}

#[test]
fn damaged_city_models_never_panic() {
    let folder = Folder::new("mutated-city");
    folder.put_png("t.png", 4, 4, [1, 2, 3, 200]);
    folder.put("lamp.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n");
    let mut random = Random(1);
    for case in 0..500 {
        let path = folder.put("a.gml", damage(CITY.as_bytes(), &mut random));
        read_quickly(&path, &CITYGML, &ReadOptions { strict: case % 10 == 0, ..ReadOptions::default() });
    }
}

#[test]
fn damaged_objs_never_panic() {
    let folder = Folder::new("mutated-obj");
    folder.put_png("t.png", 4, 4, [1, 2, 3, 200]);
    let mut random = Random(2);
    for case in 0..500 {
        folder.put("all_statements.mtl", damage(LIBRARY.as_bytes(), &mut random));
        let path = folder.put("a.obj", damage(HOUSE.as_bytes(), &mut random));
        let split = of_format(json!({"split": if case % 2 == 0 { "file" } else { "group" }}));
        read_quickly(&path, &OBJ, &ReadOptions { strict: case % 10 == 0, ..split });
    }
}

#[test]
fn damaged_images_never_panic() {
    let folder = Folder::new("mutated-image");
    folder.put("a.mtl", "newmtl m\nmap_Kd t.png\n");
    let path = folder.put("a.obj", "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n");
    let image = crate::documents::encode_png(16, 16, [1, 2, 3, 4]);
    let mut random = Random(3);
    for _ in 0..200 {
        folder.put("t.png", damage(&image, &mut random));
        read_quickly(&path, &OBJ, &ReadOptions::default());
    }
}

#[test]
fn undamaged_documents_are_read_completely() {
    let folder = Folder::new("undamaged");
    folder.put_png("t.png", 4, 4, [1, 2, 3, 200]);
    folder.put("lamp.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n");
    folder.put("all_statements.mtl", LIBRARY);
    let city = read_with(&folder.put("a.gml", CITY), &CITYGML, &ReadOptions { strict: true, ..ReadOptions::default() }).expect("no fault");
    assert_eq!((city.objects.len(), city.instances.len(), city.count()), (6, 3, 20));
    let house = read_with(&folder.put("a.obj", HOUSE), &OBJ, &ReadOptions { strict: true, ..ReadOptions::default() }).expect("no fault");
    assert_eq!((house.count(), house.materials.len()), (10, 5));
}
