//! Data sets that are folders: EuRoC / ASL, TUM RGB-D, KITTI odometry.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::prepared::{Pictures, Prepared, Request};
use super::tables::{imu_table, tum_list, tum_poses};
use crate::formats::{
    CameraModel, Format, Motion, body_from_sensor, read_camera, read_euroc, read_kitti, write_camera,
};
use shutterbug::camera::{Intrinsics, Pose};
use shutterbug::capture::{FrameEntry, parse_frames, read_text};
use shutterbug::error::{Error, Result, counted};
use shutterbug::files::{Limit, is_there, read};

/// KITTI's pixel centres are at whole numbers.
const PIXEL_CENTRE: f64 = 0.5;
/// What lists a folder of pictures' frames.
const FRAMES: &str = "the frames: lines of `timestamp in ns,file name`";

/// The kinds of folders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Euroc,
    Tum,
    Kitti,
}

/// What kind of data set a folder is, if it is one.
pub(super) fn kind_of(folder: &Path) -> Option<Kind> {
    let has = |name: &str| folder.join(name).exists();
    if has("mav0") || has("cam0/sensor.yaml") || has("state_groundtruth_estimate0") {
        return Some(Kind::Euroc);
    }
    if has("rgb.txt") {
        return Some(Kind::Tum);
    }
    (has("calib.txt") && has("times.txt")).then_some(Kind::Kitti)
}

/// Everything but the pictures' values.
pub(super) fn prepare(kind: Kind, folder: &Path, request: &Request) -> Result<Prepared> {
    match kind {
        Kind::Euroc => euroc(folder, request),
        Kind::Tum => tum(folder, request),
        Kind::Kitti => kitti(folder, request),
    }
}

/// KITTI's poses alone.
pub(super) fn prepare_poses(file: &Path, request: &Request) -> Result<Prepared> {
    let motion = read_kitti(file, request.times.as_deref())?;
    prepared(motion, Vec::new(), (file, None), request)
}

