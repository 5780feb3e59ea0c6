//! Usage masks, filling, mips, texture files, the build and the cache.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::common::{Random, folder, noise, png};
use map3d_base::asset::{AssetMesh, AssetReport, AssetWriter, Batch, Material, Materials, Rank, Wrap};
use map3d_image::{ImageLimits, PixelMask, Raster, fill_unmarked};
use map3d_texture::{
    Level, LinearRaster, TextureAsset, TextureCache, TextureFile, TextureKeys, build_textures, encode_texture, first_mip, hex, level_count,
    mark_triangle, next_mip, premultiplied, prune_textures, texture_key, texture_path, write_texture,
};

// -- usage masks

fn used(mask: &PixelMask) -> Vec<(u32, u32)> {
    (0..mask.height()).flat_map(|y| (0..mask.width()).map(move |x| (x, y))).filter(|(x, y)| mask.contains(*x, *y)).collect()
}

#[test]
fn v_points_up() {
    let mut mask = PixelMask::empty(4, 4);
    mark_triangle(&mut mask, [[0.05, 0.05], [0.2, 0.05], [0.05, 0.2]], Wrap::Wrap);
    assert_eq!(used(&mask), [(0, 3)]);
}

#[test]
fn triangles_on_texel_borders_touch_no_neighbour() {
    let mut mask = PixelMask::empty(8, 8);
    mark_triangle(&mut mask, [[0.25, 0.25], [0.5, 0.25], [0.5, 0.5]], Wrap::Wrap);
    mark_triangle(&mut mask, [[0.25, 0.25], [0.5, 0.5], [0.25, 0.5]], Wrap::Wrap);
    assert_eq!(used(&mask), [(2, 4), (3, 4), (2, 5), (3, 5)]);
}

#[test]
fn a_point_or_sliver_uses_the_texels_it_lies_in() {
    let mut mask = PixelMask::empty(8, 8);
    mark_triangle(&mut mask, [[0.3, 0.3]; 3], Wrap::Wrap);
    assert_eq!(used(&mask), [(2, 5)]);
    mark_triangle(&mut mask, [[0.01, 0.99], [0.99, 0.99], [0.5, 0.99]], Wrap::Wrap);
    assert_eq!(mask.marked(), 9);
}

/// Every texel that contains a random point of a triangle is used; no texel clearly outside the triangle is.
#[test]
fn masks_equal_brute_force() {
    let mut random = Random(4);
    for wrap in [Wrap::Wrap, Wrap::Mirror, Wrap::Clamp, Wrap::None] {
        for _ in 0..60 {
            let uv = [(); 3].map(|()| [(random.unit() * 3.0 - 1.0) as f32, (random.unit() * 3.0 - 1.0) as f32]);
            let mut mask = PixelMask::empty(13, 9);
            mark_triangle(&mut mask, uv, wrap);
            assert_eq!(mask.marked() as usize, used(&mask).len());
            let mut seen = std::collections::BTreeSet::new();
            for _ in 0..4000 {
                let (mut a, mut b) = (random.unit(), random.unit());
                if a + b > 1.0 {
                    (a, b) = (1.0 - a, 1.0 - b);
                }
                let at = |k: usize| f64::from(uv[0][k]) * (1.0 - a - b) + f64::from(uv[1][k]) * a + f64::from(uv[2][k]) * b;
                seen.extend(texel(at(0), at(1), 13, 9, wrap));
            }
            let missed: Vec<_> = seen.iter().filter(|(x, y)| !mask.contains(*x, *y)).collect();
            // Samples within 1/512 texel of a border may fall on a neighbour that is only grazed.
            assert!(missed.len() <= 1, "{wrap:?} {uv:?}: {missed:?}");
            assert!(mask.marked() as usize <= seen.len() + 8, "{wrap:?} {uv:?}: {} used, {} seen", mask.marked(), seen.len());
        }
    }
}

