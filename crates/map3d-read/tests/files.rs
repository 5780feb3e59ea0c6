//! File names in user data resolve only inside the asset's folder; image headers are checked before the image is used.

use crate::documents::{Folder, ParsedDocument, detect_file, encode_png, read_with};
use map3d_image::Raster;
use map3d_image::encode::encode_jpeg;
use map3d_read::{AssetFolder, FileError, FileHead, HEAD_BYTES, OBJ, ReadOptions, detect};

#[test]
fn names_resolve_only_inside_the_folder() {
    let outer = Folder::new("names");
    outer.put("secret.png", "x");
    outer.put("inner/a b.png", "x");
    outer.put("inner/Sub/C.PNG", "x");
    outer.put("inner/100%25.png", "x");
    let document = outer.put("inner/doc.obj", "");
    std::os::unix::fs::symlink(outer.0.join("secret.png"), outer.0.join("inner/link.png")).expect("link");
    std::os::unix::fs::symlink(outer.0.join("inner/Sub/C.PNG"), outer.0.join("inner/good-link.png")).expect("link");
    let absolute = outer.0.join("inner/a b.png");
    let secret = outer.0.join("secret.png");
    let mut folder = AssetFolder::for_document(&document, None).expect("folder");
    for name in [
        "a b.png",
        " a b.png ",
        "a%20b.png",
        "A%20B.png",
        "./a b.png",
        "Sub/C.PNG",
        "sub\\c.png",
        "Sub/../a b.png",
        "100%25.png",
        "good-link.png",
        "\"a b.png\"",
        "'sub/c.png'",
        "/Sub/C.PNG",
        "C:\\Projects\\inner\\Sub\\C.PNG",
        "C:a b.png",
        "\\\\server\\share\\a b.png",
        "file:///C:/elsewhere/a%20b.png",
        "file://server/sub/c.png",
        absolute.to_str().expect("utf-8"),
        &format!("file://{}", absolute.display()),
        "file:a b.png",
    ] {
        assert!(folder.find(name).is_ok(), "{name}: {:?}", folder.find(name));
    }
    for (name, error) in [
        ("../secret.png", FileError::OutsideFolder),
        ("..\\secret.png", FileError::OutsideFolder),
        ("%2e%2e/secret.png", FileError::OutsideFolder),
        ("../missing.png", FileError::OutsideFolder),
        ("link.png", FileError::OutsideFolder),
        (secret.to_str().expect("utf-8"), FileError::OutsideFolder),
        ("/etc/passwd", FileError::OutsideFolder),
        ("/elsewhere/secret.png", FileError::OutsideFolder),
        ("C:\\inner\\..\\..\\secret.png", FileError::OutsideFolder),
        ("C:\\texture.png", FileError::OutsideFolder),
        ("http://host.example/a.png", FileError::Url),
        ("HTTPS://host.example/a.png", FileError::Url),
        ("data:image/png;base64,AA", FileError::Url),
        ("missing.png", FileError::NotFound),
        ("Sub", FileError::NotAFile),
        (".", FileError::NotAFile),
        ("", FileError::InvalidName),
        ("a\0b", FileError::InvalidName),
    ] {
        assert_eq!(folder.find(name), Err(error), "{name}");
    }
    assert_eq!(folder.find(&"x".repeat(1025)), Err(FileError::InvalidName));
}

#[test]
fn names_may_lead_up_to_the_given_folder() {
    let outer = Folder::new("wider");
    outer.put("textures/a.png", "x");
    let document = outer.put("models/doc.obj", "");
    let mut folder = AssetFolder::for_document(&document, Some(&outer.0)).expect("folder");
    assert!(folder.find("../textures/a.png").is_ok());
    assert!(folder.find("../TEXTURES/A.PNG").is_ok());
    assert_eq!(folder.find("../../etc/passwd"), Err(FileError::OutsideFolder));
}

#[test]
fn pipes_are_not_opened() {
    let folder = Folder::new("pipe");
    let document = folder.put("doc.obj", "");
    let made = std::process::Command::new("mkfifo").arg(folder.0.join("pipe.png")).status();
    if made.is_ok_and(|status| status.success()) {
        assert_eq!(AssetFolder::for_document(&document, None).expect("folder").find("pipe.png"), Err(FileError::NotAFile));
    }
}

fn read_with_image(bytes: &[u8], options: &ReadOptions) -> ParsedDocument {
    let folder = Folder::new("image");
    folder.put("t.png", bytes);
    folder.put("a.mtl", "newmtl m\nmap_Kd t.png\n");
    let path = folder.put("a.obj", "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n");
    read_with(&path, &OBJ, options).expect("readable")
}

