//! Reads the captures of `../shared/data/cycles-dev`. Deliberately apart from the library's own readers: an oracle that
//! shares their mistakes would not see them.
#![allow(clippy::unwrap_used)]

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DQuat, DVec3};
use shutterbug::camera::{Intrinsics, Pose, ScanOrder, ShutterTiming, Trajectory};
use shutterbug::plane::{Plane, read_rgb8};
use shutterbug::scene::{Draw, Material, Object, Scene, Texture, Vertex};

/// A capture with the answer's timing.
pub struct Answered {
    pub root: PathBuf,
    pub intrinsics: Intrinsics,
    pub scene: Scene,
    pub trajectory: Trajectory,
    /// Start of each frame, s after the first; file name.
    pub frames: Vec<(f64, String)>,
    pub exposure_time_s: f64,
    pub readout_time_s: f64,
    pub scan_order: ScanOrder,
    /// k1, k2 of the lens.
    pub lens: [f64; 2],
}

impl Answered {
    /// Shutter of a frame.
    pub fn timing(&self, frame: usize) -> ShutterTiming {
        ShutterTiming {
            start_s: self.frames[frame].0,
            exposure_time_s: self.exposure_time_s,
            readout_time_s: self.readout_time_s,
            scan_order: self.scan_order,
            line_count: self.scan_order.line_count(self.intrinsics.width, self.intrinsics.height),
        }
    }

    /// The real frame.
    pub fn real(&self, frame: usize) -> Plane<u8> {
        read_rgb8(&self.root.join("real").join(&self.frames[frame].1)).unwrap()
    }
}

/// The capture of that name, or `None`, said loudly, where the data is absent.
pub fn cycles(name: &str, test: &str) -> Option<Answered> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/cycles-dev").join(name);
    if !root.is_dir() {
        eprintln!("SKIPPED {test}: ../shared/data/cycles-dev/{name} is absent");
        return None;
    }
    let camera: toml::Table = fs::read_to_string(root.join("camera.toml")).unwrap().parse().unwrap();
    let number = |key: &str| {
        let v = &camera[key];
        v.as_float().or(v.as_integer().map(|i| i as f64)).unwrap()
    };
    let intrinsics = Intrinsics {
        width: number("width") as u32,
        height: number("height") as u32,
        fx: number("fx"),
        fy: number("fy"),
        cx: number("cx"),
        cy: number("cy"),
    };
    let frames = fs::read_to_string(root.join("frames.csv")).unwrap();
    let frames: Vec<(i64, String)> = frames
        .lines()
        .filter(|l| !l.starts_with('#') && !l.is_empty())
        .map(|l| l.split_once(',').map(|(t, f)| (t.parse().unwrap(), f.trim().to_owned())).unwrap())
        .collect();
    let epoch_s = frames[0].0 as f64 * 1e-9;
    let mut answered = Answered {
        intrinsics,
        scene: scene(&root, epoch_s),
        trajectory: tum(&root.join("trajectory.tum"), epoch_s),
        frames: frames.iter().map(|(t, f)| ((t - frames[0].0) as f64 * 1e-9, f.clone())).collect(),
        exposure_time_s: 0.0,
        readout_time_s: 0.0,
        scan_order: ScanOrder::default(),
        lens: [0.0; 2],
        root,
    };
    let text = fs::read_to_string(answered.root.join("answer.json")).unwrap();
    let answer: serde_json::Value = serde_json::from_str(&text).unwrap();
    for effect in answer["effects"].as_array().unwrap() {
        match effect["name"].as_str().unwrap() {
            "rolling_shutter" => {
                answered.readout_time_s = effect["readout_s"].as_f64().unwrap();
                answered.scan_order = ScanOrder::from_name(effect["direction"].as_str().unwrap()).unwrap();
            }
            "motion_blur" => answered.exposure_time_s = effect["exposure_s"].as_f64().unwrap(),
            "lens_distortion" => answered.lens = ["k1", "k2"].map(|k| effect[k].as_f64().unwrap()),
            other => panic!("{name} has {other}, which the oracle does not render"),
        }
    }
    Some(answered)
}

fn numbers(text: &str) -> Vec<f64> {
    text.split_whitespace().map(|n| n.parse().unwrap()).collect()
}

