//! Gzip files are read like their content; of a cut one, what comes before the cut.

use std::io::Write;

use crate::documents::city_model::{member, model, multi_surface, square};
use crate::documents::random::Random;
use crate::documents::{Folder, ParsedDocument, detect_file, is_error_of, read_with};
use flate2::Compression;
use flate2::write::GzEncoder;
use map3d_base::{Error, Reason};
use map3d_read::{CITYGML, OBJ, ReadOptions};

fn pack(content: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(content).expect("write");
    encoder.finish().expect("finish")
}

fn read(packed: &[u8], strict: bool) -> Result<ParsedDocument, Error> {
    let folder = Folder::new("gzip");
    read_with(&folder.put("town.gml.gz", packed), &CITYGML, &ReadOptions { strict, ..ReadOptions::default() })
}

/// Returns a town of 500 houses, each two triangles, with ids that hardly compress.
fn build_town() -> String {
    let mut random = Random(23);
    let houses = (0..500).map(|k| {
        let surface = multi_surface(&member(&square(&format!("p{:x}", (random.next_f64() * 1e15) as u64), k)));
        format!("<core:cityObjectMember><bldg:Building gml:id=\"b{k}\"><bldg:lod2MultiSurface>{surface}</bldg:lod2MultiSurface></bldg:Building></core:cityObjectMember>\n")
    });
    model(&houses.collect::<String>())
}

#[test]
fn a_packed_document_is_read_like_its_content() {
    let town = build_town();
    let plain = read(town.as_bytes(), true).expect("readable");
    let half = town.len() / 2;
    let members = [pack(&town.as_bytes()[..half]), pack(&town.as_bytes()[half..])].concat();
    for packed in [pack(town.as_bytes()), members] {
        let document = read(&packed, true).expect("readable");
        assert_eq!(document.triangles(), plain.triangles());
        assert_eq!(document.objects, plain.objects);
        assert_eq!(document.srs_name, plain.srs_name);
        assert_eq!(document.report, plain.report);
    }
    let latin = town.replace("gml:id=\"b7\"", "gml:id=\"b\u{fc}7\"").chars().map(|c| c as u8).collect::<Vec<u8>>();
    assert_eq!(
        read(&pack(&latin), false).expect("readable").reported("not-utf-8-as-declared"),
        1,
        "the file is rewound after the check of its encoding"
    );
}

#[test]
fn what_comes_before_a_cut_is_kept() {
    let packed = pack(build_town().as_bytes());
    for share in [2, 3, 5] {
        let document = read(&packed[..packed.len() - packed.len() / share], false).expect("readable");
        let whole = 1_000 - 1_000 / share;
        assert!((whole * 8 / 10..whole + 100).contains(&document.count()), "{} triangles of {whole}", document.count());
        assert_eq!(document.reported("gzip-damaged"), 1);
        assert_eq!(document.reported("document-broken"), 1);
    }
    assert!(is_error_of(read(&packed[..packed.len() / 2], true), Reason::GzipDamaged));
}

#[test]
fn a_wrong_checksum_is_said_and_nothing_is_lost() {
    let mut packed = pack(build_town().as_bytes());
    let at = packed.len() - 8;
    packed[at] ^= 1;
    let document = read(&packed, false).expect("readable");
    assert_eq!((document.count(), document.reported("gzip-damaged")), (1_000, 1));
}

#[test]
fn a_file_without_content_is_an_error() {
    for packed in [pack(b""), pack(b"x")[..12].to_vec(), vec![0x1f, 0x8b]] {
        assert!(read(&packed, false).is_err());
    }
}

#[test]
fn a_packed_obj_is_read_and_a_cut_one_is_an_error() {
    let mut random = Random(29);
    let vertices: String = (0..3_000).map(|_| format!("v {} {} 0\n", random.next_f64(), random.next_f64())).collect();
    let packed = pack(format!("{vertices}f 1 2 3\n").as_bytes());
    let folder = Folder::new("gzip");
    let path = folder.put("a.obj.gz", &packed);
    assert!(detect_file(&path).is_some_and(|format| format.name == OBJ.name));
    assert_eq!(read_with(&path, &OBJ, &ReadOptions::default()).expect("readable").count(), 1);
    let cut = folder.put("b.obj.gz", &packed[..packed.len() / 2]);
    let error = read_with(&cut, &OBJ, &ReadOptions::default()).expect_err("cut").to_string();
    assert!(error.contains("b.obj.gz") && error.contains("gzip file cut or damaged after"), "{error}");
}
