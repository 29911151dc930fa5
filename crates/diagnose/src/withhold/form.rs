//! Trials of the forms of input that have no scene: the same hidden cameras, but the diagnosis is given the frames of a
//! simulator.
//!
//! Simulated frames come from `shutterbug simulate` with an ideal camera; real ones, as always, from the reference on
//! the CPU.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::WithholdOptions;
use super::child::made;
use super::draw::Draw;
use super::falsify::normal;
use super::motion::Motion;
use crate::diagnose::changes_places;
use shutterbug::camera::Trajectory;
use shutterbug::capture::{Capture, read_text};
use shutterbug::error::{Error, Result};
use shutterbug::files::Limit;
use shutterbug::plane::write_atomic;

/// Standard deviation of the poses of roughly aligned frames, by axis: rad, m.
const ROUGH: [f64; 2] = [0.0175, 0.02];
/// What unpaired frames can tell, see docs/pairs.md.
const UNPAIRED: [&str; 10] = [
    "bayer_mosaic",
    "shot_noise",
    "fixed_pattern_noise",
    "row_noise",
    "hot_pixels",
    "read_noise",
    "chromatic_aberration",
    "defocus",
    "chroma_subsampling",
    "jpeg",
];

/// What a diagnosis is given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// A scene and a path.
    #[default]
    Capture,
    /// Simulated frames of the same moments, with depth and the path.
    Pairs,
    /// Simulated frames at poses that are a little off, and nothing else.
    Rough,
    /// Simulated frames of the same room from another path.
    Unpaired,
}

impl Form {
    /// Of `available` effects those that frames of this form can tell.
    pub(super) fn tells(self, available: &[&'static str]) -> Vec<&'static str> {
        let told = |name: &&&'static str| match self {
            Self::Capture | Self::Pairs => true,
            Self::Rough => **name == "chromatic_aberration" || !changes_places(name),
            Self::Unpaired => UNPAIRED.contains(name),
        };
        available.iter().filter(told).copied().collect()
    }

    /// Makes the folder of simulated frames `sim` for a capture.
    ///
    /// # Errors
    /// Files that cannot be read or written, a simulation that fails or is stopped.
    pub(super) fn make(
        self,
        options: &WithholdOptions,
        index: usize,
        (capture, sim): (&Path, &Path),
        stop: &dyn Fn() -> bool,
    ) -> Result<()> {
        let room = capture.with_file_name("room");
        copy(capture, &room)?;
        let mut draw = Draw::new(options.seed, index, "simulated path");
        let path = room.join("trajectory.tum");
        match self {
            Self::Capture | Self::Pairs => {}
            Self::Rough => write_atomic(&path, rough(capture, &mut draw)?.as_bytes())?,
            Self::Unpaired => {
                let known = Capture::read(capture, None)?;
                let (from_s, to_s) = known.trajectory.span_s();
                let other = Motion::draw(&mut draw, &options.recordings, to_s - from_s)?;
                write_atomic(&path, other.tum(from_s).as_bytes())?;
            }
        }
        let mut command = Command::new(&options.program);
        command.arg("simulate").arg(&room).arg("--out").arg(sim).arg("--overwrite").stdin(Stdio::null());
        if self == Self::Pairs {
            command.args(["--planes", "depth"]);
        }
        if let Some(device) = &options.device {
            command.arg("--device").arg(device);
        }
        made(command, "simulation", capture, stop)?;
        if self == Self::Pairs {
            for name in ["trajectory.tum", "camera.toml", "frames.csv"] {
                take(&room.join(name), &sim.join(name))?;
            }
        }
        fs::remove_dir_all(&room).map_err(|e| Error::io(&room, "remove", e))
    }
}

/// The capture's poses at the frames' times, each off by a turn and a step of its own.
fn rough(capture: &Path, draw: &mut Draw) -> Result<String> {
    let known = Capture::read(capture, None)?;
    let mut out = String::from("# t tx ty tz qx qy qz qw\n");
    let path: &Trajectory = &known.trajectory;
    for frame in &known.frames {
        let pose = path.pose_at(frame.start_s);
        let mut axis = |size: f64| DVec3::new(normal(draw), normal(draw), normal(draw)) * size;
        let (turn, step) = (axis(ROUGH[0]), axis(ROUGH[1]));
        let q = (pose.rotation * DQuat::from_scaled_axis(turn)).normalize();
        let t = pose.translation_m + step;
        // Straight lines from frame to frame: an ideal camera sees none of them.
        writeln!(
            out,
            "{:.9} {:.9} {:.9} {:.9} {:.12} {:.12} {:.12} {:.12}",
            frame.start_s, t.x, t.y, t.z, q.x, q.y, q.z, q.w
        )
        .expect("a String");
    }
    Ok(out)
}

/// Copies a capture without its frames.
fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to).map_err(|e| Error::io(to, "create the folder", e))?;
    for entry in fs::read_dir(from).map_err(|e| Error::io(from, "list", e))? {
        let path = entry.map_err(|e| Error::io(from, "list", e))?.path();
        let Some(name) = path.file_name().filter(|n| *n != "real") else { continue };
        if path.is_dir() { copy(&path, &to.join(name))? } else { take(&path, &to.join(name))? }
    }
    Ok(())
}

fn take(from: &Path, to: &Path) -> Result<()> {
    if to.extension().is_some_and(|e| e == "tum" || e == "toml" || e == "csv") {
        let text = read_text(from, "a part of the capture", Limit::TABLE)?;
        return write_atomic(to, text.as_bytes());
    }
    fs::copy(from, to).map(|_| ()).map_err(|e| Error::io(from, "copy", e))
}
