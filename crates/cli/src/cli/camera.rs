//! `shutterbug camera convert`.

use std::path::Path;

use super::args::Convert;
use super::terminal::print;
use crate::formats::{Format, read_camera, write_camera};
use shutterbug::error::{Error, Result};
use shutterbug::files::write_single;

/// Converts one camera; what has no place in the target is said on stderr and in the file.
pub fn run(args: &Convert) -> Result<()> {
    let target = match args.to {
        Some(to) => to.into(),
        None => by_ending(args.out.as_deref())?,
    };
    let imported = read_camera(&args.input, args.from.map(Format::from), args.name.as_deref())?;
    let out = args.out.as_deref().unwrap_or(Path::new("the camera"));
    // What is missing is missing from the input.
    let (text, notes) = write_camera(&imported.camera, target, &args.input, args.rate_hz)?;
    for note in &imported.notes {
        tracing::warn!("{}: {note}", args.input.display());
    }
    for note in &notes {
        tracing::warn!("{}: {note}", out.display());
    }
    match &args.out {
        Some(path) => write_single(path, text.as_bytes(), args.overwrite, std::slice::from_ref(&args.input)),
        None => print(text),
    }
}

/// The format that a file's ending names: YAML has three.
fn by_ending(out: Option<&Path>) -> Result<Format> {
    let Some(path) = out else { return Ok(Format::Toml) };
    match path.extension().and_then(|e| e.to_str()).map(str::to_lowercase).as_deref() {
        Some("toml") => Ok(Format::Toml),
        Some("sdf" | "xml" | "world") => Ok(Format::Sdf),
        Some("json") => Ok(Format::Gyroflow),
        _ => {
            let names: Vec<_> = Format::ALL.iter().map(|f| f.name()).collect();
            let expected = format!("--to {}", names.join(", "));
            Err(Error::input(path, None, "an ending that names no format", expected))
        }
    }
}
