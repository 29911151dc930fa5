//! The folder: frames with times, the camera, and the gyro.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::turn::Gyro;
use crate::diagnose::evidence::LEAST_SIDE_PX;
use crate::diagnose::expect::pair::{notes_of_kind, pictures};
use shutterbug::camera::{Intrinsics, Lens};
use shutterbug::capture::{
    CameraFile, IMU_COLUMNS, check_columns, check_rates, is_header, parse_frames, read_text,
};
use shutterbug::effects::LensDistortion;
use shutterbug::error::{Error, Result, counted};
use shutterbug::files::Limit;
use shutterbug::plane::{Plane, read_rgb8};

/// Most pairs of neighbouring frames that are looked at.
const MOST_PAIRS: usize = 60;
/// Fewest: half of them judge.
const FEWEST_PAIRS: usize = 6;
/// Neighbours follow each other within so many periods.
const FOLLOWS: f64 = 1.5;
/// What the gyro must cover before and behind a frame, s.
const AROUND_S: f64 = 0.1;

/// A frame.
pub(super) struct Frame {
    pub name: String,
    pub path: PathBuf,
    /// Its timestamp, s after the first frame's.
    pub start_s: f64,
}

/// All that was given.
pub(super) struct Footage {
    pub folder: PathBuf,
    pub camera: CameraFile,
    /// The camera's lens: one that does not fold inside the picture.
    pub lens: Lens,
    pub frames: Vec<Frame>,
    pub gyro: Gyro,
    /// Frames that follow each other, which the gyro covers.
    pub pairs: Vec<[usize; 2]>,
    pub period_s: f64,
    pub notes: Vec<String>,
}

impl Footage {
    /// # Errors
    /// See [`super::diagnose_gyro`].
    pub(super) fn read(folder: &Path) -> Result<Self> {
        pictures(folder)?;
        let list = folder.join("frames.csv");
        let text =
            read_text(&list, "the times of the frames, lines `timestamp in ns,file name`", Limit::TABLE)?;
        let entries = parse_frames(&list, &text)?;
        let epoch_ns = entries[0].timestamp_ns;
        let camera_path = folder.join("camera.toml");
        let purpose = "the camera: width, height, fx, fy, cx, cy, frame_period_s";
        read_text(&camera_path, purpose, Limit::SETTINGS)?;
        let camera = CameraFile::read(&camera_path)?;
        let imu = folder.join("imu.csv");
        let purpose = "a gyro beside the frames, lines `timestamp in ns,wx,wy,wz` [rad/s], as `import` writes \
        it; or --sim";
        let (gyro, note) = read_gyro(&imu, &read_text(&imu, purpose, Limit::TABLE)?, epoch_ns)?;
        let frame = |e: shutterbug::capture::FrameEntry| Frame {
            path: folder.join(&e.filename),
            start_s: (e.timestamp_ns - epoch_ns) as f64 * 1e-9,
            name: e.filename,
        };
        let frames: Vec<Frame> = entries.into_iter().map(frame).collect();
        let period_s = period_s(&frames);
        check_size(&frames[0].path, &camera.intrinsics)?;
        let pairs = pairs(&frames, period_s, &gyro);
        let last_s = frames[frames.len() - 1].start_s;
        if pairs.len() < FEWEST_PAIRS {
            let [from_s, to_s] = gyro.span_s();
            let count = counted(pairs.len(), "pair of frames", "pairs of frames");
            let found = format!("rates from {from_s:.3} to {to_s:.3} s, which cover {count}");
            let expected =
                format!("at least {FEWEST_PAIRS} of the frames, which are from 0 to {last_s:.3} s");
            return Err(Error::input(&imu, None, found, expected));
        }
        let gaps = gyro.gaps_s().iter().filter(|[from_s, to_s]| *from_s < last_s && *to_s > 0.0);
        let gaps = gaps.map(|[from_s, to_s]| {
            format!("imu.csv has no rates from {from_s:.3} to {to_s:.3} s: frames of that time are left out")
        });
        let gaps: Vec<String> = gaps.collect();
        let lens = Lens::new(camera.intrinsics, LensDistortion::distortion(&camera.settings))?;
        let notes = notes_of_kind(folder, &frames[0].name)?;
        Ok(Self {
            folder: folder.to_owned(),
            camera,
            lens,
            frames,
            gyro,
            pairs,
            period_s,
            notes: notes.into_iter().chain(note).chain(gaps).collect(),
        })
    }

