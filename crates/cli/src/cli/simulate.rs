//! `shutterbug simulate CAPTURE --out DIR`.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::args::{PlaneName, Simulate};
use super::begin::{Begin, plane_folder, stem};
use super::darkness::Darkness;
use super::description::Description;
use super::interrupt::Interrupt;
use super::presets::find_preset;
use super::terminal::say;
use super::timings::Timings;
use crate::formats::read_capture;
use shutterbug::capture::Capture;
use shutterbug::chain::View;
use shutterbug::effects::ExposureControl;
use shutterbug::engine::{Engine, EngineOptions, Frame, FrameRequest, Planes, Ticket};
use shutterbug::error::{Error, Result, counted};
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, Validation};
use shutterbug::plane::{read_rgb8, write_exr_plane, write_png_atomic};
use shutterbug_diagnose::out::{Out, OutRules, make_folder};

/// Frames that wait for the disk at most; more would only take memory.
const WRITE_QUEUE: usize = 4;
/// Time between two lines of progress in a log.
const LOG_INTERVAL: Duration = Duration::from_secs(5);

/// Runs the command.
pub fn run(args: &Simulate) -> Result<()> {
    let of_name = |name: &String| find_preset(name, args.profiles.as_deref(), "--preset");
    let preset = args.preset.as_ref().map(of_name).transpose()?;
    let mut capture = read_capture(&args.capture, args.camera.as_deref(), preset.as_ref())?;
    let description = Description::of(args.description.as_deref(), &mut capture)?;
    capture.gap_warnings(0.0).iter().for_each(|gap| tracing::warn!("{gap}"));
    let out = open(args)?;
    let (todo, begin) = Begin::new(args, &capture, &out)?;
    let total = capture.frames.len();
    if todo.is_empty() {
        let all = counted(total, "frame is", "frames are");
        say(format_args!("all of {all} there already: {}", args.out.display()));
        begin.run()?;
        return begin.appear();
    }
    let device = DeviceChoice::from_option_or_environment(args.device.as_deref());
    let context = Context::new(&ContextOptions { device, validation: validation() })?;
    // Of all frames, also those that are there: how triangles are cut for one depends on all that are announced, and so
    // do the last bits of its picture.
    let mut all: Vec<_> = (0..total).map(|f| request(args, &capture, f)).collect();
    all.iter_mut().for_each(|r| r.statistics = description.relights());
    let requests: Vec<_> = todo.iter().map(|&f| all[f].clone()).collect();
    // The set-up's effects: from here on the path is the true camera's.
    let capture = Capture { trajectory: capture.true_trajectory(), ..capture };
    let options = engine_options(args);
    let camera = &capture.true_intrinsics();
    let size = [camera.width, camera.height];
    let stems: Vec<_> = (0..total).map(|f| stem(&capture, f)).collect();
    let (scene, path) = (Arc::new(capture.scene), Arc::new(capture.trajectory));
    let counts = [scene.indices.len() / 3, scene.objects.len()];
    let engine = Engine::new(&context, scene, path, *camera, options, &all);
    let mut engine = engine.map_err(|e| of_scene(e, &args.capture, counts))?;
    let (mut timings, mut darkness) = (Timings::default(), Darkness::default());
    let start = Instant::now();
    let mut done = |frame: &mut Frame| {
        let shutter = all[frame.index as usize].shutter;
        let view = View { intrinsics: *camera, shutter, frame: frame.index, seed: args.seed };
        description.relight(frame, &requests, view, &stems[frame.index as usize])?;
        darkness.look(frame, &all[frame.index as usize].settings, &view);
        Ok(())
    };
    let done = render_all((args, &stems, &begin), &mut engine, &requests, &mut timings, &mut done)?;
    say_rate(args, done, start);
    darkness.said(&stems).iter().for_each(|dark| tracing::warn!("{dark}"));
    report_validation(&context)?;
    if args.timings {
        timings.finish(&args.out, &context, &args.method_name(), size, args.samples)?;
    }
    if done < requests.len() {
        return Err(Error::Interrupted { done: total - requests.len() + done, total });
    }
    out.check_same()?;
    say(format_args!("{} written to {}", counted(done, "frame", "frames"), args.out.display()));
    Ok(())
}

