//! Lens profiles of Gyroflow: JSON, which is YAML, so errors name lines. Pixel centres are at whole numbers, as in
//! OpenCV, whose models they use.

use super::common::{at, lens_left_out, no_more_than_a_pinhole, opencv_pinhole, pinhole, side_px};
use super::ros::rational;
use super::yaml::Field;
use super::{CameraModel, Imported};
use shutterbug::camera::Distortion;
use shutterbug::chain::Value;
use shutterbug::effects::RollingShutter;
use shutterbug::error::{Error, Result};

const FISHEYE: &str = "opencv_fisheye";
const STANDARD: &str = "opencv_standard";
/// Longest readout, ms; as `rolling_shutter.readout_time_s`.
const READOUT_MS: (f64, f64) = (-1000.0, 1000.0);

/// What a profile says beside its camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct About {
    /// Brand, model, lens and setting, as far as they are given.
    pub(super) words: Vec<String>,
    /// Reprojection error, px.
    pub(super) rms_px: Option<f64>,
    /// Pictures that it was calibrated with.
    pub(super) images: Option<u32>,
}

/// Whether a document looks like this format.
pub(super) fn recognises(top: &Field) -> bool {
    top.get("fisheye_params").is_some()
}

/// Reads a camera and checks that its lens can be inverted.
pub(super) fn import(top: &Field) -> Result<Imported> {
    let imported = read(top)?;
    let lens = top.require("fisheye_params", "the calibration")?;
    imported.camera.check_lens().map_err(|problem| at(&lens, problem))?;
    Ok(imported)
}

/// Reads a camera.
pub(super) fn read(top: &Field) -> Result<Imported> {
    let lens = top.require("fisheye_params", "the calibration")?;
    let dimension = match top.get("calib_dimension") {
        Some(dimension) => dimension,
        None => top.require("orig_dimension", "w and h of the calibrated picture, px")?,
    };
    let size = ["w", "h"].map(|side| dimension.require(side, "px").and_then(|f| side_px(&f)));
    let [width, height] = size;
    let (width, height) = (width?, height?);
    let matrix = lens.require("camera_matrix", "a 3x3 matrix: fx 0 cx, 0 fy cy, 0 0 1")?;
    let m: [f64; 9] = matrix.exactly("nine numbers, row by row: fx 0 cx, 0 fy cy, 0 0 1")?;
    let intrinsics = pinhole(&matrix, [width, height], [m[0], m[4], m[2], m[5]])?;
    let mut notes = Vec::new();
    no_more_than_a_pinhole(&matrix, &m, &mut notes)?;
    notes.extend(doubt_of_fit(top, width));
    let name = about(top).words.join(" ");
    let mut camera = CameraModel::new(if name.is_empty() { "camera" } else { &name }, intrinsics);
    camera.distortion = distortion(top, &lens, &camera, &mut notes)?;
    match positive(top, "fps")? {
        Some(fps) => camera.rate_hz = Some(fps.number_in("Hz", super::RATE_HZ)?),
        None => notes.push("no fps is given".to_owned()),
    }
    match positive(top, "frame_readout_time")? {
        Some(readout) => set_readout_ms(&mut camera, readout.number_in("ms", READOUT_MS)?)?,
        None => notes.push("no frame_readout_time is given: a global shutter is assumed".to_owned()),
    }
    for key in ["input_horizontal_stretch", "input_vertical_stretch"] {
        let stretch = top.get(key).map(|f| f.number("a factor")).transpose()?;
        if let Some(stretch) = stretch.filter(|n| *n != 1.0 && *n != 0.0) {
            notes.push(format!("{key} = {stretch} has no place here and is left out"));
        }
    }
    if let Some(digital) = top.get("digital_lens").and_then(|f| f.text("").ok().map(str::to_owned)) {
        notes.push(format!("the digital lens `{digital}` that the camera computes has no place here"));
    }
    Ok(Imported { camera, notes })
}

/// A number that is given and not zero.
fn positive<'a>(top: &Field<'a>, key: &str) -> Result<Option<Field<'a>>> {
    let Some(field) = top.get(key) else { return Ok(None) };
    Ok((field.number("a number")? != 0.0).then_some(field))
}

/// Sets the rolling shutter; below zero the lowest line is read first.
pub(super) fn set_readout_ms(camera: &mut CameraModel, readout_ms: f64) -> Result<()> {
    let order = if readout_ms < 0.0 { "bottom_to_top" } else { "top_to_bottom" };
    let settings = &mut camera.settings;
    settings.set(&RollingShutter, "readout_time_s", Value::Number(readout_ms.abs() * 1e-3))?;
    settings.set(&RollingShutter, "scan_order", Value::Choice(order))
}

/// Error of a calibration over the picture's width beyond which something else was fitted than the lens. The worst of
/// 876 published modes (Gyroflow's lens profiles) misses 0.0007.
const WORST_FIT: f64 = 2e-3;

