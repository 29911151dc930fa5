//! Scenes with everything that a rasterizer can get wrong, and camera paths.

use std::path::Path;
use std::sync::Arc;

use glam::{DQuat, DVec3, EulerRot};
use shutterbug::camera::{Intrinsics, Pose, Trajectory};
use shutterbug::plane::Plane;
use shutterbug::scene::{Draw, Material, Object, PointLight, Scene, Shading, Texture, Vertex};

use super::bench::Scatter;

/// The scene with its runs of triangles by texture and gloss, as the device draws them: the untextured, matt ones
/// first.
pub fn drawable(mut scene: Scene) -> Scene {
    let material = |i: u32| &scene.materials[scene.vertices[i as usize].material as usize];
    let run = |i: u32| (material(i).texture, material(i).is_glossy());
    let mut triangles: Vec<[u32; 3]> = scene.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    triangles.sort_by_key(|t| run(t[0]));
    let mut draws: Vec<Draw> = Vec::new();
    for (i, triangle) in triangles.iter().enumerate() {
        match draws.last_mut() {
            Some(draw) if i > 0 && run(triangles[i - 1][0]) == run(triangle[0]) => draw.index_count += 3,
            _ => {
                let texture = run(triangle[0]).0;
                draws.push(Draw { first_index: 3 * i as u32, index_count: 3, texture });
            }
        }
    }
    (scene.indices, scene.draws) = (triangles.concat(), draws);
    scene
}

/// Poses computed from time, every ms from -0.2 s to 0.4 s.
pub fn path(pose: impl Fn(f64) -> Pose) -> Trajectory {
    let times: Vec<f64> = (0..=600).map(|i| -0.2 + 1e-3 * f64::from(i)).collect();
    let poses = times.iter().map(|&t| pose(t)).collect();
    Trajectory::new(Path::new("test.tum"), times, poses).unwrap()
}

/// A hand-held walk: turns and moves in all directions at about 1 rad/s and 1 m/s.
pub fn walk() -> Trajectory {
    path(|t| Pose {
        rotation: DQuat::from_euler(EulerRot::XYZ, 0.05 + 0.6 * t, 0.07 - t, 0.1 + 0.5 * t),
        translation_m: DVec3::new(0.8 * t, -0.3 * t, 1.1 * t),
    })
}

/// Object to world of the thing that moves on its own.
pub fn moving() -> Trajectory {
    path(|t| Pose {
        rotation: DQuat::from_rotation_z(3.0 * t),
        translation_m: DVec3::new(-0.4 + 2.0 * t, 0.1 - t, 1.4),
    })
}

struct Builder(Scene);

impl Builder {
    fn quad(&mut self, corners: [[f64; 3]; 4], object: u32, material: u32) {
        let corners = corners.map(DVec3::from);
        let normal = (corners[1] - corners[0]).cross(corners[3] - corners[0]).normalize();
        let first = self.0.vertices.len() as u32;
        self.0.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
        let uvs = [[0.0, 0.0], [1.5, 0.1], [1.4, 2.1], [-0.1, 2.0]];
        for (corner, uv) in corners.into_iter().zip(uvs) {
            let (position_m, normal) = (corner.as_vec3().to_array(), normal.as_vec3().to_array());
            self.0.vertices.push(Vertex { position_m, object, normal, material, uv });
        }
    }
}

/// A textured slanted wall, a floor that passes under and behind the camera, crossing plates, and an object that moves
/// on its own. `lights`: how many point lights; 0 = unlit.
pub fn rich(lights: usize) -> Scene {
    // One of them is matt.
    let material = |kd: [f32; 3], texture: Option<usize>| Material {
        name: "m".into(),
        kd,
        ks: if kd[0] < 0.3 { [0.0; 3] } else { [0.4, 0.3, 0.2] },
        ns: 24.0,
        texture,
    };
    let mut scatter = Scatter(5);
    let texel = |_: usize| ((40.0 + 200.0 * scatter.number()) as u8, (255.0 * scatter.number()) as u8);
    let rgba = (0..8 * 6).map(texel).flat_map(|(a, b)| [a, b, 128, 255]).collect();
    let mut b = Builder(Scene {
        materials: vec![
            material([0.8, 0.7, 0.6], None),
            material([0.9, 1.0, 0.8], Some(0)),
            material([0.2, 0.5, 0.9], None),
            material([0.9, 0.3, 0.1], None),
            material([0.4, 0.9, 0.3], Some(0)),
        ],
        textures: vec![Texture { path: "texture".into(), width: 8, height: 6, rgba }],
        objects: vec![
            Object { name: "world".into(), trajectory: None },
            Object { name: "moving".into(), trajectory: Some(Arc::new(moving())) },
        ],
        ..Scene::default()
    });
    b.quad([[-9.0, 0.6, -9.0], [9.0, 0.6, -9.0], [9.0, 0.6, 9.0], [-9.0, 0.6, 9.0]], 0, 0);
    b.quad([[-1.5, -1.2, 2.4], [1.2, -1.1, 3.1], [1.2, 0.55, 3.1], [-1.5, 0.55, 2.4]], 0, 1);
    b.quad([[0.2, -0.5, 1.6], [0.9, -0.4, 2.3], [0.8, 0.2, 2.2], [0.1, 0.1, 1.5]], 0, 2);
    b.quad([[0.1, -0.2, 2.2], [0.8, -0.3, 1.6], [0.8, 0.3, 1.6], [0.1, 0.4, 2.2]], 0, 3);
    b.quad([[-0.3, -0.2, 0.02], [0.25, -0.25, -0.04], [0.3, 0.2, 0.03], [-0.25, 0.25, 0.1]], 1, 4);
    if lights > 0 {
        let light = |i: usize| {
            let (j, row) = ((i % 5) as f32, (i / 5) as f32);
            PointLight {
                position_m: [j - 2.0 + 0.3 * row, -1.5 + 0.3 * j, 0.5 + 0.4 * j],
                color: [0.5, 0.4 + 0.1 * j, 0.6],
                attenuation: [1.0, 0.2, 0.1 * j],
            }
        };
        b.0.shading = Shading::Lit((0..lights).map(light).collect());
    }
    drawable(b.0)
}

