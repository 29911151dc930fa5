//! The post-process chain (remap, blur, noise; 640x480, everything moving about 40 px) against what a user would
//! otherwise write: `cargo bench --bench chain [-- --quick]`.
//!
//! Writes `target/bench/chain.json` and `chain.md`. The programs in `benches/peers/` run in the same minutes on the
//! same number of threads; what cannot run here is named. Times are the least and the median of several runs by the
//! host's clock; the picture of each is compared with the exact gather's twin on the CPU.
#![allow(clippy::unwrap_used)]

#[path = "chain/device.rs"]
mod device;
#[path = "chain/floor.rs"]
mod floor;
#[path = "chain/input.rs"]
mod input;
#[path = "measured/mod.rs"]
mod measured;
#[path = "peers/kernels.rs"]
mod peer_kernels;
#[path = "peers/bounds.rs"]
mod peers_bounds;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use device::{Device, Level, Variant};
use floor::{Tap, Way};
use input::{Input, MOTIONS, SIGMA};
use peers_bounds::{Bounded, Bounds};
use serde::{Deserialize, Serialize};
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, Validation};
use shutterbug::plane::Plane;
use shutterbug::plane::metrics::psnr_db;
use shutterbug::reference::paper_fast::{Tap as TwinTap, Way as TwinWay, paper_fast};
use shutterbug::reference::paper_gather::paper_gather;

/// Threads of every implementation.
const THREADS: usize = 2;
const SIZE: [usize; 2] = [640, 480];
/// A peer whose picture is farther from the truth computes something else.
const SAME_PICTURE_DB: f64 = 35.0;

const VARIANTS: [Variant; 16] = [
    variant("bilinear fixed 240, sampler", "paper_fast_sampler.comp", 1.0, 4, true, true),
    variant("bilinear, sampler", "paper_fast_sampler.comp", 1.0, 1, false, true),
    variant("bilinear half taps, sampler", "paper_fast_sampler.comp", 0.5, 1, false, true),
    variant("bilinear half taps, sampler x2", "paper_fast_sampler.comp", 0.5, 2, false, true),
    variant("bilinear half taps, sampler x4", "paper_fast_sampler.comp", 0.5, 4, false, true),
    variant("bilinear half taps, sampler x2, half floats", "paper_fast_sampler.comp", 0.5, 2, false, false),
    variant("bilinear half taps, texels x2", "paper_fast_texels.comp", 0.5, 2, false, true),
    variant("nearest, texels", "paper_fast_nearest.comp", 1.0, 1, false, true),
    variant("nearest, texels x4", "paper_fast_nearest.comp", 1.0, 4, false, true),
    variant("nearest, texels x8", "paper_fast_nearest.comp", 1.0, 8, false, true),
    variant("nearest, texels x4, half floats", "paper_fast_nearest.comp", 1.0, 4, false, false),
    // Tried, and no kernel of the engine: what they cost and what their pictures are worth.
    variant(
        "trial: bilinear, a tap every third px, sampler x2",
        "paper_fast_sampler.comp",
        0.33,
        2,
        false,
        true,
    ),
    variant("trial: nearest at eight places in turn", "trial_dithered.comp", 1.0, 8, false, true),
    variant(
        "trial: nearest at eight places, a tap every second px",
        "trial_dithered.comp",
        0.5,
        8,
        false,
        true,
    ),
    Variant {
        level: Level::Half,
        ..variant("trial: prefiltered level", "trial_prefiltered.comp", 0.25, 2, false, true)
    },
    Variant {
        level: Level::Sums,
        ..variant("trial: sums along rows", "trial_prefix.comp", 1.0, 1, false, true)
    },
];

const fn variant(
    name: &'static str,
    file: &'static str,
    taps_per_px: f32,
    unroll: u32,
    fixed: bool,
    eight_bits: bool,
) -> Variant {
    Variant { name, file, taps_per_px, unroll, fixed, eight_bits, level: Level::None }
}

