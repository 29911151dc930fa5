//! The paper's Table 1, every cell of it at three sizes: `cargo bench --bench table1 [-- --quick] [-- --only TEXT]`.
//!
//! Writes `target/bench/table1.json`, `table1.md` and `table1.png`. The scene is `scenes/table1`. On a software device
//! times are CPU times, `LP_NUM_THREADS` is 2 unless it is set, and device times that disagree with the host's clock are
//! an error. `--quick`: the smallest picture and few frames. `--only TEXT`: cells whose name holds the text, such as
//! `generic`, `640x480` or `velocity 24 320x240`; prints them and writes no files.
#![allow(clippy::unwrap_used)]

#[path = "table1/cells.rs"]
mod cells;
#[path = "table1/chart.rs"]
mod chart;
#[path = "table1/report.rs"]
mod report;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use cells::{Bench, Cell, METHODS, SAMPLES, SIZES};
use shutterbug::capture::Capture;
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, DeviceKind, Validation};

/// Threads of a software driver where `LP_NUM_THREADS` does not say: the paper's machine had two cores.
const THREADS: &str = "2";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

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

fn run(context: &Arc<Context>, quick: bool, only: Option<&str>) -> Result<(), String> {
    let scene = std::env::var_os("TABLE1_SCENE").map_or(root().join("scenes/table1"), PathBuf::from);
    let capture = Capture::read(&scene, None).map_err(|e| e.to_string())?;
    let bench = Bench::new(context, capture, if quick { 1.0 } else { 2.5 });
    let sizes = if quick { &SIZES[..1] } else { &SIZES[..] };
    let load = report::load_average();
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
    if only.is_some() {
        return Ok(());
    }
    let threads = std::env::var("LP_NUM_THREADS").unwrap_or_default();
    let mut extra = report::Extra::default();
    for &size in &sizes[..sizes.len().min(2)] {
        for in_flight in [1, 4, 16] {
            let fps = bench.throughput(size, in_flight).map_err(|e| e.to_string())?;
            println!(
                "throughput {}x{} with {in_flight} in flight: {fps:.2} frames a second",
                size[0], size[1]
            );
            extra.throughput.push((size, in_flight, fps));
        }
        let (ours, four) = bench.raster_16(size).map_err(|e| e.to_string())?;
        println!("16 samples {}x{}: {ours:.2} ms; four passes of four: {four:.2} ms", size[0], size[1]);
        extra.raster_16.push((size, ours, four));
    }
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
    result.write(&output());
    println!("\n{}", result.markdown());
    Ok(())
}
