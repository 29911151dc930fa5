//! A small ray caster: a renderer that is not ours, against which frames from outside are measured. It renders one
//! picture for the library, and what the camera would have seen row by row.
#![allow(dead_code, unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

pub mod host;

use std::f64::consts::TAU;

use glam::{DQuat, DVec2, DVec3, EulerRot};
use rayon::prelude::*;
use shutterbug::camera::{Intrinsics, Lens, Pose, ScanOrder, ShutterTiming};
use shutterbug::plane::srgb8;

pub const K: Intrinsics = Intrinsics { width: 320, height: 240, fx: 280.0, fy: 280.0, cx: 160.0, cy: 120.0 };
pub const READOUT_S: f64 = 0.024;
pub const EXPOSURE_S: f64 = 0.008;
/// Instants of a line with blur.
pub const INSTANTS: u32 = 96;

/// Rays a pixel and side of a host's picture.
const HOST_SIDE: u32 = 4;
/// Those of the truth: of one instant, and of each of many that are averaged. With 4 of one instant the edges' steps of
/// a quarter of a px were most of what pictures that are read together differed by (37.0 dB instead of 39.2).
const SIDES: [u32; 2] = [8, 2];

/// A box, its colour, and what it moves with.
struct Cuboid {
    low: DVec3,
    high: DVec3,
    tint: [f64; 3],
    /// Place in the poses of the bodies.
    body: usize,
}

/// A room with posts and a box; body 0 rests.
pub struct World(Vec<Cuboid>);

impl World {
    /// `flying`: another box, which is body 1.
    pub fn new(flying: bool) -> Self {
        let cuboid = |low: [f64; 3], size: [f64; 3], tint: [f64; 3], body: usize| {
            let low = DVec3::from(low);
            Cuboid { low, high: low + DVec3::from(size), tint, body }
        };
        let mut all = vec![
            cuboid([-3.0, -1.6, -2.0], [6.0, 2.8, 7.0], [0.85, 0.85, 0.8], 0),
            cuboid([-0.9, -1.6, 2.2], [0.18, 2.8, 0.18], [1.0, 0.5, 0.35], 0),
            cuboid([0.75, -1.6, 1.7], [0.12, 2.8, 0.12], [0.4, 0.6, 1.0], 0),
            cuboid([-0.3, 0.5, 2.6], [0.6, 0.7, 0.5], [0.5, 1.0, 0.6], 0),
        ];
        if flying {
            all.push(cuboid([-0.25, -0.25, -0.15], [0.5, 0.5, 0.3], [1.0, 0.9, 0.2], 1));
        }
        Self(all)
    }

    /// Linear colour and distance along the ray (in units of its length) of what is seen, and the body.
    pub fn cast(&self, from: DVec3, way: DVec3, bodies: &[Pose]) -> ([f64; 3], f64, usize) {
        let mut nearest: Option<(&Cuboid, f64, DVec3)> = None;
        for cuboid in &self.0 {
            let pose = &bodies[cuboid.body];
            let (o, d) = match cuboid.body {
                0 => (from, way),
                _ => (pose.inverse().transform(from), pose.rotation.inverse() * way),
            };
            let each = 1.0 / d;
            let (a, b) = ((cuboid.low - o) * each, (cuboid.high - o) * each);
            let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
            let at = if enter > 1e-9 { enter } else { leave };
            if leave < enter || at < 1e-9 || nearest.is_some_and(|n| at >= n.1) {
                continue;
            }
            nearest = Some((cuboid, at, o + at * d));
        }
        nearest.map_or(([0.0; 3], f64::INFINITY, 0), |(cuboid, at, place)| {
            (cuboid.color(place), at, cuboid.body)
        })
    }
}

impl Cuboid {
    /// Checks of 0.25 m, with a shade that tells the faces apart.
    fn color(&self, at: DVec3) -> [f64; 3] {
        let on = |v: f64, low: f64, high: f64| (v - low).abs() < 1e-6 || (v - high).abs() < 1e-6;
        let [x, y, z] = at.to_array();
        let (u, v, shade) = if on(x, self.low.x, self.high.x) {
            (y, z, 0.8)
        } else if on(y, self.low.y, self.high.y) {
            (x, z, 0.65)
        } else {
            (x, y, 1.0)
        };
        let cell = |t: f64| (t / 0.25 + 100.37).floor();
        let odd = (cell(u) + cell(v)) % 2.0 == 0.0;
        let hash = ((cell(u) * 7.0 + cell(v) * 13.0) % 11.0) / 11.0;
        let light = shade * if odd { 0.55 + 0.3 * hash } else { 0.12 + 0.15 * hash };
        self.tint.map(|t| t * light)
    }
}

/// How camera and bodies move.
pub type Motion<'a> = &'a (dyn Fn(f64) -> Vec<Pose> + Sync);

/// Where a place of the sensor looks (camera's frame), for a colour: 0, 1, 2.
pub type Looks<'a> = &'a (dyn Fn(DVec2, usize) -> DVec3 + Sync);

/// A host's picture of one instant.
#[derive(Clone)]
pub struct Shot {
    pub rgb: Vec<u8>,
    pub depth_m: Vec<f32>,
    pub body: Vec<u32>,
    pub size: [usize; 2],
}

