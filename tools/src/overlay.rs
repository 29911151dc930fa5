//! `overlay`: a capture whose real frames get further effects put on them. With another renderer's frames this makes
//! captures with a known answer of which nothing was drawn by the simulator that diagnoses them.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use shutterbug::capture::{CameraFile, Capture};
use shutterbug::chain::{Effect, View, Work};
use shutterbug::effects;
use shutterbug::plane::{Plane, read_rgb8, srgb_decode, write_png_atomic};
use shutterbug::reference::chain;

/// What goes on top of what.
#[derive(clap::Args)]
pub struct Args {
    /// The capture whose real frames are read.
    #[arg(long)]
    capture: PathBuf,
    /// A camera.toml with the effects to put on: those that act on the picture, not on its geometry or time.
    #[arg(long)]
    camera: PathBuf,
    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The new capture's folder; made if absent.
    #[arg(long)]
    out: PathBuf,
}

/// Writes the capture: the frames with the effects on, everything else as it was.
///
/// # Errors
/// A capture or camera that cannot be read, an effect that acts before there is a picture, files that cannot be
/// written.
pub fn write(args: &Args) -> Result<()> {
    let camera = CameraFile::read(&args.camera)?;
    for (name, _) in camera.settings.iter() {
        let effect = effects::by_id(name).with_context(|| format!("no effect `{name}`"))?;
        ensure!(!matches!(effect.work(), Work::Elsewhere), "{name} acts before there is a picture");
    }
    copy_all_but_frames(&args.capture, &args.out)?;
    let capture = Capture::read(&args.out, None)?;
    for (frame, entry) in capture.frames.iter().enumerate() {
        let name = Path::new("real").join(&entry.filename);
        let clean = linear(&read_rgb8(&args.capture.join(&name))?);
        let (intrinsics, shutter) = (capture.true_intrinsics(), capture.shutter(frame));
        let view = View { intrinsics, shutter, frame: frame as u32, seed: args.seed };
        let list: &[&dyn Effect] = effects::LIST;
        write_png_atomic(&args.out.join(&name), &chain::picture(list, &camera.settings, &view, &clean))?;
    }
    Ok(())
}

/// Delivered values as linear radiance, shape `[height, width, 4]`.
fn linear(delivered: &Plane<u8>) -> Plane<f32> {
    let pixels = delivered.data.chunks_exact(3);
    let data =
        pixels.flat_map(|p| [p[0], p[1], p[2], 255].map(|v| srgb_decode(f32::from(v) / 255.0))).collect();
    Plane { width: delivered.width, height: delivered.height, channels: 4, data }
}

fn copy_all_but_frames(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to.join("real"))?;
    for entry in fs::read_dir(from).with_context(|| format!("{}", from.display()))? {
        let entry = entry?;
        let (name, path) = (entry.file_name(), entry.path());
        // The answer is another one now.
        if name == "real" || name == "answer.json" {
            continue;
        }
        if path.is_dir() {
            fs::create_dir_all(to.join(&name))?;
            for file in fs::read_dir(&path)? {
                let file = file?;
                fs::copy(file.path(), to.join(&name).join(file.file_name()))?;
            }
        } else {
            fs::copy(&path, to.join(&name))?;
        }
    }
    Ok(())
}