fn texel(u: f64, v: f64, w: i64, h: i64, wrap: Wrap) -> Option<(u32, u32)> {
    let fold = |t: f64, n: i64| {
        let i = (t * n as f64).floor() as i64;
        match wrap {
            Wrap::Wrap => Some(i.rem_euclid(n)),
            Wrap::Mirror => Some(if i.rem_euclid(2 * n) < n { i.rem_euclid(n) } else { n - 1 - i.rem_euclid(n) }),
            Wrap::Clamp => Some(i.clamp(0, n - 1)),
            _ => (0..n).contains(&i).then_some(i),
        }
    };
    Some((fold(u, w)? as u32, fold(1.0 - v, h)? as u32))
}

#[test]
fn repeated_and_absurd_coordinates_end_quickly() {
    let mut mask = PixelMask::empty(64, 64);
    mark_triangle(&mut mask, [[0.0, 0.1], [5_000.0, 0.1], [5_000.0, 0.2]], Wrap::Wrap);
    assert!(mask.marked() > 0 && mask.marked() < 64 * 64, "a trim sheet uses its band only");
    let mut all = PixelMask::empty(64, 64);
    mark_triangle(&mut all, [[0.0, 0.0], [1e9, 3e9], [1e9, 1e9]], Wrap::Wrap);
    assert!(all.is_full());
    let mut none = PixelMask::empty(64, 64);
    mark_triangle(&mut none, [[f32::NAN, 0.0], [1.0, 0.0], [0.0, 1.0]], Wrap::Wrap);
    mark_triangle(&mut none, [[5.0, 5.0], [1e30, 5.0], [5.0, 6.0]], Wrap::None);
    assert!(none.marked() == 0 || none.is_full());
}

#[test]
fn runs_round_trip() {
    let mut random = Random(8);
    for (w, h) in [(1, 1), (7, 3), (64, 2), (65, 33), (200, 100)] {
        let mut mask = PixelMask::empty(w, h);
        assert_eq!(PixelMask::from_runs(w, h, &mask.to_runs()), Some(mask.clone()));
        for _ in 0..w * h / 3 {
            mask.mark(random.below(w), random.below(h));
        }
        let runs = mask.to_runs();
        assert_eq!(PixelMask::from_runs(w, h, &runs), Some(mask));
        assert_eq!(PixelMask::from_runs(w + 1, h, &runs), None);
        assert_eq!(PixelMask::from_runs(w, h, &runs[..runs.len() - 1]), None);
    }
    assert_eq!(PixelMask::from_runs(2, 2, &[0xFF; 12]), None);
}

// -- filling

#[test]
fn unused_texels_take_the_nearest_used_one() {
    let mut random = Random(21);
    for density in [1, 5, 60] {
        let (w, h) = (37, 29);
        let image = noise(w, h, u64::from(density));
        let mut mask = PixelMask::empty(w, h);
        for _ in 0..w * h * density / 100 + 1 {
            mask.mark(random.below(w), random.below(h));
        }
        let mut filled = image.clone();
        fill_unmarked(&mut filled, &mask, u32::MAX);
        for y in 0..h {
            for x in 0..w {
                let distance = |(i, j): (u32, u32)| i64::from(i.abs_diff(x)).pow(2) + i64::from(j.abs_diff(y)).pow(2);
                let best = used(&mask).into_iter().map(distance).min().expect("not empty");
                let got = filled.row(y)[x as usize];
                let right = used(&mask).into_iter().filter(|p| distance(*p) == best).any(|(i, j)| image.row(j)[i as usize] == got);
                assert!(right, "({x}, {y}) at density {density}");
            }
        }
    }
}