#[test]
fn images_over_a_limit_are_skipped() {
    let image = encode_png(40, 20, [1, 2, 3, 255]);
    for (side, pixels, is_used) in [(40, 800, true), (39, 800, false), (40, 799, false)] {
        let options = ReadOptions { max_image_side_px: side, max_image_px: pixels, ..ReadOptions::default() };
        let document = read_with_image(&image, &options);
        assert_eq!(document.textures.len() == 1, is_used, "{side} {pixels}");
        assert_eq!(document.count(), 1);
        assert_eq!(document.reported("image-"), u64::from(!is_used));
    }
}

#[test]
fn invalid_images_are_skipped() {
    let image = encode_png(4, 4, [1, 2, 3, 255]);
    let huge_header = {
        let mut b = image.clone();
        b[16..20].copy_from_slice(&[0x7F, 0xFF, 0xFF, 0xFF]);
        b
    };
    for bytes in [&b""[..], b"text", &image[..10], &huge_header, b"GIF89a", b"\xFF\xD8\xFF"] {
        let document = read_with_image(bytes, &ReadOptions::default());
        assert_eq!((document.textures.len(), document.count()), (0, 1), "{bytes:?}");
        assert_eq!(document.reported("image-"), 1);
    }
}

#[test]
fn image_extension_follows_the_content() {
    let jpeg = encode_jpeg(&Raster::filled(7, 5, [9, 9, 9, 255]), 80).expect("encodes");
    let document = read_with_image(&jpeg, &ReadOptions::default());
    assert_eq!((document.textures[0].extension, document.textures[0].width_px, document.textures[0].height_px), ("jpg", 7, 5));
}

#[test]
fn formats_are_detected_by_content() {
    let utf16 = |text: &str, bytes: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(bytes).collect::<Vec<u8>>();
    let cut = [b"v 0 0 0\n".repeat(HEAD_BYTES / 8 - 1), b"unknown ".to_vec()].concat();
    for (bytes, expected) in [
        (&b"v 0 0 0\nv 1 0 0\n"[..], Some("obj")),
        (b"# by hand\n\nmtllib a.mtl\n", Some("obj")),
        (b"v 0 0 0", Some("obj")),
        (b"\r\r\nv 0 0 0\rf 1 1 1\r", Some("obj")),
        (b"  call a.obj\nusemap t\nvp 1 2\n", Some("obj")),
        (&[&b"v 0 0 0\n".repeat(9)[..], b"unknown\n"].concat(), Some("obj")),
        (&[&b"v 0 0 0\n".repeat(8)[..], b"unknown\n"].concat(), None),
        (b"v 0 0 0\nunknown", None),
        (&cut, Some("obj")),
        (&utf16("\u{feff}v 0 0 0\nf 1 1 1\n", u16::to_be_bytes), Some("obj")),
        (&utf16("v 0 0 0\nf 1 1 1\n", u16::to_le_bytes), Some("obj")),
        (b"v 0 0 0\0\n", None),
        (b"<?xml version='1.0'?><!-- <a> --><core:CityModel xmlns:core='x'/>", Some("citygml")),
        (b"\xEF\xBB\xBF<CityModel/>", Some("citygml")),
        (b"\n <CityModel\n>", Some("citygml")),
        (b"<!DOCTYPE CityModel><CityModel>", Some("citygml")),
        (b"<?xml version='1.0' encoding='utf-16'?><CityModel>", Some("citygml")),
        (&utf16("\u{feff}<CityModel/>", u16::to_le_bytes), Some("citygml")),
        (&utf16("<?xml version='1.0'?><CityModel/>", u16::to_be_bytes), Some("citygml")),
        (b"<html></html>", None),
        (b"<CityModel2/>", None),
        (b"<!-- <CityModel> ", None),
        (b"<?xml version='1.0'?>", None),
        (b"{\"type\":\"CityJSON\"}", None),
        (b"", None),
        (b"\x89PNG\r\n\x1a\n", None),
        (b"a plain text\nof two lines\n", None),
    ] {
        let found = detect(&FileHead::new(bytes.to_vec())).map(|format| format.name);
        assert_eq!(found, expected, "{:?}", String::from_utf8_lossy(&bytes[..bytes.len().min(80)]));
    }
}

#[test]
fn the_beginning_is_that_of_a_regular_file() {
    let folder = Folder::new("detect");
    assert!(detect_file(&folder.put("document", "<CityModel/>")).is_some_and(|format| format.name == "citygml"));
    assert!(detect_file(&folder.0).is_none(), "a folder");
    assert!(detect_file(&folder.0.join("missing")).is_none());
}
