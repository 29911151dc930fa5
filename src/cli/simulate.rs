//! `shutterbug simulate CAPTURE --out DIR`.

use std::collections::VecDeque;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::args::{PlaneName, Simulate};
use super::interrupt::Interrupt;
use super::timings::Timings;
use crate::capture::Capture;
use crate::effects::ExposureControl;
use crate::engine::{Engine, EngineOptions, Frame, FrameRequest, Planes, Ticket};
use crate::error::{Error, Result};
use crate::formats::{preset, read_capture};
use crate::gpu::{Context, ContextOptions, DeviceChoice, Validation};
use crate::plane::{read_rgb8, write_atomic, write_exr_plane, write_png_atomic};

/// Frames that wait for the disk at most; more would only take memory.
const WRITE_QUEUE: usize = 4;
/// Time between two lines of progress in a log.
const LOG_INTERVAL: Duration = Duration::from_secs(5);

/// Runs the command.
pub fn run(args: &Simulate) -> Result<()> {
    let preset = args.preset.as_deref().map(preset).transpose()?;
    let capture = read_capture(&args.capture, args.camera.as_deref(), preset)?;
    fs::create_dir_all(&args.out).map_err(|e| Error::io(&args.out, "create the folder", e))?;
    let todo = start_run(args, &capture)?;
    write_atomic(&args.out.join("instants.csv"), instants_csv(&capture).as_bytes())?;
    let total = capture.frames.len();
    if todo.is_empty() {
        eprintln!("all {total} frames are there already: {}", args.out.display());
        return Ok(());
    }
    let device = DeviceChoice::from_option_or_environment(args.device.as_deref());
    let validation = match std::env::var_os("SHUTTERBUG_VALIDATION") {
        Some(on) if on == "1" => Validation::Required,
        _ => Validation::Off,
    };
    let context = Context::new(&ContextOptions { device, validation })?;
    let requests: Vec<_> = todo.iter().map(|&f| request(args, &capture, f)).collect();
    // The set-up's effects: from here on the path is the true camera's.
    let capture = Capture { trajectory: capture.true_trajectory(), ..capture };
    let options = EngineOptions {
        method: args.engine_method(),
        samples: args.samples,
        frames_in_flight: args.batch.unwrap_or(args.frames_in_flight),
        planes: !args.planes.is_empty(),
        ..EngineOptions::default()
    };
    let camera = &capture.true_intrinsics();
    let size = [camera.width, camera.height];
    let stems: Vec<_> = (0..total).map(|f| stem(&capture, f)).collect();
    let (scene, path) = (Arc::new(capture.scene), Arc::new(capture.trajectory));
    let mut engine = Engine::new(&context, scene, path, *camera, options, &requests)?;
    let mut timings = Timings::default();
    let start = Instant::now();
    let done = render_all((args, &stems), &mut engine, &requests, &mut timings)?;
    if let Some(batch) = args.batch {
        let rate = done as f64 / start.elapsed().as_secs_f64();
        eprintln!("{rate:.2} frames a second, on disk, with {batch} in flight");
    }
    report_validation(&context)?;
    if args.timings {
        timings.finish(&args.out, &context, &args.method_name(), size, args.samples)?;
    }
    if done < requests.len() {
        return Err(Error::Interrupted { done: total - requests.len() + done, total });
    }
    eprintln!("{done} frames written to {}", args.out.display());
    Ok(())
}

/// With `SHUTTERBUG_VALIDATION=1` any message of the layer is a failure.
fn report_validation(context: &Context) -> Result<()> {
    let messages = context.validation_messages();
    match messages.first() {
        None => Ok(()),
        Some(first) => Err(Error::Vulkan {
            call: "the validation layer",
            result: format!("{} messages, the first: {first}", messages.len()),
        }),
    }
}

fn request(args: &Simulate, capture: &Capture, frame: usize) -> FrameRequest {
    FrameRequest {
        index: frame as u32,
        shutter: capture.shutter(frame),
        frame_interval_s: capture.camera.frame_period_s,
        seed: args.seed,
        settings: capture.camera.settings.clone(),
        static_camera: capture.camera.static_camera,
        planes: !args.planes.is_empty(),
        statistics: false,
    }
}

