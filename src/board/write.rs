//! The capture: the board as a scene, a pinhole, poses, and the pictures as real frames.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::json;

use super::charuco;
use super::corners::write_corners;
use super::input::Picture;
use super::observe::Observed;
use super::select::BoardFit;
use super::sheet::Sheet;
use super::target::Target;
use super::tone::Tone;
use crate::camera::{Pose, Trajectory};
use crate::capture::CameraFile;
use crate::chain::Settings;
use crate::error::{Error, Result, one_line};
use crate::files::{Limit, read, write_atomic};

/// Time between stills, s: none is known, and nothing depends on it.
const STILL_S: f64 = 1.0;

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Written {
    /// Real frames.
    pub frames: usize,
}

/// Writes the capture into `out`, which is open; `times_ns`: when each picture began, of frames that follow each other.
///
/// # Errors
/// Files that cannot be read or written; frames that follow each other of which none has a neighbour on both sides.
pub fn write_capture(
    out: &Path,
    pictures: &[Picture],
    target: &Target,
    observed: &Observed,
    fit: &BoardFit,
    tone: &Tone,
    times_ns: Option<&[i64]>,
) -> Result<Written> {
    let (trajectory, frames, period_s) = motion(observed, fit, times_ns)?;
    if frames.is_empty() {
        let found = "no picture with the board whose neighbours in time show it too";
        return Err(Error::input(out, None, found, "frames that follow each other, or stills without times"));
    }
    let sheet = charuco::sheet(target)
        .unwrap_or_else(|| Sheet::checkerboard(target, observed.even_is_dark, tone.reach));
    let put = |name: &str, text: &str| write_atomic(&out.join(name), text.as_bytes());
    put("camera.toml", &camera_toml(out, target, observed, fit, times_ns.is_none(), period_s))?;
    put("scene.obj", &sheet.to_obj())?;
    put("scene.mtl", &materials(tone))?;
    put("trajectory.tum", &trajectory)?;
    let mut list = String::from("#timestamp [ns],filename\n");
    let real = out.join("real");
    std::fs::create_dir_all(&real).map_err(|e| Error::io(&real, "create the folder", e))?;
    for (time_ns, view) in &frames {
        let picture = &pictures[observed.views[*view].picture];
        let _ = writeln!(list, "{time_ns},{}", picture.name);
        write_atomic(&real.join(&picture.name), &read(&picture.path, Limit::PICTURE)?)?;
    }
    put("frames.csv", &list)?;
    put("corners.csv", &write_corners(pictures, &observed.views))?;
    put("board.json", &report(pictures, target, observed, fit, tone))?;
    Ok(Written { frames: frames.len() })
}

/// Text of the trajectory; time (ns) and view of each frame; time between frames, s.
fn motion(
    observed: &Observed,
    fit: &BoardFit,
    times_ns: Option<&[i64]>,
) -> Result<(String, Vec<(i64, usize)>, f64)> {
    if let (Some((trajectory, kept)), Some(times_ns)) = (&fit.path, times_ns) {
        let at = |view: usize| times_ns[observed.views[view].picture];
        let frames: Vec<(i64, usize)> = kept.iter().map(|v| (at(*v), *v)).collect();
        let starts_s: Vec<f64> = times_ns.iter().map(|t| (t - times_ns[0]) as f64 * 1e-9).collect();
        let period_s = super::motion::usual_interval_s(&starts_s);
        return Ok((trajectory.to_tum(times_ns[0]), frames, period_s));
    }
    let poses = fit.poses.iter().map(Pose::inverse).collect();
    let times_s = (0..fit.poses.len()).map(|i| STILL_S * i as f64).collect();
    let trajectory = Trajectory::new(Path::new("trajectory.tum"), times_s, poses)?;
    let frames = (0..fit.poses.len()).map(|i| ((1e9 * STILL_S) as i64 * i as i64, i)).collect();
    Ok((trajectory.to_tum(0), frames, STILL_S))
}

fn camera_toml(
    out: &Path,
    target: &Target,
    observed: &Observed,
    fit: &BoardFit,
    stills: bool,
    period_s: f64,
) -> String {
    let camera = CameraFile {
        path: out.join("camera.toml"),
        intrinsics: fit.camera.intrinsics(),
        frame_period_s: period_s,
        background_ignored: true,
        static_camera: stills,
        lit: false,
        settings: Settings::default(),
        warnings: Vec::new(),
    };
    let about = format!(
        "# The pinhole of a camera, from {} views of a {}.\n",
        observed.views.len(),
        target.describe()
    );
    let why = "# Fitted together with a lens and a readout (board.json), which are left out here: `diagnose` is to find them.\n";
    format!("{about}{why}{}", camera.to_toml())
}

fn materials(tone: &Tone) -> String {
    let kd = |rgb: [f64; 3]| format!("Kd {:.6} {:.6} {:.6}", rgb[0], rgb[1], rgb[2]);
    format!(
        "# Linear radiance, the middle over all pictures.\nnewmtl dark\n{}\nnewmtl bright\n{}\n",
        kd(tone.dark),
        kd(tone.bright)
    )
}

fn report(pictures: &[Picture], target: &Target, observed: &Observed, fit: &BoardFit, tone: &Tone) -> String {
    let parameters: serde_json::Map<String, serde_json::Value> = fit
        .half
        .iter()
        .map(|(name, half)| {
            let value = fit.camera.get(name);
            ((*name).to_owned(), json!({ "value": value, "ci95": [value - half, value + half] }))
        })
        .collect();
    let views: Vec<_> = observed
        .views
        .iter()
        .zip(&fit.view_rms_px)
        .map(|(v, rms)| json!({ "file": one_line(&pictures[v.picture].name), "points": v.seen.len(), "rms_px": rms }))
        .collect();
    let left_out: Vec<_> =
        observed.left_out.iter().map(|l| json!({ "file": one_line(&l.name), "why": l.why })).collect();
    let all = json!({
        "target": { "pattern": target.pattern.name(), "points": target.size, "square_m": target.square_m },
        "camera": parameters,
        "rms_px": { "pinhole_alone": fit.rms_px[0], "with_lens_and_readout": fit.rms_px[1] },
        "views": views,
        "left_out": left_out,
        "print": { "dark": tone.dark, "bright": tone.bright, "reach_squares": tone.reach },
    });
    serde_json::to_string_pretty(&all).expect("numbers and names") + "\n"
}
