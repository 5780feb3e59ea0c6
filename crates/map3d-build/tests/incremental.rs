//! A build after a change reads only what changed and gives the same bytes as a build from scratch.

use std::collections::BTreeMap;
use std::path::Path;

use crate::fixture::{Face, Folder, batch, bytes_of, new_folder, request, run, tent, write_asset};
use map3d_base::asset::{Instance, Material, Materials, Rank};
use map3d_build::{BuildRequest, build_scene};
use map3d_image::encode::{Deflate, Filter, encode_png};
use map3d_scene::SceneStore;

/// Returns a quarter of a grid of tents over 20 × 20 km; cells at its borders also have tents of other quarters.
fn quarter(number: u32) -> Vec<Face> {
    let (left, bottom) = (f64::from(number % 2) * 10_000.0, f64::from(number / 2) * 10_000.0);
    (0..100).flat_map(|k| tent(left + f64::from(k % 10) * 1000.0, bottom + f64::from(k / 10) * 1000.0, k)).collect()
}

fn name(number: u32) -> String {
    format!("quarter-{number}")
}

fn plain_materials() -> Materials {
    let colour = |red: f32| Material { diffuse: [red, 0.5, 0.5, 1.0], ..Material::default() };
    Materials { materials: vec![colour(0.1), colour(0.2), colour(0.3)], instances: vec![] }
}

fn write_quarter(folder: &Path, number: u32, faces: &[Face], materials: Materials) {
    let _ = std::fs::remove_dir_all(folder.join("assets").join(name(number)));
    write_asset(folder, &name(number), &[batch(faces, 0)], materials);
    let ids = folder.join("assets").join(name(number)).join("ids.u32");
    let count = std::fs::metadata(&ids).expect("ids").len() as u32 / 4;
    std::fs::write(&ids, (1..=count).flat_map(|k| (number * 10_000 + k * 10).to_le_bytes()).collect::<Vec<u8>>()).expect("ids");
}

fn request_for(numbers: &[u32]) -> BuildRequest {
    BuildRequest { assets: numbers.iter().map(|n| name(*n)).collect(), ..request() }
}

/// Returns the files of a build of these quarters in a new folder.
fn build_from_nothing(quarters: &[(u32, Vec<Face>)]) -> BTreeMap<String, Vec<u8>> {
    let folder = new_folder();
    quarters.iter().for_each(|(number, faces)| write_quarter(&folder.0, *number, faces, plain_materials()));
    run(&folder, &request_for(&quarters.iter().map(|q| q.0).collect::<Vec<_>>()));
    bytes_of(&folder)
}

fn build_four_quarters(folder: &Folder) -> Vec<(u32, Vec<Face>)> {
    let quarters: Vec<_> = (0..4).map(|k| (k, quarter(k))).collect();
    quarters.iter().for_each(|(number, faces)| write_quarter(&folder.0, *number, faces, plain_materials()));
    run(folder, &request_for(&[0, 1, 2, 3]));
    quarters
}

/// Corrupts the body of an asset's mesh: only opening it fails.
fn corrupt_mesh(folder: &Path, number: u32) {
    let path = folder.join("assets").join(name(number)).join("mesh.m3a");
    let mut bytes = std::fs::read(&path).expect("read");
    bytes[64..].fill(0xAB);
    std::fs::write(&path, bytes).expect("write");
}

#[test]
fn changed_added_and_removed_objects_give_the_bytes_of_a_build_from_scratch() {
    let folder = new_folder();
    let mut quarters = build_four_quarters(&folder);
    // One tent moves and two are swapped in the order of the file.
    quarters[1].1.iter_mut().filter(|f| f.1 == 44).for_each(|f| f.0.iter_mut().for_each(|p| p[0] += 7.25));
    quarters[1].1.rotate_left(3);
    write_quarter(&folder.0, 1, &quarters[1].1, plain_materials());
    let report = run(&folder, &request_for(&[0, 1, 2, 3]));
    assert_eq!(report.chunks - report.chunks_kept, 1);
    assert!(bytes_of(&folder) == build_from_nothing(&quarters));
    // One is removed, one added.
    quarters[3].1.retain(|f| f.1 != 50);
    quarters[3].1.extend(tent(14_444.0, 15_555.0, 100));
    write_quarter(&folder.0, 3, &quarters[3].1, plain_materials());
    let report = run(&folder, &request_for(&[0, 1, 2, 3]));
    assert!((1..=2).contains(&(report.chunks - report.chunks_kept)), "{report:?}");
    assert!(bytes_of(&folder) == build_from_nothing(&quarters));
    assert_eq!(report.triangles_read, 1200);
}

