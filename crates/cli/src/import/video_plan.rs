//! Plans the import of a video.

use super::frames::{Timed, periods_ns, timed};
use super::gather::Shot;
use super::prepared::{Pictures, Prepared, Request};
use super::video::Video;
use shutterbug::error::Error;

/// All frames of a video, with its own times.
pub(super) fn prepare(video: Video, request: &Request) -> Prepared {
    let shot = |t: &i64| Some(Shot { stamp_ns: *t, recorded_ns: *t });
    let shots: Vec<_> = video.times_ns.iter().map(shot).collect();
    let mut notes = Vec::new();
    let mut timed = timed(&shots, "the video", &mut notes);
    timed.thin(request.every.max(1));
    let Timed { times_ns, frame_of } = timed;
    // The note on stamps there is of drivers.
    notes.retain(|n| !n.starts_with("stamps are") && !n.contains("has no stamps"));
    let period_ms = periods_ns(&times_ns) as f64 * 1e-6;
    notes.push(format!(
        "a video says when frames are shown, not when they were exposed: every {period_ms:.3} ms in the median, on \
         the video's own clock"
    ));
    notes.push(format!(
        "frames are what ffmpeg decodes ({}, {}): what that compression did stays",
        video.codec, video.pixels
    ));
    if video.turned {
        notes.push("the video asks to be shown turned: frames are as the sensor was read".to_owned());
    }
    let broken = video.broken(video.times_ns.len(), video.damage.as_deref());
    let broken = broken.map(|(found, expected)| Error::input(&video.path, None, found, expected));
    let path = video.path.clone();
    let pictures = Pictures::Video { video, frame_of };
    let (poses, texts, names, camera_px) = (Vec::new(), Vec::new(), None, None);
    Prepared { path, times_ns, names, poses, camera_px, texts, notes, pictures, broken }
}