/// Submits, collects and hands to the writer; returns how many frames are on disk. Stops early when asked to.
fn render_all(
    (args, stems): (&Simulate, &[String]),
    engine: &mut Engine,
    requests: &[FrameRequest],
    timings: &mut Timings,
) -> Result<usize> {
    let interrupt = Interrupt::listen();
    let progress = Progress::new(requests.len() as u64);
    std::thread::scope(|scope| {
        let (to_disk, frames) = sync_channel::<Frame>(WRITE_QUEUE);
        let writer = scope.spawn(move || {
            let mut written = 0;
            for frame in frames {
                write_frame(args, &stems[frame.index as usize], &frame)?;
                written += 1;
            }
            Ok(written)
        });
        let mut progress = progress;
        let control =
            ExposureControl::new(&requests[0].settings).map(|control| Exposure { control, args, stems });
        let rendered = feed(engine, requests, &interrupt, timings, (&to_disk, &mut progress, control));
        drop(to_disk);
        let written = writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        progress.finish();
        // A full disk makes both sides fail; the writer knows why.
        let written = written?;
        rendered.map(|()| written)
    })
}

fn feed(
    engine: &mut Engine,
    requests: &[FrameRequest],
    interrupt: &Interrupt,
    timings: &mut Timings,
    (to_disk, progress, mut exposure): (&SyncSender<Frame>, &mut Progress, Option<Exposure<'_>>),
) -> Result<()> {
    let mut in_flight: VecDeque<Ticket> = VecDeque::new();
    let mut next = requests.iter().peekable();
    loop {
        while in_flight.len() < engine.frames_in_flight() && !interrupt.requested() {
            let Some(request) = next.peek() else { break };
            let exposed = match &mut exposure {
                Some(exposure) => {
                    // What it answers to is in flight.
                    let Some(exposed) = exposure.request(request, requests)? else { break };
                    Some(exposed)
                }
                None => None,
            };
            in_flight.push_back(engine.submit(exposed.as_ref().unwrap_or(request))?);
            next.next();
        }
        let Some(ticket) = in_flight.pop_front() else { return Ok(()) };
        let frame = engine.collect(ticket)?;
        if let Some(exposure) = &mut exposure {
            exposure.control.meter(frame.index as usize, &frame.picture);
        }
        timings.add(&frame);
        progress.step();
        if to_disk.send(frame).is_err() {
            // The writer has stopped and will say why.
            return Ok(());
        }
    }
}

/// Automatic exposure over the frames of a run.
struct Exposure<'a> {
    control: ExposureControl,
    args: &'a Simulate,
    stems: &'a [String],
}

impl Exposure<'_> {
    /// The request with its gain; `None` until all frames that it answers to were metered. Those of an interrupted run are
    /// read from the disk.
    fn request(&mut self, request: &FrameRequest, requests: &[FrameRequest]) -> Result<Option<FrameRequest>> {
        let index = request.index as usize;
        for frame in self.control.missing(index).collect::<Vec<_>>() {
            if requests.iter().any(|r| r.index as usize == frame) {
                return Ok(None);
            }
            let picture = read_rgb8(&self.args.out.join(format!("{}.png", self.stems[frame])))?;
            self.control.meter(frame, &picture);
        }
        let settings = self.control.settings(index, &request.settings)?;
        Ok(Some(FrameRequest { settings, ..request.clone() }))
    }
}

fn write_frame(args: &Simulate, stem: &str, frame: &Frame) -> Result<()> {
    if let Some(planes) = &frame.planes {
        for plane in &args.planes {
            write_plane(args, stem, planes, *plane)?;
        }
    }
    // Last, as its presence says that the frame is complete.
    write_png_atomic(&args.out.join(format!("{stem}.png")), &frame.picture)
}

fn write_plane(args: &Simulate, stem: &str, planes: &Planes, plane: PlaneName) -> Result<()> {
    let (folder, source, names): (_, _, &[&str]) = match plane {
        PlaneName::Color => ("color", &planes.color, &["R", "G", "B", "A"]),
        PlaneName::Motion => ("motion", &planes.motion_px, &["forward.u", "forward.v"]),
        PlaneName::Depth => ("depth", &planes.depth_m, &["Z"]),
    };
    let folder = args.out.join(folder);
    fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, "create the folder", e))?;
    write_exr_plane(&folder.join(format!("{stem}.exr")), source, names)
}

/// Name of a frame without extension, as `frames.csv` has it: results lie under the real frames' names.
fn stem(capture: &Capture, frame: usize) -> String {
    let name = Path::new(&capture.frames[frame].filename);
    name.file_stem().map_or_else(|| format!("{frame:06}"), |s| s.to_string_lossy().into_owned())
}

