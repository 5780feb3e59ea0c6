//! The views of the golden pictures that no pyramid has: in perspective, level, from below, rolled, cut by the near plane.

use map3d_base::vec3::{cross, normalized};
use map3d_base::{Camera, CameraKind, Isa, LayerFormat, LayerKind, LayerSpec, Vec3, ViewAxes, Window};
use map3d_render::{RenderScene, ViewImage, ViewRequest};

use super::SIDE;
use super::pictures::{atlas_cube, balls, brick_court, gabled_house, signs, trees};
use crate::town::Town;

pub struct GoldenCamera {
    pub name: &'static str,
    pub scene: fn() -> Town,
    kind: CameraKind,
    position: Vec3,
    forward: Vec3,
    up: Vec3,
    /// Half the window's side: metres, or metres at a distance of one metre.
    half: f64,
    near_m: f64,
}

use CameraKind::{Orthographic, Perspective};

pub const CAMERAS: [GoldenCamera; 6] = [
    GoldenCamera {
        name: "atlas-cube-air",
        scene: atlas_cube,
        kind: Perspective,
        position: [-9.0, -12.0, 9.0],
        forward: [0.6, 0.8, -0.6],
        up: [0.0, 0.0, 1.0],
        half: 0.45,
        near_m: 0.5,
    },
    GoldenCamera {
        name: "trees-street",
        scene: trees,
        kind: Perspective,
        position: [-1.0, -9.0, -1.0],
        forward: [0.1, 1.0, 0.15],
        up: [0.0, 0.0, 1.0],
        half: 0.7,
        near_m: 0.5,
    },
    GoldenCamera {
        name: "bricks-below",
        scene: brick_court,
        kind: Perspective,
        position: [0.7, -0.4, -7.0],
        forward: [0.05, 0.1, 1.0],
        up: [0.0, 1.0, 0.0],
        half: 0.6,
        near_m: 0.5,
    },
    GoldenCamera {
        name: "signs-level",
        scene: signs,
        kind: Orthographic,
        position: [0.0, -20.0, 0.0],
        forward: [0.3, 1.0, 0.0],
        up: [0.0, 0.0, 1.0],
        half: 6.0,
        near_m: 0.0,
    },
    GoldenCamera {
        name: "gable-rolled",
        scene: gabled_house,
        kind: Orthographic,
        position: [-15.0, -20.0, 18.0],
        forward: [0.6, 0.8, -0.7],
        up: [0.5, 0.0, 1.0],
        half: 7.0,
        near_m: 0.0,
    },
    GoldenCamera {
        name: "balls-cut",
        scene: balls,
        kind: Perspective,
        position: [0.3, -4.0, 0.5],
        forward: [0.0, 1.0, -0.1],
        up: [0.2, 0.0, 1.0],
        half: 0.8,
        near_m: 3.0,
    },
];

impl GoldenCamera {
    fn camera(&self) -> Camera {
        let forward = normalized(self.forward).expect("a direction");
        let right = normalized(cross(forward, self.up)).expect("up is not forward");
        Camera {
            kind: self.kind,
            position: self.position,
            axes: ViewAxes { right, up: cross(right, forward), forward },
            window: Window { left: -self.half, right: self.half, bottom: -self.half, top: self.half },
            near_m: self.near_m,
            far_m: 100.0,
            width_px: SIDE as u32,
            height_px: SIDE as u32,
        }
        .validated()
        .expect("a camera")
    }

    /// Renders the view with an instruction set.
    pub fn render(&self, scene: &RenderScene, isa: Isa) -> ViewImage {
        let layer = |kind| LayerSpec::new(kind, LayerFormat::Png);
        let request = ViewRequest {
            camera: self.camera(),
            layers: [LayerKind::Color, LayerKind::Normal, LayerKind::Id, LayerKind::Depth].map(layer).to_vec(),
            samples: 16,
            cut: None,
            objects: None,
            region: None,
            threads: 1,
            deadline_s: None,
        };
        scene.render_view_with(&request, isa, &mut || true).expect("a view")
    }
}
