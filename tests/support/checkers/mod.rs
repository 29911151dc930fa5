//! Scenes for the warping methods: a room of checkerboards and posts, a camera that moves in one way each.
#![allow(dead_code, clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DQuat, DVec3, EulerRot};
use shutterbug::camera::{Intrinsics, Pose, ScanOrder, ShutterTiming, Trajectory};
use shutterbug::chain::Settings;
use shutterbug::engine::FrameRequest;
use shutterbug::scene::{Draw, Material, Object, Scene, Texture, Vertex};

pub const WIDTH: u32 = 320;
pub const HEIGHT: u32 = 240;
/// Readout and exposure of the rows, s.
pub const READOUT_S: f64 = 0.028;
pub const EXPOSURE_S: f64 = 0.012;
pub const INTERVAL_S: f64 = 0.05;

/// What moves, and how.
pub struct Row {
    pub name: &'static str,
    pub scene: Arc<Scene>,
    pub path: Arc<Trajectory>,
}

pub fn intrinsics() -> Intrinsics {
    Intrinsics { width: WIDTH, height: HEIGHT, fx: 250.0, fy: 250.0, cx: 160.0, cy: 120.0 }
}

fn texture() -> Texture {
    // Cells of 16 texels in uneven colours. Nothing finer: at 320x240 that would measure aliasing, not time.
    let (side, mut rgba) = (256u32, Vec::new());
    for y in 0..side {
        for x in 0..side {
            let (cx, cy) = (x / 16, y / 16);
            let hash = (cx * 7919 + cy * 104_729) % 97;
            let value = if (cx + cy) % 2 == 0 { 225 - hash } else { 40 + hash };
            rgba.extend_from_slice(&[
                value as u8,
                (value * 7 / 8 + hash / 4) as u8,
                (255 - value) as u8 / 2 + 60,
                255,
            ]);
        }
    }
    Texture { path: PathBuf::from("checker"), width: side, height: side, rgba }
}

struct Builder(Scene);

impl Builder {
    fn quad(&mut self, object: u32, origin: DVec3, u: DVec3, v: DVec3, material: u32) {
        let normal = u.cross(v).normalize().as_vec3().to_array();
        let first = self.0.vertices.len() as u32;
        for (a, b) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let p = origin + a * u + b * v;
            // A texture every 4 m: cells of 25 cm.
            let uv = [(a * u.length() / 4.0) as f32, (b * v.length() / 4.0) as f32];
            self.0.vertices.push(Vertex { position_m: p.as_vec3().to_array(), object, normal, material, uv });
        }
        self.0.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
    }

    fn cuboid(&mut self, object: u32, low: DVec3, size: DVec3, material: u32) {
        let (x, y, z) = (DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z);
        for (origin, u, v) in
            [(low, x, y), (low + z, x, y), (low, x, z), (low + y, x, z), (low, y, z), (low + x, y, z)]
        {
            self.quad(object, origin, u, v, material);
        }
    }
}

/// A room 6 m deep; posts and boxes at 1 to 4 m when `clutter`; a box that flies through when `flying`.
fn scene(clutter: bool, flying: Option<Trajectory>) -> Arc<Scene> {
    let material =
        |name: &str, kd| Material { name: name.to_owned(), kd, ks: [0.0; 3], ns: 1.0, texture: Some(0) };
    let mut b = Builder(Scene {
        materials: vec![
            material("wall", [0.8, 0.8, 0.8]),
            material("post", [1.0, 0.5, 0.35]),
            material("box", [0.5, 1.0, 0.6]),
        ],
        textures: vec![texture()],
        objects: vec![Object { name: "room".to_owned(), trajectory: None }],
        ..Scene::default()
    });
    b.cuboid(0, DVec3::new(-3.0, -1.6, -2.0), DVec3::new(6.0, 2.8, 7.0), 0);
    if clutter {
        b.cuboid(0, DVec3::new(-0.9, -1.6, 2.2), DVec3::new(0.18, 2.8, 0.18), 1);
        b.cuboid(0, DVec3::new(0.75, -1.6, 1.7), DVec3::new(0.12, 2.8, 0.12), 1);
        b.cuboid(0, DVec3::new(-0.3, 0.5, 2.6), DVec3::new(0.6, 0.7, 0.5), 2);
        b.cuboid(0, DVec3::new(1.3, 0.1, 3.4), DVec3::new(0.5, 1.1, 0.5), 1);
    }
    if let Some(trajectory) = flying {
        b.0.objects.push(Object { name: "box".to_owned(), trajectory: Some(Arc::new(trajectory)) });
        b.cuboid(1, DVec3::new(-0.3, -0.3, -0.2), DVec3::new(0.6, 0.6, 0.4), 2);
    }
    let index_count = b.0.indices.len() as u32;
    b.0.draws = vec![Draw { first_index: 0, index_count, texture: Some(0) }];
    Arc::new(b.0)
}