#[test]
fn a_limited_fill_is_the_whole_one_within_its_reach() {
    let mut random = Random(5);
    let (w, h) = (61, 47);
    for (reach, marks) in [(1, 3), (4, 1), (9, 5), (200, 2)] {
        let image = noise(w, h, u64::from(reach));
        let mut mask = PixelMask::empty(w, h);
        (0..marks).for_each(|_| mask.mark(random.below(w), random.below(h)));
        let (mut whole, mut limited) = (image.clone(), image);
        fill_unmarked(&mut whole, &mask, u32::MAX);
        fill_unmarked(&mut limited, &mask, reach);
        let near = |x: u32, y: u32| used(&mask).iter().any(|(i, j)| i.abs_diff(x).pow(2) + j.abs_diff(y).pow(2) <= reach * reach);
        let differ = (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).filter(|(x, y)| whole.row(*y)[*x as usize] != limited.row(*y)[*x as usize]);
        assert!(differ.clone().all(|(x, y)| !near(x, y)), "reach {reach}");
        assert_eq!(differ.count() == 0, reach == 200, "reach {reach}: what is beyond is left");
    }
}

// -- mips

/// Computes the exact mean of a rectangle of texels in linear light, weighted by alpha.
fn brute(image: &Raster, x: (f64, f64), y: (f64, f64)) -> [f64; 4] {
    let mut sum = [0.0; 4];
    let mut area = 0.0;
    for j in y.0.floor() as u32..(y.1.ceil() as u32).min(image.height) {
        for i in x.0.floor() as u32..(x.1.ceil() as u32).min(image.width) {
            let overlap = |a: (f64, f64), k: u32| (a.1.min(f64::from(k) + 1.0) - a.0.max(f64::from(k))).max(0.0);
            let weight = overlap(x, i) * overlap(y, j);
            let p = premultiplied(image.row(j)[i as usize]);
            (0..4).for_each(|c| sum[c] += weight * f64::from(p[c]));
            area += weight;
        }
    }
    sum.map(|c| c / area)
}

#[test]
fn mips_are_area_weighted_means_of_any_size() {
    for (w, h) in [(8, 8), (5, 3), (1, 7), (13, 1), (2, 9), (31, 17)] {
        let mut image = noise(w, h, u64::from(w));
        image.pixels.iter_mut().enumerate().for_each(|(i, p)| p[3] = if i % 3 == 0 { 40 } else { 255 });
        let mip = first_mip(&image);
        assert_eq!((mip.width, mip.height), ((w / 2).max(1), (h / 2).max(1)));
        for y in 0..mip.height {
            for x in 0..mip.width {
                let cell = |k: u32, n: u32, m: u32| (f64::from(k) * f64::from(n) / f64::from(m), f64::from(k + 1) * f64::from(n) / f64::from(m));
                let exact = brute(&image, cell(x, w, mip.width), cell(y, h, mip.height));
                let got = mip.pixels[(y * mip.width + x) as usize];
                assert!((0..4).all(|c| (f64::from(got[c]) - exact[c]).abs() <= 1.0), "{w} × {h} at ({x}, {y}): {got:?} {exact:?}");
            }
        }
    }
}

#[test]
fn pyramids_end_at_one_texel() {
    for (w, h) in [(1, 1), (1, 9), (300, 7), (1024, 1024)] {
        let mut mip = first_mip(&Raster::filled(w, h, [10, 200, 30, 255]));
        for _ in 2..level_count(w, h) {
            mip = next_mip(&mip);
        }
        assert!(level_count(w, h) == 1 || (mip.width, mip.height) == (1, 1));
        assert_eq!(mip.to_raster().pixels[0], [10, 200, 30, 255]);
    }
}

#[test]
fn transparent_texels_add_no_colour() {
    let image = Raster::new(2, 2, vec![[255, 0, 255, 0], [0, 128, 0, 255], [255, 0, 255, 0], [0, 128, 0, 255]]);
    let LinearRaster { pixels, .. } = first_mip(&image);
    assert_eq!(first_mip(&image).to_raster().pixels[0], [0, 128, 0, 128]);
    assert_eq!(pixels[0][0], 0);
}

// -- files

