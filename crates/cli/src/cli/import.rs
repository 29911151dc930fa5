//! `shutterbug import`: a recording's motion as a capture's files.

use std::fs;
use std::path::Path;

use super::args::Import;
use super::terminal::say;
use crate::formats::{Format, read_euroc, read_kitti, write_camera};
use shutterbug::error::{Error, Result};
use shutterbug::files::write_single;
use shutterbug_diagnose::out::recorded_reads;

/// Writes frames.csv, trajectory.tum and, where the recording has a camera, camera.toml.
pub fn run(args: &Import) -> Result<()> {
    let motion = if args.input.is_dir() {
        read_euroc(&args.input, Some(&args.name))?
    } else {
        read_kitti(&args.input, args.times.as_deref())?
    };
    let mut notes = motion.notes.clone();
    let mut files = vec![("frames.csv", motion.frames_csv()), ("trajectory.tum", motion.trajectory_tum())];
    if let Some(camera) = &motion.camera {
        // Its place on the body is in the trajectory now.
        let camera = crate::formats::CameraModel { body_from_camera: None, ..camera.clone() };
        let (text, left_out) = write_camera(&camera, Format::Toml, &args.out.join("camera.toml"), None)?;
        notes.extend(left_out);
        files.push(("camera.toml", text));
    }
    if !args.overwrite
        && let Some((name, _)) = files.iter().find(|(name, _)| args.out.join(name).exists())
    {
        let expected = "no such file yet, or --overwrite";
        return Err(Error::input(&args.out.join(name), None, "a file", expected));
    }
    let inputs: Vec<_> = recorded_reads().into_keys().collect();
    fs::create_dir_all(&args.out).map_err(|e| Error::io(&args.out, "create the folder", e))?;
    for (name, text) in &files {
        write_single(&args.out.join(name), text.as_bytes(), args.overwrite, &inputs)?;
    }
    for note in &notes {
        tracing::warn!("{}: {note}", args.input.display());
    }
    let names: Vec<_> = files.iter().map(|(name, _)| *name).collect();
    report(&args.out, &names, motion.frames.len(), motion.poses.len());
    Ok(())
}

fn report(out: &Path, names: &[&str], frames: usize, poses: usize) {
    say(format_args!("{frames} frames and {poses} poses: {} written to {}", names.join(", "), out.display()));
}
