//! Asset folders are read back as written; invalid triangles are skipped and counted.

use map3d_base::Box3;
use map3d_base::Reason;
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
fn an_asset_is_read_back_as_written() {
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
    assert_eq!((mesh.triangles(), mesh.positions()[3]), (&[[0, 1, 2], [3, 4, 5]][..], [5.0, 6.0, 5.0]), "released pages are read again");
    std::fs::remove_dir_all(dir).expect("clean up");
}

#[test]
fn uvs_that_the_reader_has_shifted_are_kept() {
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
fn invalid_triangles_are_skipped_and_counted() {
    let dir = folder("validation");
    let mut writer = AssetWriter::create(&dir).expect("writer");
    let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f64::NAN, 0.0, 0.0], [f64::INFINITY, 0.0, 0.0], [2e8, 0.0, 0.0], [2.0, 0.0, 0.0]];
    writer.append(&batch(points, vec![[0, 1, 2], [0, 1, 3], [0, 2, 4], [0, 2, 5], [0, 1, 6], [0, 0, 1], [0, 1, 99]])).expect("append");
    let report = writer.finish(&Materials::default(), &[], AssetReport::default()).expect("finish");
    assert_eq!(report.triangles, 1);
    assert_eq!(report.findings.iter().map(|finding| finding.count).sum::<u64>(), 6);
    assert_eq!((report.count(Reason::ZeroArea), report.count(Reason::CoordinateNotFinite)), (2, 2));
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

#[test]
fn boxes_of_a_mesh_are_those_of_its_objects_and_prototypes() {
    let dir = folder("boxes");
    let mut writer = AssetWriter::create(&dir).expect("writer");
    let points = |shift: f64| (0..30).map(|k| [shift + f64::from(k * 7 % 11), f64::from(k * 5 % 13), f64::from(k * 3 % 17)]).collect::<Vec<_>>();
    let triangles: Vec<[u32; 3]> = (0..20).map(|k| [k, (k * 3 + 1) % 30, (k * 11 + 2) % 30]).collect();
    let objects: Vec<u32> = (0..20).map(|k| k % 4).collect();
    writer.append(&Batch { objects: objects.clone(), ..batch(points(0.0), triangles.clone()) }).expect("append");
    writer.append(&Batch { objects: objects.clone(), prototype: 2, ..batch(points(-50.0), triangles) }).expect("append");
    writer.finish(&Materials::default(), &[], AssetReport::default()).expect("finish");
    let mesh = AssetMesh::open(&dir.join("mesh.m3a")).expect("open");
    let expected = |is_one: &dyn Fn(usize) -> bool| {
        let mut bounds = Box3::EMPTY;
        let corners = mesh.triangles().iter().enumerate().filter(|(t, _)| is_one(*t)).flat_map(|(_, t)| t);
        corners.for_each(|v| bounds.add_point(mesh.positions()[*v as usize]));
        bounds
    };
    let found = mesh.boxes(6, None).expect("boxes");
    for (object, bounds) in found.objects.iter().enumerate() {
        assert_eq!(*bounds, expected(&|t| mesh.prototypes()[t] == 0 && mesh.objects()[t] as usize == object), "object {object}");
    }
    assert!(found.objects[5].is_empty() && !found.objects[3].is_empty());
    assert_eq!(found.prototypes.into_iter().collect::<Vec<_>>(), [(2, expected(&|t| mesh.prototypes()[t] == 2))]);
    assert!(mesh.boxes(3, None).is_err(), "an object beyond the count");
    std::fs::remove_dir_all(dir).expect("clean up");
}
