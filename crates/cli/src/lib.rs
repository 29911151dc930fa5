//! The command line `shutterbug`, as a library: for its own program, and for the Python package, which runs it.

pub mod cli;
pub mod formats;
pub mod import;
