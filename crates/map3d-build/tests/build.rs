//! Builds convert assets to chunks; the same assets give the same bytes.

use crate::fixture::{Face, batch, bytes_of, new_folder, request, run, tent, tent_grid, world, write_asset, write_faces};
use map3d_base::Error;
use map3d_base::asset::{Adjustments, Instance, Material, Materials, Rank};
use map3d_build::{BuildOptions, BuildRequest, GroundPlane, build_scene};
use map3d_scene::{Chunk, SceneStore};

#[test]
fn an_empty_scene_can_be_built_and_opened() {
    let folder = new_folder();
    write_faces(&folder.0, &[]);
    assert_eq!(run(&folder, &request()).triangles, 0);
    let store = SceneStore::open(&folder.0, 1 << 20).expect("open");
    assert!(store.bounds().is_empty() && store.parts().is_empty());
    let none = BuildRequest { assets: vec![], ..request() };
    assert_eq!(run(&folder, &none).triangles_read, 0);
}

#[test]
fn one_triangle_is_snapped_to_the_lattice() {
    let folder = new_folder();
    let t = [[1.0 / 4096.0, 0.0, 0.0], [3.00001, 0.0, 0.0], [0.0, 4.0, 1.5]];
    write_faces(&folder.0, &[(world(t), 0, 0, Rank::Ground)]);
    run(&folder, &request());
    let store = SceneStore::open(&folder.0, 1 << 20).expect("open");
    let chunk = store.chunk(0).expect("chunk");
    let leaf = &chunk.leaves()[0];
    let corner = |c: usize| [0, 1, 2].map(|k| chunk.origin()[k] + f64::from(leaf.corners[3 * c + k][0]));
    assert_eq!([corner(0), corner(1), corner(2)], [[1.0 / 4096.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 1.5]]);
    assert_eq!((chunk.objects()[0].id, chunk.triangles()[0].rank), (10, 2));
}

#[test]
fn each_optimisation_is_counted_and_can_be_switched_off() {
    let t = world([[0.0; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]]);
    let faces = [
        (t, 0, 0, Rank::Other),
        // The same face again: rotated, reversed, and with an equal material.
        ([t[1], t[2], t[0]], 0, 0, Rank::Other),
        ([t[0], t[2], t[1]], 0, 1, Rank::Other),
        // Another object's, and another material's: both stay.
        (t, 1, 0, Rank::Other),
        (t, 0, 2, Rank::Other),
        // Without area once snapped.
        (world([[9.0, 9.0, 0.0], [9.00001, 9.0, 0.0], [9.0, 9.00001, 0.0]]), 0, 0, Rank::Other),
    ];
    let folder = new_folder();
    write_faces(&folder.0, &faces);
    let on = run(&folder, &request());
    assert_eq!((on.triangles_read, on.triangles, on.duplicate_faces, on.degenerate_triangles), (6, 3, 2, 1));
    assert_eq!((on.merged_materials, on.duplicate_vertices), (1, 14));
    let mut off = request();
    let no = false;
    off.options = BuildOptions { merge_vertices: no, merge_faces: no, drop_degenerate: no, merge_materials: no, ..off.options };
    let off = run(&folder, &off);
    assert_eq!((off.triangles, off.duplicate_faces, off.degenerate_triangles, off.merged_materials, off.duplicate_vertices), (6, 0, 0, 0, 0));
    let mut textured = request();
    textured.options.drop_untextured = true;
    assert_eq!(run(&folder, &textured).untextured_faces, 6);
}

#[test]
fn builds_are_equal_with_any_number_of_threads_and_any_memory() {
    let folders = [new_folder(), new_folder()];
    folders.iter().for_each(|f| write_faces(&f.0, &tent_grid()));
    run(&folders[0], &request());
    // 4 KiB: all triangles go to files.
    let report = run(&folders[1], &BuildRequest { threads: 1, max_memory_bytes: 4096, ..request() });
    assert_eq!((report.triangles, report.chunks_kept), (1200, 0));
    assert!(report.chunks > 20, "{} chunks", report.chunks);
    assert!(bytes_of(&folders[0]) == bytes_of(&folders[1]));
    assert!(!folders[1].0.join("spill").exists());
    let again = run(&folders[0], &request());
    assert_eq!(again.chunks_kept, again.chunks);
    assert!(bytes_of(&folders[0]) == bytes_of(&folders[1]));
}

