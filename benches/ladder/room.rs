//! The room of the ladder, made in code: textured, with things at 1 to 5 m, and seven ways to move. `exact` was chosen
//! on it (number of reads, chords, supersampling).

use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use shutterbug::camera::{Intrinsics, Pose, Trajectory};
use shutterbug::scene::{Draw, Material, Object, PointLight, Scene, Shading, Texture, Vertex};

use super::takes::{Family, Take};

/// As the strongest of the development captures.
const READOUT_S: f64 = 0.0273;
const EXPOSURE_S: f64 = 0.0183;

/// 60 degrees across.
pub const CAMERA: Intrinsics =
    Intrinsics { width: 320, height: 240, fx: 277.0, fy: 277.0, cx: 160.0, cy: 120.0 };

/// All takes; those whose data is absent are left out, loudly.
pub fn takes() -> Vec<Take> {
    let still = Arc::new(room(None));
    let turning = |axis: DVec3, angle: fn(f64) -> f64| {
        path(move |t| Pose { rotation: askew(0.0) * DQuat::from_axis_angle(axis, angle(t)), ..eye() })
    };
    let mut takes = vec![
        take("pan", &still, turning(DVec3::Y, |t| 1.5 * t)),
        take("tilt", &still, turning(DVec3::X, |t| 1.5 * t)),
        take("roll", &still, turning(DVec3::Z, |t| 3.0 * t)),
        take(
            "translation",
            &still,
            path(|t| Pose { translation_m: eye().translation_m + DVec3::new(0.3, 1.6, 0.1) * t, ..eye() }),
        ),
        take("object", &Arc::new(room(Some(Arc::new(flying())))), path(|_| eye())),
        // 8 Hz, up to 3 rad/s, 150 rad/s^2; the frame holds a turning point.
        take("acceleration", &still, turning(DVec3::new(0.3, 0.95, 0.1), |t| 0.06 * (16.0 * PI * t).sin())),
    ];
    takes.extend(walking().map(|path| take("robot", &still, path)));
    takes
}

fn take(name: &str, scene: &Arc<Scene>, path: Trajectory) -> Take {
    Take {
        name: name.to_owned(),
        family: Family::Room,
        scene: scene.clone(),
        path: Arc::new(path),
        intrinsics: CAMERA,
        start_s: 0.01,
        readout_s: READOUT_S,
        exposure_s: EXPOSURE_S,
    }
}

/// At 1 kHz from -0.1 to 0.2 s.
fn path(pose: impl Fn(f64) -> Pose) -> Trajectory {
    let times: Vec<f64> = (-100..=200).map(|i| f64::from(i) * 1e-3).collect();
    let poses = times.iter().map(|&t| pose(t)).collect();
    Trajectory::new(Path::new("ladder"), times, poses).expect("increasing times")
}

/// World from camera: x forward, z up in the world; turned by `heading` about z.
fn looking(heading: f64) -> DQuat {
    let optical = DQuat::from_mat3(&glam::DMat3::from_cols(-DVec3::Y, -DVec3::Z, DVec3::X));
    DQuat::from_rotation_z(heading) * optical
}

/// Askew, so that no edge of the room runs along a row of samples: such an edge takes or leaves a whole row at once.
fn eye() -> Pose {
    Pose { rotation: askew(0.0), translation_m: DVec3::new(-2.2, 0.1, 1.3) }
}

fn askew(heading: f64) -> DQuat {
    looking(heading + 0.11) * DQuat::from_rotation_z(0.035) * DQuat::from_rotation_x(0.04)
}

fn flying() -> Trajectory {
    path(|t| Pose {
        rotation: DQuat::from_axis_angle(DVec3::new(0.2, 0.5, 1.0).normalize(), 0.4 + 8.0 * t),
        translation_m: DVec3::new(-0.3, 0.9, 1.35) + DVec3::new(0.5, -3.5, 0.8) * t,
    })
}