/// Puts a data set's parts together. `folder`: where the pictures are; if there are none, the tables are written alone.
fn prepared(
    motion: Motion,
    mut texts: Vec<(&'static str, String)>,
    (recording, folder): (&Path, Option<&Path>),
    request: &Request,
) -> Result<Prepared> {
    let Motion { camera, frames, poses, mut notes } = motion;
    let camera_px = camera.as_ref().map(|c| [c.intrinsics.width, c.intrinsics.height]);
    if let Some(camera) = camera {
        // Its place on the body is in the trajectory now.
        notes.extend(other_rate(camera.rate_hz, &frames));
        let rate_hz = camera.rate_hz.or_else(|| rate_hz(&frames));
        let camera = CameraModel { body_from_camera: None, rate_hz, ..camera };
        let (text, left_out) = write_camera(&camera, Format::Toml, Path::new("camera.toml"), None)?;
        notes.extend(left_out);
        texts.push(("camera.toml", text));
    }
    let kept: Vec<FrameEntry> = frames.into_iter().step_by(request.every.max(1)).collect();
    let pictures = match folder {
        Some(folder) => pictures(folder, &kept, &mut notes)?,
        None => Pictures::Missing,
    };
    Ok(Prepared {
        path: recording.to_owned(),
        times_ns: kept.iter().map(|f| f.timestamp_ns).collect(),
        names: Some(kept.into_iter().map(|f| f.filename).collect()),
        poses,
        camera_px,
        texts,
        notes,
        pictures,
        broken: None,
    })
}

/// Said where frames follow each other at another rate than a camera's file says. Frames may be missing, but half of
/// them come no faster; and a unit is off by a thousand.
fn other_rate(said_hz: Option<f64>, frames: &[FrameEntry]) -> Option<String> {
    let (said, seen) = (said_hz?, rate_hz(frames)?);
    let unit = seen > 100.0 * said || seen < 0.01 * said;
    (unit || seen > 1.1 * said).then(|| {
        let ask =
            if unit { "are the times in ns?" } else { "camera.toml has the latter, so correct one of them" };
        format!(
            "frames are {:.6} ms apart, and the camera's file says {:.6} ms ({said} a second): {ask}",
            1e3 / seen,
            1e3 / said
        )
    })
}

fn rate_hz(frames: &[FrameEntry]) -> Option<f64> {
    let times: Vec<i64> = frames.iter().map(|f| f.timestamp_ns).collect();
    Some(super::frames::periods_ns(&times)).filter(|p| *p > 0).map(|p| 1e9 / p as f64)
}

/// The frames' files. A data set that was stripped of its pictures gives its tables; one that lacks some is at fault.
fn pictures(folder: &Path, frames: &[FrameEntry], notes: &mut Vec<String>) -> Result<Pictures> {
    let paths: Vec<PathBuf> = frames.iter().map(|f| folder.join(&f.filename)).collect();
    let missing: Vec<&PathBuf> = paths.iter().filter(|p| !p.is_file()).collect();
    match missing.first() {
        None => Ok(Pictures::Files(paths)),
        Some(_) if missing.len() == paths.len() => {
            notes.push(format!(
                "none of the pictures is in {}: the tables are written alone",
                folder.display()
            ));
            Ok(Pictures::Missing)
        }
        Some(first) => {
            let found = format!(
                "no such file, as {} of {}",
                missing.len(),
                counted(paths.len(), "picture", "pictures")
            );
            Err(Error::input(first, None, found, "all pictures that the list names"))
        }
    }
}

fn euroc(folder: &Path, request: &Request) -> Result<Prepared> {
    let inner = folder.join("mav0");
    let root = if inner.is_dir() { inner } else { folder.to_owned() };
    let name = request.name.as_deref().unwrap_or("cam0");
    let camera_folder = root.join(name);
    let truth = root.join("state_groundtruth_estimate0");
    let wanted = request.poses.as_deref() != Some(super::prepared::NONE);
    let motion = if truth.exists() && wanted {
        read_euroc(folder, Some(name))?
    } else {
        let imported = read_camera(&camera_folder.join("sensor.yaml"), Some(Format::Euroc), None)?;
        let path = camera_folder.join("data.csv");
        let frames = parse_frames(&path, &read_text(&path, FRAMES, Limit::TABLE)?)?;
        let mut notes = imported.notes;
        notes.push("no state_groundtruth_estimate0: no trajectory.tum".to_owned());
        Motion { camera: Some(imported.camera), frames, poses: Vec::new(), notes }
    };
    let mut motion = motion;
    let body_from_camera = motion.camera.as_ref().and_then(|c| c.body_from_camera);
    let imu = match request.imu.as_deref() {
        Some(super::prepared::NONE) => None,
        _ => euroc_imu(&root.join("imu0"), name, body_from_camera, &mut motion.notes)?,
    };
    prepared(motion, imu.into_iter().collect(), (folder, Some(&camera_folder.join("data"))), request)
}

/// `imu0`, turned into the camera's axes where both sensors say how they sit.
fn euroc_imu(
    folder: &Path,
    camera: &str,
    body_from_camera: Option<Pose>,
    notes: &mut Vec<String>,
) -> Result<Option<(&'static str, String)>> {
    let path = folder.join("data.csv");
    if !is_there(&path) {
        return Ok(None);
    }
    let text = read_text(&path, "samples of the inertial sensor", Limit::TABLE)?;
    let about = folder.join("sensor.yaml");
    let body_from_imu = if is_there(&about) { body_from_sensor(&about)? } else { None };
    let turn = body_from_camera.zip(body_from_imu).map(|(c, i)| (c.inverse().then_from(&i)).rotation);
    let axes = match turn {
        Some(_) => format!("of the camera `{camera}` (x right, y down, z forward)"),
        None => "of the sensor: how it sits on the camera is not known".to_owned(),
    };
    notes.push(format!("imu.csv: axes {axes}"));
    Ok(Some(("imu.csv", imu_table(&path, &text, turn.unwrap_or_default(), &axes)?)))
}

fn tum(folder: &Path, request: &Request) -> Result<Prepared> {
    let list = folder.join("rgb.txt");
    let files = tum_list(&list)?;
    let entry = |(ns, name): &(i64, String)| FrameEntry {
        timestamp_ns: *ns,
        start_s: 0.0,
        filename: name.rsplit('/').next().unwrap_or_default().to_owned(),
    };
    let pictures_in = folder.join(files[0].1.rsplit_once('/').map_or("", |(folder, _)| folder));
    let frames: Vec<FrameEntry> = files.iter().map(entry).collect();
    let mut notes = vec!["TUM's files hold no camera: write camera.toml from the data set's page".to_owned()];
    for name in ["depth.txt", "accelerometer.txt"] {
        if folder.join(name).is_file() {
            notes.push(format!("{name} is left out: it is not needed to diagnose"));
        }
    }
    let truth = folder.join("groundtruth.txt");
    let wanted = request.poses.as_deref() != Some(super::prepared::NONE);
    let poses = if wanted && is_there(&truth) { tum_poses(&truth)? } else { Vec::new() };
    let mut motion = Motion { camera: None, frames, poses, notes };
    if motion.poses.is_empty() {
        motion.notes.push("no groundtruth.txt: no trajectory.tum".to_owned());
    } else {
        let times: Vec<i64> = motion.frames.iter().map(|f| f.timestamp_ns).collect();
        motion.keep_covered(&truth, super::frames::periods_ns(&times))?;
    }
    prepared(motion, Vec::new(), (folder, Some(&pictures_in)), request)
}

fn kitti(folder: &Path, request: &Request) -> Result<Prepared> {
    let name = match &request.name {
        Some(name) => name.clone(),
        None => {
            let there =
                ["image_2", "image_0", "image_3", "image_1"].into_iter().find(|n| folder.join(n).is_dir());
            there.unwrap_or("image_2").to_owned()
        }
    };
    let number = name.strip_prefix("image_").and_then(|n| n.parse::<usize>().ok()).filter(|n| *n < 4);
    let Some(number) = number else {
        return Err(Error::input(Path::new("--name"), None, name, "image_0, image_1, image_2 or image_3"));
    };
    let times = request.times.clone().unwrap_or_else(|| folder.join("times.txt"));
    let stem = folder.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let laid_out = folder.ancestors().nth(2).map(|top| top.join("poses").join(format!("{stem}.txt")));
    let poses = [Some(folder.join("poses.txt")), laid_out].into_iter().flatten().find(|p| is_there(p));
    let wanted = request.poses.as_deref() != Some(super::prepared::NONE);
    let mut motion = match poses.filter(|_| wanted) {
        Some(path) => read_kitti(&path, Some(&times))?,
        None => kitti_frames(&times)?,
    };
    let pictures_in = folder.join(&name);
    let k = kitti_camera(&folder.join("calib.txt"), number)?;
    if let Some(first) = motion.frames.first().map(|f| pictures_in.join(&f.filename)).filter(|p| p.is_file())
    {
        let bytes = read(&first, Limit::PICTURE)?;
        let picture = shutterbug::plane::decode_picture(&first, &bytes)?;
        let (width, height) = (picture.width(), picture.height());
        let at = |c: f64| c + PIXEL_CENTRE;
        let intrinsics = Intrinsics { width, height, fx: k.0[0], fy: k.0[1], cx: at(k.0[2]), cy: at(k.0[3]) };
        motion.notes.retain(|n| !n.contains("hold no camera"));
        motion.camera = Some(CameraModel::new(name, intrinsics));
    }
    for (_, pose) in &mut motion.poses {
        *pose = pose.then_from(&Pose { translation_m: k.1, ..Pose::IDENTITY });
    }
    prepared(motion, Vec::new(), (folder, Some(&pictures_in)), request)
}

fn kitti_frames(times: &Path) -> Result<Motion> {
    let lines = crate::formats::read_times(times)?;
    let frame = |(i, ns): (usize, i64)| FrameEntry {
        timestamp_ns: ns,
        start_s: 0.0,
        filename: format!("{i:06}.png"),
    };
    let frames = lines.into_iter().enumerate().map(frame).collect();
    let notes = vec!["no poses of this sequence: no trajectory.tum".to_owned()];
    Ok(Motion { camera: None, frames, poses: Vec::new(), notes })
}

/// fx, fy, cx, cy of a camera of `calib.txt` (pixel centres at whole numbers), and its place in camera 0.
fn kitti_camera(path: &Path, number: usize) -> Result<([f64; 4], DVec3)> {
    let text = read_text(path, "lines `P0: ` and twelve numbers", Limit::SETTINGS)?;
    let key = format!("P{number}:");
    let line = text.lines().enumerate().find_map(|(i, l)| Some((i + 1, l.trim().strip_prefix(&key)?)));
    let Some((line, rest)) = line else {
        return Err(Error::input(path, None, format!("no line `{key}`"), "P0: to P3:, twelve numbers each"));
    };
    let numbers: Vec<f64> =
        rest.split_whitespace().filter_map(|n| n.parse().ok()).filter(|n: &f64| n.is_finite()).collect();
    let usable = numbers.len() == 12 && numbers[0] > 0.0 && numbers[5] > 0.0;
    if !usable {
        let found = format!("{} numbers, or a focal length that is not positive", numbers.len());
        return Err(Error::input(path, line, found, "twelve numbers: a 3x4 matrix"));
    }
    let p = &numbers;
    // P = K [I | t], and a point of camera 0 is x + t in this one.
    let z = p[11];
    let t = DVec3::new((p[3] - p[2] * z) / p[0], (p[7] - p[6] * z) / p[5], z);
    Ok(([p[0], p[5], p[2], p[6]], -t))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_that_are_no_nanoseconds_are_doubted() {
        let said = |step_ns: i64| {
            let frame = |i: i64| FrameEntry {
                timestamp_ns: 1_000 + step_ns * i,
                start_s: 0.0,
                filename: format!("{i}.png"),
            };
            other_rate(Some(20.0), &(0..5).map(frame).collect::<Vec<_>>())
        };
        // As the file says, and with every second frame missing.
        assert_eq!((said(50_000_000), said(100_000_000)), (None, None));
        for step_ns in [1, 50_000, 50_000_000_000] {
            let said = said(step_ns).expect("a sentence");
            assert!(
                said.contains("the camera's file says 50.000000 ms (20 a second): are the times"),
                "{said}"
            );
        }
        let faster = said(33_333_333).expect("thirty a second");
        assert!(faster.contains("33.333333 ms apart") && faster.contains("correct one of them"), "{faster}");
    }
}