#[test]
fn a_local_edit_rewrites_one_chunk() {
    let folder = new_folder();
    write_faces(&folder.0, &tent_grid());
    run(&folder, &request());
    let before = bytes_of(&folder);
    let mut edited = tent_grid();
    edited.extend(tent(5500.0, 5500.0, 400));
    write_faces(&folder.0, &edited);
    let report = run(&folder, &request());
    assert_eq!(report.chunks - report.chunks_kept, 1);
    let after = bytes_of(&folder);
    let changed: Vec<_> = after.iter().filter(|(name, bytes)| name.contains("m3c") && before.get(*name) != Some(bytes)).collect();
    assert_eq!((changed.len(), after.len()), (1, before.len()));
}

#[test]
fn a_ground_plane_lies_under_scenes_without_terrain() {
    let folder = new_folder();
    write_faces(&folder.0, &tent(0.0, 0.0, 0));
    let mut auto = request();
    auto.options.ground_plane = GroundPlane::Auto;
    let refused = build_scene(&folder.0, &auto, &mut |_, _, _| true);
    assert!(matches!(refused, Err(Error::Argument(what)) if what.contains("ground_id")));
    auto.ground_id = 77;
    assert_eq!(run(&folder, &auto).ground_plane_triangles, 2);
    let store = SceneStore::open(&folder.0, 1 << 20).expect("open");
    // A quarter of the longest side, the height, on each side.
    assert_eq!((store.bounds().lo, store.bounds().hi), ([-1.75, -1.75, 0.0], [7.75, 6.75, 7.0]));
    assert!(store.chunk(0).expect("chunk").objects().iter().any(|o| o.id == 77 && o.rank == 0));
    let mut faces = tent(0.0, 0.0, 0);
    faces.push((world([[0.0; 3], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]]), 1, 0, Rank::Terrain));
    write_faces(&folder.0, &faces);
    assert_eq!(run(&folder, &auto).ground_plane_triangles, 0);
}

#[test]
fn prototypes_are_stored_once_and_placed() {
    let folder = new_folder();
    let tree: Vec<Face> =
        [[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 3.0]], [[0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 3.0]]].map(|t| (t, 0, 0, Rank::Other)).to_vec();
    let at = |object: u32, x: f64| Instance {
        prototype: 1,
        object,
        transform: [2.0, 0.0, 0.0, 500_000.0 + x, 0.0, 2.0, 0.0, 5_000_000.0, 0.0, 0.0, 2.0, 1.0],
    };
    let instances = vec![at(2, 300.0), at(1, 100.0), Instance { prototype: 9, ..at(1, 0.0) }];
    write_asset(&folder.0, "town", &[batch(&tree, 1)], Materials { materials: vec![Material::default()], instances });
    let report = run(&folder, &request());
    assert_eq!((report.prototypes, report.instances, report.instances_of_nothing), (1, 2, 1));
    let store = SceneStore::open(&folder.0, 1 << 20).expect("open");
    let ids: Vec<u32> = store.instances().iter().map(|i| i.object_id).collect();
    assert_eq!(ids, [20, 30]);
    assert_eq!(store.parts().len(), 2);
    let b = store.bounds();
    assert!((b.lo[0] - 100.0).abs() < 1e-6 && (b.hi[0] - 302.0).abs() < 1e-6 && (b.hi[2] - 7.0).abs() < 1e-6, "{b:?}");
}

#[test]
fn a_stopped_build_is_an_error_and_the_next_one_finishes() {
    let folder = new_folder();
    write_faces(&folder.0, &tent_grid());
    let stopped = build_scene(&folder.0, &request(), &mut |stage, done, _| stage != "chunks" || done < 8);
    assert!(matches!(stopped, Err(Error::Interrupted)));
    assert!(!folder.0.join("scene.json").exists() && !folder.0.join("spill").exists());
    assert!(run(&folder, &request()).chunks_kept >= 8);
}

#[test]
fn a_damaged_chunk_is_refused() {
    let folder = new_folder();
    write_faces(&folder.0, &tent(0.0, 0.0, 0));
    run(&folder, &request());
    let path = std::fs::read_dir(folder.0.join("chunks")).expect("list").next().expect("a chunk").expect("entry").path();
    let good = std::fs::read(&path).expect("read");
    for cut in [0, 40, 127, 128, good.len() - 64] {
        std::fs::write(&path, &good[..cut]).expect("write");
        assert!(Chunk::open(&path, false).is_err(), "cut at {cut}");
    }
    // Node child, triangle number in a leaf, a NaN corner, material, a box too small.
    let leaf = 128 + 256;
    for (at, value) in
        [(128 + 192, 5u32), (leaf + 288, 9), (leaf, f32::NAN.to_bits()), (leaf + 320 + 24, 70), (128 + 96, 0), (40, f32::NAN.to_bits())]
    {
        let mut bad = good.clone();
        bad[at..at + 4].copy_from_slice(&value.to_le_bytes());
        std::fs::write(&path, &bad).expect("write");
        assert!(Chunk::open(&path, false).is_err(), "changed at {at}");
        assert!(Chunk::open(&path, true).is_err(), "the checksum is wrong too");
    }
    std::fs::write(&path, &good).expect("write");
    assert!(Chunk::open(&path, true).is_ok());
}