fn stored(dir: &Path, image: &[u8], alpha: &[u8], mask: &PixelMask) -> TextureFile {
    let path = texture_path(dir, &texture_key(image, alpha, &mask.to_runs()));
    write_texture(&path, &encode_texture(&path, image, alpha, mask, &ImageLimits::default()).expect("sound")).expect("written");
    TextureFile::open(&path).expect("opens")
}

fn full(w: u32, h: u32) -> PixelMask {
    let mut mask = PixelMask::empty(w, h);
    mark_triangle(&mut mask, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], Wrap::Wrap);
    mark_triangle(&mut mask, [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]], Wrap::Wrap);
    assert!(mask.is_full(), "two triangles tile the image");
    mask
}

#[test]
fn a_texture_file_yields_all_its_levels() {
    let dir = folder("file");
    let image = noise(50, 30, 2);
    let file = stored(&dir, &png(&image), &[], &full(50, 30));
    assert_eq!((file.width, file.height, file.levels, file.has_alpha), (50, 30, 6, false));
    assert_eq!(file.level(0).expect("level 0"), image);
    let mut mip = first_mip(&image);
    for level in 1..6 {
        let got = file.level(level).expect("a level");
        assert_eq!(got, mip.to_raster(), "level {level}");
        let (ready, exact) = (file.stored_level(level).expect("a level"), Level::from_raster(got));
        let differs = (0..mip.height).flat_map(|y| (0..mip.width).map(move |x| (x, y))).map(|(x, y)| (ready.texel(x, y), exact.texel(x, y)));
        // Level 1 has never been sRGB bytes.
        assert!(differs.flat_map(|(a, b)| (0..4).map(move |c| a[c].abs_diff(b[c]))).all(|d| d <= if level == 1 { 3 } else { 0 }), "level {level}");
        mip = next_mip(&mip);
    }
    assert!(file.level(6).is_err());
    std::fs::remove_dir_all(dir).expect("clean up");
}

#[test]
fn damaged_texture_files_are_refused() {
    let dir = folder("damaged");
    let image = png(&noise(20, 20, 2));
    let mut mask = PixelMask::empty(20, 20);
    mask.mark(3, 3);
    stored(&dir, &image, &[], &mask);
    let path = texture_path(&dir, &texture_key(&image, &[], &mask.to_runs()));
    let good = std::fs::read(&path).expect("read");
    for cut in [0, 10, 64, 100, 319, 320, good.len() - 1] {
        std::fs::write(&path, &good[..cut]).expect("write");
        assert!(TextureFile::open(&path).is_err(), "cut at {cut}");
        let _ = TextureFile::open_header(&path);
    }
    for at in (0..good.len()).step_by(13).filter(|at| !(32..64).contains(at)) {
        let mut bad = good.clone();
        bad[at] ^= 4;
        std::fs::write(&path, &bad).expect("write");
        if let Ok(file) = TextureFile::open(&path) {
            assert!((28..32).contains(&at), "flipped at {at}");
            let _ = file.level(0);
        }
        if let Ok(file) = TextureFile::open_header(&path) {
            (0..5).for_each(|l| drop(file.level(l)));
        }
    }
    std::fs::remove_dir_all(dir).expect("clean up");
}

#[test]
fn a_grey_image_becomes_alpha() {
    let dir = folder("alpha");
    let image = Raster::filled(4, 4, [200, 100, 50, 255]);
    let grey = Raster::new(2, 2, vec![[255, 255, 255, 255], [0, 0, 0, 255], [128, 128, 128, 255], [255, 255, 255, 255]]);
    let file = stored(&dir, &png(&image), &png(&grey), &full(4, 4));
    let level = file.level(0).expect("level 0");
    assert!(file.has_alpha);
    assert_eq!([level.row(0)[0], level.row(0)[3], level.row(3)[0], level.row(3)[3]].map(|p| p[3]), [255, 0, 128, 255]);
    let alone = stored(&dir, &[], &png(&grey), &full(2, 2));
    assert_eq!(alone.level(0).expect("level 0").pixels[2], [255, 255, 255, 128]);
    std::fs::remove_dir_all(dir).expect("clean up");
}