fn open(args: &Simulate) -> Result<Out> {
    let rules = OutRules {
        command: "simulate",
        inputs: &[&args.capture],
        overwrite: args.overwrite,
        goes_on: args.resume,
    };
    Out::open(&args.out, &rules)
}

fn engine_options(args: &Simulate) -> EngineOptions {
    EngineOptions {
        method: args.engine_method(),
        samples: args.samples,
        frames_in_flight: args.batch.unwrap_or(args.frames_in_flight),
        planes: !args.planes.is_empty(),
        ..EngineOptions::default()
    }
}

/// With `--batch`: how many frames a second came to the disk since `start`.
fn say_rate(args: &Simulate, done: usize, start: Instant) {
    let Some(batch) = args.batch else { return };
    let rate = done as f64 / start.elapsed().as_secs_f64();
    say(format_args!("{rate:.2} frames a second, on disk, with {batch} in flight"));
}

/// The layer is asked for by `SHUTTERBUG_VALIDATION=1`.
fn validation() -> Validation {
    match std::env::var_os("SHUTTERBUG_VALIDATION") {
        Some(on) if on == "1" => Validation::Required,
        _ => Validation::Off,
    }
}

/// A limit of the device says more with the file that went beyond it.
fn of_scene(error: Error, capture: &Path, [triangles, objects]: [usize; 2]) -> Error {
    if !matches!(error, Error::Limit { .. } | Error::OutOfMemory { .. }) {
        return error;
    }
    let of = [counted(triangles, "triangle", "triangles"), counted(objects, "object", "objects")];
    let hint = format!("; the scene has {} in {}", of[0], of[1]);
    Error::At { path: capture.join("scene.obj"), line: None, problem: Box::new(error), hint }
}

/// With `SHUTTERBUG_VALIDATION=1` any message of the layer is a failure.
fn report_validation(context: &Context) -> Result<()> {
    let messages = context.validation_messages();
    match messages.first() {
        None => Ok(()),
        Some(first) => Err(Error::Vulkan {
            call: "the validation layer",
            result: format!("{}, the first: {first}", counted(messages.len(), "message", "messages")),
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
    (args, stems, begin): (&Simulate, &[String], &Begin<'_>),
    engine: &mut Engine,
    requests: &[FrameRequest],
    timings: &mut Timings,
    done: &mut dyn FnMut(&mut Frame) -> Result<()>,
) -> Result<usize> {
    let interrupt = Interrupt::listen();
    let progress = Progress::new(requests.len() as u64);
    std::thread::scope(|scope| {
        let (to_disk, frames) = sync_channel::<Frame>(WRITE_QUEUE);
        let write_all = move || {
            let mut written = 0;
            for frame in frames {
                // Now there is a device, memory, and something to put in the place of what an earlier run made.
                begin.run()?;
                write_frame(args, &stems[frame.index as usize], &frame)?;
                begin.appear()?;
                written += 1;
            }
            Ok(written)
        };
        let writer = std::thread::Builder::new().spawn_scoped(scope, write_all);
        let writer = writer.map_err(|e| Error::Threads { reason: e.to_string() })?;
        let mut progress = progress;
        let control =
            ExposureControl::new(&requests[0].settings).map(|control| Exposure { control, args, stems });
        let rendered = feed(engine, requests, &interrupt, timings, done, (&to_disk, &mut progress, control));
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
    done: &mut dyn FnMut(&mut Frame) -> Result<()>,
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
        let mut frame = engine.collect(ticket)?;
        done(&mut frame)?;
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
    /// The request with its gain; `None` until all frames that it answers to were metered. Those of an interrupted run
    /// are read from the disk.
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
    let (source, names): (_, &[&str]) = match plane {
        PlaneName::Color => (&planes.color, &["R", "G", "B", "A"]),
        PlaneName::Motion => (&planes.motion_px, &["forward.u", "forward.v"]),
        PlaneName::Depth => (&planes.depth_m, &["Z"]),
    };
    let folder = args.out.join(plane_folder(plane));
    make_folder(&folder)?;
    write_exr_plane(&folder.join(format!("{stem}.exr")), source, names)
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
            say(format_args!("{}/{} frames, {rate:.2} a second, {left_s:.0} s left", self.done, self.total));
        }
    }

    fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