/// One implementation on one motion.
#[derive(Clone, Debug, Serialize)]
struct Row {
    name: String,
    motion: String,
    ms_least: f64,
    ms_median: f64,
    /// Against the exact gather's twin, 8 bits, without noise.
    psnr_db: Option<f64>,
}

/// What a peer prints.
#[derive(Deserialize)]
struct Printed {
    name: String,
    motion: String,
    samples: u32,
    ms: Vec<f64>,
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if arguments.iter().any(|a| a == "--test" || a == "--list") {
        return;
    }
    if std::env::var_os("LP_NUM_THREADS").is_none() {
        let again = std::env::current_exe().unwrap();
        let threads = THREADS.to_string();
        let done = Command::new(again).args(&arguments[1..]).env("LP_NUM_THREADS", threads).status().unwrap();
        std::process::exit(done.code().unwrap_or(1));
    }
    let repeats = if arguments.iter().any(|a| a == "--quick") { 5 } else { 15 };
    let device = DeviceChoice::from_option_or_environment(None);
    let context = match Context::new(&ContextOptions { device, validation: Validation::Off }) {
        Ok(context) => context,
        Err(error) => return eprintln!("SKIPPED chain: {error}"),
    };
    if arguments.iter().any(|a| a == "--scaling") {
        return print_scaling(&context, repeats);
    }
    let input = Input::new(&context, &root().join("scenes/table1"), SIZE);
    let folder = root().join("target/bench/chain");
    input.write(&folder, THREADS, repeats);
    let truths: Vec<Plane<u8>> = (0..MOTIONS.len()).map(|m| truth(&input, m)).collect();
    let mut rows = ours(&context, &input, &truths, repeats);
    rows.extend(by_hand(&input, &truths, repeats));
    rows.extend(peers(&folder, &truths));
    let mut text = report(&context, &rows, repeats);
    text += &bounds(&context, &input, &rows);
    text += &scaling(&arguments);
    println!("{text}");
    let info = context.info();
    let json = serde_json::json!({
        "device": info.name, "driver": info.driver, "threads": THREADS, "size": SIZE, "rows": rows,
    });
    std::fs::write(
        root().join("target/bench/chain.json"),
        serde_json::to_string_pretty(&json).unwrap() + "\n",
    )
    .unwrap();
    std::fs::write(root().join("target/bench/chain.md"), &text).unwrap();
    if !arguments.iter().any(|a| a == "--quick") {
        let bars: Vec<_> = rows.iter().map(|r| (format!("{}, {}", r.name, r.motion), r.ms_median)).collect();
        measured::write_page("chain", &info.name, &text, (&bars, "ms"));
    }
}

/// The exact gather on the CPU, a tap a px, 8 bits.
fn truth(input: &Input, motion: usize) -> Plane<u8> {
    let exact = paper_gather(&input.push(240), &input.color_plane(), &input.motion_planes(motion));
    let data = exact
        .data
        .chunks_exact(4)
        .flat_map(|p| [p[0], p[1], p[2]])
        .map(|v| (255.0 * v.clamp(0.0, 1.0) + 0.5) as u8);
    Plane { width: input.size[0], height: input.size[1], channels: 3, data: data.collect() }
}

fn rgb(rgbx: &[u8]) -> Plane<u8> {
    let data = rgbx.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    Plane { width: SIZE[0], height: SIZE[1], channels: 3, data }
}

fn row(name: &str, motion: usize, mut ms: Vec<f64>, picture: Option<(&Plane<u8>, &Plane<u8>)>) -> Row {
    ms.sort_by(f64::total_cmp);
    let psnr_db = picture.map(|(got, want)| psnr_db(got, want).min(99.0));
    Row {
        name: name.to_owned(),
        motion: MOTIONS[motion].to_owned(),
        ms_least: ms[0],
        ms_median: ms[ms.len() / 2],
        psnr_db,
    }
}