/// An atlas with islands of colour on magenta: no level shows magenta anywhere.
#[test]
fn an_atlas_bleeds_no_background_into_any_level() {
    let dir = folder("atlas");
    let islands = [(3u32, 5u32, 30u32, 40u32, [200u8, 60, 40]), (50, 10, 90, 33, [30, 140, 60]), (20, 60, 60, 110, [240, 240, 200])];
    let mut image = Raster::filled(120, 120, [255, 0, 255, 255]);
    let mut mask = PixelMask::empty(120, 120);
    for (x0, y0, x1, y1, c) in islands {
        for y in y0..y1 {
            (x0..x1).for_each(|x| image.pixels[(y * 120 + x) as usize] = [c[0], c[1], c[2], 255]);
        }
        let [u0, u1] = [x0, x1].map(|x| x as f32 / 120.0);
        let [v0, v1] = [y0, y1].map(|y| 1.0 - y as f32 / 120.0);
        mark_triangle(&mut mask, [[u0, v0], [u1, v0], [u1, v1]], Wrap::Wrap);
        mark_triangle(&mut mask, [[u0, v0], [u1, v1], [u0, v1]], Wrap::Wrap);
    }
    let file = stored(&dir, &png(&image), &[], &mask);
    for level in 0..file.levels {
        for p in file.level(level).expect("a level").pixels {
            assert!(p[1] >= 60.min(p[0]), "level {level}: {p:?} is a mixture with magenta");
        }
    }
    std::fs::remove_dir_all(dir).expect("clean up");
}

// -- build

struct Town {
    folder: std::path::PathBuf,
    materials: Vec<Material>,
}

/// An asset with one quad per material, each over `part` of its image.
fn asset(dir: &Path, images: &[(Option<&[u8]>, f32)]) -> Town {
    let mut writer = AssetWriter::create(dir).expect("writer");
    let mut materials = Vec::new();
    for (image, part) in images {
        let texture = image.map(|bytes| writer.add_texture(bytes, "png").expect("stored"));
        materials.push(Material { texture, ..Material::default() });
        let mut b = Batch { positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], triangles: vec![[0, 1, 2]], ..Batch::default() };
        b.uvs = vec![[[0.0, 0.0], [*part, 0.0], [0.0, *part]]];
        (b.materials, b.objects, b.ranks) = (vec![materials.len() as u32 - 1], vec![0], vec![Rank::Other]);
        writer.append(&b).expect("append");
    }
    let tables = Materials { materials: materials.clone(), instances: vec![] };
    writer.finish(&tables, &[], AssetReport::default()).expect("finish");
    Town { folder: dir.to_path_buf(), materials }
}

fn build(towns: &[&Town], out: &Path, threads: usize) -> TextureKeys {
    let meshes: Vec<AssetMesh> = towns.iter().map(|t| AssetMesh::open(&t.folder.join("mesh.m3a")).expect("mesh")).collect();
    let assets: Vec<TextureAsset> =
        towns.iter().zip(&meshes).map(|(t, mesh)| TextureAsset { folder: &t.folder, mesh, materials: &t.materials }).collect();
    build_textures(&assets, out, threads, &|_, _, _| true).expect("built")
}

