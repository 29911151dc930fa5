//! Small captures made up here: a room of coloured patches, a camera that pans and tilts, and frames by the
//! accumulation reference and the pixel chain (never by the path that fits use).
#![allow(dead_code)]

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use shutterbug::capture::Capture;
use shutterbug::engine::{AccumulationOptions, Engine, EngineOptions, FrameRequest, Method};
use shutterbug::gpu::Context;
use shutterbug::plane::write_png_atomic;
use shutterbug_diagnose::diagnose::{DiagnoseOptions, Diagnosis, Progress, Report, diagnose};

use crate::dice_support::Dice;

pub const PERIOD_S: f64 = 0.04;
pub const CAMERA: &str =
    "width = 128\nheight = 96\nfx = 110.0\nfy = 110.0\ncx = 64.4\ncy = 47.7\nframe_period_s = 0.04\n";

/// A half-open box around the camera whose sides are patches of random colours.
fn write_scene(folder: &Path, dice: &mut Dice) {
    let (mut obj, mut mtl) = (String::from("mtllib scene.mtl\n"), String::new());
    for m in 0..24 {
        let [r, g, b] = [0, 1, 2].map(|_| 0.03 + 0.75 * dice.roll().powi(2));
        writeln!(mtl, "newmtl m{m}\nKd {r} {g} {b}").unwrap();
    }
    let mut vertices = 0;
    let mut side = |obj: &mut String, dice: &mut Dice, at: &dyn Fn(f64, f64) -> [f64; 3]| {
        const CELLS: usize = 11;
        for i in 0..CELLS {
            for j in 0..CELLS {
                let edge = |k: usize| -1.0 + 2.0 * k as f64 / CELLS as f64;
                for (a, b) in [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)] {
                    let [x, y, z] = at(edge(a), edge(b));
                    writeln!(obj, "v {x} {y} {z}").unwrap();
                }
                let m = (dice.roll() * 24.0) as usize;
                let v = vertices;
                writeln!(obj, "usemtl m{m}\nf {} {} {} {}", v + 1, v + 2, v + 3, v + 4).unwrap();
                vertices += 4;
            }
        }
    };
    // The camera looks along +x; z is up.
    side(&mut obj, dice, &|a, b| [3.0, 3.0 * a, 3.0 * b]);
    side(&mut obj, dice, &|a, b| [3.0 * a, 3.0, 3.0 * b]);
    side(&mut obj, dice, &|a, b| [3.0 * a, -3.0, 3.0 * b]);
    side(&mut obj, dice, &|a, b| [3.0 * a, 3.0 * b, 3.0]);
    side(&mut obj, dice, &|a, b| [3.0 * a, 3.0 * b, -3.0]);
    side(&mut obj, dice, &|a, b| [-3.0, 3.0 * a, 3.0 * b]);
    // A pillar near by: surfaces part before it.
    side(&mut obj, dice, &|a, b| [1.6, 0.3 + 0.15 * a, 1.2 * b]);
    fs::write(folder.join("scene.obj"), obj).unwrap();
    fs::write(folder.join("scene.mtl"), mtl).unwrap();
}

fn write_path(folder: &Path, frames: usize, speed: f64, dice: &mut Dice) {
    let phases = [0, 1, 2, 3].map(|_| TAU * dice.roll());
    let mut text = String::new();
    let end_s = (frames as f64 + 3.0) * PERIOD_S;
    let steps = ((end_s + 2.0 * PERIOD_S) / 0.002) as usize;
    for i in 0..=steps {
        let t = -2.0 * PERIOD_S + 0.002 * i as f64;
        let turn =
            |amplitude: f64, hertz: f64, phase: f64| speed * amplitude * (TAU * hertz * t + phase).sin();
        let (pan, tilt) = (turn(0.24, 1.3, phases[0]), turn(0.16, 1.7, phases[1]));
        // Optical axes (x right, y down, z forward) for a look along world +x, then tilt and pan.
        let base = glam::DQuat::from_mat3(&glam::DMat3::from_cols(
            glam::DVec3::NEG_Y,
            glam::DVec3::NEG_Z,
            glam::DVec3::X,
        ));
        let q = glam::DQuat::from_rotation_z(pan) * base * glam::DQuat::from_rotation_x(tilt);
        let (y, z) = (turn(0.1, 0.9, phases[2]), turn(0.05, 1.1, phases[3]));
        writeln!(text, "{:.6} 0 {y:.9} {z:.9} {:.12} {:.12} {:.12} {:.12}", 100.0 + t, q.x, q.y, q.z, q.w)
            .unwrap();
    }
    fs::write(folder.join("trajectory.tum"), text).unwrap();
    let mut csv = String::from("#timestamp [ns],filename\n");
    for f in 0..frames {
        writeln!(csv, "{},{f:06}.png", 100_000_000_000_i64 + 40_000_000 * f as i64).unwrap();
    }
    fs::write(folder.join("frames.csv"), csv).unwrap();
}