/// The scene in a room of 60 m, so that every pixel shows some surface.
pub fn closed(scene: Scene) -> Scene {
    let mut b = Builder(scene);
    let side =
        |f: &dyn Fn(f64, f64) -> [f64; 3]| [f(-30.0, -30.0), f(30.0, -30.0), f(30.0, 30.0), f(-30.0, 30.0)];
    for at in [-30.0, 30.0] {
        b.quad(side(&|a, b| [at, a, b]), 0, 2);
        b.quad(side(&|a, b| [a, at, b]), 0, 3);
        b.quad(side(&|a, b| [a, b, at]), 0, 2);
    }
    drawable(b.0)
}

/// The same geometry with a flat colour of its own for every quad.
pub fn flat_ids(scene: &Scene) -> Scene {
    let mut ids = Scene { textures: Vec::new(), shading: Shading::Unlit, ..scene.clone() };
    let count = scene.vertices.len().div_ceil(4);
    let material = |i: usize| Material {
        name: i.to_string(),
        kd: [(i + 1) as f32, 0.0, 0.0],
        ks: [0.0; 3],
        ns: 1.0,
        texture: None,
    };
    ids.materials = (0..count).map(material).collect();
    ids.vertices.iter_mut().enumerate().for_each(|(i, v)| v.material = (i / 4) as u32);
    drawable(ids)
}

/// Total length of all triangles' edges on the picture, px.
pub fn edge_length_px(scene: &Scene, k: &Intrinsics, pose: &Pose, time_s: f64) -> f64 {
    const STEPS: u32 = 4000;
    let camera = |i: u32| {
        let v = &scene.vertices[i as usize];
        let world = scene.objects[v.object as usize].world_from_object(time_s);
        pose.inverse().then_from(&world).transform(DVec3::from(v.position_m.map(f64::from)))
    };
    let seen = |p: DVec3| {
        let px = (p.z > 0.01).then(|| [k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy])?;
        let inside = px[0] >= 0.0 && px[1] >= 0.0 && px[0] <= k.width.into() && px[1] <= k.height.into();
        inside.then_some(px)
    };
    let mut length = 0.0;
    for t in scene.indices.chunks_exact(3) {
        for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(a, b)| (camera(t[a]), camera(t[b]))) {
            let mut last = seen(a);
            for i in 1..=STEPS {
                let next = seen(a.lerp(b, f64::from(i) / f64::from(STEPS)));
                if let (Some(p), Some(q)) = (last, next) {
                    length += (p[0] - q[0]).hypot(p[1] - q[1]);
                }
                last = next;
            }
        }
    }
    length
}

/// Whether a pixel and its eight neighbours all hold the very same values.
pub fn uniform_around(plane: &Plane<f32>, x: usize, y: usize) -> bool {
    around(plane, x, y).all(|(nx, ny)| plane.pixel(nx, ny) == plane.pixel(x, y))
}

/// Largest difference of a channel between a pixel and its neighbours.
pub fn step_around(plane: &Plane<f32>, x: usize, y: usize) -> f32 {
    let here = plane.pixel(x, y);
    let steps = around(plane, x, y)
        .flat_map(|(nx, ny)| plane.pixel(nx, ny).iter().zip(here).map(|(a, b)| (a - b).abs()));
    steps.fold(0.0, f32::max)
}

fn around(plane: &Plane<f32>, x: usize, y: usize) -> impl Iterator<Item = (usize, usize)> {
    let (columns, rows) =
        (x.saturating_sub(1)..(x + 2).min(plane.width), y.saturating_sub(1)..(y + 2).min(plane.height));
    rows.flat_map(move |ny| columns.clone().map(move |nx| (nx, ny)))
}
