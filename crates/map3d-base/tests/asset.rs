//! An asset folder written and read back; the gate keeps unsound triangles out and counts them.

use map3d_base::asset::{AssetMesh, AssetReport, AssetWriter, Batch, Materials, Rank};

fn folder(name: &str) -> std::path::PathBuf {
    let path = std::env::temp_dir().join(format!("map3d-asset-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&path);
    path
}

fn batch(positions: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> Batch {
    let n = triangles.len();
    Batch { positions, triangles, materials: vec![0; n], objects: vec![0; n], ranks: vec![Rank::Other; n], ..Batch::default() }
}

#[test]
fn what_is_written_is_read_back() {
    let dir = folder("round-trip");
    let mut writer = AssetWriter::create(&dir).expect("writer");
    let mut b = batch(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [9.0; 3]], vec![[0, 1, 2]]);
    b.uvs = vec![[[-3.5, 7.25], [-2.5, 7.25], [-3.5, 8.25]]];
    writer.append(&b).expect("append");
    writer.append(&batch(vec![[5.0, 5.0, 5.0], [6.0, 5.0, 5.0], [5.0, 6.0, 5.0]], vec![[2, 1, 0]])).expect("append");
    let report = writer.finish(&Materials::default(), &[], AssetReport::default()).expect("finish");
    assert_eq!(report.triangles, 2);
    let mesh = AssetMesh::open(&dir.join("mesh.m3a")).expect("open");
    assert_eq!(mesh.positions().len(), 6, "a vertex that no triangle uses is not written");
    assert_eq!(mesh.triangles(), &[[0, 1, 2], [3, 4, 5]]);
    assert_eq!(mesh.positions()[3], [5.0, 6.0, 5.0]);
    assert_eq!(mesh.uvs()[0], [[0.5, 0.25], [1.5, 0.25], [0.5, 1.25]]);
    assert!(mesh.normals().is_empty());
    mesh.release();
    assert_eq!((mesh.triangles(), mesh.positions()[3]), (&[[0, 1, 2], [3, 4, 5]][..], [5.0, 6.0, 5.0]), "what was let go comes back");
    std::fs::remove_dir_all(dir).expect("clean up");
}

#[test]
fn texture_coordinates_of_a_reader_that_knows_the_wrap_mode_stay() {
    let dir = folder("shifted");
    let mut writer = AssetWriter::create(&dir).expect("writer");
    let mut b = batch(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]]);
    b.uvs = vec![[[1.25, -0.5], [1.5, 0.5], [1.75, -0.5]]];
    b.uvs_shifted = true;
    writer.append(&b).expect("append");
    writer.finish(&Materials::default(), &[], AssetReport::default()).expect("finish");
    assert_eq!(AssetMesh::open(&dir.join("mesh.m3a")).expect("open").uvs(), b.uvs);
    std::fs::remove_dir_all(dir).expect("clean up");
}

#[test]
fn unsound_triangles_stay_outside_and_are_counted() {
    let dir = folder("gate");
    let mut writer = AssetWriter::create(&dir).expect("writer");
    let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f64::NAN, 0.0, 0.0], [f64::INFINITY, 0.0, 0.0], [2e8, 0.0, 0.0], [2.0, 0.0, 0.0]];
    writer.append(&batch(points, vec![[0, 1, 2], [0, 1, 3], [0, 2, 4], [0, 2, 5], [0, 1, 6], [0, 0, 1], [0, 1, 99]])).expect("append");
    let report = writer.finish(&Materials::default(), &[], AssetReport::default()).expect("finish");
    assert_eq!(report.triangles, 1);
    let counts: Vec<u64> = report.skipped.values().copied().collect();
    assert_eq!(counts.iter().sum::<u64>(), 6);
    assert_eq!(report.skipped["zero area"], 2);
    assert_eq!(report.skipped["coordinate is not a finite number"], 2);
    std::fs::remove_dir_all(dir).expect("clean up");
}

#[test]
fn a_damaged_file_is_refused() {
    let dir = folder("damage");
    let mut writer = AssetWriter::create(&dir).expect("writer");
    writer.append(&batch(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])).expect("append");
    writer.finish(&Materials::default(), &[], AssetReport::default()).expect("finish");
    let path = dir.join("mesh.m3a");
    let good = std::fs::read(&path).expect("read");
    for cut in [0, 3, 63, 64, good.len() - 64] {
        std::fs::write(&path, &good[..cut]).expect("write");
        assert!(AssetMesh::open(&path).is_err(), "cut at {cut}");
    }
    for at in [4, 20, 70, good.len() - 1] {
        let mut bad = good.clone();
        bad[at] ^= 1;
        std::fs::write(&path, &bad).expect("write");
        assert!(AssetMesh::open(&path).is_err(), "flipped at {at}");
    }
    std::fs::remove_dir_all(dir).expect("clean up");
}
