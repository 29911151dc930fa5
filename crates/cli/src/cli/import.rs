//! `shutterbug import`: turns a recording into a folder for `diagnose`, or lists its contents.

use std::path::Path;
use std::time::{Duration, Instant};

use super::args_import::Import;
use super::interrupt::Interrupt;
use super::terminal::{print, say};
use crate::import::{Damage, Delivered, Prepared, RUN_FILE, Recording, deliver};
use shutterbug::error::{Error, Result, counted};
use shutterbug::files::{Limit, read_if_there, write_atomic};
use shutterbug_diagnose::out::{Out, OutRules, recorded_reads};

/// Time between two lines of progress.
const LOG_INTERVAL: Duration = Duration::from_secs(2);

/// Runs the command.
pub fn run(args: &Import) -> Result<()> {
    let recording = Recording::open(&args.input)?;
    let mut said = Instant::now();
    let mut progress = |at: u64, all: u64| {
        if said.elapsed() >= LOG_INTERVAL {
            said = Instant::now();
            say(format_args!("reading: {} %", 100 * at / all.max(1)));
        }
        Ok(())
    };
    let Some(folder) = &args.out else {
        let (text, broken) = recording.listing(&mut progress)?;
        print(text)?;
        return broken.map_or(Ok(()), Err);
    };
    refuse_finished(args, folder)?;
    let rules = OutRules {
        command: "import",
        inputs: &[&args.input],
        overwrite: args.overwrite,
        goes_on: args.resume,
    };
    let out = Out::open(folder, &rules)?;
    let prepared = recording.prepare(&args.request(), &mut progress)?;
    prepared.note_pictures()?;
    let goes_on = begin(args, folder, &out)?;
    let delivered = write(args, folder, &prepared, (&out, goes_on))?;
    for note in prepared.notes.iter().chain(&delivered.note) {
        tracing::warn!("{}: {note}", args.input.display());
    }
    out.check_same()?;
    report(args, folder, &prepared, &delivered);
    let input = |(found, expected): Damage| Error::input(&args.input, None, found, expected);
    let errors = [delivered.broken.map(input), delivered.left_out.map(input), prepared.broken()];
    let mut errors = errors.into_iter().flatten();
    let Some(first) = errors.next() else { return Ok(()) };
    // Each is a reason of its own; the one that ends the command is said at its end.
    errors.for_each(say);
    Err(first)
}

/// An import that is done is replaced only when that is asked for.
fn refuse_finished(args: &Import, folder: &Path) -> Result<()> {
    let path = folder.join("frames.csv");
    if args.overwrite || args.resume || path.symlink_metadata().is_err() {
        return Ok(());
    }
    Err(Error::input(&path, None, "a file", "no such file yet, --resume or --overwrite"))
}

/// Writes what this run is; whether it goes on with an earlier one, which was the same.
fn begin(args: &Import, folder: &Path, out: &Out) -> Result<bool> {
    let path = folder.join(RUN_FILE);
    let now = run_json(args);
    let before = if args.resume { read_if_there(&path, Limit::OWN)? } else { None };
    if before.as_ref().is_some_and(|b| *b != now.as_bytes()) {
        let found = "frames of an import with other input or options";
        return Err(Error::input(
            &path,
            None,
            found,
            "the same as now; use another --out, or leave out --resume",
        ));
    }
    let goes_on = before.is_some();
    if goes_on {
        out.go_on()?;
    } else {
        out.start()?;
    }
    write_atomic(&path, now.as_bytes())?;
    Ok(goes_on)
}

/// Everything that decides what is written: the options, and every file that was read.
fn run_json(args: &Import) -> String {
    let files: serde_json::Map<_, _> =
        recorded_reads().into_iter().map(|(path, mark)| (path.display().to_string(), mark.into())).collect();
    let value = serde_json::json!({
        "shutterbug": env!("CARGO_PKG_VERSION"),
        "request": format!("{:?}", args.request()),
        "capture": args.capture,
        "files": files,
    });
    serde_json::to_string_pretty(&value).expect("strings serialize") + "\n"
}

fn write(args: &Import, folder: &Path, prepared: &Prepared, out: (&Out, bool)) -> Result<Delivered> {
    let interrupt = Interrupt::listen();
    let mut said = Instant::now();
    let mut watch = |done: usize, total: usize| {
        if interrupt.requested() && done < total {
            return Err(Error::Interrupted { done, total });
        }
        if said.elapsed() >= LOG_INTERVAL {
            said = Instant::now();
            say(format_args!("{done} of {total} frames"));
        }
        Ok(())
    };
    let pictures = if args.capture { "real" } else { "" };
    deliver(prepared, (folder, pictures), out, &mut watch)
}

fn report(args: &Import, folder: &Path, prepared: &Prepared, delivered: &Delivered) {
    let (names, to) = (delivered.files.join(", "), folder.display());
    say(format_args!(
        "{} and {}: {names} written to {to}",
        counted(delivered.frames, "frame", "frames"),
        counted(prepared.poses(), "pose", "poses")
    ));
    if delivered.files.contains(&"trajectory.tum") && args.capture {
        say("with a scene.obj `shutterbug diagnose` names what the camera does");
    }
}