fn tum(path: &Path, epoch_s: f64) -> Trajectory {
    let text = fs::read_to_string(path).unwrap();
    let rows: Vec<Vec<f64>> =
        text.lines().filter(|l| !l.starts_with('#') && !l.trim().is_empty()).map(numbers).collect();
    let pose = |r: &Vec<f64>| Pose {
        rotation: DQuat::from_xyzw(r[4], r[5], r[6], r[7]).normalize(),
        translation_m: DVec3::new(r[1], r[2], r[3]),
    };
    let times = rows.iter().map(|r| r[0] - epoch_s).collect();
    Trajectory::new(path, times, rows.iter().map(pose).collect()).unwrap()
}

fn materials(root: &Path) -> (Vec<Material>, Vec<Texture>) {
    let (mut materials, mut textures): (Vec<Material>, Vec<Texture>) = Default::default();
    for line in fs::read_to_string(root.join("scene.mtl")).unwrap().lines() {
        match line.trim().split_once(' ') {
            Some(("newmtl", name)) => materials.push(Material {
                name: name.to_owned(),
                kd: [0.0; 3],
                ks: [0.0; 3],
                ns: 1.0,
                texture: None,
            }),
            Some(("Kd", rgb)) => {
                let rgb = numbers(rgb);
                materials.last_mut().unwrap().kd = [rgb[0] as f32, rgb[1] as f32, rgb[2] as f32];
            }
            Some(("map_Kd", file)) => {
                let path = root.join(file);
                let picture = read_rgb8(&path).unwrap();
                let rgba = picture.data.chunks_exact(3).flat_map(|c| [c[0], c[1], c[2], 255]).collect();
                materials.last_mut().unwrap().texture = Some(textures.len());
                let (width, height) = (picture.width as u32, picture.height as u32);
                textures.push(Texture { path, width, height, rgba });
            }
            _ => {}
        }
    }
    (materials, textures)
}

fn scene(root: &Path, epoch_s: f64) -> Scene {
    let (materials, textures) = materials(root);
    let by_name: HashMap<String, u32> =
        materials.iter().enumerate().map(|(i, m)| (m.name.clone(), i as u32)).collect();
    let mut scene = Scene { materials, textures, ..Scene::default() };
    let (mut points, mut uvs, mut material) = (Vec::new(), Vec::new(), 0);
    for line in fs::read_to_string(root.join("scene.obj")).unwrap().lines() {
        match line.trim().split_once(' ') {
            Some(("v", xyz)) => points.push(numbers(xyz)),
            Some(("vt", uv)) => uvs.push(numbers(uv)),
            Some(("usemtl", name)) => material = by_name[name],
            Some(("o", name)) => {
                let path = root.join("objects").join(format!("{name}.tum"));
                let trajectory = path.is_file().then(|| Arc::new(tum(&path, epoch_s)));
                scene.objects.push(Object { name: name.to_owned(), trajectory });
            }
            Some(("f", corners)) => {
                if scene.objects.is_empty() {
                    scene.objects.push(Object { name: String::new(), trajectory: None });
                }
                let object = scene.objects.len() as u32 - 1;
                let corners: Vec<&str> = corners.split_whitespace().collect();
                assert_eq!(corners.len(), 3, "the captures hold triangles");
                for corner in corners {
                    let mut parts = corner.split('/').map(|n| n.parse::<usize>().unwrap() - 1);
                    let p = &points[parts.next().unwrap()];
                    let uv = parts.next().map_or([0.0; 2], |i| [uvs[i][0] as f32, uvs[i][1] as f32]);
                    scene.indices.push(scene.vertices.len() as u32);
                    let position_m = [p[0] as f32, p[1] as f32, p[2] as f32];
                    scene.vertices.push(Vertex { position_m, object, normal: [0.0, 0.0, 1.0], material, uv });
                }
            }
            _ => {}
        }
    }
    group_by_texture(&mut scene);
    scene
}

/// The order that the device draws in: one run of triangles a texture, the untextured ones first.
fn group_by_texture(scene: &mut Scene) {
    let texture = |i: u32| scene.materials[scene.vertices[i as usize].material as usize].texture;
    let mut triangles: Vec<[u32; 3]> = scene.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    triangles.sort_by_key(|t| texture(t[0]));
    let mut draws: Vec<Draw> = Vec::new();
    for (i, triangle) in triangles.iter().enumerate() {
        let texture = texture(triangle[0]);
        match draws.last_mut() {
            Some(draw) if draw.texture == texture => draw.index_count += 3,
            _ => draws.push(Draw { first_index: 3 * i as u32, index_count: 3, texture }),
        }
    }
    (scene.indices, scene.draws) = (triangles.concat(), draws);
}