#[test]
fn adding_or_removing_an_asset_does_not_read_the_others() {
    let folder = new_folder();
    let quarters = build_four_quarters(&folder);
    let far: Vec<Face> = (0..5).flat_map(|k| tent(18_500.0, 18_500.0 + f64::from(k) * 10.0, k)).collect();
    write_quarter(&folder.0, 4, &far, plain_materials());
    (0..4).for_each(|k| corrupt_mesh(&folder.0, k));
    let report = run(&folder, &request_for(&[0, 1, 2, 3, 4]));
    assert_eq!((report.chunks - report.chunks_kept, report.triangles), (1, 1215));
    let all: Vec<_> = quarters.iter().cloned().chain([(4, far)]).collect();
    assert!(bytes_of(&folder) == build_from_nothing(&all));
    run(&folder, &request_for(&[0, 1, 2, 3]));
    assert!(bytes_of(&folder) == build_from_nothing(&quarters));
    assert!(!folder.0.join("build/quarter-4.m3v").exists());
    // A square that grows moves all cells, so the build reads everything and finds the damage.
    write_quarter(&folder.0, 4, &tent(90_000.0, 0.0, 0), plain_materials());
    assert!(build_scene(&folder.0, &request_for(&[0, 1, 2, 3, 4]), &mut |_, _, _| true).is_err());
}

#[test]
fn an_unchanged_scene_reads_no_asset_and_writes_nothing() {
    let folder = new_folder();
    build_four_quarters(&folder);
    let before = bytes_of(&folder);
    (0..4).for_each(|k| corrupt_mesh(&folder.0, k));
    let report = run(&folder, &request_for(&[0, 1, 2, 3]));
    assert_eq!((report.chunks, report.triangles_read, report.merged_materials), (report.chunks_kept, 1200, 9));
    assert!(bytes_of(&folder) == before);
}

#[test]
fn missing_or_damaged_chunks_and_summaries_are_rebuilt() {
    let folder = new_folder();
    build_four_quarters(&folder);
    let before = bytes_of(&folder);
    let chunk = std::fs::read_dir(folder.0.join("chunks")).expect("list").next().expect("a chunk").expect("entry").path();
    std::fs::write(&chunk, &std::fs::read(&chunk).expect("read")[..200]).expect("write");
    std::fs::remove_file(folder.0.join("build/quarter-2.m3v")).expect("remove");
    std::fs::write(folder.0.join("build/quarter-1.m3v"), b"nonsense").expect("write");
    let report = run(&folder, &request_for(&[0, 1, 2, 3]));
    assert_eq!(report.chunks - report.chunks_kept, 1);
    assert!(bytes_of(&folder) == before);
}

#[test]
fn objects_keep_their_content_hash_when_their_asset_grows() {
    let folder = new_folder();
    let contents = |folder: &Folder| -> BTreeMap<u32, [u64; 2]> {
        let store = SceneStore::open(&folder.0, 1 << 20).expect("open");
        let chunks: Vec<_> = store.parts().iter().map(|p| store.chunk(p.chunk).expect("chunk")).collect();
        chunks.iter().flat_map(|c| c.objects()).map(|o| (o.id, o.content)).collect()
    };
    let quarters = build_four_quarters(&folder);
    let before = contents(&folder);
    let mut more = tent(3_333.0, 3_333.0, 100);
    more.extend(quarters[0].1.clone());
    write_quarter(&folder.0, 0, &more, plain_materials());
    run(&folder, &request_for(&[0, 1, 2, 3]));
    let mut after = contents(&folder);
    assert!(after.remove(&1010).is_some());
    assert_eq!(before, after);
}

