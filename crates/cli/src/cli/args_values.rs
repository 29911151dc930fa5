//! Parsers of single values on the command line.

use shutterbug::engine::{GATHER_KERNELS, GatherKernel};

pub(super) fn gather_kernel(text: &str) -> Result<GatherKernel, String> {
    let names: Vec<_> = GATHER_KERNELS.iter().map(|k| k.name).collect();
    let found = GATHER_KERNELS.iter().find(|k| k.name == text);
    found.copied().ok_or_else(|| format!("a kernel is one of {}", names.join(", ")))
}

pub(super) fn samples(text: &str) -> Result<u32, String> {
    match text.parse() {
        Ok(n @ (1 | 4 | 16)) => Ok(n),
        _ => Err("samples a pixel are 1, 4 or 16".to_owned()),
    }
}

/// A whole number between two.
pub(super) fn in_steps(from: usize, to: usize) -> impl Fn(&str) -> Result<usize, String> + Clone {
    move |text| match text.parse() {
        Ok(n) if (from..=to).contains(&n) => Ok(n),
        _ => Err(format!("{from} to {to}")),
    }
}

pub(super) fn rate_hz(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(rate) if (1.0 / 86_400.0..=1e6).contains(&rate) => Ok(rate),
        _ => Err("a frame rate is a number of Hz, 1 a day to 1e6".to_owned()),
    }
}