    /// From the first frame to the last, s.
    pub(super) fn span_s(&self) -> f64 {
        self.frames[self.frames.len() - 1].start_s - self.frames[0].start_s
    }

    pub(super) fn intrinsics(&self) -> &Intrinsics {
        &self.camera.intrinsics
    }

    /// Whether the camera has a lens that bends rays.
    pub(super) fn is_bent(&self) -> bool {
        !self.lens.distortion().is_identity()
    }

    /// Values of a frame, DN.
    ///
    /// # Errors
    /// A file that is no picture, or one of another size.
    pub(super) fn picture(&self, frame: usize) -> Result<Plane<f32>> {
        let picture = read_rgb8(&self.frames[frame].path)?;
        let k = self.intrinsics();
        if [picture.width as u32, picture.height as u32] != [k.width, k.height] {
            let found = format!("a picture of {}x{} px", picture.width, picture.height);
            let expected = format!("{}x{} px, as camera.toml says", k.width, k.height);
            return Err(Error::input(&self.frames[frame].path, None, found, expected));
        }
        Ok(picture.to_f32())
    }
}

fn check_size(first: &Path, k: &Intrinsics) -> Result<()> {
    if k.width.min(k.height) < LEAST_SIDE_PX {
        let found = format!("frames of {}x{} px", k.width, k.height);
        return Err(Error::input(first, None, found, format!("at least {LEAST_SIDE_PX} px a side")));
    }
    Ok(())
}

/// The usual time from frame to frame, s.
fn period_s(frames: &[Frame]) -> f64 {
    let mut steps: Vec<f64> = frames.windows(2).map(|w| w[1].start_s - w[0].start_s).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(1.0)
}

fn pairs(frames: &[Frame], period_s: f64, gyro: &Gyro) -> Vec<[usize; 2]> {
    let [from_s, to_s] = gyro.span_s();
    let all: Vec<[usize; 2]> = (1..frames.len())
        .filter(|&i| frames[i].start_s - frames[i - 1].start_s < FOLLOWS * period_s)
        .filter(|&i| frames[i - 1].start_s - AROUND_S > from_s && frames[i].start_s + AROUND_S < to_s)
        .filter(|&i| !gyro.is_broken(frames[i - 1].start_s - AROUND_S, frames[i].start_s + AROUND_S))
        .map(|i| [i - 1, i])
        .collect();
    let count = all.len().min(MOST_PAIRS);
    (0..count).map(|k| all[k * all.len() / count]).collect()
}

/// The gyro on the frames' clock, and what its file says of its axes.
fn read_gyro(path: &Path, text: &str, epoch_ns: i64) -> Result<(Gyro, Option<String>)> {
    let expected = "timestamp [ns] and the rates about x, y, z [rad/s]";
    check_columns(path, text, &IMU_COLUMNS[..4])?;
    let (mut times_s, mut rates) = (Vec::new(), Vec::new());
    let mut note = None;
    for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let (number, line) = (index + 1, line.trim());
        if let Some(axes) = line.strip_prefix("# axes ") {
            let camera = axes.contains("camera");
            note = (!camera).then(|| format!("imu.csv says of its axes: {axes}; the camera's are needed"));
        }
        if line.is_empty() || line.starts_with('#') || (times_s.is_empty() && is_header(line)) {
            continue;
        }
        let bad = || Error::input(path, number, format!("`{line}`"), expected);
        let mut fields = line.split(',').map(str::trim);
        let stamp_ns: i64 = fields.next().and_then(|f| f.parse().ok()).ok_or_else(bad)?;
        let mut rate = [0.0; 3];
        for r in &mut rate {
            *r = fields
                .next()
                .and_then(|f| f.parse::<f64>().ok())
                .filter(|v| v.is_finite())
                .ok_or_else(bad)?;
        }
        let time_s = (stamp_ns - epoch_ns) as f64 * 1e-9;
        if times_s.last().is_some_and(|last| time_s <= *last) {
            return Err(Error::input(path, number, format!("time {stamp_ns} ns"), "times that increase"));
        }
        times_s.push(time_s);
        rates.push(DVec3::from(rate));
    }
    if times_s.len() < 2 {
        return Err(Error::input(
            path,
            None,
            format!("{} rates", times_s.len()),
            format!("lines of {expected}"),
        ));
    }
    check_rates(path, rates.iter().map(|r| r.to_array()))?;
    Ok((Gyro::new(times_s, rates), note))
}
