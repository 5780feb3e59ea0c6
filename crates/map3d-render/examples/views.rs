//! Measures views of a built scene on one core: the first one of an opened scene, and the median of the next ones.
//!
//! `cargo run --release -p map3d-render --example views -- <scene folder> [--view orthographic|air|street] [--layers color,normal,id,depth] [--rounds 5]`.
//! Times are CPU times of one thread in milliseconds.

use std::path::PathBuf;

use map3d_base::vec3::{cross, normalized};
use map3d_base::{Camera, CameraKind, LayerFormat, LayerKind, LayerSpec, Vec3, ViewAxes, Window};
use map3d_render::{RenderScene, ViewRequest};
use rustix::time::{ClockId, clock_gettime};

const SIZE: [u32; 2] = [1024, 768];

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let option = |name: &str| args.iter().position(|a| a == name).and_then(|k| args.get(k + 1).cloned());
    let begun = now_ms();
    let scene = RenderScene::open(&PathBuf::from(&args[0]), 1 << 30).expect("a scene folder");
    println!("{} triangles, opened in {:.1}", scene.store().triangle_count(), now_ms() - begun);
    let request = ViewRequest {
        camera: camera(&scene, &option("--view").unwrap_or_else(|| "orthographic".into())),
        layers: option("--layers").unwrap_or_else(|| "color,normal,id,depth".into()).split(',').map(layer).collect(),
        samples: 16,
        cut: None,
        objects: None,
        region: None,
        threads: 1,
        deadline_s: None,
    };
    let render = || {
        let begun = now_ms();
        scene.render_view(&request, &mut || true).expect("a view");
        now_ms() - begun
    };
    println!("first {:.1}", render());
    println!("{:?}", scene.stats());
    let rounds = option("--rounds").map_or(5, |v| v.parse().expect("a number"));
    let mut times: Vec<f64> = (0..rounds).map(|_| render()).collect();
    times.sort_by(f64::total_cmp);
    if let (Some(least), Some(median)) = (times.first(), times.get(times.len() / 2)) {
        println!("next: median {median:.1}, least {least:.1}");
    }
}

fn layer(name: &str) -> LayerSpec {
    match name {
        "color" => LayerSpec::new(LayerKind::Color, LayerFormat::Png),
        "normal" => LayerSpec::new(LayerKind::Normal, LayerFormat::Png),
        "id" => LayerSpec::new(LayerKind::Id, LayerFormat::Png),
        "depth" => LayerSpec::new(LayerKind::Depth, LayerFormat::Png),
        other => panic!("unknown layer {other}"),
    }
}

/// Returns the views of bench/view.py: oblique at 0.2 m per pixel, from the air, near the ground.
fn camera(scene: &RenderScene, name: &str) -> Camera {
    let bounds = scene.store().bounds();
    let (middle, top) = (bounds.center(), bounds.hi[2]);
    match name {
        "orthographic" => looking(CameraKind::Orthographic, middle, [0.0, 1.0, -1.0], 102.4),
        "air" => looking(CameraKind::Perspective, [middle[0], middle[1] - 250.0, top + 60.0], [0.1, 1.0, -0.4], 0.6),
        "street" => looking(CameraKind::Perspective, [middle[0], middle[1] - 120.0, middle[2]], [0.1, 1.0, 0.0], 0.7),
        other => panic!("unknown view {other}"),
    }
}

fn looking(kind: CameraKind, position: Vec3, forward: Vec3, half: f64) -> Camera {
    let forward = normalized(forward).expect("a direction");
    let right = normalized(cross(forward, [0.0, 0.0, 1.0])).expect("not vertical");
    let high = half * f64::from(SIZE[1]) / f64::from(SIZE[0]);
    let camera = Camera {
        kind,
        position,
        axes: ViewAxes { right, up: cross(right, forward), forward },
        window: Window { left: -half, right: half, bottom: -high, top: high },
        near_m: if kind == CameraKind::Perspective { 0.5 } else { -5_000.0 },
        far_m: 20_000.0,
        width_px: SIZE[0],
        height_px: SIZE[1],
    };
    camera.validated().expect("a valid camera")
}

fn now_ms() -> f64 {
    let t = clock_gettime(ClockId::ThreadCPUTime);
    t.tv_sec as f64 * 1e3 + t.tv_nsec as f64 * 1e-6
}