#[test]
fn masks_join_over_assets_and_unchanged_files_are_kept() {
    let dir = folder("build");
    let image = png(&noise(32, 32, 9));
    let (a, b) = (asset(&dir.join("a"), &[(Some(&image), 0.25), (None, 1.0)]), asset(&dir.join("b"), &[(Some(&image), 1.0)]));
    let out = dir.join("textures");
    let keys = build(&[&a, &b], &out, 1);
    assert_eq!((keys.by_source.len(), keys.written, keys.kept), (1, 1, 0));
    assert!(keys.get(&a.materials[0]).is_some() && keys.get(&a.materials[1]).is_none());
    let again = build(&[&b, &a], &out, 2);
    assert_eq!((again.written, again.kept, &again.by_source), (0, 1, &keys.by_source), "the order of assets does not matter");
    let alone = build(&[&a], &out, 2);
    assert_ne!(alone.by_source, keys.by_source, "another mask, another key");
    assert_eq!(prune_textures(&out, &keys).expect("pruned"), 1);
    let key = keys.get(&a.materials[0]).expect("built").key;
    assert!(TextureFile::open(&texture_path(&out, &key)).is_ok(), "{}", hex(&key));
    std::fs::remove_dir_all(dir).expect("clean up");
}

#[test]
fn a_file_of_another_version_is_written_anew() {
    let dir = folder("version");
    let town = asset(&dir.join("a"), &[(Some(&png(&noise(32, 32, 9))), 0.25)]);
    let out = dir.join("textures");
    let keys = build(&[&town], &out, 1);
    let path = texture_path(&out, &keys.get(&town.materials[0]).expect("built").key);
    let good = std::fs::read(&path).expect("read");
    let mut older = good.clone();
    older[4] -= 1;
    std::fs::write(&path, older).expect("write");
    assert!(TextureFile::open_header(&path).is_err());
    assert_eq!(build(&[&town], &out, 1).written, 1);
    assert_eq!(std::fs::read(&path).expect("read"), good);
    std::fs::remove_dir_all(dir).expect("clean up");
}

#[test]
fn threads_make_no_difference() {
    let dir = folder("threads");
    let images: Vec<Vec<u8>> = (0..12).map(|k| png(&noise(17 + k, 40, u64::from(k)))).collect();
    let town = asset(&dir.join("a"), &images.iter().map(|i| (Some(&i[..]), 0.6)).collect::<Vec<_>>());
    let keys: Vec<TextureKeys> = [1, 4].map(|n| build(&[&town], &dir.join(format!("out{n}")), n)).to_vec();
    assert_eq!(keys[0], keys[1]);
    for info in keys[0].by_source.values() {
        let bytes = |n: usize| std::fs::read(texture_path(&dir.join(format!("out{n}")), &info.key)).expect("a file");
        assert_eq!(bytes(1), bytes(4));
    }
    std::fs::remove_dir_all(dir).expect("clean up");
}

#[test]
fn missing_and_damaged_images_are_counted_and_absent() {
    let dir = folder("missing");
    let mut town = asset(&dir.join("a"), &[(Some(b"not an image at all"), 1.0), (Some(&png(&noise(8, 8, 1))), 1.0), (Some(b"x"), 1.0)]);
    let gone = town.materials[2].texture.clone().expect("a key");
    std::fs::remove_file(dir.join("a/textures").join(format!("{gone}.png"))).expect("removed");
    let keys = build(&[&town], &dir.join("out"), 2);
    assert_eq!((keys.by_source.len(), keys.missing.values().map(|m| m.count).sum::<u64>()), (1, 2), "{:?}", keys.missing);
    town.materials[0].texture = Some("../../etc/passwd".into());
    let mesh = AssetMesh::open(&town.folder.join("mesh.m3a")).expect("mesh");
    let assets = [TextureAsset { folder: &town.folder, mesh: &mesh, materials: &town.materials }];
    let keys = build_textures(&assets, &dir.join("out"), 1, &|_, _, _| true).expect("built");
    assert_eq!(keys.missing.values().map(|m| m.count).sum::<u64>(), 2, "a name that leaves the folder names no image");
    std::fs::remove_dir_all(dir).expect("clean up");
}