/// Poses every 2 ms from -0.1 s to 0.2 s; `f` gives position (m) and yaw, pitch, roll (rad).
fn path(f: impl Fn(f64) -> (DVec3, [f64; 3])) -> Trajectory {
    let times: Vec<f64> = (-50..=100).map(|i| f64::from(i) * 0.002).collect();
    let pose = |&t: &f64| {
        let (translation_m, [yaw, pitch, roll]) = f(t);
        Pose { rotation: DQuat::from_euler(EulerRot::YXZ, yaw, pitch, roll), translation_m }
    };
    let poses = times.iter().map(pose).collect();
    Trajectory::new(Path::new("path"), times, poses).unwrap()
}

/// The rows of the table.
pub fn rows() -> Vec<Row> {
    let still = |t: f64| (DVec3::new(0.0, 0.0, 0.0 * t), [0.1, 0.05, 0.02]);
    let row = |name, scene, path: Trajectory| Row { name, scene, path: Arc::new(path) };
    let flight =
        path(|t| (DVec3::new(-0.4 + 9.0 * t, 0.1 - 1.5 * t + 20.0 * t * t, 2.0), [2.0 * t, 0.5, 9.0 * t]));
    vec![
        row("pan", scene(true, None), path(|t| (DVec3::ZERO, [2.2 * t, 0.05, 0.02]))),
        row("tilt", scene(true, None), path(|t| (DVec3::ZERO, [0.1, 1.6 * t, 0.02]))),
        row("roll", scene(true, None), path(|t| (DVec3::ZERO, [0.1, 0.05, 3.5 * t]))),
        row(
            "parallax",
            scene(true, None),
            path(|t| (DVec3::new(1.8 * t, 0.3 * t, 0.5 * t), [0.1, 0.05, 0.02])),
        ),
        row("object", scene(false, Some(flight)), path(still)),
        row(
            "acceleration",
            scene(true, None),
            path(|t| (DVec3::ZERO, [-0.8 * t + 60.0 * t * t, 0.4 * t - 25.0 * t * t, 0.3 * t])),
        ),
        row(
            "walk",
            scene(true, None),
            path(|t| {
                let w = 2.0 * std::f64::consts::PI;
                let sway = 0.02 * (w * 9.0 * t).sin();
                let yaw = 0.05 * (w * 6.0 * t + 0.4).sin() + 0.015 * (w * 17.0 * t).sin();
                let pitch = 0.04 * (w * 8.0 * t + 1.0).sin();
                (DVec3::new(0.6 * t + sway, 0.02 * (w * 11.0 * t).cos(), 0.8 * t), [yaw, pitch, 0.6 * sway])
            }),
        ),
    ]
}

/// A frame that starts at 0 s.
pub fn request(readout_time_s: f64, exposure_time_s: f64, scan_order: ScanOrder) -> FrameRequest {
    let line_count = scan_order.line_count(WIDTH, HEIGHT);
    FrameRequest {
        index: 0,
        shutter: ShutterTiming { start_s: 0.0, exposure_time_s, readout_time_s, scan_order, line_count },
        frame_interval_s: INTERVAL_S,
        seed: 0,
        settings: Settings::default(),
        static_camera: false,
        planes: false,
        statistics: true,
    }
}
