//! The vectors of `spec/vectors`, read by all three languages.

use map3d_base::tile::{Tile, block_levels, morton};
use map3d_base::{Camera, CameraKind, Frame, Projection, ViewAxes, Window};
use serde_json::Value;

fn vectors(name: &str) -> Value {
    let path = format!("{}/../../spec/vectors/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).expect("vectors are in the repository")).expect("vectors are JSON")
}

fn vec3(v: &Value) -> [f64; 3] {
    [0, 1, 2].map(|k| v[k].as_f64().expect("number"))
}

fn close(a: [f64; 3], b: [f64; 3]) -> bool {
    (0..3).all(|k| (a[k] - b[k]).abs() <= 1e-12 * (1.0 + b[k].abs()))
}

#[test]
fn view_axes_and_coordinates_follow_the_vectors() {
    for row in vectors("views").as_array().expect("rows") {
        let axes = ViewAxes::new(row["look_at_deg"].as_f64().expect("number"), row["pitch_deg"].as_f64().expect("number"));
        assert!(close(axes.right, vec3(&row["right"])) && close(axes.up, vec3(&row["up"])) && close(axes.forward, vec3(&row["forward"])));
        for p in row["points"].as_array().expect("points") {
            let uvd = axes.uvd_from_local(vec3(&p["local"]));
            assert!(close(uvd, vec3(&p["uvd"])), "{uvd:?} {p}");
            let back = axes.local_from_uvd(uvd);
            assert!((0..3).all(|k| (back[k] - vec3(&p["local"])[k]).abs() < 1e-9));
        }
    }
}

#[test]
fn cameras_follow_the_vectors() {
    for row in vectors("cameras").as_array().expect("rows") {
        let given = &row["camera"];
        let number = |v: &Value| v.as_f64().expect("number");
        let [left, right, bottom, top] = [0, 1, 2, 3].map(|k| number(&given["window"][k]));
        let camera = Camera {
            kind: if given["projection"] == "perspective" { CameraKind::Perspective } else { CameraKind::Orthographic },
            position: vec3(&given["position"]),
            axes: ViewAxes { right: vec3(&given["right"]), up: vec3(&given["up"]), forward: vec3(&given["forward"]) },
            window: Window { left, right, bottom, top },
            near_m: 0.1,
            far_m: 1e4,
            width_px: number(&given["size"][0]) as u32,
            height_px: number(&given["size"][1]) as u32,
        };
        let projection = Projection::of_camera(&camera.validated().expect("valid"), 0.0);
        for p in row["points"].as_array().expect("points") {
            let (x, y, depth) = (number(&p["pixel"][0]), number(&p["pixel"][1]), number(&p["depth"]));
            let [px, py, units] = projection.project(vec3(&p["local"]));
            assert!((px - x).abs() < 1e-8 && (py - y).abs() < 1e-8 && (units / 1024.0 - depth).abs() < 1e-9, "{px} {py} {units} {p}");
            assert!(close(projection.unproject([x, y, depth * 1024.0]), vec3(&p["local"])));
        }
    }
}

#[test]
fn tiles_follow_the_vectors() {
    let v = vectors("tiles");
    let view = &v["frame"]["views"][v["view"].as_u64().expect("number") as usize];
    let number = |v: &Value| v.as_f64().expect("number");
    let frame = Frame {
        look_at_deg: number(&view["look_at_deg"]),
        pitch_deg: number(&view["pitch_deg"]),
        u0_m: number(&view["u0_m"]),
        v0_m: number(&view["v0_m"]),
        d0_m: number(&view["d0_m"]),
        size_m: number(&v["frame"]["size_m"]),
        tile_px: 256,
        zmax: number(&v["frame"]["zmax"]) as u8,
        layers: vec![],
    };
    for row in v["rows"].as_array().expect("rows") {
        let n = |v: &Value| v.as_u64().expect("number") as u32;
        let tile = Tile { z: n(&row["tile"][0]) as u8, x: n(&row["tile"][1]), y: n(&row["tile"][2]) };
        let (u, w) = frame.uv_of_pixel(tile, n(&row["pixel"][0]), n(&row["pixel"][1]));
        assert!((u - number(&row["u"])).abs() < 1e-9 && (w - number(&row["v"])).abs() < 1e-9);
        assert_eq!(morton(tile.x, tile.y), row["morton"].as_u64().expect("number"));
        let parent = tile.parent().map(|p| vec![u32::from(p.z), p.x, p.y]);
        assert_eq!(serde_json::to_value(parent).expect("json"), row["parent"]);
    }
}

#[test]
fn parent_of_child_is_itself() {
    let tile = Tile { z: 5, x: 17, y: 30 };
    assert!(tile.children().iter().all(|c| c.parent() == Some(tile)));
}

#[test]
fn blocks_follow_the_vectors() {
    for row in vectors("blocks").as_array().expect("rows") {
        let got = block_levels(row["zmax"].as_u64().expect("number") as u8);
        let expected: Vec<(u8, u8)> =
            row["blocks"].as_array().expect("blocks").iter().map(|b| (b[0].as_u64().expect("n") as u8, b[1].as_u64().expect("n") as u8)).collect();
        assert_eq!(got, expected);
    }
}
