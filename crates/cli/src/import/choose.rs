//! Chooses from a log what to import: the picture topic, the camera, the poses and the inertial sensor.

use std::path::PathBuf;

use super::chosen::{Chosen, named, names, places, with_damage};
use super::frames::{Timed, periods_ns};
use super::gather::Gathered;
use super::log::Log;
use super::poses::{poses_of, written_imu};
use super::prepared::{Pictures, Prepared, Request};
use super::topic::Topic;
use crate::formats::{CameraModel, Format, write_camera};
use shutterbug::error::{Error, Result, counted};

/// Decides, and makes everything but the frames.
pub(super) fn choose(log: &Log, all: &Gathered, request: &Request) -> Result<Prepared> {
    let pictures = pictures_topic(log, all, request)?;
    let first_frame = all.first.get(&pictures).map(|f| f.frame.clone()).unwrap_or_default();
    let frame = request.camera_frame.clone().unwrap_or(first_frame);
    let chosen = Chosen { log, all, request, pictures, frame };
    let mut notes = Vec::new();
    let mut timed = chosen.times(&mut notes)?;
    let period_ns = periods_ns(&timed.times_ns);
    let poses = poses_of(&chosen, &mut notes)?;
    if let Some(poses) = &poses {
        keep_covered(&chosen, poses, period_ns, &mut timed, &mut notes)?;
    }
    timed.thin(request.every.max(1));
    let Timed { times_ns, frame_of } = timed;
    let period_ns = periods_ns(&times_ns);
    let (mut texts, mut camera_px) = (Vec::new(), None);
    if let Some(camera) = chosen.camera(&mut notes)? {
        camera_px = Some([camera.intrinsics.width, camera.intrinsics.height]);
        let rate_hz = if period_ns > 0 { Some(1e9 / period_ns as f64) } else { None };
        match rate_hz {
            None => notes.push("no camera.toml: one frame states no frame period".to_owned()),
            Some(_) => {
                let camera = CameraModel { rate_hz, ..camera };
                let (text, more) = write_camera(&camera, Format::Toml, &PathBuf::from("camera.toml"), None)?;
                notes.extend(more);
                texts.push(("camera.toml", text));
            }
        }
    }
    let imu = written_imu(&chosen, &mut notes)?;
    texts.extend(imu.map(|text| ("imu.csv", text)));
    notes.extend(all.first.get(&pictures).and_then(|f| super::pixels::note(&f.encoding)));
    let broken = chosen.broken(&mut notes);
    Ok(Prepared {
        path: log.path.clone(),
        times_ns,
        names: None,
        poses: poses.unwrap_or_default(),
        camera_px,
        texts,
        notes,
        pictures: Pictures::Log { log: log.clone(), topic: pictures, frame_of },
        broken,
    })
}

/// Leaves out frames that the poses do not cover for a frame period.
fn keep_covered(
    chosen: &Chosen<'_>,
    poses: &[(i64, shutterbug::camera::Pose)],
    period_ns: i64,
    Timed { times_ns, frame_of }: &mut Timed,
    notes: &mut Vec<String>,
) -> Result<()> {
    let (Some((from, _)), Some((to, _))) = (poses.first(), poses.last()) else { return Ok(()) };
    let kept = |t: i64| t >= *from && t.saturating_add(period_ns) <= *to;
    let before = times_ns.len();
    let first = times_ns.partition_point(|t| *t < *from);
    times_ns.retain(|t| kept(*t));
    for place in frame_of.iter_mut() {
        *place = place.and_then(|p| p.checked_sub(first)).filter(|p| *p < times_ns.len());
    }
    if times_ns.is_empty() {
        let found =
            format!("poses from {from} ns to {to} ns, and {} outside", counted(before, "frame", "frames"));
        let expected = "poses that cover frames (are both on one clock?), or --poses none";
        return Err(Error::input(&chosen.log.path, None, found, expected));
    }
    if times_ns.len() < before {
        let lost = before - times_ns.len();
        notes.push(format!(
            "{lost} of {} left out: poses reach from {from} ns to {to} ns and are never extrapolated",
            counted(before, "frame is", "frames are")
        ));
    }
    Ok(())
}

/// The topic of pictures.
fn pictures_topic(log: &Log, all: &Gathered, request: &Request) -> Result<usize> {
    if let Some(name) = &request.topic {
        let expected = "a topic of sensor_msgs/Image or sensor_msgs/CompressedImage";
        return named(log, all, name, Topic::has_pictures, expected);
    }
    let found: Vec<usize> = places(all, Topic::has_pictures);
    match found[..] {
        [one] => Ok(one),
        [] => {
            let found = format!("no topic of pictures among {}", names(all, |_| true));
            let expected = "sensor_msgs/Image or sensor_msgs/CompressedImage";
            Err(Error::input(&log.path, None, with_damage(all, found), expected))
        }
        _ => {
            let found = format!("several topics of pictures: {}", names(all, Topic::has_pictures));
            Err(Error::input(&log.path, None, found, "--topic with one of them"))
        }
    }
}