fn ours(context: &Arc<Context>, input: &Input, truths: &[Plane<u8>], repeats: usize) -> Vec<Row> {
    let mut device = Device::new(context, input);
    let mut rows = Vec::new();
    for motion in 0..MOTIONS.len() {
        for variant in &VARIANTS {
            let (ms, picture) = device.fused(variant, motion, input.push(240), repeats);
            rows.push(row(variant.name, motion, ms, Some((&rgb(&picture), &truths[motion]))));
        }
        let (ms, picture) = device.unfused(motion, input.push(240), repeats.min(5));
        rows.push(row("exact gather, then chain", motion, ms, Some((&rgb(&picture), &truths[motion]))));
    }
    rows.push(row("pass-through", 2, device.pass_through(repeats), None));
    rows.push(row("noise and encoding alone", 2, device.developed(repeats), None));
    rows
}

fn by_hand(input: &Input, truths: &[Plane<u8>], repeats: usize) -> Vec<Row> {
    if !floor::available() {
        eprintln!("SKIPPED by hand: this CPU has no AVX2");
        return Vec::new();
    }
    let bilinear = Way { tap: Tap::Bilinear, taps_per_px: 1.0, fixed: None, most: 240, sigma: 0.0 };
    let ways = [
        ("by hand: bilinear fixed 240", Way { fixed: Some(240), ..bilinear }),
        ("by hand: bilinear", bilinear),
        ("by hand: bilinear half taps", Way { taps_per_px: 0.5, ..bilinear }),
        ("by hand: nearest", Way { tap: Tap::Nearest, ..bilinear }),
    ];
    let mut rows = Vec::new();
    let mut out = vec![0u32; SIZE[0] * SIZE[1]];
    for motion in 0..MOTIONS.len() {
        for (name, way) in ways {
            floor::run(input, &input.motions[motion], way, THREADS, &mut out);
            let picture = rgb(bytemuck::cast_slice(&out));
            let noisy = Way { sigma: 255.0 * SIGMA, ..way };
            let ms = (0..repeats).map(|_| {
                let start = std::time::Instant::now();
                floor::run(input, &input.motions[motion], noisy, THREADS, &mut out);
                start.elapsed().as_secs_f64() * 1e3
            });
            rows.push(row(name, motion, ms.collect(), Some((&picture, &truths[motion]))));
        }
    }
    rows
}

fn peers(folder: &Path, truths: &[Plane<u8>]) -> Vec<Row> {
    let source = root().join("benches/peers");
    let python = std::env::var_os("SHUTTERBUG_PEERS_PYTHON")
        .map_or(root().join("target/peers-venv/bin/python"), PathBuf::from);
    let mut commands = Vec::new();
    for script in ["opencv_loop.py", "numba_chain.py"] {
        let mut command = Command::new(&python);
        command.arg(source.join(script)).arg(folder);
        commands.push((script, command));
    }
    let binary = folder.join("plain");
    let built = Command::new("g++")
        .args(["-O3", "-march=native", "-ffast-math", "-fopenmp"])
        .arg(source.join("plain.cpp"))
        .arg("-o")
        .arg(&binary)
        .status();
    if built.is_ok_and(|s| s.success()) {
        let parameters: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.join("parameters.json")).unwrap()).unwrap();
        let mut command = Command::new(&binary);
        command.arg(folder).args([
            SIZE[0].to_string(),
            SIZE[1].to_string(),
            parameters["margin_px"].to_string(),
            SIGMA.to_string(),
            parameters["repeats"].to_string(),
        ]);
        command.env("OMP_NUM_THREADS", THREADS.to_string());
        commands.push(("plain.cpp", command));
    } else {
        eprintln!("SKIPPED plain.cpp: g++ could not build it");
    }
    let mut rows = Vec::new();
    for (name, mut command) in commands {
        match command.output() {
            Ok(done) if done.status.success() => {
                rows.extend(printed(folder, &String::from_utf8_lossy(&done.stdout), truths))
            }
            Ok(done) => eprintln!(
                "SKIPPED {name}: {}",
                String::from_utf8_lossy(&done.stderr).lines().last().unwrap_or("failed")
            ),
            Err(error) => eprintln!("SKIPPED {name}: {error}"),
        }
    }
    rows
}