/// One picture, with a margin; `motion` gives the camera, then the bodies.
pub fn shot(world: &World, motion: Motion<'_>, time_s: f64, margin_px: [u32; 2]) -> Shot {
    let k = K.with_margin(margin_px);
    let poses = motion(time_s);
    let size = [k.width as usize, k.height as usize];
    let pixels: Vec<_> = (0..size[0] * size[1])
        .into_par_iter()
        .map(|i| {
            let (x, y) = ((i % size[0]) as f64, (i / size[0]) as f64);
            let rays = (DVec2::new(x, y), HOST_SIDE, DVec2::splat(0.5));
            let color = pixel(|px| k.ray(px), world, &poses, rays);
            let way = poses[0].rotation * k.ray(DVec2::new(x + 0.5, y + 0.5));
            let (_, depth_m, body) = world.cast(poses[0].translation_m, way, &poses[1..]);
            (color.map(|c| srgb8(c as f32)), depth_m as f32, body as u32)
        })
        .collect();
    Shot {
        rgb: pixels.iter().flat_map(|p| p.0).collect(),
        depth_m: pixels.iter().map(|p| p.1).collect(),
        body: pixels.iter().map(|p| p.2).collect(),
        size,
    }
}

/// Mean of `side` by `side` rays of a pixel, each at that place of its share.
fn pixel(
    ray: impl Fn(DVec2) -> DVec3,
    world: &World,
    poses: &[Pose],
    (corner, side, place): (DVec2, u32, DVec2),
) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for i in 0..side * side {
        let at = (DVec2::new(f64::from(i % side), f64::from(i / side)) + place) / f64::from(side);
        let way = poses[0].rotation * ray(corner + at);
        let (color, ..) = world.cast(poses[0].translation_m, way, &poses[1..]);
        (0..3).for_each(|c| sum[c] += color[c]);
    }
    sum.map(|s| s / f64::from(side * side))
}

/// What a camera would have delivered: every row at its own time, `INSTANTS` times where it integrates.
pub fn truth(
    world: &World,
    motion: Motion<'_>,
    shutter: &ShutterTiming,
    looks: Option<Looks<'_>>,
) -> Vec<u8> {
    let (w, h) = (K.width as usize, K.height as usize);
    let count = if shutter.exposure_time_s > 0.0 { INSTANTS } else { 1 };
    let rows: Vec<Vec<u8>> = (0..h)
        .into_par_iter()
        .map(|y| {
            let line = f64::from(shutter.scan_order.line_of(0, y as u32, K.width, K.height));
            let start_s = shutter.start_s + shutter.readout_time_s * line / h as f64;
            let mut sums = vec![[0.0; 3]; w];
            for i in 0..count {
                let share = if count == 1 { 0.5 } else { (f64::from(i) + 0.5) / f64::from(count) };
                let poses = motion(start_s + share * shutter.exposure_time_s);
                // What rests would meet the same few rays at every instant: a lattice that fills the pixel evenly.
                let lattice = DVec2::new(0.754_877_666, 0.569_840_291);
                let place = if count == 1 { DVec2::splat(0.5) } else { (f64::from(i) * lattice).fract() };
                for (x, sum) in sums.iter_mut().enumerate() {
                    let corner = (DVec2::new(x as f64, y as f64), SIDES[usize::from(count > 1)], place);
                    let color = match looks {
                        None => pixel(|px| K.ray(px), world, &poses, corner),
                        Some(looks) => [0, 1, 2].map(|c| pixel(|px| looks(px, c), world, &poses, corner)[c]),
                    };
                    (0..3).for_each(|c| sum[c] += color[c] / f64::from(count));
                }
            }
            sums.iter().flat_map(|s| s.map(|c| srgb8(c as f32))).collect()
        })
        .collect();
    rows.concat()
}

/// Where a lens lets pixels look.
pub fn through(lens: &Lens, px: DVec2) -> DVec3 {
    let mut at = px;
    let centre = DVec2::new(lens.intrinsics().cx, lens.intrinsics().cy);
    loop {
        if let Some(ideal) = lens.undistort_px(at) {
            return lens.intrinsics().ray(ideal);
        }
        at = centre + (at - centre) * 0.999;
    }
}

pub fn shutter(exposure_time_s: f64) -> ShutterTiming {
    ShutterTiming {
        start_s: 0.0,
        exposure_time_s,
        readout_time_s: READOUT_S,
        scan_order: ScanOrder::TopToBottom,
        line_count: K.height,
    }
}

/// Decibels between two 8-bit pictures.
pub fn psnr(a: &[u8], b: &[u8]) -> f64 {
    assert_eq!(a.len(), b.len());
    let squares: f64 = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
    10.0 * (255.0 * 255.0 * a.len() as f64 / squares.max(1e-9)).log10()
}

/// Kinds of motion: the camera's position, m, and its yaw, pitch and roll, rad.
pub fn camera_motion(name: &str, t: f64) -> Pose {
    let shake = |hz: f64| {
        let (a, b) = ((TAU * hz * t).sin(), (TAU * hz * t + 1.3).sin());
        (DVec3::new(0.004 * a, 0.003 * b, 0.002 * a), [0.016 * a, 0.022 * b, 0.006 * a])
    };
    let (translation_m, [yaw, pitch, roll]) = match name {
        "pan 1.2" => (DVec3::ZERO, [1.2 * t, 0.0, 0.0]),
        "pan 2.5" => (DVec3::ZERO, [2.5 * t, 0.0, 0.0]),
        "pan 4" => (DVec3::ZERO, [4.0 * t, 0.0, 0.0]),
        "walk 5 Hz" => {
            let w = (TAU * 5.0 * t + 0.7).sin();
            (DVec3::new(0.03 * w, 0.02 * w, 1.2 * t), [0.04 * w, 0.05 * (TAU * 5.0 * t).sin(), 0.02 * w])
        }
        "vibration 18 Hz" => shake(18.0),
        "vibration 25 Hz" => shake(25.0),
        "still" => (DVec3::ZERO, [0.0; 3]),
        other => panic!("no motion {other}"),
    };
    let rotation = DQuat::from_euler(EulerRot::YXZ, yaw + 0.08, pitch + 0.05, roll);
    Pose { rotation, translation_m }
}
