//! The command line; see `shutterbug --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    shutterbug_cli::cli::run()
}
