//! Against a path tracer: `cargo bench --bench tracer`. The frames of `../shared/data/cycles-dev` took one about 0.35 s
//! each on two threads (an upper bound: the machine was busy), at 16 samples a pixel. Ours for the same captures with
//! the answer's camera, each compared with many renders as the truth. Writes `target/bench/tracer.md`.
#![allow(clippy::unwrap_used)]

#[path = "measured/mod.rs"]
mod measured;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use shutterbug::capture::Capture;
use shutterbug::chain::Settings;
use shutterbug::engine::{
    AccumulationOptions, Engine, EngineOptions, ExactOptions, FastOptions, FrameRequest, Method, PaperOptions,
};
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, Validation};
use shutterbug::plane::metrics::mean_absolute_difference;
use shutterbug::plane::{Plane, read_rgb8};

/// Of the path tracer, ms a frame.
const TRACER_MS: f64 = 350.0;
/// Renders of the truth.
const TRUTH: u32 = 128;
/// How often the three frames of a capture are timed.
const REPEATS: usize = 5;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if arguments.iter().any(|a| a == "--test" || a == "--list") {
        return;
    }
    if std::env::var_os("LP_NUM_THREADS").is_none() {
        let again = std::env::current_exe().unwrap();
        let done = Command::new(again).args(&arguments[1..]).env("LP_NUM_THREADS", "2").status().unwrap();
        std::process::exit(done.code().unwrap_or(1));
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let data = root.join("../shared/data/cycles-dev");
    if !data.is_dir() {
        return eprintln!("SKIPPED tracer: ../shared/data/cycles-dev is absent");
    }
    let device = DeviceChoice::from_option_or_environment(None);
    let context = match Context::new(&ContextOptions { device, validation: Validation::Off }) {
        Ok(context) => context,
        Err(error) => return eprintln!("SKIPPED tracer: {error}"),
    };
    let mut text = format!(
        "Device: {}, 2 threads. Error: mean absolute difference from {TRUTH} renders of 16 samples, levels of 255.\n\
         \ncapture | who | error | ms a frame | times faster\n---|---|---|---|---\n",
        context.info().name
    );
    let mut bars = Vec::new();
    for name in ["d01", "d02", "d08"] {
        capture(&context, &data.join(name), name, (&mut text, &mut bars));
    }
    println!("{text}");
    std::fs::create_dir_all(root.join("target/bench")).unwrap();
    std::fs::write(root.join("target/bench/tracer.md"), &text).unwrap();
    measured::write_page("tracer", &context.info().name, &text, (&bars, "ms"));
}

/// The capture's camera with the answer's shutter, as a file beside the results.
fn answered(folder: &Path, name: &str) -> PathBuf {
    let mut camera = std::fs::read_to_string(folder.join("camera.toml")).unwrap();
    let answer: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.join("answer.json")).unwrap()).unwrap();
    let effects = answer["effects"].as_array().cloned().unwrap_or_default();
    for effect in effects {
        match effect["name"].as_str().unwrap() {
            "rolling_shutter" => {
                let order = effect["direction"].as_str().unwrap();
                write!(
                    camera,
                    "\n[rolling_shutter]\nreadout_time_s = {}\nscan_order = \"{order}\"\n",
                    effect["readout_s"]
                )
                .unwrap();
            }
            "motion_blur" => {
                write!(camera, "\n[motion_blur]\nexposure_time_s = {}\n", effect["exposure_s"]).unwrap()
            }
            other => panic!("{other} is not compared here"),
        }
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/bench").join(format!("{name}.toml"));
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, camera).unwrap();
    path
}

/// Adds lines to the table and bars to the chart.
fn capture(
    context: &Arc<Context>,
    folder: &Path,
    name: &str,
    (text, bars): (&mut String, &mut Vec<(String, f64)>),
) {
    let capture = Capture::read(folder, Some(&answered(folder, name))).unwrap();
    let last = capture.frames.len() - 1;
    let frames = [last / 6, last / 2, last - 1];
    let requests: Vec<FrameRequest> = frames.iter().map(|&f| request(&capture, f)).collect();
    let truth = render(context, &capture, &requests, accumulation(TRUTH), 1).0;
    let real: Vec<_> = frames
        .iter()
        .map(|&f| read_rgb8(&folder.join("real").join(&capture.frames[f].filename)).unwrap())
        .collect();
    let mut row = |who: &str, pictures: &[Plane<u8>], ms: f64| {
        let error: f64 = pictures.iter().zip(&truth).map(|(a, b)| mean_absolute_difference(a, b)).sum();
        bars.push((format!("{name}, {who}"), ms));
        writeln!(
            text,
            "{name} | {who} | {:.3} | {ms:.1} | {:.1}",
            error / frames.len() as f64,
            TRACER_MS / ms
        )
        .unwrap();
    };
    row("path tracer", &real, TRACER_MS);
    let methods = [
        ("exact", Method::Exact(ExactOptions::default())),
        ("fast", Method::Fast(FastOptions::default())),
        ("paper", Method::Paper(PaperOptions::default())),
        ("accumulation of 16", accumulation(16)),
    ];
    for (who, method) in methods {
        let (pictures, ms) = render(context, &capture, &requests, method, REPEATS);
        row(who, &pictures, ms);
    }
}

fn accumulation(renders: u32) -> Method {
    Method::Accumulation(AccumulationOptions { renders: Some(renders), ..AccumulationOptions::default() })
}

fn request(capture: &Capture, frame: usize) -> FrameRequest {
    FrameRequest {
        index: frame as u32,
        shutter: capture.shutter(frame),
        frame_interval_s: capture.camera.frame_period_s,
        seed: 0,
        settings: Settings::default(),
        static_camera: false,
        planes: false,
        statistics: false,
    }
}

/// Pictures, and the least mean time of a round, ms a frame.
fn render(
    context: &Arc<Context>,
    capture: &Capture,
    requests: &[FrameRequest],
    method: Method,
    repeats: usize,
) -> (Vec<Plane<u8>>, f64) {
    let (scene, path) = (Arc::new(capture.scene.clone()), Arc::new(capture.trajectory.clone()));
    let options = EngineOptions { method, frames_in_flight: 1, ..EngineOptions::default() };
    let mut engine = Engine::new(context, scene, path, capture.true_intrinsics(), options, requests).unwrap();
    let pictures: Vec<_> = requests.iter().map(|r| engine.render(r).unwrap().picture).collect();
    let mut least = f64::INFINITY;
    for _ in 0..repeats {
        let start = Instant::now();
        requests.iter().for_each(|r| drop(engine.render(r).unwrap()));
        least = least.min(start.elapsed().as_secs_f64() * 1e3 / requests.len() as f64);
    }
    (pictures, least)
}
