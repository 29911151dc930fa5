//! `shutterbug withhold --out DIR --count N --seed S`.

use std::path::{Path, PathBuf};

use super::args::Withhold;
use super::interrupt::Interrupt;
use crate::error::{Error, Result};
use crate::withhold::{CurveOptions, WithholdOptions, curves, graded_effects, withhold};

/// Runs the command.
pub fn run(args: &Withhold) -> Result<()> {
    let program = std::env::current_exe().map_err(|e| Error::io(Path::new("shutterbug"), "find", e))?;
    let options = WithholdOptions {
        out: args.out.clone(),
        count: args.count,
        seed: args.seed,
        size_px: [args.width, args.height],
        frames: args.frames,
        recordings: recordings(args.trajectories.as_deref())?,
        program,
        device: args.device.clone(),
        keep_frames: args.keep_frames,
        only: args.only.clone(),
    };
    let interrupt = Interrupt::listen();
    if !args.curve.is_empty() {
        let all = args.curve == ["all"];
        let effects =
            if all { graded_effects().into_iter().map(str::to_owned).collect() } else { args.curve.clone() };
        let curve = CurveOptions { effects, points: args.points, repeats: args.repeats };
        curves(&options, &curve, &mut |line| eprintln!("{line}"), &|| interrupt.requested())?;
        eprintln!("{}", args.out.join("curves.html").display());
        return Ok(());
    }
    let result = withhold(&options, &mut |line| eprintln!("{line}"), &|| interrupt.requested())?;
    let summary = serde_json::to_string_pretty(&result.summary).expect("all keys are strings");
    println!("{summary}");
    eprintln!("{}", args.out.join("withhold.html").display());
    Ok(())
}

/// A file, or the `.tum` and `.txt` files of a folder, sorted; none without a path.
fn recordings(path: Option<&Path>) -> Result<Vec<PathBuf>> {
    let Some(path) = path else { return Ok(Vec::new()) };
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let entries = std::fs::read_dir(path).map_err(|e| Error::io(path, "list", e))?;
    let mut files: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
    files.retain(|p| p.extension().is_some_and(|e| e == "tum" || e == "txt"));
    files.sort();
    if files.is_empty() {
        return Err(Error::input(
            path,
            None,
            "no recording",
            "files *.tum or *.txt: lines of t tx ty tz qx qy qz qw",
        ));
    }
    Ok(files)
}
