//! The paper's Table 1, every cell of it at three sizes: `cargo bench --bench table1 [-- --quick] [-- --only TEXT]`.
//!
//! Writes `target/bench/table1.json`, `table1.md` and `table1.png`. The scene is `scenes/table1`. On a software device
//! times are CPU times, `LP_NUM_THREADS` is 2 unless it is set, and device times that disagree with the host's clock
//! are an error. `--quick`: the smallest picture and few frames. `--only TEXT`: cells whose name holds the text, such
//! as `generic`, `640x480` or `velocity 24 320x240`, or one of `throughput`, `raster16` and `rates`; prints them and
//! writes no files. `--from FILE.json` measures nothing: it writes table and chart of what was measured elsewhere.
#![allow(clippy::unwrap_used)]

#[path = "table1/cells.rs"]
mod cells;
#[path = "table1/chart.rs"]
mod chart;
#[path = "measured/mod.rs"]
mod measured;
#[path = "table1/peer.rs"]
mod peer;
#[path = "peers/kernels.rs"]
mod peer_kernels;
#[path = "peers/bounds.rs"]
mod peers_bounds;
#[path = "table1/raster16.rs"]
mod raster16;
#[path = "table1/report.rs"]
mod report;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use cells::{Bench, Cell, METHODS, SAMPLES, SIZES};
use peers_bounds::{Bounded, Bounds};
use shutterbug::capture::Capture;
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, DeviceKind, Validation};

/// Threads of a software driver where `LP_NUM_THREADS` does not say: the paper's machine had two cores.
const THREADS: &str = "2";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// What `--only` names beside cells.
const EXTRA: [&str; 3] = ["throughput", "raster16", "rates"];

/// Where results go.
fn output() -> PathBuf {
    root().join("target/bench")
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    // `cargo test --benches` passes flags of a harness that this bench does not have.
    if arguments.iter().any(|a| a == "--test" || a == "--list") {
        return;
    }
    // The driver reads the variable when it is loaded, before anything here could set it safely.
    if std::env::var_os("LP_NUM_THREADS").is_none() {
        let again = std::env::current_exe().unwrap();
        let done = Command::new(again).args(&arguments[1..]).env("LP_NUM_THREADS", THREADS).status().unwrap();
        std::process::exit(done.code().unwrap_or(1));
    }
    if let Some(at) = arguments.iter().position(|a| a == "--from") {
        return written_from(arguments.get(at + 1));
    }
    let quick = arguments.iter().any(|a| a == "--quick") || std::env::var_os("TABLE1_QUICK").is_some();
    let only = arguments.iter().position(|a| a == "--only").and_then(|i| arguments.get(i + 1));
    let device = DeviceChoice::from_option_or_environment(None);
    let context = match Context::new(&ContextOptions { device, validation: Validation::Off }) {
        Ok(context) => context,
        Err(error) => return eprintln!("SKIPPED table1: {error}"),
    };
    if let Err(error) = run(&context, quick, only.map(String::as_str)) {
        eprintln!("table1: {error}");
        std::process::exit(1);
    }
}

/// Table and chart of an earlier run, of any device.
fn written_from(file: Option<&String>) {
    let read = |file: &String| -> Result<report::Table, String> {
        let text = std::fs::read_to_string(file).map_err(|e| format!("{file}: {e}"))?;
        serde_json::from_str(&text).map_err(|e| format!("{file}: {e}"))
    };
    match file.ok_or_else(|| "--from wants a table1.json".to_owned()).and_then(read) {
        Ok(table) => {
            table.write(&output());
            println!("{}", table.markdown());
        }
        Err(error) => {
            eprintln!("table1: {error}");
            std::process::exit(1);
        }
    }
}

