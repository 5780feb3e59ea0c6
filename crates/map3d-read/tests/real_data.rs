//! Real documents, found through `MAP3D_DATA` (a folder of data sets): nothing panics or hangs, and counts are those of the sources.

mod reading;

use std::path::{Path, PathBuf};
use std::time::Instant;

use map3d_base::asset::AssetMesh;
use map3d_read::{Format, ReadOptions, detect_format, import};
use reading::{Folder, Reading, read_with};

fn data(folder: &str) -> Option<PathBuf> {
    let Some(root) = std::env::var_os("MAP3D_DATA") else {
        eprintln!("SKIPPED: MAP3D_DATA is not set; {folder} was not read");
        return None;
    };
    let path = Path::new(&root).join(folder);
    assert!(path.is_dir(), "{} does not exist", path.display());
    Some(path)
}

fn files_below(folder: &Path, out: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() { files_below(&path, out) } else { out.push(path) }
    }
}

fn documents(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let mut files = Vec::new();
    files_below(folder, &mut files);
    files.retain(|f| f.extension().is_some_and(|e| extensions.contains(&e.to_string_lossy().to_lowercase().as_str())));
    files
}

fn read(path: &Path) -> Option<Reading> {
    let start = Instant::now();
    let format = detect_format(path);
    let reading = format.and_then(|format| read_with(path, format, &ReadOptions::default()));
    assert!(start.elapsed().as_secs() < 10, "{} took {:?}", path.display(), start.elapsed());
    reading.ok()
}

/// Sums over all documents of a data set: documents, objects, triangles.
fn totals(folder: &Path, extensions: &[&str]) -> (usize, usize, usize) {
    let readings: Vec<Reading> = documents(folder, extensions).iter().filter_map(|f| read(f)).collect();
    let totals = (readings.len(), readings.iter().map(|r| r.objects.len()).sum(), readings.iter().map(Reading::count).sum());
    println!("{}: {totals:?}", folder.display());
    totals
}

#[test]
fn city_models_have_the_counts_of_their_sources() {
    for (folder, expected) in [
        ("citygml-lyon-small-houses", (2, 4, 50)),
        ("citygml-munich-lod2-solid", (1, 111, 3530)),
        ("citygml-potsdam-lod1", (1, 97, 5024)),
        ("citygml-ingolstadt-lod3", (53, 55, INGOLSTADT_TRIANGLES)),
    ] {
        let Some(folder) = data(folder) else { return };
        assert_eq!(totals(&folder, &["gml", "xml"]), expected, "{}", folder.display());
    }
}

/// The sum of points − 2 + 2 · holes over all sound rings is 152,672; less where holes touch their polygon or one another.
const INGOLSTADT_TRIANGLES: usize = 150_616;

#[test]
fn ingolstadt_keeps_its_holes_images_and_classes() {
    let Some(folder) = data("citygml-ingolstadt-lod3") else { return };
    let readings: Vec<Reading> = documents(&folder, &["xml"]).iter().filter_map(|f| read(f)).collect();
    let count = |class: &str| readings.iter().flat_map(|r| &r.objects).filter(|o| o.class == class).count();
    assert_eq!((count("building"), count("building_part")), (54, 1));
    assert!(readings.iter().all(|r| r.srs_name.as_deref() == Some("EPSG:32632")));
    assert!(readings.iter().map(|r| r.warned("image: file not found")).sum::<u64>() > 0, "two images are missing");
    assert!(readings.iter().map(|r| r.textures.len()).sum::<usize>() >= 170);
    let textured = readings.iter().flat_map(|r| r.triangles().into_iter().filter(|t| r.materials[t.material as usize].texture.is_some())).count();
    // By the same sum, polygons whose front has a texture with coordinates for their exterior ring have 35,388.
    assert!((34_000..=35_388).contains(&textured), "{textured}");
    let crossing: u64 = readings.iter().map(|r| r.warned("cross")).sum();
    assert!(crossing <= 4, "{crossing}: all polygons but the few that cross themselves are covered exactly");
}

#[test]
fn objs_have_the_counts_of_their_sources() {
    for (file, objects, triangles) in [
        ("obj-teapot/teapot.obj", 1, 6320),
        ("obj-3dfier-delft/example_data/output/testarea.obj", 1, 28_617),
        ("obj-spot-textured/spot.obj", 1, 5856),
    ] {
        let (folder, name) = file.split_once('/').expect("a folder");
        let Some(folder) = data(folder) else { return };
        let reading = read(&folder.join(name)).expect("readable");
        assert_eq!((reading.objects.len(), reading.count()), (objects, triangles), "{file}");
    }
}

#[test]
fn nothing_in_any_data_set_panics_or_hangs() {
    let Some(root) = data(".") else { return };
    let mut seen = 0;
    for entry in std::fs::read_dir(&root).expect("a folder") {
        let folder = entry.expect("an entry").path();
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if folder.is_dir() && ["citygml", "obj-", "malformed-"].iter().any(|p| name.starts_with(p)) {
            let mut files = Vec::new();
            files_below(&folder, &mut files);
            for file in files.iter().filter(|f| f.metadata().is_ok_and(|m| m.len() < 20_000_000)) {
                seen += 1;
                read(file);
                for format in [Format::Obj, Format::CityGml] {
                    let _ = read_with(file, format, &ReadOptions::default());
                }
            }
        }
    }
    println!("{seen} files");
    assert!(seen > 500, "{seen} files");
}

#[test]
fn an_asset_is_written_and_read_back() {
    let Some(folder) = data("citygml-lyon-small-houses") else { return };
    let asset = Folder::new("asset");
    let report = import(&folder.join("LYON_1ER_BATI_2015_small_house.gml"), Format::CityGml, &ReadOptions::default(), &asset.0).expect("an asset");
    let mesh = AssetMesh::open(&asset.0.join("mesh.m3a")).expect("a mesh");
    assert_eq!((report.triangles, mesh.triangles().len(), report.objects), (28, 28, 2));
    assert_eq!(std::fs::read_dir(asset.0.join("textures")).expect("textures").count(), 1);
}
