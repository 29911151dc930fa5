//! `shutterbug diagnose CAPTURE --out DIR`.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::args::{Described, Diagnose};
use super::interrupt::Interrupt;
use super::terminal::say;
use shutterbug::capture::Capture;
use shutterbug::error::{Error, Result};
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, Validation};
use shutterbug_diagnose::diagnose::{
    DiagnoseOptions, Diagnosis, Pair, Progress, Report, diagnose, diagnose_gyro, diagnose_pair,
    diagnose_unpaired, no_one_place,
};
use shutterbug_diagnose::out::{Out, OutRules};

/// Time between two lines of progress.
const LOG_INTERVAL: Duration = Duration::from_secs(2);

/// What has been worked out so far, in the folder of the report; it goes when the report is there.
const JOURNAL_FILE: &str = "progress.jsonl";

/// Runs the command.
pub fn run(args: &Diagnose) -> Result<()> {
    let begun = Instant::now();
    match (&args.capture, &args.sim, &args.real) {
        (_, Some(sim), Some(real)) if args.unpaired => {
            of_unpaired(args, &options(args, begun), (sim, real), &[])
        }
        (_, Some(sim), Some(real)) => of_pair(args, begun, sim, real),
        (_, None, Some(real)) => of_gyro(args, begun, real),
        (Some(capture), ..) => of_capture(args, begun, capture),
        _ => unreachable!("clap asks for a capture or for both folders"),
    }
}

fn of_capture(args: &Diagnose, begun: Instant, folder: &Path) -> Result<()> {
    let capture = Capture::read(folder, args.camera.as_deref())?;
    let out = open(args, &[folder, &folder.join("real")])?;
    let device = DeviceChoice::from_option_or_environment(args.device.as_deref());
    let context = Context::new(&ContextOptions { device, validation: Validation::Off })?;
    out.working(JOURNAL_FILE)?;
    let mut lines = Lines::new();
    let diagnosis = diagnose(&context, &capture, &options(args, begun), &mut lines);
    lines.bar.finish_and_clear();
    write(args, &out, diagnosis?, &capture)
}

fn of_pair(args: &Diagnose, begun: Instant, sim: &Path, real: &Path) -> Result<()> {
    let options = options(args, begun);
    let pair = Pair::read(sim, real, args.matches.as_deref(), args.camera.as_deref(), &options)?;
    let said = no_one_place(&pair, &options)?;
    if let Some(why) = said.first() {
        say(why);
        return of_unpaired(args, &options, (sim, real), &said);
    }
    let out = open(args, &[sim, real])?;
    out.working(JOURNAL_FILE)?;
    let mut lines = Lines::new();
    let diagnosis = diagnose_pair(&pair, &options, &mut lines);
    lines.bar.finish_and_clear();
    write(args, &out, diagnosis?, &pair.capture)
}

/// `said`: why pairs were not compared as such, and what is wrong with how they lie.
fn of_unpaired(
    args: &Diagnose,
    options: &DiagnoseOptions,
    (sim, real): (&Path, &Path),
    said: &[String],
) -> Result<()> {
    let out = open(args, &[sim, real])?;
    let mut lines = Lines::new();
    let found = diagnose_unpaired(sim, real, options, &mut lines);
    lines.bar.finish_and_clear();
    let mut found = found?;
    found.instead_of_pairs(said);
    out.start_together()?;
    let report = found.write(&args.out)?;
    out.appear()?;
    page(args, &report)
}

fn of_gyro(args: &Diagnose, begun: Instant, real: &Path) -> Result<()> {
    let out = open(args, &[real])?;
    let mut lines = Lines::new();
    let found = diagnose_gyro(real, &options(args, begun), &mut lines);
    lines.bar.finish_and_clear();
    let found = found?;
    out.start_together()?;
    let report = found.write(&args.out)?;
    out.appear()?;
    page(args, &report)
}

fn page(args: &Diagnose, report: &Report) -> Result<()> {
    shutterbug_diagnose::report::write_html(report, &args.out)?;
    if let Some(line) = report.asked().line() {
        say(line);
    }
    say(&report.sentence);
    say(args.out.join(shutterbug_diagnose::report::PAGE_FILE).display());
    Ok(())
}

fn open(args: &Diagnose, inputs: &[&Path]) -> Result<Out> {
    let rules = OutRules { command: "diagnose", inputs, overwrite: args.overwrite, goes_on: false };
    Out::open(&args.out, &rules)
}

fn options(args: &Diagnose, begun: Instant) -> DiagnoseOptions {
    DiagnoseOptions {
        seed: args.seed,
        without: args.without.clone(),
        scene_exact: args.scene == Described::Exact,
        poses_exact: args.poses == Described::Exact,
        time_limit: Some(Duration::from_secs(args.time_limit_s)),
        begun: Some(begun),
        journal: Some(args.out.join(JOURNAL_FILE)),
        distance: args.distance.clone(),
        stop: Some(Interrupt::listen().flag()),
    }
}

fn write(args: &Diagnose, out: &Out, diagnosis: Diagnosis, capture: &Capture) -> Result<()> {
    out.start_together()?;
    let report = diagnosis.write(&args.out, capture)?;
    out.appear()?;
    page(args, &report)?;
    // It is done: there is nothing to go on with.
    let journal = args.out.join(JOURNAL_FILE);
    fs::remove_file(&journal).map_err(|e| Error::io(&journal, "remove", e))
}

/// Stage, candidate and time left: a bar on a terminal, lines in a log, at most one every two seconds.
struct Lines {
    bar: ProgressBar,
    stage: String,
    begun: Instant,
    said: Instant,
}

impl Lines {
    fn new() -> Self {
        let bar = ProgressBar::new(1);
        let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}");
        bar.set_style(style.expect("a constant template"));
        bar.enable_steady_tick(Duration::from_millis(500));
        Self { bar, stage: String::new(), begun: Instant::now(), said: Instant::now() - LOG_INTERVAL }
    }
}

impl Progress for Lines {
    fn step(&mut self, stage: &str, what: &str, step: usize, steps: usize) {
        let fresh = self.stage != stage;
        if fresh {
            (self.stage, self.begun) = (stage.to_owned(), Instant::now());
        }
        let spent_s = self.begun.elapsed().as_secs_f64();
        let left_s = if step > 1 { spent_s / (step - 1) as f64 * (steps + 1 - step) as f64 } else { 0.0 };
        let eta = if step > 1 { format!(", {left_s:.0} s left in this stage") } else { String::new() };
        if !self.bar.is_hidden() {
            self.bar.set_length(steps as u64);
            self.bar.set_position(step as u64 - 1);
            self.bar.set_message(format!("{stage}: {what}{eta}"));
        } else if fresh || self.said.elapsed() >= LOG_INTERVAL {
            self.said = Instant::now();
            say(format_args!("{stage}: {what} ({step}/{steps}{eta})"));
        }
    }
}
