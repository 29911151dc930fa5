//! The command line: parsing, progress, files. Everything it can do, the library can.

mod args;
mod args_board;
mod args_calibrate;
mod args_import;
mod args_names;
mod args_values;
mod begin;
mod board;
mod calibrate;
mod calibrate_chart;
mod calibrate_readout;
mod camera;
mod darkness;
mod description;
mod devices;
mod diagnose;
mod effects;
mod import;
mod interrupt;
mod presets;
mod simulate;
mod terminal;
mod timings;
mod together;
mod withhold;

use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::Arc;

use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches};

use args::{Args, Calibrate, Camera, Command};
use terminal::{end_log, print, say, start_log};

use shutterbug::error::{Error, Result};

/// The exit code for every error: 2 where the command line itself is at fault, whatever files and machine hold; else 1.
fn exit_code(error: &Error) -> u8 {
    if error.is_usage() { 2 } else { 1 }
}

/// Runs the process's own command line; exit code 0 done, 1 the input or the machine is at fault, 2 usage.
pub fn run() -> ExitCode {
    ExitCode::from(run_from(std::env::args_os()))
}

/// Runs a command line whose first argument is the program's name; the exit code is as of [`run`]. For a process that
/// has nothing else to do: it takes over signals.
pub fn run_from(args: impl IntoIterator<Item = OsString>) -> u8 {
    let args = match parse(args) {
        Ok(args) => args,
        Err(told) => return tell(&told),
    };
    start_log();
    survive_full_disks();
    shutterbug_diagnose::out::record_reads();
    let done = run_command(&args.command);
    end_log();
    ended(done)
}

fn ended(done: Result<()>) -> u8 {
    match done {
        Ok(()) => 0,
        Err(error) => {
            say(format_args!("shutterbug: error: {error}"));
            exit_code(&error)
        }
    }
}

fn parse(args: impl IntoIterator<Item = OsString>) -> std::result::Result<Args, clap::Error> {
    let mut command = with_negative_numbers(Args::command());
    let read = command.try_get_matches_from_mut(args).and_then(|m| Args::from_arg_matches(&m));
    let args = read.map_err(|e| e.format(&mut command))?;
    let checked = match &args.command {
        Command::Simulate(simulate) => simulate.check(),
        Command::Board(board) => board.check(),
        _ => Ok(()),
    };
    match checked {
        Ok(()) => Ok(args),
        Err(problem) => Err(Args::command().error(ErrorKind::ArgumentConflict, problem)),
    }
}

/// Takes `-5` as a value: what is wrong with it is said by the option, which knows what it expects.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let number = |arg: clap::Arg| {
        let has_value = arg.get_action().takes_values() && !arg.is_positional();
        if has_value { arg.allow_negative_numbers(true) } else { arg }
    };
    command.mut_args(number).mut_subcommands(with_negative_numbers)
}

/// Prints help, which was asked for, or what is wrong with the arguments; the exit code. clap's own way would let
/// escape sequences of an argument through to the terminal, and would take help that a full disk swallowed for printed.
fn tell(told: &clap::Error) -> u8 {
    if told.use_stderr() {
        told.to_string().lines().for_each(say);
        return 2;
    }
    ended(print(told))
}

/// A file that grows beyond what `ulimit -f` allows is an error of that write, with its name, not the end of the
/// process.
fn survive_full_disks() {
    #[cfg(unix)]
    if let Err(error) = signal_hook::flag::register(libc::SIGXFSZ, Arc::default()) {
        tracing::debug!("a file beyond the limit of its size will end the process: {error}");
    }
}

/// Starts the threads that pictures are worked on with. Later, a machine that has none left could only be told by a
/// panic.
///
/// # Errors
/// No thread could be started.
fn start_threads() -> Result<()> {
    let started = rayon::ThreadPoolBuilder::new().build_global();
    started.map_err(|e| Error::Threads { reason: e.to_string() })
}

fn run_command(command: &Command) -> Result<()> {
    if matches!(
        command,
        Command::Simulate(_)
            | Command::Diagnose(_)
            | Command::Withhold(_)
            | Command::Board(_)
            | Command::Calibrate(_)
            | Command::Import(_)
    ) {
        start_threads()?;
    }
    match command {
        Command::Simulate(simulate) => simulate::run(simulate),
        Command::Diagnose(args) => diagnose::run(args),
        Command::Withhold(args) => withhold::run(args),
        Command::Devices(args) => devices::run(args),
        Command::Effects => effects::run(),
        Command::Presets(args) => presets::run(args),
        Command::Camera(Camera::Convert(convert)) => camera::run(convert),
        Command::Import(import) => import::run(import),
        Command::Board(args) => board::run(args),
        Command::Calibrate(Calibrate::Flat(args)) => calibrate_chart::flat(args),
        Command::Calibrate(Calibrate::Edge(args)) => calibrate_chart::edge(args),
        Command::Calibrate(Calibrate::Readout(args)) => calibrate_readout::readout(args),
        Command::Calibrate(Calibrate::Noise(noise)) => calibrate::run(noise),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn exit_codes_tell_the_command_line_from_files_and_machine() {
        let unknown = |path: &str| Error::unknown_name(Path::new(path), None, "candidate", "x", ["y"]);
        let code = |error: Error| exit_code(&error);
        assert_eq!(code(unknown("--without")), 2);
        assert_eq!(
            code(crate::formats::preset("none", None, "<NAME>").map(|_| ()).expect_err("no such preset")),
            2
        );
        assert_eq!(code(unknown("camera.toml")), 1);
        assert_eq!(code(Error::NoDevice { wanted: String::new(), present: String::new() }), 1);
    }
}
