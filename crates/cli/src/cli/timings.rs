//! Times of the passes over a run: printed, and written as `timings.json`.

use std::path::Path;

use serde::Serialize;

use super::terminal::print;
use shutterbug::engine::Frame;
use shutterbug::error::{Result, counted};
use shutterbug::gpu::{Context, DeviceKind};
use shutterbug::plane::write_atomic;

/// Collects the times of every frame.
#[derive(Default)]
pub struct Timings {
    passes: Vec<(&'static str, Vec<f64>)>,
    host_ms: Vec<f64>,
}

#[derive(Serialize)]
struct Report<'a> {
    device: &'a str,
    driver: &'a str,
    /// On a software device the timestamps are CPU times.
    software_device: bool,
    method: &'a str,
    width: u32,
    height: u32,
    samples: u32,
    frames: usize,
    passes: Vec<Row>,
    host_ms_median: f64,
    host_ms_p95: f64,
}

#[derive(Serialize)]
struct Row {
    name: &'static str,
    ms_median: f64,
    ms_p95: f64,
}

impl Timings {
    /// Adds a frame.
    pub fn add(&mut self, frame: &Frame) {
        self.host_ms.push(frame.host_ms);
        for time in &frame.times {
            match self.passes.iter_mut().find(|(name, _)| *name == time.name) {
                Some((_, all)) => all.push(time.ms),
                None => self.passes.push((time.name, vec![time.ms])),
            }
        }
    }

    /// Writes `out/timings.json` and prints the table.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(
        &self,
        out: &Path,
        context: &Context,
        method: &str,
        size: [u32; 2],
        samples: u32,
    ) -> Result<()> {
        let info = context.info();
        let row = |(name, all): &(&'static str, Vec<f64>)| Row {
            name,
            ms_median: quantile(all, 0.5),
            ms_p95: quantile(all, 0.95),
        };
        let report = Report {
            device: &info.name,
            driver: &info.driver,
            software_device: info.kind == DeviceKind::Cpu,
            method,
            width: size[0],
            height: size[1],
            samples,
            frames: self.host_ms.len(),
            passes: self.passes.iter().map(row).collect(),
            host_ms_median: quantile(&self.host_ms, 0.5),
            host_ms_p95: quantile(&self.host_ms, 0.95),
        };
        let clock = if report.software_device { "CPU time by a software driver" } else { "GPU time" };
        let json = serde_json::to_string_pretty(&report).expect("numbers and strings serialize");
        write_atomic(&out.join("timings.json"), json.as_bytes())?;
        let mut text = format!(
            "{} of {}x{}, {} ({clock})\n",
            counted(report.frames, "frame", "frames"),
            size[0],
            size[1],
            info.name
        );
        text += &format!("{:<16} {:>10} {:>10}\n", "pass", "median ms", "p95 ms");
        for row in &report.passes {
            text += &format!("{:<16} {:>10.3} {:>10.3}\n", row.name, row.ms_median, row.ms_p95);
        }
        let host =
            format!("{:<16} {:>10.3} {:>10.3}\n", "frame (host)", report.host_ms_median, report.host_ms_p95);
        print(text + &host)
    }
}

/// Quantile by nearest rank; 0 of nothing.
fn quantile(values: &[f64], at: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = (at * sorted.len() as f64).ceil() as usize;
    sorted.get(place.saturating_sub(1)).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_that_occurred() {
        let values = [5.0, 1.0, 4.0, 2.0, 3.0];
        assert_eq!(quantile(&values, 0.5), 3.0);
        assert_eq!(quantile(&values, 0.95), 5.0);
        assert_eq!(quantile(&[], 0.5), 0.0);
    }
}