/// Frames of a capture that [`make`] makes.
pub const FRAMES: usize = 9;

/// A capture whose real frames have the effects of `hidden` (tables of `camera.toml`); `camera.toml` has those of
/// `known`.
pub fn make(
    context: &Arc<Context>,
    folder: &Path,
    hidden: &str,
    known: &str,
    speed: f64,
    seed: u64,
) -> Capture {
    make_by(context, folder, (CAMERA, FRAMES), [hidden, known], speed, seed)
}

/// The same by another camera than [`CAMERA`], or of another number of frames than [`FRAMES`].
pub fn make_by(
    context: &Arc<Context>,
    folder: &Path,
    (camera, frames): (&str, usize),
    [hidden, known]: [&str; 2],
    speed: f64,
    seed: u64,
) -> Capture {
    let mut dice = Dice(seed);
    write_scene(folder, &mut dice);
    write_path(folder, frames, speed, &mut dice);
    fs::write(folder.join("camera.toml"), format!("{camera}{hidden}")).unwrap();
    let capture = Capture::read(folder, None).unwrap();
    fs::create_dir_all(folder.join("real")).unwrap();
    for (f, picture) in frames_of(context, &capture, reference()).into_iter().enumerate() {
        write_png_atomic(&folder.join(format!("real/{f:06}.png")), &picture).unwrap();
    }
    fs::write(folder.join("camera.toml"), format!("{camera}{known}")).unwrap();
    Capture::read(folder, None).unwrap()
}

pub fn reference() -> Method {
    Method::Accumulation(AccumulationOptions { step_px: 0.3, ..AccumulationOptions::default() })
}

/// All frames of a capture as its camera delivers them.
pub fn frames_of(
    context: &Arc<Context>,
    capture: &Capture,
    method: Method,
) -> Vec<shutterbug::plane::Plane<u8>> {
    let requests: Vec<FrameRequest> = (0..capture.frames.len())
        .map(|f| FrameRequest {
            index: f as u32,
            shutter: capture.shutter(f),
            frame_interval_s: PERIOD_S,
            seed: 4711,
            settings: capture.camera.settings.clone(),
            static_camera: capture.camera.static_camera,
            planes: false,
            statistics: false,
        })
        .collect();
    let (scene, path) = (Arc::new(capture.scene.clone()), Arc::new(capture.true_trajectory()));
    let options = EngineOptions { method, ..EngineOptions::default() };
    let mut engine =
        Engine::new(context, scene, path, capture.true_intrinsics(), options, &requests).unwrap();
    requests.iter().map(|r| engine.render(r).unwrap().picture).collect()
}

struct Silent;

impl Progress for Silent {
    fn step(&mut self, _: &str, _: &str, _: usize, _: usize) {}
}

/// Diagnoses with everything, or without some candidates.
pub fn run(context: &Arc<Context>, capture: &Capture, without: &[&str]) -> Diagnosis {
    run_by(context, capture, without, DiagnoseOptions::default())
}

/// The same with a description that is known to be right.
pub fn run_exact(context: &Arc<Context>, capture: &Capture, without: &[&str]) -> Diagnosis {
    let exact = DiagnoseOptions { scene_exact: true, poses_exact: true, ..DiagnoseOptions::default() };
    run_by(context, capture, without, exact)
}

fn run_by(
    context: &Arc<Context>,
    capture: &Capture,
    without: &[&str],
    options: DiagnoseOptions,
) -> Diagnosis {
    let without = without.iter().map(|w| (*w).to_owned()).collect();
    let options = DiagnoseOptions { without, ..options };
    diagnose(context, capture, &options, &mut Silent).unwrap_or_else(|e| panic!("{e}"))
}

/// Names of the effects found, sorted.
pub fn names(report: &Report) -> Vec<&str> {
    let mut names: Vec<_> = report.effects.iter().map(|e| e.name.as_str()).collect();
    names.sort_unstable();
    names
}

/// Value and 95 % interval of a parameter that was found.
pub fn parameter(report: &Report, effect: &str, name: &str) -> (f64, [f64; 2]) {
    let found = report.effects.iter().find(|e| e.name == effect);
    let found = found.unwrap_or_else(|| panic!("no {effect} among {:?}", names(report)));
    let p = &found.parameters[name];
    let ci = p.ci95.as_ref().unwrap();
    (p.value.as_f64().unwrap(), [ci[0].as_f64().unwrap(), ci[1].as_f64().unwrap()])
}

/// Checks a parameter: within `share` of the truth.
pub fn near(report: &Report, effect: &str, name: &str, truth: f64, share: f64) {
    let (value, [from, to]) = parameter(report, effect, name);
    eprintln!("{effect}.{name} = {value} [{from}, {to}], true {truth}");
    assert!((value / truth - 1.0).abs() < share, "{effect}.{name} = {value}, true {truth}");
    let room = 0.5 * (to - from).max(0.01 * truth.abs());
    assert!(from - room <= truth && truth <= to + room, "{truth} is far outside [{from}, {to}]");
}
