//! Failed calls as Python's exceptions.

use pyo3::prelude::*;
use shutterbug::capi::{STATUSES, Status};

/// Names and meanings of all statuses, in the order of their numbers.
#[pyfunction]
pub fn statuses() -> Vec<(&'static str, &'static str)> {
    STATUSES.iter().map(|(_, name, text)| (*name, *text)).collect()
}

/// The exception of a status, with the library's sentence: `shutterbug.errors` says which.
pub fn exception(py: Python<'_>, status: Status, sentence: &str) -> PyErr {
    let made = py
        .import("shutterbug.errors")
        .and_then(|errors| errors.getattr("of_status"))
        .and_then(|of_status| of_status.call1((status, sentence)));
    match made {
        Ok(error) => PyErr::from_value(error),
        Err(error) => error,
    }
}

/// An error of the Rust library, which stands for a file or text that cannot be used.
pub fn input_error(py: Python<'_>, error: &shutterbug::Error) -> PyErr {
    let status = match error {
        shutterbug::Error::Io { .. } => number("IO"),
        shutterbug::Error::NoVulkanLoader { .. } | shutterbug::Error::NoDevice { .. } => number("NO_DEVICE"),
        _ => number("INPUT"),
    };
    exception(py, status, &error.to_string())
}

/// The number of a status by its name.
pub fn number(name: &str) -> Status {
    STATUSES.iter().find(|(_, n, _)| *n == name).map_or(-1, |(number, ..)| *number)
}
