//! The capture: the board as a scene, a pinhole, poses, and the pictures as real frames.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::json;

use super::april;
use super::charuco;
use super::corners::write_corners;
use super::crop::{cropped, cut};
use super::input::Picture;
use super::observe::Observed;
use super::select::BoardFit;
use super::sheet::Sheet;
use super::target::Target;
use super::tone::Tone;
use shutterbug::camera::{Intrinsics, Pose, Trajectory};
use shutterbug::capture::CameraFile;
use shutterbug::error::{Error, Result, counted, one_line};
use shutterbug::files::{Limit, read, write_atomic};
use shutterbug::plane::{Plane, read_rgb8, srgb_decode, srgb8, write_png_atomic};

/// Time between stills, s: none is known, and nothing depends on it.
const STILL_S: f64 = 1.0;

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Written {
    /// Real frames.
    pub frames: usize,
    /// Columns and rows that were cut on each side, px of the pictures: no ray of the fitted lens reaches what lies
    /// there.
    pub cut_px: [u32; 2],
}

/// How the pictures come into the capture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Real<'a> {
    /// When each picture began, ns, of frames that follow each other.
    pub times_ns: Option<&'a [i64]>,
    /// 1: as they are; else means over so many px by so many.
    pub shrink: usize,
}

/// Writes the capture into `out`, which is open.
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
    real: Real<'_>,
) -> Result<Written> {
    let Real { times_ns, shrink } = real;
    let cut_px = cut(&fit.camera.intrinsics(), fit.camera.lens());
    let (trajectory, frames, period_s) = motion(observed, fit, times_ns)?;
    if frames.is_empty() {
        let found = "no picture with the board whose neighbours in time show it too";
        return Err(Error::input(out, None, found, "frames that follow each other, or stills without times"));
    }
    let sheet = charuco::sheet(target)
        .or_else(|| april::sheet(target))
        .unwrap_or_else(|| Sheet::checkerboard(target, observed.even_is_dark, tone.reach));
    let put = |name: &str, text: &str| write_atomic(&out.join(name), text.as_bytes());
    put("camera.toml", &camera_toml(out, target, observed, fit, real, period_s))?;
    put("scene.obj", &sheet.to_obj())?;
    put("scene.mtl", &materials(tone))?;
    put("trajectory.tum", &trajectory)?;
    let mut list = String::from("#timestamp [ns],filename\n");
    let folder = out.join("real");
    std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, "create the folder", e))?;
    for (time_ns, view) in &frames {
        let picture = &pictures[observed.views[*view].picture];
        let changed = shrink > 1 || cut_px != [0; 2];
        let name = if changed { png_name(picture) } else { picture.name.clone() };
        let _ = writeln!(list, "{time_ns},{name}");
        let path = folder.join(&name);
        if changed {
            let whole = read_rgb8(&picture.path)?;
            write_png_atomic(&path, &shrunk(&part(&whole, cut_px), shrink))?;
        } else {
            write_atomic(&path, &read(&picture.path, Limit::PICTURE)?)?;
        }
    }
    put("frames.csv", &list)?;
    put("corners.csv", &write_corners(pictures, &observed.views))?;
    put("board.json", &report(pictures, target, observed, fit, tone))?;
    Ok(Written { frames: frames.len(), cut_px })
}

fn png_name(picture: &Picture) -> String {
    let stem = picture.path.file_stem().unwrap_or_default();
    format!("{}.png", stem.to_string_lossy())
}

/// A picture without columns and rows at its sides.
fn part(picture: &Plane<u8>, cut_px: [u32; 2]) -> Plane<u8> {
    let [across, down] = cut_px.map(|c| c as usize);
    let (width, height) = (picture.width - 2 * across, picture.height - 2 * down);
    Plane::from_fn(width, height, |x, y| {
        let p = picture.pixel(x + across, y + down);
        [p[0], p[1], p[2]]
    })
}

/// Means of linear light over blocks; what does not fill one at the right and below is left out.
fn shrunk(picture: &Plane<u8>, times: usize) -> Plane<u8> {
    let linear: Vec<f32> = (0..=255u8).map(|v| srgb_decode(f32::from(v) / 255.0)).collect();
    Plane::from_fn(picture.width / times, picture.height / times, |x, y| {
        let mut sum = [0.0f32; 3];
        for (i, j) in (0..times).flat_map(|j| (0..times).map(move |i| (i, j))) {
            let p = picture.pixel(x * times + i, y * times + j);
            (0..3).for_each(|c| sum[c] += linear[usize::from(p[c])]);
        }
        sum.map(|s| srgb8(s / (times * times) as f32))
    })
}

/// The fitted pinhole in pictures that were cut and shrunk so many times: places count from the first pixel's corner.
fn pinhole(fit: &BoardFit, times: usize) -> Intrinsics {
    let whole = fit.camera.intrinsics();
    cropped(&whole, cut(&whole, fit.camera.lens())).divided(times as u32)
}

/// Text of the trajectory; time (ns) and view of each frame; time between frames, s.
type Motion = (String, Vec<(i64, usize)>, f64);

fn motion(observed: &Observed, fit: &BoardFit, times_ns: Option<&[i64]>) -> Result<Motion> {
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
    real: Real<'_>,
    period_s: f64,
) -> String {
    let mut camera = CameraFile::pinhole(out.join("camera.toml"), pinhole(fit, real.shrink), period_s);
    camera.background_ignored = true;
    camera.static_camera = real.times_ns.is_none();
    let about = format!(
        "# The pinhole of a camera, from {} of a board ({}).\n",
        counted(observed.views.len(), "view", "views"),
        target.describe()
    );
    let why = "# Fitted together with a lens and a readout (board.json), which are left out here: `diagnose` is to \
        find them.\n";
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
    let file = |v: usize| one_line(&pictures[observed.views[v].picture].name);
    // Nothing of frames that follow each other: that was not measured.
    let one_camera = fit.one_camera.as_ref().map(|of| {
        let own_focal: Vec<_> =
            of.own_focal.iter().map(|(v, times)| json!({ "file": file(*v), "times": times })).collect();
        json!({ "error_shared_by_neighbours": of.shared, "own_focal_length": own_focal, "misfit": of.is_misfit() })
    });
    let all = json!({
        "target": { "pattern": target.pattern.name(), "points": target.size, "square_m": target.square_m,
            "tag_spacing": target.tag_spacing },
        "size_px": observed.size,
        "camera": parameters,
        "rms_px": { "pinhole_alone": fit.rms_px[0], "with_lens_and_readout": fit.rms_px[1] },
        "views": views,
        "one_camera": one_camera,
        "left_out": left_out,
        "cut_px": cut(&fit.camera.intrinsics(), fit.camera.lens()),
        "print": { "dark": tone.dark, "bright": tone.bright, "reach_squares": tone.reach },
    });
    serde_json::to_string_pretty(&all).expect("numbers and names") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shrunk_picture_has_the_light_of_the_whole_one() {
        let fine = Plane::from_fn(7, 4, |x, y| [if (x + y) % 2 == 0 { 255u8 } else { 0 }; 3]);
        let small = shrunk(&fine, 2);
        assert_eq!((small.width, small.height), (3, 2));
        // Half of the light, which is not half of the value.
        assert_eq!(small.data[0], srgb8(0.5));
        assert_ne!(small.data[0], 128, "control");
    }
}
