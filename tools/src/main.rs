//! Makers of the project's own data and pictures: not part of the product, built beside it.

#[macro_use]
mod materials;

mod contact_sheet;
mod demo_capture;
mod flat_fields;
mod font;
mod overlay;
mod pitch;
mod table1_scene;
mod timings;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Makers of Shutterbug's own data and pictures.
#[derive(Parser)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Writes the capture that ships as demo/capture: a small football field seen by a walking robot.
    DemoCapture {
        /// The folder to write; made if absent.
        #[arg(long)]
        out: PathBuf,
    },
    /// Writes the capture that ships as scenes/table1: the scene of the paper's Table 1, as its section 4 describes it.
    Table1Scene {
        /// The folder to write; made if absent.
        #[arg(long)]
        out: PathBuf,
    },
    /// Puts frames of several folders side by side: one column a folder, one row a frame name.
    ContactSheet(contact_sheet::Args),
    /// Takes flat fields with a simulated sensor, as EMVA 1288 wants them: raw digital numbers and the list of them.
    FlatFields(flat_fields::Args),
    /// Puts further effects on a capture's real frames: a capture with a known answer from another renderer's frames.
    Overlay(overlay::Args),
    /// Prints the time of each pass from the timings that `simulate --timings` wrote.
    Timings(timings::Args),
}

fn main() -> ExitCode {
    let done = match Cli::parse().command {
        Command::DemoCapture { out } => demo_capture::write(&out),
        Command::Table1Scene { out } => table1_scene::write(&out),
        Command::ContactSheet(args) => contact_sheet::write(&args),
        Command::FlatFields(args) => flat_fields::write(&args),
        Command::Overlay(args) => overlay::write(&args),
        Command::Timings(args) => timings::print(&args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