fn printed(folder: &Path, text: &str, truths: &[Plane<u8>]) -> Vec<Row> {
    let lines = text.lines().filter_map(|l| serde_json::from_str::<Printed>(l).ok());
    let one = |p: Printed| {
        let motion = MOTIONS.iter().position(|m| *m == p.motion).unwrap();
        let data = std::fs::read(folder.join(format!("{}_{}_{}.out", p.name, p.motion, p.samples))).unwrap();
        let picture = Plane { width: SIZE[0], height: SIZE[1], channels: 3, data };
        row(&format!("{} {}", p.name, p.samples), motion, p.ms, Some((&picture, &truths[motion])))
    };
    lines.map(one).collect()
}

fn report(context: &Arc<Context>, rows: &[Row], repeats: usize) -> String {
    let mut text = format!(
        "Remap, blur and noise of {}x{}; {}, {THREADS} threads, {repeats} runs; load {}.\n\n\
         implementation | motion | least ms | median ms | PSNR, dB\n---|---|---|---|---\n",
        SIZE[0],
        SIZE[1],
        context.info().name,
        measured::load_average()
    );
    for r in rows {
        let quality = r.psnr_db.map_or("-".to_owned(), |db| format!("{db:.1}"));
        writeln!(text, "{} | {} | {:.2} | {:.2} | {quality}", r.name, r.motion, r.ms_least, r.ms_median)
            .unwrap();
        let peer = VARIANTS.iter().all(|v| v.name != r.name);
        let few = r.name.starts_with("opencv 6") || r.name.starts_with("opencv 24 ") || r.name == "opencv 24";
        if peer && !few && r.psnr_db.is_some_and(|db| db < SAME_PICTURE_DB) {
            writeln!(text, "^ computes another picture: no ratio with it counts").unwrap();
        }
    }
    text += "\nratio (least over least) | ours | goal\n---|---|---\n";
    let get = |name: &str, motion: &str| {
        rows.iter().find(|r| r.name == name && r.motion == motion).map(|r| r.ms_least)
    };
    let best = |prefix: &str, motion: &str| {
        let all = rows
            .iter()
            .filter(|r| r.name.starts_with(prefix) && r.motion == motion && !r.name.contains("fixed"));
        all.map(|r| r.ms_least).min_by(f64::total_cmp)
    };
    let mut ratio = |name: &str, over: Option<f64>, under: Option<f64>, goal: &str| {
        if let (Some(over), Some(under)) = (over, under) {
            writeln!(text, "{name} | {:.2} | {goal}", over / under).unwrap();
        }
    };
    let (bilinear, nearest) = (best("bilinear", "moving"), best("nearest", "moving"));
    ratio("OpenCV loop of 240 / ours, bilinear", get("opencv 240", "moving"), bilinear, ">= 8");
    ratio("OpenCV loop of 240 / ours, fast", get("opencv 240", "moving"), nearest, "-");
    ratio("numba adaptive / ours, bilinear", get("numba 240", "moving"), bilinear, "-");
    ratio("plain C++ adaptive / ours, bilinear", get("plain 240", "moving"), bilinear, ">= 1.5");
    ratio("ours, bilinear / by hand, bilinear", bilinear, get("by hand: bilinear", "moving"), "<= 1.3");
    ratio(
        "ours, bilinear / by hand, half taps",
        bilinear,
        get("by hand: bilinear half taps", "moving"),
        "<= 1.3",
    );
    ratio("ours, fast / by hand, nearest", nearest, get("by hand: nearest", "moving"), "<= 2");
    ratio(
        "fixed 240 / ours, a tenth moving",
        get("bilinear fixed 240, sampler", "tenth"),
        best("bilinear", "tenth"),
        ">= 15",
    );
    ratio("ours at rest / pass-through", best("bilinear", "rest"), get("pass-through", "rest"), "<= 2");
    ratio("exact gather, then chain / ours", get("exact gather, then chain", "moving"), bilinear, "-");
    text
}

