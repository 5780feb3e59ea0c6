//! Parents and seams (spec/pyramid.md §7, §8).

use crate::common::Random;
use map3d_base::layers::{AO, COLOR, DEPTH, DEPTH2, ID, NORMAL, PICTURE, SUN, SUN16};
use map3d_base::{DEPTH_NOTHING, LayerKind};
use map3d_image::seam::{read_seam, write_seam};
use map3d_image::{Arrays, GBuffer, reduce};
use serde_json::Value;

fn random_tile(seed: u64, side: u32) -> GBuffer {
    let mut random = Random(seed);
    let mut g = GBuffer::empty(side, side);
    for i in 0..g[ID].len() {
        if random.below(4) == 0 {
            continue;
        }
        g[ID][i] = 1 + random.below(3);
        g[DEPTH][i] = random.below(5);
        g[COLOR][i] = [(); 4].map(|()| random.below(65_536) as u16);
        g[NORMAL][i] = map3d_image::gbuffer::normal_from_vector([(); 3].map(|()| random.unit() - 0.5)).expect("has a direction");
    }
    g
}

#[test]
fn parents_follow_the_vectors() {
    let path = format!("{}/../../spec/vectors/parents.json", env!("CARGO_MANIFEST_DIR"));
    let rows: Value = serde_json::from_str(&std::fs::read_to_string(path).expect("vectors")).expect("JSON");
    let rows = rows.as_array().expect("rows");
    assert!(rows.len() >= 5);
    for row in rows {
        let mut child = GBuffer::empty(2, 2);
        for (k, c) in row["children"].as_array().expect("four").iter().enumerate() {
            put(&mut child, k, c);
        }
        let mut expected = GBuffer::empty(2, 2);
        put(&mut expected, 0, &row["parent"]);
        let got = reduce([Some(&child), None, None, None], 2);
        assert_eq!(got, expected, "{row}");
    }
}

fn put(g: &mut GBuffer, at: usize, pixel: &Value) {
    let number = |v: &Value| v.as_i64().expect("number");
    g[COLOR][at] = std::array::from_fn(|c| number(&pixel["color"][c]) as u16);
    g[NORMAL][at] = std::array::from_fn(|c| number(&pixel["normal"][c]) as i16);
    g[ID][at] = number(&pixel["id"]) as u32;
    g[DEPTH][at] = number(&pixel["depth"]) as u32;
}

#[test]
fn each_child_fills_its_quadrant() {
    let side = 8;
    let children: Vec<GBuffer> = (0..4).map(|k| random_tile(k, side)).collect();
    let whole = reduce([0, 1, 2, 3].map(|k| Some(&children[k])), side);
    for (k, child) in children.iter().enumerate() {
        let mut one = [None; 4];
        one[0] = Some(child);
        let alone = reduce(one, side);
        for y in 0..4usize {
            for x in 0..4usize {
                let (from, to) = (y * 8 + x, (y + k / 2 * 4) * 8 + x + k % 2 * 4);
                assert_eq!(
                    (whole[ID][to], whole[DEPTH][to], whole[COLOR][to], whole[NORMAL][to]),
                    (alone[ID][from], alone[DEPTH][from], alone[COLOR][from], alone[NORMAL][from])
                );
            }
        }
    }
}

#[test]
fn absent_and_empty_children_are_the_same() {
    let (some, nothing) = (random_tile(5, 16), GBuffer::empty(16, 16));
    assert_eq!(reduce([Some(&some), None, Some(&nothing), None], 16), reduce([Some(&some), Some(&nothing), None, Some(&nothing)], 16));
    let none = reduce([None; 4], 16);
    assert!(none.is_empty() && none[DEPTH].iter().all(|d| *d == DEPTH_NOTHING));
}

#[test]
fn opposite_normals_take_the_nearest() {
    let mut child = GBuffer::empty(2, 2);
    child[ID].fill(9);
    child[DEPTH].copy_from_slice(&[5, 4, 5, 5]);
    child[NORMAL].copy_from_slice(&[[32_767, 0, 0], [-32_767, 0, 0], [0, 32_767, 0], [0, -32_767, 0]]);
    assert_eq!(reduce([Some(&child), None, None, None], 2)[NORMAL][0], [-32_767, 0, 0]);
}

/// Normals of one object, from opposite ones to those of a curved surface. The oracle adds in float64 as spec/pyramid.md section 7 says.
#[test]
fn normals_are_normalised_means_rounded_half_away_from_zero() {
    let mut random = Random(11);
    for spread in [0.0001, 0.01, 0.3, 2.0] {
        let mut child = GBuffer::empty(64, 64);
        child[ID].fill(7);
        for normal in &mut child[NORMAL] {
            let near = [0.3, -0.2, 0.9].map(|c| c + spread * (random.unit() - 0.5));
            *normal = map3d_image::gbuffer::normal_from_vector(near).expect("has a direction");
        }
        let parent = reduce([Some(&child), None, None, None], 64);
        for (y, x) in (0..32).flat_map(|y| (0..32).map(move |x| (y, x))) {
            let four = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(b, a)| child[NORMAL][(2 * y + b) * 64 + 2 * x + a]);
            let mean = [0, 1, 2].map(|c| four.iter().map(|n| f64::from(n[c])).sum::<f64>() / (4.0 * 32_767.0));
            let expected = if four == [four[0]; 4] { four[0] } else { map3d_image::gbuffer::normal_from_vector(mean).expect("has a direction") };
            assert_eq!(parent[NORMAL][y * 64 + x], expected, "{four:?}");
        }
    }
}

