//! The command line: parsing, progress, files. Everything it can do, the library can.

mod args;
mod calibrate;
mod camera;
mod devices;
mod diagnose;
mod effects;
mod import;
mod interrupt;
mod presets;
mod simulate;
mod timings;
mod withhold;

use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};

use args::{Args, Calibrate, Camera, Command};

/// Runs the command line; exit code 0 done, 1 the input or the machine is at fault, 2 usage.
pub fn run() -> ExitCode {
    let args = Args::parse();
    if let Command::Simulate(simulate) = &args.command
        && let Err(problem) = simulate.check()
    {
        Args::command().error(ErrorKind::ArgumentConflict, problem).exit();
    }
    start_log();
    let done = match &args.command {
        Command::Simulate(simulate) => simulate::run(simulate),
        Command::Diagnose(args) => diagnose::run(args),
        Command::Withhold(args) => withhold::run(args),
        Command::Devices(args) => devices::run(args),
        Command::Effects => {
            effects::run();
            Ok(())
        }
        Command::Presets { name } => presets::run(name.as_deref()),
        Command::Camera(Camera::Convert(convert)) => camera::run(convert),
        Command::Import(import) => import::run(import),
        Command::Calibrate(Calibrate::Noise(noise)) => calibrate::run(noise),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("shutterbug: error: {error}");
            ExitCode::from(1)
        }
    }
}

/// Warnings go to stderr; `RUST_LOG` asks for more or less.
fn start_log() {
    use tracing_subscriber::EnvFilter;
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn"));
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    // A second logger in one process is a caller's choice and no reason to stop.
    let _ = log.without_time().with_target(false).try_init();
}