#[test]
fn a_lazy_chunk_rejects_invalid_references() {
    let folder = new_folder();
    write_faces(&folder.0, &tent(0.0, 0.0, 0));
    run(&folder, &request());
    let path = std::fs::read_dir(folder.0.join("chunks")).expect("list").next().expect("a chunk").expect("entry").path();
    let good = std::fs::read(&path).expect("read");
    let open_lazily = || SceneStore::open(&folder.0, 1 << 20).expect("open").open_lazily(0);
    let sound = open_lazily().expect("a chunk");
    assert_eq!((sound.objects().len(), sound.objects()[0].id), (1, 10));
    assert!(sound.node(0).is_ok() && sound.leaf(0).is_ok() && sound.node(1).is_err() && sound.leaf(9).is_err());
    // A root that is its own child; a truncated file; a file of another build; an object without an id.
    let with = |at: usize, value: u32| [&good[..at], &value.to_le_bytes(), &good[at + 4..]].concat();
    std::fs::write(&path, with(128 + 192, 0)).expect("write");
    assert!(open_lazily().expect("opens").node(0).is_err());
    for bad in [good[..good.len() - 64].to_vec(), with(8, 7), with(good.len() - 64, 0)] {
        std::fs::write(&path, bad).expect("write");
        assert!(matches!(open_lazily(), Err(Error::Format { .. } | Error::Rebuilt { .. })));
    }
}

#[test]
fn broken_requests_and_assets_are_typed_errors() {
    let folder = new_folder();
    write_faces(&folder.0, &tent(0.0, 0.0, 0));
    for name in ["../town", "", ".", "a/b"] {
        let request = BuildRequest { assets: vec![name.into()], ..request() };
        assert!(matches!(build_scene(&folder.0, &request, &mut |_, _, _| true), Err(Error::Argument(_))), "{name:?}");
    }
    assert!(BuildRequest::from_json("{\"assets\": [], \"origin\": [0, 0, 0], \"colour\": 1}").is_err());
    let ids = folder.0.join("assets/town/ids.u32");
    for bytes in [&[0u8, 0, 0, 0][..], &[1, 0, 0][..], &[][..]] {
        std::fs::write(&ids, bytes).expect("write");
        assert!(matches!(build_scene(&folder.0, &request(), &mut |_, _, _| true), Err(Error::Format { .. })), "{bytes:?}");
    }
}

#[test]
fn a_small_capacity_serves_all_chunks() {
    let folder = new_folder();
    write_faces(&folder.0, &tent_grid());
    run(&folder, &request());
    let store = SceneStore::open(&folder.0, 4096).expect("open");
    for _ in 0..2 {
        for part in store.parts() {
            store.chunk(part.chunk).expect("chunk");
        }
    }
    let stats = store.stats();
    assert!(stats.chunks_mapped <= 3 && stats.chunk_misses as usize == 2 * store.parts().len(), "{stats:?}");
}

/// Two places 3,000 km apart make counting cells of 4 km, one of which has more triangles than are sorted in memory.
#[test]
fn a_dense_cell_is_divided_in_files_and_its_chunks_are_found_again() {
    let folder = new_folder();
    let mut faces: Vec<Face> = (0..200_000).flat_map(|k| tent(f64::from(k % 500) * 7.0, f64::from(k / 500) * 7.0, k % 100)).collect();
    faces.extend(tent(3e6, 0.0, 100));
    write_faces(&folder.0, &faces);
    let mut request = BuildRequest { max_memory_bytes: 64 << 20, ..request() };
    assert_eq!(run(&folder, &request).outlier_triangles, 3);
    request.options.keep_outliers = true;
    let report = run(&folder, &request);
    assert_eq!((report.triangles, report.outlier_triangles), (600_003, 0));
    let store = SceneStore::open(&folder.0, 1 << 20).expect("open");
    assert!(store.index().chunks.iter().all(|c| c.triangles <= 262_144), "every cell is small");
    let before = bytes_of(&folder);
    let again = run(&folder, &request);
    assert_eq!((again.chunks_kept, again.triangles), (again.chunks, 600_003));
    assert!(bytes_of(&folder) == before);
    assert!(!folder.0.join("spill").exists());
}

