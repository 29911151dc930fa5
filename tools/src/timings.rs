//! `timings`: the time of each pass as a table, from the `timings.json` that `simulate --timings` writes.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::{Context, Result};
use serde::Deserialize;

/// Which files to print.
#[derive(clap::Args)]
pub struct Args {
    /// Folders that hold a `timings.json`: LABEL=DIR.
    #[arg(required = true, value_parser = labelled)]
    runs: Vec<(String, PathBuf)>,
}

/// The part of `timings.json` that is printed; other keys may stand beside these.
#[derive(Deserialize)]
struct Timings {
    device: String,
    driver: String,
    method: String,
    frames: u64,
    passes: Vec<Pass>,
    host_ms_median: f64,
}

#[derive(Deserialize)]
struct Pass {
    name: String,
    ms_median: f64,
    ms_p95: f64,
}

fn labelled(text: &str) -> std::result::Result<(String, PathBuf), String> {
    let (label, folder) = text.split_once('=').ok_or_else(|| format!("`{text}` is not LABEL=DIR"))?;
    Ok((label.to_owned(), folder.into()))
}

/// Prints the table.
///
/// # Errors
/// A file that is missing or is not a timings file.
pub fn print(args: &Args) -> Result<()> {
    let mut runs = Vec::new();
    for (label, folder) in &args.runs {
        let path = folder.join("timings.json");
        let text =
            std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let timings: Timings =
            serde_json::from_str(&text).with_context(|| format!("{}: not a timings file", path.display()))?;
        runs.push((label.as_str(), timings));
    }
    print!("{}", table(&runs));
    Ok(())
}

/// One line a pass; the device is said once for every change of it.
fn table(runs: &[(&str, Timings)]) -> String {
    let mut text = String::new();
    let mut device = String::new();
    for (label, run) in runs {
        let this = format!("{} ({}), method {}", run.device, run.driver, run.method);
        if this != device {
            writeln!(text, "{this}").expect("writing to a String cannot fail");
            writeln!(text, "{:<18}{:<28}{:>12}{:>12}", "", "pass", "median ms", "p95 ms").expect("as above");
            device = this;
        }
        for (i, pass) in run.passes.iter().enumerate() {
            let first = if i == 0 { label } else { "" };
            writeln!(text, "{first:<18}{:<28}{:>12.3}{:>12.3}", pass.name, pass.ms_median, pass.ms_p95)
                .expect("as above");
        }
        let whole = format!("host clock, {} frames", run.frames);
        writeln!(
            text,
            "{:<18}{whole:<28}{:>12.3}",
            if run.passes.is_empty() { label } else { "" },
            run.host_ms_median
        )
        .expect("as above");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    const JSON: &str = r#"{"device":"llvmpipe","driver":"Mesa 22","method":"paper","frames":6,"later":[1],
        "passes":[{"name":"raster","ms_median":1.25,"ms_p95":1.5},{"name":"warp","ms_median":0.5,"ms_p95":0.75}],
        "host_ms_median":2.5}"#;

    #[test]
    fn every_pass_is_printed_once_under_its_run() {
        let run = || serde_json::from_str::<Timings>(JSON).expect("valid");
        let text = table(&[("ideal", run()), ("blur", run())]);
        assert_eq!(text.matches("llvmpipe (Mesa 22), method paper").count(), 1);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 2 + 2 * 3);
        assert_eq!(lines[2].split_whitespace().collect::<Vec<_>>(), ["ideal", "raster", "1.250", "1.500"]);
        assert_eq!(lines[3].split_whitespace().collect::<Vec<_>>(), ["warp", "0.500", "0.750"]);
        assert!(lines[5].starts_with("blur ") && lines[7].ends_with("2.500"), "{text}");
    }

    #[test]
    fn other_json_is_refused() {
        assert!(serde_json::from_str::<Timings>(&JSON.replace("host_ms_median", "host")).is_err());
        assert!(labelled("nolabel").is_err());
    }
}
