//! Real documents from `MAP3D_DATA`, a folder of data sets: nothing panics or hangs, and counts match the sources.

use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::documents::{Folder, ParsedDocument, detect_file, read_with};
use map3d_base::asset::{AssetMesh, AssetWriter};
use map3d_read::{CITYGML, OBJ, ReadOptions, open, write_tables};

fn find_data_set(folder: &str) -> Option<PathBuf> {
    let Some(root) = std::env::var_os("MAP3D_DATA") else {
        eprintln!("SKIPPED: MAP3D_DATA is not set; {folder} was not read");
        return None;
    };
    let path = Path::new(&root).join(folder);
    assert!(path.is_dir(), "{} does not exist", path.display());
    Some(path)
}

fn list_files(folder: &Path, out: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() { list_files(&path, out) } else { out.push(path) }
    }
}

fn list_documents(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let mut files = Vec::new();
    list_files(folder, &mut files);
    files.retain(|f| f.extension().is_some_and(|e| extensions.contains(&e.to_string_lossy().to_lowercase().as_str())));
    files
}

fn read(path: &Path) -> Option<ParsedDocument> {
    let start = Instant::now();
    let format = detect_file(path);
    let document = format.and_then(|format| read_with(path, format, &ReadOptions::default()).ok());
    assert!(start.elapsed().as_secs() < 10, "{} took {:?}", path.display(), start.elapsed());
    document
}

/// Counts the documents, objects and triangles of a data set.
fn count_contents(folder: &Path, extensions: &[&str]) -> (usize, usize, usize) {
    let parsed: Vec<ParsedDocument> = list_documents(folder, extensions).iter().filter_map(|f| read(f)).collect();
    let counts = (parsed.len(), parsed.iter().map(|r| r.objects.len()).sum(), parsed.iter().map(ParsedDocument::count).sum());
    println!("{}: {counts:?}", folder.display());
    counts
}

#[test]
fn city_models_have_the_expected_counts() {
    for (folder, expected) in [
        ("citygml-lyon-small-houses", (2, 4, 50)),
        ("citygml-munich-lod2-solid", (1, 111, 3530)),
        ("citygml-potsdam-lod1", (1, 97, 5024)),
        ("citygml-ingolstadt-lod3", (53, 55, INGOLSTADT_TRIANGLES)),
    ] {
        let Some(folder) = find_data_set(folder) else { return };
        assert_eq!(count_contents(&folder, &["gml", "xml"]), expected, "{}", folder.display());
    }
}

/// The sum of points − 2 + 2 · holes over all valid rings is 152,672; holes that touch their polygon or each other reduce it.
const INGOLSTADT_TRIANGLES: usize = 150_616;

#[test]
fn ingolstadt_has_the_expected_classes_and_textures() {
    let Some(folder) = find_data_set("citygml-ingolstadt-lod3") else { return };
    let parsed: Vec<ParsedDocument> = list_documents(&folder, &["xml"]).iter().filter_map(|f| read(f)).collect();
    let count = |class: &str| parsed.iter().flat_map(|r| &r.objects).filter(|o| o.class == class).count();
    assert_eq!((count("building"), count("building_part")), (54, 1));
    assert!(parsed.iter().all(|r| r.srs_name.as_deref() == Some("EPSG:32632")));
    assert!(parsed.iter().map(|r| r.reported("image-file-not-found")).sum::<u64>() > 0, "two images are missing");
    assert!(parsed.iter().map(|r| r.textures.len()).sum::<usize>() >= 170);
    let textured = parsed.iter().flat_map(|r| r.triangles().into_iter().filter(|t| r.materials[t.material as usize].texture.is_some())).count();
    // The same sum over polygons with a front texture and coordinates for the exterior ring is 35,388.
    assert!((34_000..=35_388).contains(&textured), "{textured}");
    let crossing: u64 = parsed.iter().map(|r| r.reported("rings-cross")).sum();
    assert!(crossing <= 4, "{crossing}: only a few polygons intersect themselves; all others are covered exactly");
}

#[test]
fn objs_have_the_expected_counts() {
    for (file, objects, triangles) in [
        ("obj-teapot/teapot.obj", 1, 6320),
        ("obj-3dfier-delft/example_data/output/testarea.obj", 1, 28_617),
        ("obj-spot-textured/spot.obj", 1, 5856),
    ] {
        let (folder, name) = file.split_once('/').expect("a folder");
        let Some(folder) = find_data_set(folder) else { return };
        let document = read(&folder.join(name)).expect("readable");
        assert_eq!((document.objects.len(), document.count()), (objects, triangles), "{file}");
    }
}

#[test]
fn no_file_in_any_data_set_panics_or_hangs() {
    let Some(root) = find_data_set(".") else { return };
    let mut seen = 0;
    for entry in std::fs::read_dir(&root).expect("a folder") {
        let folder = entry.expect("an entry").path();
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if folder.is_dir() && ["citygml", "obj-", "malformed-"].iter().any(|p| name.starts_with(p)) {
            let mut files = Vec::new();
            list_files(&folder, &mut files);
            for file in files.iter().filter(|f| f.metadata().is_ok_and(|m| m.len() < 20_000_000)) {
                seen += 1;
                read(file);
                for format in [&OBJ, &CITYGML] {
                    let _ = read_with(file, format, &ReadOptions::default());
                }
            }
        }
    }
    println!("{seen} files");
    assert!(seen > 500, "{seen} files");
}

#[test]
fn assets_are_written_and_read_back() {
    let Some(folder) = find_data_set("citygml-lyon-small-houses") else { return };
    let asset = Folder::new("asset");
    let path = folder.join("LYON_1ER_BATI_2015_small_house.gml");
    let mut reader = open(&path, &CITYGML, &ReadOptions::default()).expect("readable");
    let mut writer = AssetWriter::create(&asset.0).expect("a writer");
    while let Some(batch) = reader.next_batch().expect("readable") {
        writer.append(&batch).expect("appended");
    }
    let report = write_tables(reader.as_ref(), writer).expect("an asset");
    let mesh = AssetMesh::open(&asset.0.join("mesh.m3a")).expect("a mesh");
    assert_eq!((report.triangles, mesh.triangles().len(), report.objects), (28, 28, 2));
    assert_eq!(std::fs::read_dir(asset.0.join("textures")).expect("textures").count(), 1);
}
