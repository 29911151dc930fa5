//! `shutterbug diagnose CAPTURE --out DIR`.

use std::fs;
use std::time::{Duration, Instant};

use super::args::Diagnose;
use crate::capture::Capture;
use crate::diagnose::{DiagnoseOptions, Progress, diagnose};
use crate::error::{Error, Result};
use crate::gpu::{Context, ContextOptions, DeviceChoice, Validation};

/// Time between two lines of progress.
const LOG_INTERVAL: Duration = Duration::from_secs(2);

/// Runs the command.
pub fn run(args: &Diagnose) -> Result<()> {
    let capture = Capture::read(&args.capture, args.camera.as_deref())?;
    fs::create_dir_all(&args.out).map_err(|e| Error::io(&args.out, "create the folder", e))?;
    let device = DeviceChoice::from_option_or_environment(args.device.as_deref());
    let context = Context::new(&ContextOptions { device, validation: Validation::Off })?;
    let options = DiagnoseOptions {
        seed: args.seed,
        without: args.without.clone(),
        time_limit: Some(Duration::from_secs(args.time_limit_s)),
    };
    let mut lines =
        Lines { stage: String::new(), begun: Instant::now(), said: Instant::now() - LOG_INTERVAL };
    let diagnosis = diagnose(&context, &capture, &options, &mut lines)?;
    let report = diagnosis.write(&args.out, &capture)?;
    crate::report::write_html(&report, &args.out)?;
    eprintln!("{}", report.sentence);
    eprintln!("{}", args.out.join(crate::report::PAGE_FILE).display());
    Ok(())
}

/// Progress as lines on stderr, at most one every two seconds.
struct Lines {
    stage: String,
    begun: Instant,
    said: Instant,
}

impl Progress for Lines {
    fn step(&mut self, stage: &str, what: &str, step: usize, steps: usize) {
        if self.stage != stage {
            (self.stage, self.begun) = (stage.to_owned(), Instant::now());
        } else if self.said.elapsed() < LOG_INTERVAL {
            return;
        }
        self.said = Instant::now();
        let spent_s = self.begun.elapsed().as_secs_f64();
        let left_s = if step > 1 { spent_s / (step - 1) as f64 * (steps + 1 - step) as f64 } else { 0.0 };
        let eta = if step > 1 { format!(", {left_s:.0} s left in this stage") } else { String::new() };
        eprintln!("{stage}: {what} ({step}/{steps}{eta})");
    }
}