/// Writes what the frames depend on into `simulate.json`, and returns the frames to be rendered: all, or with
/// `--resume` those that are not there, provided that those that are come from the same run.
fn start_run(args: &Simulate, capture: &Capture) -> Result<Vec<usize>> {
    let path = args.out.join("simulate.json");
    let manifest = manifest(args, capture)?;
    let all = 0..capture.frames.len();
    let path_of = |f: usize| args.out.join(format!("{}.png", stem(capture, f)));
    let there = |f: &usize| path_of(*f).is_file();
    if args.resume && !path.exists() && all.clone().any(|f| there(&f)) {
        let found = "frames without a simulate.json beside them";
        return Err(Error::input(
            &args.out,
            None,
            found,
            "the folder of an interrupted run, as --resume was given",
        ));
    }
    if args.resume && path.exists() {
        let before = fs::read_to_string(&path).map_err(|e| Error::io(&path, "read", e))?;
        if before != manifest {
            let found = "frames of a run with other input or options";
            return Err(Error::input(
                &path,
                None,
                found,
                "the same as now; use another --out, or leave out --resume",
            ));
        }
        return Ok(all.filter(|f| !there(f)).collect());
    }
    // Frames of an earlier run must not be taken for this one's.
    for frame in all.clone() {
        let old = path_of(frame);
        if old.exists() {
            fs::remove_file(&old).map_err(|e| Error::io(&old, "remove the earlier run's", e))?;
        }
    }
    write_atomic(&path, manifest.as_bytes())?;
    Ok(all.collect())
}

/// Everything that decides how the frames look, as JSON. Files count by a hash of their bytes.
fn manifest(args: &Simulate, capture: &Capture) -> Result<String> {
    let mut files = vec![capture.camera.path.clone()];
    let fixed = ["scene.obj", "scene.mtl", "trajectory.tum", "frames.csv", "lights.toml"];
    files.extend(fixed.iter().map(|f| args.capture.join(f)).filter(|f| f.is_file()));
    files.extend(capture.scene.textures.iter().map(|t| t.path.clone()));
    files.extend(
        capture.scene.objects.iter().filter_map(|o| o.trajectory.as_ref()).map(|t| t.path().to_owned()),
    );
    files.dedup();
    let mut hashes = serde_json::Map::new();
    for file in files {
        let bytes = fs::read(&file).map_err(|e| Error::io(&file, "read", e))?;
        hashes.insert(file.display().to_string(), format!("{:016x}", fnv1a(&bytes)).into());
    }
    let planes: Vec<_> = args.planes.iter().map(|p| format!("{p:?}").to_lowercase()).collect();
    let value = serde_json::json!({
        "shutterbug": env!("CARGO_PKG_VERSION"),
        "method": format!("{:?}", args.engine_method()),
        "samples": args.samples,
        "preset": args.preset,
        "seed": args.seed,
        "planes": planes,
        "files_fnv1a": hashes,
    });
    Ok(serde_json::to_string_pretty(&value).expect("strings and numbers serialize") + "\n")
}

/// FNV-1a, 64 bits: tells changed files apart; no defence against forgery is needed here.
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, &b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
}

/// When each frame was taken: start of the first line's exposure, middle, end of the last line's, and the camera's
/// pose at the middle.
fn instants_csv(capture: &Capture) -> String {
    let mut text = String::from(
        "#frame,first_line_start [ns],middle [ns],last_line_end [ns],middle_tx [m],ty,tz,qx,qy,qz,qw\n",
    );
    for frame in 0..capture.frames.len() {
        let shutter = capture.shutter(frame);
        let ns = |time_s: f64| capture.epoch_ns + (time_s * 1e9).round() as i64;
        let pose = capture.world_from_camera(frame, shutter.middle_s());
        let (t, q) = (pose.translation_m, pose.rotation);
        text += &format!(
            "{},{},{},{},{:.9},{:.9},{:.9},{:.12},{:.12},{:.12},{:.12}\n",
            stem(capture, frame),
            capture.frames[frame].timestamp_ns,
            ns(shutter.middle_s()),
            ns(shutter.end_s()),
            t.x,
            t.y,
            t.z,
            q.x,
            q.y,
            q.z,
            q.w,
        );
    }
    text
}

/// A bar on a terminal, plain lines in a log.
struct Progress {
    bar: ProgressBar,
    last_line: Instant,
    start: Instant,
    done: u64,
    total: u64,
}

impl Progress {
    fn new(total: u64) -> Self {
        let bar = ProgressBar::new(total);
        let style = ProgressStyle::with_template("{bar:40} {pos}/{len} frames, {per_sec}, {eta} left");
        bar.set_style(style.expect("a constant template"));
        let now = Instant::now();
        Self { bar, last_line: now, start: now, done: 0, total }
    }

    fn step(&mut self) {
        self.done += 1;
        self.bar.inc(1);
        if self.bar.is_hidden() && self.last_line.elapsed() >= LOG_INTERVAL {
            self.last_line = Instant::now();
            let rate = self.done as f64 / self.start.elapsed().as_secs_f64();
            let left_s = (self.total - self.done) as f64 / rate;
            eprintln!("{}/{} frames, {rate:.2} a second, {left_s:.0} s left", self.done, self.total);
        }
    }

    fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
