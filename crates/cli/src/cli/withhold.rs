//! `shutterbug withhold --out DIR --count N --seed S`.

use std::path::{Path, PathBuf};

use super::args::{FormName, Withhold};
use super::interrupt::Interrupt;
use super::terminal::{print, say};
use shutterbug::error::{Error, Result};
use shutterbug_diagnose::out::{Out, OutRules};
use shutterbug_diagnose::withhold::{CurveOptions, Falsified, Form, WithholdOptions, curves, withhold};

/// Runs the command.
pub fn run(args: &Withhold) -> Result<()> {
    let program = std::env::current_exe().map_err(|e| Error::io(Path::new("shutterbug"), "find", e))?;
    if let Some(absent) = args.only.iter().find(|n| **n >= args.count) {
        let found = format!("case {absent}, and --count {}", args.count);
        return Err(Error::input(Path::new("--only"), None, found, "numbers of cases, from 0"));
    }
    // Before a folder is made.
    let curve = (!args.curve.is_empty())
        .then(|| CurveOptions::new(&args.curve, args.points, args.repeats))
        .transpose()?;
    let falsified = falsified(&args.imperfect)?;
    let recordings = recordings(args.trajectories.as_deref())?;
    let inputs: Vec<&Path> = recordings.iter().map(PathBuf::as_path).collect();
    let rules = OutRules { command: "withhold", inputs: &inputs, overwrite: args.overwrite, goes_on: true };
    let out = Out::open(&args.out, &rules)?;
    out.go_on()?;
    let options = WithholdOptions {
        out: args.out.clone(),
        count: args.count,
        seed: args.seed,
        size_px: [args.width, args.height],
        frames: args.frames,
        recordings,
        program,
        device: args.device.clone(),
        keep_frames: args.keep_frames,
        only: args.only.clone(),
        falsified,
        form: match args.form {
            FormName::Capture => Form::Capture,
            FormName::Pairs => Form::Pairs,
            FormName::Rough => Form::Rough,
            FormName::Unpaired => Form::Unpaired,
        },
    };
    let interrupt = Interrupt::listen();
    if let Some(curve) = curve {
        curves(&options, &curve, &mut |line| say(line), &|| interrupt.requested())?;
        say(args.out.join("curves.html").display());
        return Ok(());
    }
    let result = withhold(&options, &mut |line| say(line), &|| interrupt.requested())?;
    let summary = serde_json::to_string_pretty(&result.summary).expect("all keys are strings");
    print(summary + "\n")?;
    say(args.out.join("withhold.html").display());
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

/// Words of `--imperfect`; `all` is all of them.
fn falsified(words: &[String]) -> Result<Vec<Falsified>> {
    if words == ["all"] {
        return Ok(Falsified::ALL.to_vec());
    }
    let known = || Falsified::ALL.iter().map(|f| f.name()).chain(["all"]).collect::<Vec<_>>();
    let one = |word: &String| {
        let unknown =
            || Error::unknown_name(Path::new("--imperfect"), None, "part of a description", word, known());
        Falsified::from_name(word).ok_or_else(unknown)
    };
    words.iter().map(one).collect()
}