#[test]
fn seams_round_trip_exactly() {
    for g in [random_tile(1, 32), GBuffer::empty(4, 4), random_tile(2, 256)] {
        assert_eq!(read_seam("test", &write_seam(&g)).expect("sound"), g);
    }
}

#[test]
fn damaged_seams_are_refused() {
    let good = write_seam(&random_tile(3, 16));
    for cut in [0, 3, 15, 16, 23, good.len() - 1] {
        assert!(read_seam("cut", &good[..cut]).is_err(), "cut at {cut}");
    }
    for at in 0..good.len() {
        let mut bad = good.clone();
        bad[at] ^= 0x10;
        assert!(read_seam("flipped", &bad).is_err(), "flipped at {at}");
    }
}

#[test]
fn a_seam_whose_arrays_do_not_fit_its_size_is_refused() {
    let mut bad = write_seam(&random_tile(3, 16));
    bad[8] = 17;
    let body = bad.len() - 8;
    let checksum = map3d_base::file::checksum(&bad[..body]);
    bad[body..].copy_from_slice(&checksum.to_le_bytes());
    assert!(read_seam("resized", &bad).is_err());
}

/// Id, depth and all layers that rays compute.
fn light_tile(seed: u64, side: u32) -> GBuffer {
    let mut random = Random(seed);
    let arrays =
        [LayerKind::Sun, LayerKind::Sun16, LayerKind::Ao, LayerKind::Depth2, LayerKind::Picture].into_iter().fold(Arrays::LEAST, Arrays::and);
    let mut g = GBuffer::with(side, side, arrays);
    for i in 0..g[ID].len() {
        if random.below(4) != 0 {
            (g[ID][i], g[DEPTH][i], g[DEPTH2][i]) = (1 + random.below(3), random.below(5), 100 + random.below(9));
            (g[SUN][i], g[AO][i], g[SUN16][i]) = (random.below(256) as u8, random.below(256) as u8, random.below(65_536) as u16);
            g[PICTURE][i] = [(); 4].map(|()| random.below(65_536) as u16);
        }
    }
    g
}

#[test]
fn shades_are_means_of_pixels_with_an_id() {
    let mut child = GBuffer::with(2, 2, Arrays::LEAST.and(LayerKind::Sun).and(LayerKind::Ao));
    child[ID].copy_from_slice(&[7, 9, 0, 9]);
    child[DEPTH].copy_from_slice(&[5, 6, DEPTH_NOTHING, 8]);
    child[SUN].copy_from_slice(&[255, 0, 255, 0]);
    child[AO].copy_from_slice(&[10, 20, 255, 31]);
    let parent = reduce([Some(&child), None, None, None], 2);
    assert_eq!((parent[SUN][0], parent[AO][0], parent[ID][0]), (85, 20, 9));
    assert_eq!((parent[SUN][1], parent[AO][3]), (255, 255), "nothing there");
    assert_eq!(parent.arrays(), child.arrays());
}

#[test]
fn suns_and_second_depths_come_from_the_id_that_wins() {
    let mut child = GBuffer::with(2, 2, Arrays::LEAST.and(LayerKind::Sun16).and(LayerKind::Depth2));
    child[ID].copy_from_slice(&[7, 9, 9, 4]);
    child[DEPTH].copy_from_slice(&[1, 6, 5, 2]);
    child[SUN16].copy_from_slice(&[1, 2, 4, 8]);
    child[DEPTH2].copy_from_slice(&[10, 40, 50, 20]);
    let parent = reduce([None, Some(&child), None, None], 2);
    assert_eq!((parent[ID][1], parent[SUN16][1], parent[DEPTH2][1]), (9, 4, 40));
}

#[test]
fn seams_keep_the_arrays_that_are_present() {
    for g in [light_tile(8, 32), light_tile(9, 256)] {
        assert_eq!(read_seam("test", &write_seam(&g)).expect("sound"), g);
        let mut some = g.clone();
        some.keep(Arrays::LEAST.and(LayerKind::Ao));
        let bytes = write_seam(&some);
        assert_eq!(bytes[16..20], 0b100_1100u32.to_le_bytes());
        assert_eq!(read_seam("test", &bytes).expect("sound"), some);
    }
}

#[test]
fn pictures_are_reduced_as_colours_are() {
    let lit = light_tile(5, 16);
    let mut plain = GBuffer::empty(16, 16);
    plain[COLOR].copy_from_slice(&lit[PICTURE]);
    let parent = |g| reduce([Some(g), None, Some(g), None], 16);
    assert_eq!(parent(&plain)[COLOR], parent(&lit)[PICTURE]);
}