fn run(context: &Arc<Context>, quick: bool, only: Option<&str>) -> Result<(), String> {
    let scene = std::env::var_os("TABLE1_SCENE").map_or(root().join("scenes/table1"), PathBuf::from);
    let capture = Capture::read(&scene, None).map_err(|e| e.to_string())?;
    let bench = Bench::new(context, capture, if quick { 1.0 } else { 2.5 });
    let sizes = if quick { &SIZES[..1] } else { &SIZES[..] };
    let load = measured::load_average();
    let mut cells: Vec<Cell> = Vec::new();
    for &size in sizes {
        for method in METHODS {
            for samples in SAMPLES {
                let name = format!("{method} {samples} {}x{}", size[0], size[1]);
                if only.is_some_and(|text| !name.contains(text)) {
                    continue;
                }
                let cell = bench.cell(method, samples, size).map_err(|e| format!("{name}: {e}"))?;
                println!("{}", report::line(&cell));
                cells.push(cell);
            }
        }
    }
    let info = context.info();
    let software = info.kind == DeviceKind::Cpu;
    if software {
        // A device time is host time there: one that the host's clock does not confirm is a wrong one.
        let wrong: Vec<String> = cells.iter().filter(|c| !c.clocks_agree()).map(report::line).collect();
        if !wrong.is_empty() {
            return Err(format!("device and host disagree, so nothing is written:\n{}", wrong.join("\n")));
        }
    }
    let threads = std::env::var("LP_NUM_THREADS").unwrap_or_default();
    let extra = extras(&bench, &sizes[..sizes.len().min(2)], only).map_err(|e| e.to_string())?;
    let extra = report::Extra { bounds: bounds(&extra.rates, &cells), ..extra };
    let result = report::Table {
        device: info.name.clone(),
        driver: info.driver.clone(),
        threads,
        software,
        load,
        quick,
        cells,
        extra,
    };
    if only.is_none() {
        result.write(&output());
    }
    let text = result.markdown();
    if only.is_none() && !quick {
        let name = |c: &Cell| format!("{}, {} samples, {}x{}", c.method, c.samples, c.width, c.height);
        let bars: Vec<_> = result.cells.iter().map(|c| (name(c), c.ms_median)).collect();
        measured::write_page("table1", &info.name, &text, (&bars, "ms"));
    }
    println!("\n{text}");
    Ok(())
}

/// What is measured beside the cells.
fn extras(bench: &Bench, sizes: &[[u32; 2]], only: Option<&str>) -> shutterbug::error::Result<report::Extra> {
    let wanted = |name: &str| only.is_none_or(|text| text == name);
    let mut extra = report::Extra::default();
    for &size in sizes {
        for in_flight in [1, 4, 16].into_iter().filter(|_| wanted("throughput")) {
            extra.throughput.push((size, in_flight, bench.throughput(size, in_flight)?));
        }
        if wanted("raster16") {
            extra.raster_16.extend(bench.raster_16(size)?);
        }
    }
    // The passes of cells are held against them.
    if only.is_none_or(|text| text == "rates" || !EXTRA.contains(&text)) {
        extra.rates = Bounds::measure(bench.context())?;
    }
    Ok(extra)
}

/// The passes of the generic model at 240 samples against what they must read and write, and sample.
fn bounds(rates: &Bounds, cells: &[Cell]) -> Vec<([u32; 2], Vec<Bounded>)> {
    let generic = cells.iter().filter(|c| c.method == "generic" && c.samples == 240);
    generic.map(|cell| ([cell.width, cell.height], bounded(rates, cell))).collect()
}

fn bounded(rates: &Bounds, cell: &Cell) -> Vec<Bounded> {
    let area = |margin: [u32; 2]| f64::from((cell.width + 2 * margin[0]) * (cell.height + 2 * margin[1]));
    let (inner, outer) = (area([0; 2]), area(cell.margin_px));
    let samples = outer * f64::from(cell.aa_samples);
    // Bytes a sample or pixel: colour of half floats 8, depth 4, motion 8, radiance 16, a delivered pixel 4.
    let bytes = |pass: &str| match pass {
        "raster" => samples * (8.0 + 4.0),
        "resolve" => samples * 8.0 + outer * 8.0,
        // Two images: drawn, read, kept.
        "motion" => 2.0 * outer * 3.0 * (8.0 + 4.0),
        "paper_gather" => outer * (8.0 + 2.0 * 8.0) + inner * 16.0,
        "pointwise" => inner * (16.0 + 4.0),
        "readback" => inner * (4.0 + 4.0),
        _ => 0.0,
    };
    let mut rows = Vec::new();
    let mut chain = (0.0, 0.0);
    for pass in &cell.passes {
        let (name, ms) = (pass.name.as_str(), pass.ms_median);
        let taps = if name == "paper_gather" { cell.taps_mean * inner } else { 0.0 };
        rows.push(rates.hold(name, ms, bytes(name), taps));
        if matches!(name, "paper_gather" | "pointwise") {
            chain = (chain.0 + ms, chain.1 + bytes(name));
        }
    }
    rows.push(rates.hold("gather and noise together", chain.0, chain.1, cell.taps_mean * inner));
    rows
}
