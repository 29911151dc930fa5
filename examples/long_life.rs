//! One process, many frames: does anything grow, and does a frame stay what it was?
//!
//! `cargo run --release --example long_life -- FRAMES [REMAKES]` renders the frames of `demo/capture` at 64x48 px, with
//! noise and a shutter, over and over in one process, and makes device and engine anew so many times on the way, as a
//! host does after a device was lost. Prints resident memory, descriptors and threads ten times, and fails if one of
//! them is above what it was after the first tenth (memory: by more than 2 %), or if a frame has other bits than the
//! first time.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use shutterbug::capture::{CameraFile, Capture};
use shutterbug::engine::{Engine, EngineOptions, FrameRequest};
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, Validation};

/// What is watched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Held {
    resident_kib: u64,
    descriptors: usize,
    threads: usize,
}

impl Held {
    fn now() -> std::io::Result<Self> {
        let status = std::fs::read_to_string("/proc/self/status")?;
        let number = |key: &str| {
            let line = status.lines().find_map(|l| l.strip_prefix(key)).unwrap_or("0");
            line.split_whitespace().next().and_then(|n| n.parse::<u64>().ok()).unwrap_or(0)
        };
        let descriptors = std::fs::read_dir("/proc/self/fd")?.count();
        Ok(Self { resident_kib: number("VmRSS:"), descriptors, threads: number("Threads:") as usize })
    }

    /// Whether something has grown since.
    fn grew_since(self, before: Self) -> bool {
        self.resident_kib > before.resident_kib * 102 / 100
            || self.descriptors > before.descriptors
            || self.threads > before.threads
    }
}

fn main() -> ExitCode {
    let mut numbers = std::env::args().skip(1).filter_map(|a| a.parse::<u64>().ok());
    let (frames, remakes) = (numbers.next().unwrap_or(1000), numbers.next().unwrap_or(5));
    match run(frames, remakes) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("long_life: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(frames: u64, remakes: u64) -> Result<(), Box<dyn std::error::Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("demo/capture");
    let capture = Capture::read_with(&root, Some(&root.join("../cameras/noise.toml")), small)?;
    let requests: Vec<FrameRequest> = (0..capture.frames.len()).map(|f| request(&capture, f)).collect();
    let mut engine = engine(&capture, &requests)?;
    let mut first: Vec<Option<Vec<u8>>> = vec![None; requests.len()];
    let mut settled = None;
    for number in 0..frames {
        if remakes > 0 && number > 0 && number % (frames / (remakes + 1)).max(1) == 0 {
            engine = self::engine(&capture, &requests)?;
        }
        let at = number as usize % requests.len();
        let ticket = engine.submit(&requests[at])?;
        let picture = engine.collect(ticket)?.picture.data;
        let known = first[at].get_or_insert_with(|| picture.clone());
        if *known != picture {
            return Err(format!("frame {number} has other bits than the first time").into());
        }
        if (number + 1) % (frames / 10).max(1) == 0 {
            let now = Held::now()?;
            println!("{:>9} frames: {now:?}", number + 1);
            let before = *settled.get_or_insert(now);
            if now.grew_since(before) {
                return Err(format!("grown since {before:?}").into());
            }
        }
    }
    Ok(())
}

/// The camera at 64x48 px.
fn small(path: &Path) -> shutterbug::Result<CameraFile> {
    let mut camera = CameraFile::read(path)?;
    let k = &mut camera.intrinsics;
    let scale = [64.0 / f64::from(k.width), 48.0 / f64::from(k.height)];
    (k.fx, k.fy, k.cx, k.cy) = (k.fx * scale[0], k.fy * scale[1], k.cx * scale[0], k.cy * scale[1]);
    (k.width, k.height) = (64, 48);
    Ok(camera)
}

fn request(capture: &Capture, frame: usize) -> FrameRequest {
    FrameRequest {
        index: frame as u32,
        shutter: capture.shutter(frame),
        frame_interval_s: capture.camera.frame_period_s,
        seed: 1,
        settings: capture.camera.settings.clone(),
        static_camera: false,
        planes: false,
        statistics: false,
    }
}

/// A device and an engine of their own.
fn engine(capture: &Capture, requests: &[FrameRequest]) -> shutterbug::Result<Engine> {
    let device = DeviceChoice::from_option_or_environment(None);
    let context = Context::new(&ContextOptions { device, validation: Validation::Off })?;
    let (scene, path) = (Arc::new(capture.scene.clone()), Arc::new(capture.true_trajectory()));
    let options = EngineOptions { samples: 1, ..EngineOptions::default() };
    Engine::new(&context, scene, path, capture.true_intrinsics(), options, requests)
}