/// Says so where the profile's own calibration does not fit.
fn doubt_of_fit(top: &Field, width: u32) -> Option<String> {
    let rms_px = about(top).rms_px.filter(|rms_px| *rms_px > WORST_FIT * f64::from(width))?;
    Some(format!(
        "its calibration misses the board's corners by {rms_px} px (RMS_error), expected at most {:.1} px at this \
         size: the lens is hardly this one",
        WORST_FIT * f64::from(width)
    ))
}

/// What stands beside the camera.
pub(super) fn about(top: &Field) -> About {
    let words = ["camera_brand", "camera_model", "lens_model", "camera_setting"];
    let word = |key: &&str| top.get(key).and_then(|f| f.text("").ok().map(|t| t.trim().to_owned()));
    let lens = top.get("fisheye_params");
    About {
        words: words.iter().filter_map(word).filter(|w| !w.is_empty()).collect(),
        rms_px: lens.and_then(|l| l.get("RMS_error")).and_then(|f| f.number("").ok()),
        images: top.get("num_images").and_then(|f| f.whole(u32::MAX).ok()),
    }
}

fn distortion(
    top: &Field,
    lens: &Field,
    camera: &CameraModel,
    notes: &mut Vec<String>,
) -> Result<Distortion> {
    let model = top.get("distortion_model");
    let name = model.as_ref().map_or(Ok(FISHEYE), |f| f.text("the name of a model"))?;
    let field = lens.require("distortion_coeffs", "a list of coefficients")?;
    match name {
        FISHEYE | "" => Ok(Distortion::Equidistant { k: field.exactly("four coefficients")? }),
        STANDARD => {
            let d = field.numbers("a list of coefficients")?;
            if ![4, 5, 8, 12].contains(&d.len()) {
                return Err(
                    field.unexpected("4, 5, 8 or 12 coefficients: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4")
                );
            }
            rational(&field, &camera.intrinsics, &d, notes)
        }
        // poly3, poly5, ptlens, insta360, sony: other functions of other arguments.
        other => {
            let line = model.map(|f| f.line());
            Err(Error::unknown_name(top.path(), line, "distortion_model", other, [FISHEYE, STANDARD]))
        }
    }
}

/// Writes a profile; with it, what it cannot hold, which also stands under `note`.
pub(super) fn export(camera: &CameraModel) -> (String, Vec<String>) {
    const TARGET: &str = "Gyroflow's lens profile";
    let readout_s = RollingShutter::readout_time_s(&camera.settings);
    let order = RollingShutter::scan_order(&camera.settings).name();
    let sign = match order {
        "top_to_bottom" => Some(1.0),
        "bottom_to_top" => Some(-1.0),
        _ => None,
    };
    let held: &[&str] = if sign.is_some() { &["rolling_shutter"] } else { &[] };
    let mut notes = camera.left_out(TARGET, held);
    if camera.body_from_camera.is_some() {
        notes.push(format!("the camera's place on its body has no place in {TARGET}"));
    }
    let (model, coefficients) = match camera.distortion {
        // Zeros of the fisheye are the ideal fisheye; of the other model they are the pinhole.
        Distortion::None => (STANDARD, vec![0.0; 12]),
        Distortion::Equidistant { k } => (FISHEYE, k.to_vec()),
        Distortion::BrownConrady { k: [k1, k2, k3], p: [p1, p2] } => {
            (STANDARD, [&[k1, k2, p1, p2, k3][..], &[0.0; 7]].concat())
        }
        Distortion::Rational { k: [k1, k2, k3, k4, k5, k6], p: [p1, p2] } => {
            (STANDARD, [&[k1, k2, p1, p2, k3, k4, k5, k6][..], &[0.0; 4]].concat())
        }
        Distortion::Division { .. } => {
            notes.push(lens_left_out(camera, TARGET));
            (STANDARD, vec![0.0; 12])
        }
    };
    let k = &camera.intrinsics;
    let [fx, fy, cx, cy] = opencv_pinhole(k);
    let size = serde_json::json!({ "w": k.width, "h": k.height });
    let mut profile = serde_json::json!({
        "name": camera.name,
        "note": notes.join("; "),
        "calibrated_by": "",
        "camera_brand": "",
        "camera_model": camera.name,
        "lens_model": "",
        "camera_setting": "",
        "calib_dimension": size,
        "orig_dimension": size,
        "fisheye_params": {
            "camera_matrix": [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
            "distortion_coeffs": coefficients,
        },
        "distortion_model": model,
    });
    if let Some(rate) = camera.rate_hz {
        profile["fps"] = rate.into();
    }
    if let Some(sign) = sign.filter(|_| readout_s > 0.0) {
        profile["frame_readout_time"] = (sign * readout_s * 1e3).into();
    }
    (serde_json::to_string_pretty(&profile).expect("numbers and texts") + "\n", notes)
}
