//! Time of a diagnosis against frames and pixels, and what dominates it: `cargo bench --bench diagnose [CAPTURE]`.
//!
//! Takes a capture (else ../shared/data/cycles-dev/d01), with all and with half of its frames, and in its own size, a
//! half, a quarter and an eighth of it (real frames averaged over squares; d14 has all four sizes). Prints a line a run
//! and the time of each stage.

#[path = "measured/mod.rs"]
mod measured;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use shutterbug::capture::Capture;
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, Validation};
use shutterbug::plane::{Plane, read_rgb8, write_png_atomic};
use shutterbug_diagnose::diagnose::{DiagnoseOptions, Progress, diagnose};

/// Smallest side of frames that are tried, px.
const LEAST_SIDE_PX: usize = 90;

/// Seconds by stage.
struct Stages {
    since: Instant,
    now: String,
    spent: Vec<(String, f64)>,
}

impl Stages {
    fn close(&mut self) {
        let spent_s = self.since.elapsed().as_secs_f64();
        match self.spent.iter_mut().find(|s| s.0 == self.now) {
            Some(stage) => stage.1 += spent_s,
            None => self.spent.push((self.now.clone(), spent_s)),
        }
        self.since = Instant::now();
    }
}

impl Progress for Stages {
    fn step(&mut self, stage: &str, _: &str, _: usize, _: usize) {
        let stage = stage.split(" beside ").next().unwrap_or(stage);
        if stage != self.now {
            self.close();
            self.now = stage.to_owned();
        }
    }
}

/// A copy of a capture with its first frames, each `scale` times smaller.
fn shrunk(from: &Path, to: &Path, frames: usize, scale: usize) {
    fs::create_dir_all(to.join("real")).expect("made");
    for entry in fs::read_dir(from).expect("a folder").flatten() {
        if entry.file_type().is_ok_and(|t| t.is_file()) {
            fs::copy(entry.path(), to.join(entry.file_name())).expect("copied");
        }
    }
    if from.join("objects").is_dir() {
        fs::create_dir_all(to.join("objects")).expect("made");
        for entry in fs::read_dir(from.join("objects")).expect("a folder").flatten() {
            fs::copy(entry.path(), to.join("objects").join(entry.file_name())).expect("copied");
        }
    }
    let csv = fs::read_to_string(from.join("frames.csv")).expect("there");
    let kept: Vec<&str> = csv.lines().take(frames + 1).collect();
    fs::write(to.join("frames.csv"), kept.join("\n") + "\n").expect("written");
    for line in &kept[1..] {
        let name = line.split(',').nth(1).expect("a name");
        let p = read_rgb8(&from.join("real").join(name)).expect("a picture");
        let small = Plane::from_fn(p.width / scale, p.height / scale, |x, y| {
            [0, 1, 2].map(|c| {
                let at = |i: usize| u32::from(p.pixel(x * scale + i % scale, y * scale + i / scale)[c]);
                ((0..scale * scale).map(at).sum::<u32>() / (scale * scale) as u32) as u8
            })
        });
        write_png_atomic(&to.join("real").join(name), &small).expect("written");
    }
    let camera = fs::read_to_string(from.join("camera.toml")).expect("there");
    let line = |l: &str| match l.split_once('=').map(|(k, v)| (k.trim(), v.trim().parse::<f64>())) {
        Some((k @ ("width" | "height" | "fx" | "fy" | "cx" | "cy"), Ok(v))) => {
            format!("{k} = {}", v / scale as f64)
        }
        _ => l.to_owned(),
    };
    fs::write(to.join("camera.toml"), camera.lines().map(line).collect::<Vec<_>>().join("\n"))
        .expect("written");
}

/// Time of a diagnosis and of its stages, s.
type Spent = (f64, Vec<(String, f64)>);

/// Diagnoses so many frames of so small a picture, and adds to `text` what it took.
fn one(context: &Arc<Context>, from: &Path, (frames, scale): (usize, usize), text: &mut String) -> Spent {
    let folder = std::env::temp_dir().join(format!("shutterbug-bench-diagnose-{}", std::process::id()));
    shrunk(from, &folder, frames, scale);
    let capture = Capture::read(&folder, None).expect("a capture");
    let mut stages = Stages { since: Instant::now(), now: "set-up".to_owned(), spent: Vec::new() };
    let report =
        diagnose(context, &capture, &DiagnoseOptions::default(), &mut stages).expect("a diagnosis").report;
    stages.close();
    fs::remove_dir_all(&folder).expect("removed");
    let i = &report.input;
    let found: Vec<&str> = report.effects.iter().map(|e| e.name.as_str()).collect();
    let line = format!(
        "{:>4}x{:<4} {:>3} frames ({} fit, {} held out): {:>6.1} s, {} renders {:.1} s ({:.0} %); found {found:?}",
        i.width,
        i.height,
        capture.frames.len(),
        i.fit_frames.len(),
        i.held_out_frames.len(),
        i.seconds,
        i.renders,
        i.render_seconds,
        100.0 * i.render_seconds / i.seconds
    );
    println!("{line}");
    *text += &format!("* {}\n", line.trim());
    for (stage, spent_s) in &stages.spent {
        println!("          {spent_s:>6.1} s {:>3.0} % {stage}", 100.0 * spent_s / i.seconds);
    }
    (i.seconds, stages.spent)
}

fn main() {
    let named = std::env::args().skip(1).find(|a| !a.starts_with('-')).map(PathBuf::from);
    let from = named.unwrap_or_else(|| "../shared/data/cycles-dev/d01".into());
    if !from.join("real").is_dir() {
        println!("SKIPPED: {} has no real frames", from.display());
        return;
    }
    let options = ContextOptions {
        device: DeviceChoice::from_option_or_environment(None),
        validation: Validation::Off,
    };
    let context = Context::new(&options).expect("a device");
    println!("{} on {}", from.display(), context.info().name);
    let all = fs::read_to_string(from.join("frames.csv")).expect("there").lines().count() - 1;
    let mut text = String::new();
    let (whole, stages) = one(&context, &from, (all, 1), &mut text);
    let (fewer, _) = one(&context, &from, (all / 2, 1), &mut text);
    text += &format!("* half the frames: {:.2} of the time\n", fewer / whole);
    let camera = Capture::read(&from, None).expect("a capture").camera.intrinsics;
    let divides = |s: &usize| {
        let sides = [camera.width, camera.height].map(|v| v as usize);
        sides.iter().all(|side| side.is_multiple_of(*s) && side / s >= LEAST_SIDE_PX)
    };
    for scale in [2, 4, 8].into_iter().filter(divides) {
        let (small, _) = one(&context, &from, (all, scale), &mut text);
        text += &format!("* 1/{} of the pixels: {:.2} of the time\n", scale * scale, small / whole);
    }
    println!("{text}");
    let name = from.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let text = format!("Capture: {name}. Chart: stages of the whole.\n\n{text}");
    measured::write_page("diagnose", &context.info().name, &text, (&stages, "s"));
}