#[test]
fn progress_counts_and_stops() {
    let dir = folder("progress");
    let images: Vec<Vec<u8>> = (0..5).map(|k| png(&noise(8, 8, k))).collect();
    let town = asset(&dir.join("a"), &images.iter().map(|i| (Some(&i[..]), 1.0)).collect::<Vec<_>>());
    let mesh = AssetMesh::open(&town.folder.join("mesh.m3a")).expect("mesh");
    let assets = [TextureAsset { folder: &town.folder, mesh: &mesh, materials: &town.materials }];
    let last = AtomicU64::new(0);
    build_textures(&assets, &dir.join("out"), 1, &|_, done, total| last.fetch_max(done, Ordering::Relaxed) < 5 && total == 5).expect("built");
    assert_eq!(last.load(Ordering::Relaxed), 5);
    let stopped = build_textures(&assets, &dir.join("out2"), 1, &|_, done, _| done < 2);
    assert!(matches!(stopped, Err(map3d_base::Error::Interrupted)));
    std::fs::remove_dir_all(dir).expect("clean up");
}

// -- cache

#[test]
fn the_cache_stays_under_its_cap_and_counts() {
    let dir = folder("cache");
    let keys: Vec<_> = (0..6)
        .map(|k| {
            let image = png(&noise(64, 64, k));
            let key = texture_key(&image, &[], &full(64, 64).to_runs());
            stored(&dir, &image, &[], &full(64, 64));
            key
        })
        .collect();
    // A row of a strip has a texel more than it shows.
    let level_bytes = 33 * 32 * 4;
    let cache = TextureCache::new(dir.clone(), 3 * level_bytes);
    let mut held = BTreeMap::new();
    for key in &keys {
        let texture = cache.texture(key).expect("opens");
        held.insert(*key, cache.level(&texture, 1).expect("a level"));
        assert!(cache.stats().bytes <= 3 * level_bytes);
    }
    let texture = cache.texture(&keys[5]).expect("opens");
    assert_eq!(cache.level(&texture, 1).expect("a level"), held[&keys[5]]);
    let stats = cache.stats();
    assert_eq!((stats.misses, stats.hits, stats.decoded), (6, 1, 0));
    assert!(stats.evicted >= 3);
    assert!(cache.texture(&[7; 16]).is_err());
    std::fs::remove_dir_all(dir).expect("clean up");
}

#[test]
fn only_level_0_is_decoded_and_again_once_a_full_cache_has_dropped_it() {
    let dir = folder("cache-first");
    let image = png(&noise(64, 37, 5));
    let key = texture_key(&image, &[], &full(64, 37).to_runs());
    stored(&dir, &image, &[], &full(64, 37));
    for (capacity, decoded) in [(1 << 20, 1), (0, 2)] {
        let cache = TextureCache::new(dir.clone(), capacity);
        let texture = cache.texture(&key).expect("opens");
        let first = cache.level(&texture, 0).expect("a level");
        (1..texture.file.levels).for_each(|level| drop(cache.level(&texture, level).expect("a level")));
        assert_eq!(cache.level(&texture, 0).expect("a level"), first);
        assert_eq!(cache.stats().decoded, decoded, "capacity {capacity}");
    }
    std::fs::remove_dir_all(dir).expect("clean up");
}

#[test]
fn many_threads_compute_a_level_once() {
    let dir = folder("cache-threads");
    let image = png(&noise(200, 100, 1));
    stored(&dir, &image, &[], &full(200, 100));
    let key = texture_key(&image, &[], &full(200, 100).to_runs());
    let cache = TextureCache::new(dir.clone(), 1 << 30);
    std::thread::scope(|s| {
        for _ in 0..4 {
            s.spawn(|| (0..7).for_each(|l| drop(cache.level(&cache.texture(&key).expect("opens"), l).expect("a level"))));
        }
    });
    let stats = cache.stats();
    assert_eq!((stats.misses, stats.hits, stats.levels, stats.decoded), (7, 21, 7, 1));
    std::fs::remove_dir_all(dir).expect("clean up");
}