fn pattern_image(seed: u8) -> Vec<u8> {
    let pixels: Vec<u8> = (0..16 * 16 * 3).map(|k| (k as u8).wrapping_mul(seed)).collect();
    encode_png((16, 16), 3, &pixels, Filter::None, Deflate::Fast)
}

/// Writes a tent whose triangles use `part` of an image.
fn write_textured_asset(folder: &Path, number: u32, part: f32, image: u8) {
    // Cells of their own, and near enough to be one place also without the middle one.
    let mut batch = batch(&tent(f64::from(number) * 4500.0, 0.0, 0), 0);
    batch.uvs = vec![[[0.0, 0.0], [part, 0.0], [0.0, part]]; 3];
    let material = Material { texture: Some("shared".into()), ..Material::default() };
    let _ = std::fs::remove_dir_all(folder.join("assets").join(name(number)));
    write_asset(folder, &name(number), &[batch], Materials { materials: vec![material], instances: vec![] });
    std::fs::write(folder.join("assets").join(name(number)).join("textures/shared.png"), pattern_image(image)).expect("image");
    std::fs::write(folder.join("assets").join(name(number)).join("ids.u32"), (number * 10 + 10).to_le_bytes()).expect("ids");
}

#[test]
fn an_asset_is_rebuilt_when_the_usage_of_a_shared_image_changes() {
    let (folder, other) = (new_folder(), new_folder());
    (0..3).for_each(|k| write_textured_asset(&folder.0, k, 0.3, 7));
    run(&folder, &request_for(&[0, 1, 2]));
    write_textured_asset(&folder.0, 1, 0.8, 7);
    let report = run(&folder, &request_for(&[0, 1, 2]));
    assert_eq!((report.textures, report.textures_kept, report.chunks_kept), (1, 0, 0));
    write_textured_asset(&other.0, 0, 0.3, 7);
    write_textured_asset(&other.0, 1, 0.8, 7);
    write_textured_asset(&other.0, 2, 0.3, 7);
    run(&other, &request_for(&[0, 1, 2]));
    assert!(bytes_of(&folder) == bytes_of(&other));
    // Without the asset that used most of the image, less of it is used.
    run(&folder, &request_for(&[0, 2]));
    std::fs::remove_dir_all(other.0.join("chunks")).expect("remove");
    std::fs::remove_file(other.0.join("scene.json")).expect("remove");
    run(&other, &request_for(&[0, 2]));
    let chunks = |f: &Folder| bytes_of(f).into_iter().filter(|(name, _)| name.contains("m3c")).collect::<Vec<_>>();
    assert!(chunks(&folder) == chunks(&other));
    // A missing texture file is written again.
    std::fs::remove_dir_all(folder.0.join("textures")).expect("remove");
    assert_eq!(run(&folder, &request_for(&[0, 2])).textures_kept, 0);
    assert!(folder.0.join("textures").exists());
}

#[test]
fn equal_prototypes_of_several_assets_are_one_file() {
    let folder = new_folder();
    let tree: Vec<Face> =
        vec![([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 3.0]], 0, 0, Rank::Other), ([[0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 3.0]], 1, 0, Rank::Other)];
    for number in 0..2 {
        let at = |object: u32| Instance {
            prototype: 1,
            object,
            transform: [1.0, 0.0, 0.0, 500_000.0 + f64::from(number * 100 + object), 0.0, 1.0, 0.0, 5_000_000.0, 0.0, 0.0, 1.0, 0.0],
        };
        let materials = Materials { materials: vec![Material::default()], instances: vec![at(2), at(3)] };
        write_asset(&folder.0, &name(number), &[batch(&tree, 1)], materials);
    }
    let report = run(&folder, &request_for(&[0, 1]));
    assert_eq!((report.prototypes, report.instances), (1, 4));
    let store = SceneStore::open(&folder.0, 1 << 20).expect("open");
    assert_eq!(store.chunk(0).expect("the prototype").triangles().iter().map(|t| t.source).max(), Some(1));
    run(&folder, &request_for(&[1]));
    assert_eq!(SceneStore::open(&folder.0, 1 << 20).expect("open").instances().len(), 2);
}