/// The best bilinear chain against its bytes and its taps.
fn bounds(context: &Arc<Context>, input: &Input, rows: &[Row]) -> String {
    let rates = Bounds::measure(context).unwrap();
    let mut text = format!("\n{}\n\n{}", rates.line(), Bounded::HEAD);
    let area = |size: [usize; 2]| (size[0] * size[1]) as f64;
    // Colour once, two motion images, the delivered pixel.
    let bytes = area(input.outer()) * 4.0 + area(input.size) * (2.0 * 8.0 + 4.0);
    for (kind, motion) in MOTIONS.iter().enumerate() {
        let of_kind = rows.iter().filter(|r| r.motion == *motion && r.name.starts_with("bilinear half taps"));
        let Some(ms) = of_kind.map(|r| r.ms_least).min_by(f64::total_cmp) else { continue };
        let way = TwinWay { tap: TwinTap::Bilinear, taps_per_px: 0.5, unroll: 1 };
        let made = paper_fast(&input.push(240), way, &input.color_plane(), &input.motion_planes(kind));
        let taps: f64 = made.data.chunks_exact(4).map(|p| f64::from(p[3].abs())).sum();
        text += &rates.hold(&format!("bilinear half taps, {motion}"), ms, bytes, taps).row();
    }
    text + "(aim: 1.5)\n"
}

/// The scaling of this bench run with one thread and with two, and what follows from it.
fn scaling(arguments: &[String]) -> String {
    let mut text = String::from("\nBilinear, half taps, over threads, sizes and nominal counts:\n\n");
    let mut of_threads = Vec::new();
    for threads in ["1", "2"] {
        let program = std::env::current_exe().unwrap();
        let done = Command::new(program)
            .args(&arguments[1..])
            .arg("--scaling")
            .env("LP_NUM_THREADS", threads)
            .output();
        let printed = String::from_utf8_lossy(&done.unwrap().stdout).into_owned();
        for line in printed.lines() {
            writeln!(text, "* {line}").unwrap();
        }
        let ms = |what: &str| -> Option<f64> {
            printed.lines().find_map(|l| l.strip_prefix(what)?.split(' ').next()?.parse().ok())
        };
        of_threads.push(ms("640x480 count 240: "));
        if let (Some(few), Some(many)) = (ms("640x480 count 60: "), ms("640x480 count 1000: ")) {
            writeln!(
                text,
                "* nominal count of 1000 over 60, {threads} threads: {:.2} (goal: flat)",
                many / few
            )
            .unwrap();
        }
        if let (Some(small), Some(large)) = (ms("640x480 count 240: "), ms("1920x1080 count 240: ")) {
            let pixels = 1920.0 * 1080.0 / (640.0 * 480.0);
            writeln!(
                text,
                "* time a pixel, 1920x1080 over 640x480, {threads} threads: {:.2} (goal: linear)",
                large / small / pixels
            )
            .unwrap();
        }
    }
    if let [Some(one), Some(two)] = of_threads[..] {
        writeln!(text, "* one thread over two, 640x480: {:.2} (goal: 1.8)", one / two).unwrap();
    }
    text
}

/// Times of one variant over sizes and nominal counts, for this process's number of threads.
fn print_scaling(context: &Arc<Context>, repeats: usize) {
    let half = VARIANTS.iter().find(|v| v.name == "bilinear half taps, sampler x2").unwrap();
    println!("threads {}", std::env::var("LP_NUM_THREADS").unwrap_or_default());
    for size in [[160, 120], [320, 240], [640, 480], [1280, 720], [1920, 1080]] {
        let input = Input::new(context, &root().join("scenes/table1"), size);
        let mut device = Device::new(context, &input);
        let counts: &[u32] = if size == SIZE { &[60, 120, 240, 1000] } else { &[240] };
        for &most in counts {
            let (mut ms, _) = device.fused(half, 0, input.push(most), repeats);
            ms.sort_by(f64::total_cmp);
            let ns = ms[0] * 1e6 / (size[0] * size[1]) as f64;
            println!("{}x{} count {most}: {:.3} ms, {ns:.1} ns a pixel", size[0], size[1], ms[0]);
        }
    }
}