#[test]
fn an_unknown_cluster_is_refused() {
    let folder = new_folder();
    write_faces(&folder.0, &tent(0.0, 0.0, 0));
    let mut request = request();
    request.options.cluster = 2;
    let refused = build_scene(&folder.0, &request, &mut |_, _, _| true).expect_err("one cluster");
    assert!(refused.to_string().contains("cluster 2: the scene has 1 clusters"), "{refused}");
}

#[test]
fn adjusted_objects_are_moved_and_left_out_as_if_imported_so() {
    let (folder, other) = (new_folder(), new_folder());
    let faces: Vec<Face> = (0..4).flat_map(|k| tent(f64::from(k) * 30.0, 0.0, k)).collect();
    write_faces(&folder.0, &faces);
    run(&folder, &request());
    let before = bytes_of(&folder);
    let asset = folder.0.join("assets/town");
    let shifts = vec![0.0, 12.5, f64::NAN, -3.0];
    Adjustments { scale: 1.0, shifts: shifts.clone() }.write(&asset).expect("write");
    let report = run(&folder, &request());
    assert_eq!((report.triangles, report.adjusted_away), (9, 3));
    let moved = faces.iter().map(|(t, object, m, r)| (t.map(|p| [p[0], p[1], p[2] + shifts[*object as usize]]), *object, *m, *r));
    write_faces(&other.0, &moved.filter(|(t, ..)| !t[0][2].is_nan()).collect::<Vec<_>>());
    run(&other, &request());
    let chunks = |f: &_| bytes_of(f).into_iter().filter(|(name, _)| name.ends_with("m3c")).collect::<Vec<_>>();
    assert!(chunks(&folder) == chunks(&other));
    std::fs::remove_file(asset.join(map3d_base::asset::ADJUSTMENTS_FILE)).expect("remove");
    run(&folder, &request());
    assert!(bytes_of(&folder) == before, "without adjustments, everything is as before");
    Adjustments { scale: 1.0, shifts: vec![0.0] }.write(&asset).expect("write");
    assert!(build_scene(&folder.0, &request(), &mut |_, _, _| true).is_err(), "they must be those of all objects");
}

#[test]
fn instances_of_adjusted_objects_are_moved_and_left_out() {
    let folder = new_folder();
    let tree: Vec<Face> = vec![([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 3.0]], 0, 0, Rank::Other)];
    let at = |object: u32| Instance {
        prototype: 1,
        object,
        transform: [1.0, 0.0, 0.0, 500_000.0 + f64::from(object), 0.0, 1.0, 0.0, 5_000_000.0, 0.0, 0.0, 1.0, 40.0],
    };
    let materials = Materials { materials: vec![Material::default()], instances: vec![at(0), at(1)] };
    write_asset(&folder.0, "town", &[batch(&tree, 1)], materials);
    Adjustments { scale: 0.5, shifts: vec![100.0, f64::NAN] }.write(&folder.0.join("assets/town")).expect("write");
    let report = run(&folder, &request());
    assert_eq!((report.instances, report.adjusted_away), (1, 1));
    let store = SceneStore::open(&folder.0, 1 << 20).expect("open");
    assert!((store.bounds().lo[2] - 120.0).abs() < 1e-6 && (store.bounds().hi[2] - 121.5).abs() < 1e-6, "{:?}", store.bounds());
}

#[test]
fn a_house_far_below_the_others_does_not_lower_the_ground_plane() {
    let folder = new_folder();
    let square = |k: u32, z: f64| {
        let p = |x: f64, y: f64| [f64::from(k) * 30.0 + x, y, z];
        [[p(0.0, 0.0), p(8.0, 0.0), p(8.0, 8.0)], [p(0.0, 0.0), p(8.0, 8.0), p(0.0, 8.0)]].map(|t| (world(t), k, 0, Rank::Ground))
    };
    let mut faces: Vec<Face> = (0..30).flat_map(|k| square(k, f64::from(k % 5))).collect();
    let mut wanted = request();
    (wanted.options.ground_plane, wanted.ground_id) = (GroundPlane::On, 999);
    let height = |folder: &_, faces: &[Face]| {
        let folder: &crate::fixture::Folder = folder;
        write_faces(&folder.0, faces);
        run(folder, &wanted);
        let store = SceneStore::open(&folder.0, 1 << 20).expect("open");
        let heights = (0..store.parts().len() as u32).flat_map(|k| {
            let chunk = store.chunk(k).expect("chunk");
            chunk.objects().iter().filter(|o| o.id == 999).map(|o| chunk.origin()[2] + f64::from(o.bounds[2])).collect::<Vec<f64>>()
        });
        heights.fold(f64::INFINITY, f64::min)
    };
    assert_eq!(height(&folder, &faces), 0.0);
    faces.extend(square(30, -520.0));
    assert_eq!(height(&folder, &faces), 0.0);
}