/// The path of a walking NAO (recorded at 1.5 Hz: position and heading) as a cubic, with the sway of its head at the
/// step rate, which that rate is too low to hold: 15 mm sideways and 8 mm up at 2 and 4 Hz, 3 degrees of roll and 2 of
/// pitch, and the knock of each footfall.
fn walking() -> Option<Trajectory> {
    let file = "../shared/data/trajectories/nao_2013062101_positions.csv";
    let Ok(text) = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(file)) else {
        eprintln!("SKIPPED robot: {file} is absent");
        return None;
    };
    let rows: Vec<Vec<f64>> = text
        .lines()
        .filter(|l| !l.starts_with('#') && !l.is_empty())
        .map(|l| l.split(',').map(|n| n.parse().expect("a number")).collect())
        .collect();
    // From the third row on the robot turns, the part that moves the picture most.
    let at = |i: usize, column: usize| rows[i][column];
    let cubic = |column: usize, u: f64| {
        let p = [0, 1, 2, 3].map(|i| at(i, column));
        let (m1, m2) = (0.5 * (p[2] - p[0]), 0.5 * (p[3] - p[1]));
        let (u2, u3) = (u * u, u * u * u);
        (2.0 * u3 - 3.0 * u2 + 1.0) * p[1]
            + (u3 - 2.0 * u2 + u) * m1
            + (3.0 * u2 - 2.0 * u3) * p[2]
            + (u3 - u2) * m2
    };
    let span_s = at(2, 1) - at(1, 1);
    Some(path(move |t| {
        let u = 0.5 + t / span_s;
        let phase = 4.0 * PI * t;
        let knock = 0.004 * (2.0 * PI * 25.0 * t).sin();
        let sway = DVec3::new(0.0, 0.015 * phase.sin(), 0.008 * (2.0 * phase).sin());
        let turned = askew(cubic(7, u) - cubic(7, 0.5))
            * DQuat::from_rotation_z(0.052 * (phase + 0.4).sin())
            * DQuat::from_rotation_x(0.035 * (2.0 * phase).sin() + knock);
        let walked =
            DVec3::new(cubic(2, u) - cubic(2, 0.5), cubic(3, u) - cubic(3, 0.5), cubic(4, u) - cubic(4, 0.5));
        Pose { rotation: turned, translation_m: eye().translation_m + walked + sway }
    }))
}

/// Triangles by texture.
#[derive(Default)]
struct Builder {
    runs: Vec<(usize, Vec<Vertex>)>,
}

impl Builder {
    fn quad(&mut self, corner: DVec3, u: DVec3, v: DVec3, (object, material): (u32, u32), tiles: [f64; 2]) {
        let normal = u.cross(v).normalize().as_vec3().to_array();
        let vertex = |a: f64, b: f64| Vertex {
            position_m: (corner + a * u + b * v).as_vec3().to_array(),
            object,
            normal,
            material,
            uv: [(a * tiles[0]) as f32, (b * tiles[1]) as f32],
        };
        let [p, q, r, s] = [vertex(0.0, 0.0), vertex(1.0, 0.0), vertex(1.0, 1.0), vertex(0.0, 1.0)];
        let texture = material as usize;
        let run = match self.runs.iter().position(|r| r.0 == texture) {
            Some(i) => i,
            None => {
                self.runs.push((texture, Vec::new()));
                self.runs.len() - 1
            }
        };
        self.runs[run].1.extend([p, q, r, p, r, s]);
    }

    fn block(&mut self, low: DVec3, size: DVec3, surface: (u32, u32), tiles_per_m: f64) {
        let (x, y, z) = (DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z);
        for (corner, u, v) in
            [(low, y, x), (low + z, x, y), (low, x, z), (low + y, z, x), (low, z, y), (low + x, y, z)]
        {
            self.quad(corner, u, v, surface, [u.length() * tiles_per_m, v.length() * tiles_per_m]);
        }
    }

    fn ball(&mut self, centre: DVec3, radius: f64, (object, material): (u32, u32)) {
        const ROUND: u32 = 24;
        let at = |i: u32, j: u32| {
            let (a, b) = (PI * f64::from(i) / 12.0, 2.0 * PI * f64::from(j) / f64::from(ROUND));
            let n = DVec3::new(a.sin() * b.cos(), a.sin() * b.sin(), a.cos());
            Vertex {
                position_m: (centre + radius * n).as_vec3().to_array(),
                object,
                normal: n.as_vec3().to_array(),
                material,
                uv: [3.0 * j as f32 / ROUND as f32, i as f32 / 12.0],
            }
        };
        let run = self.runs.iter().position(|r| r.0 == material as usize).expect("a block came first");
        for (i, j) in (0..12).flat_map(|i| (0..ROUND).map(move |j| (i, j))) {
            let [p, q, r, s] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            self.runs[run].1.extend([p, q, r, p, r, s]);
        }
    }
}

