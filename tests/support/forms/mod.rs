//! Scenes and camera paths whose pictures can be computed on paper.
#![allow(dead_code, clippy::unwrap_used)]

use std::path::Path;

use glam::{DQuat, DVec2, DVec3};
use shutterbug::camera::{Intrinsics, Pose, Trajectory};
use shutterbug::plane::Plane;
use shutterbug::scene::{Material, Object, Scene, Vertex};

/// Uneven on purpose: a swap of x and y or a centred principal point would show.
pub const K: Intrinsics = Intrinsics { width: 160, height: 120, fx: 140.0, fy: 150.0, cx: 77.3, cy: 62.1 };

/// White quads with the given corners (in order around), in camera coordinates of the camera at the origin.
pub fn quads(corners: &[[DVec3; 4]]) -> Scene {
    let mut scene = Scene {
        materials: vec![Material { name: "m".into(), kd: [1.0; 3], ks: [0.0; 3], ns: 1.0, texture: None }],
        objects: vec![Object { name: "o".into(), trajectory: None }],
        ..Scene::default()
    };
    for quad in corners {
        let first = scene.vertices.len() as u32;
        scene.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
        scene.vertices.extend(quad.map(|p| Vertex {
            position_m: p.as_vec3().to_array(),
            object: 0,
            normal: [0.0, 0.0, -1.0],
            material: 0,
            uv: [0.0; 2],
        }));
    }
    scene
}

/// An upright rectangle that faces the camera at distance z.
pub fn rectangle(x: [f64; 2], y: [f64; 2], z: f64) -> [DVec3; 4] {
    [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])].map(|(x, y)| DVec3::new(x, y, z))
}

/// Poses computed from time, every 0.1 ms from -0.1 s to 0.2 s.
fn path(pose: impl Fn(f64) -> Pose) -> Trajectory {
    let times: Vec<f64> = (0..=3000).map(|i| -0.1 + 1e-4 * f64::from(i)).collect();
    let poses = times.iter().map(|&t| pose(t)).collect();
    Trajectory::new(Path::new("test.tum"), times, poses).unwrap()
}

/// A camera that turns to the right at `rad_per_s`: about y, which points down.
pub fn pan(rad_per_s: f64) -> Trajectory {
    path(|t| Pose { rotation: DQuat::from_rotation_y(rad_per_s * t), translation_m: DVec3::ZERO })
}

/// A camera that moves to the right at `m_per_s`.
pub fn slide(m_per_s: f64) -> Trajectory {
    path(|t| Pose { rotation: DQuat::IDENTITY, translation_m: DVec3::new(m_per_s * t, 0.0, 0.0) })
}

/// Sum over a channel, and mean position weighed with it, px.
pub fn moments(plane: &Plane<f32>, channel: usize) -> (f64, DVec2) {
    let (mut sum, mut first) = (0.0, DVec2::ZERO);
    for y in 0..plane.height {
        for x in 0..plane.width {
            let value = f64::from(plane.pixel(x, y)[channel]);
            sum += value;
            first += value * DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        }
    }
    (sum, first / sum)
}