/// 6 x 5 x 3 m, boards and blocks at several distances, a ball, and, with a path, one block that flies.
fn room(flying: Option<Arc<Trajectory>>) -> Scene {
    let mut b = Builder::default();
    let (low, size) = (DVec3::new(-3.0, -2.5, 0.0), DVec3::new(6.0, 5.0, 3.0));
    b.block(low, size, (0, 0), 0.7);
    b.block(DVec3::new(1.2, -1.6, 0.0), DVec3::new(0.5, 0.6, 1.9), (0, 1), 1.6);
    b.block(DVec3::new(0.1, 0.7, 0.0), DVec3::new(0.3, 0.3, 1.5), (0, 2), 2.5);
    b.block(DVec3::new(-0.9, -0.85, 0.0), DVec3::new(0.25, 0.25, 1.05), (0, 1), 3.0);
    b.block(DVec3::new(-0.4, -0.3, 1.75), DVec3::new(0.05, 1.1, 0.08), (0, 2), 4.0);
    b.block(DVec3::new(2.2, 0.9, 0.4), DVec3::new(0.4, 1.1, 1.2), (0, 3), 1.2);
    b.ball(DVec3::new(0.6, -0.35, 0.75), 0.35, (0, 3));
    let mut objects = vec![Object { name: "room".into(), trajectory: None }];
    if flying.is_some() {
        b.block(DVec3::splat(-0.16), DVec3::splat(0.32), (1, 1), 3.0);
        objects.push(Object { name: "flying".into(), trajectory: flying });
    }
    let mut scene = Scene {
        objects,
        materials: (0..4).map(material).collect(),
        textures: (0..4).map(texture).collect(),
        shading: Shading::Lit(lights()),
        ..Scene::default()
    };
    for (texture, vertices) in b.runs {
        let first_index = scene.indices.len() as u32;
        scene.draws.push(Draw { first_index, index_count: vertices.len() as u32, texture: Some(texture) });
        scene.indices.extend((0..vertices.len() as u32).map(|i| scene.vertices.len() as u32 + i));
        scene.vertices.extend(vertices);
    }
    scene
}

fn lights() -> Vec<PointLight> {
    let light = |position_m, color| PointLight { position_m, color, attenuation: [0.6, 0.1, 0.05] };
    vec![light([-1.5, 1.2, 2.6], [0.8, 0.75, 0.7]), light([1.0, -1.8, 2.4], [0.45, 0.5, 0.6])]
}

fn material(i: usize) -> Material {
    let kd = [[0.9, 0.85, 0.8], [0.9, 0.6, 0.5], [0.5, 0.8, 0.9], [0.8, 0.9, 0.6]][i];
    Material { name: format!("m{i}"), kd, ks: [0.15; 3], ns: 20.0, texture: Some(i) }
}

/// Tiles with joints, stripes, checks and a smooth pattern; 64x64, so that a texel is about a pixel where it is seen
/// from the room's middle: textures are read without mip levels, and finer ones would compare their aliasing.
fn texture(i: usize) -> Texture {
    let value = |x: u32, y: u32| -> [u8; 3] {
        let (x, y) = (4 * x, 4 * y);
        let check = ((x / 32) ^ (y / 32)) & 1 == 1;
        let wave = (30.0 * (0.11 * f64::from(x)).sin() * (0.07 * f64::from(y)).cos()) as i32;
        let shade = |v: i32| (v + wave).clamp(0, 255) as u8;
        match i {
            0 if x % 64 < 4 || y % 64 < 4 => [40, 40, 45],
            0 => [shade(170), shade(160 + 20 * i32::from(check)), shade(150)],
            1 if (x / 16) % 2 == 0 => [235, 225, 210],
            1 => [50, shade(70), 90],
            2 if check => [240, 240, 235],
            2 => [30, 30, shade(60)],
            _ => [shade(128), shade(200 - (x / 2) as i32), shade(60 + (y / 2) as i32)],
        }
    };
    let rgba = (0..64).flat_map(|y| (0..64).map(move |x| (x, y)));
    let rgba = rgba.flat_map(|(x, y)| {
        let [r, g, b] = value(x, y);
        [r, g, b, 255]
    });
    Texture { path: format!("ladder {i}").into(), width: 64, height: 64, rgba: rgba.collect() }
}
