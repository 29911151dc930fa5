//! ROS `sensor_msgs/CameraInfo`: the file of `camera_calibration` and `camera_info_manager`, and the message as
//! `rostopic echo` and `ros2 topic echo` print it. Fields and models as REP 104 states them. Pixel centres are at whole
//! numbers there.

use glam::DVec2;

use super::common::{
    at, brown_conrady, comments, lens_left_out, list, no_more_than_a_pinhole, opencv_pinhole, pinhole,
    quoted, side_px, unused_keys,
};
use super::refit::fit_brown_conrady;
use super::yaml::Field;
use super::{CameraModel, Imported};
use shutterbug::camera::{Distortion, Intrinsics};
use shutterbug::error::{Error, Result};

/// Names of distortion models that are read.
const MODELS: [&str; 5] = ["plumb_bob", "rational_polynomial", "equidistant", "fisheye", "none"];
/// Keys that are read, of the file and of the message.
const KEYS: [&str; 26] = [
    "image_width",
    "image_height",
    "camera_name",
    "camera_matrix",
    "camera_model",
    "distortion_model",
    "distortion_coefficients",
    "rectification_matrix",
    "projection_matrix",
    "header",
    "width",
    "height",
    "D",
    "d",
    "K",
    "k",
    "R",
    "r",
    "P",
    "p",
    "binning_x",
    "binning_y",
    "binning",
    "roi",
    "frame_rate",
    "distortion_coeffs",
];

/// Whether a document looks like this format.
pub(super) fn recognises(top: &Field) -> bool {
    top.get_any(&["camera_matrix", "K", "k"]).is_some()
}

/// Reads a camera.
pub(super) fn import(top: &Field) -> Result<Imported> {
    let mut notes = Vec::new();
    let side = |long: &str, short: &str| match top.get(short) {
        Some(field) => side_px(&field),
        None => side_px(&top.require(long, "the picture's size in px")?),
    };
    let size = [side("image_width", "width")?, side("image_height", "height")?];
    let matrix = match top.get_any(&["K", "k"]) {
        Some(field) => field,
        None => top.require("camera_matrix", "a 3x3 matrix: fx 0 cx, 0 fy cy, 0 0 1")?,
    };
    let m: [f64; 9] = matrix.exactly("nine numbers, row by row: fx 0 cx, 0 fy cy, 0 0 1")?;
    let intrinsics = pinhole(&matrix, size, [m[0], m[4], m[2], m[5]])?;
    no_more_than_a_pinhole(&matrix, &m, &mut notes)?;
    let name = top.get("camera_name").map(|f| f.text("a name")).transpose()?.unwrap_or("camera");
    let mut camera = CameraModel::new(name, intrinsics);
    if let Some(rate) = top.get("frame_rate") {
        camera.rate_hz = Some(rate.number_in("Hz", super::RATE_HZ)?);
    }
    camera.distortion = distortion(top, &intrinsics, &mut notes)?;
    if let Some(field) = top.get_any(&["D", "d", "distortion_coefficients", "distortion_coeffs"]) {
        camera.check_lens().map_err(|problem| at(&field, problem))?;
    }
    note_the_rest(top, &m, &mut notes)?;
    unused_keys(top, &KEYS, &mut notes);
    Ok(Imported { camera, notes })
}

/// The lens. A lens with a thin prism is refitted, because no model here has one.
fn distortion(top: &Field, k: &Intrinsics, notes: &mut Vec<String>) -> Result<Distortion> {
    let Some(field) = top.get_any(&["D", "d", "distortion_coefficients", "distortion_coeffs"]) else {
        notes.push("no distortion coefficients are given: the lens is taken as ideal".to_owned());
        return Ok(Distortion::None);
    };
    let d = field.numbers("a list of coefficients")?;
    let model = top.get_any(&["distortion_model", "camera_model"]);
    let name = match &model {
        Some(field) => field.text("the name of a distortion model")?,
        None => {
            notes.push("no distortion_model is given: plumb_bob, ROS's default, is assumed".to_owned());
            "plumb_bob"
        }
    };
    let count = |allowed: &[usize], expected: &str| {
        if allowed.contains(&d.len()) {
            return Ok(());
        }
        let found = format!("{} of {} numbers", field.name(), d.len());
        Err(Error::input(field.path(), field.line(), found, format!("{expected} for {name}")))
    };
    let at = |i: usize| d.get(i).copied().unwrap_or(0.0);
    match name {
        _ if d.iter().all(|c| *c == 0.0) && !matches!(name, "equidistant" | "fisheye") && known(name) => {
            Ok(Distortion::None)
        }
        "plumb_bob" => {
            count(&[4, 5], "k1 k2 p1 p2 k3")?;
            Ok(brown_conrady(at(0), at(1), at(2), at(3), at(4)))
        }
        "rational_polynomial" => {
            count(&[5, 8, 12, 14], "k1 k2 p1 p2 k3 k4 k5 k6 [s1 s2 s3 s4 [tau_x tau_y]]")?;
            rational(&field, k, &d, notes)
        }
        "equidistant" | "fisheye" => {
            count(&[4], "k1 k2 k3 k4")?;
            Ok(Distortion::Equidistant { k: [at(0), at(1), at(2), at(3)] })
        }
        "none" | "" => {
            let found = format!("coefficients {d:?} beside distortion_model = `{name}`");
            Err(Error::input(field.path(), field.line(), found, "zeros, or the model that they belong to"))
        }
        other => {
            let line = model.as_ref().map(Field::line);
            Err(Error::unknown_name(top.path(), line, "distortion_model", other, MODELS))
        }
    }
}

fn known(name: &str) -> bool {
    name.is_empty() || MODELS.contains(&name)
}

/// OpenCV's rational model as it is; with a thin prism, a fit of five coefficients.
pub(super) fn rational(
    field: &Field,
    k: &Intrinsics,
    d: &[f64],
    notes: &mut Vec<String>,
) -> Result<Distortion> {
    let c = |i: usize| d.get(i).copied().unwrap_or(0.0);
    if c(12) != 0.0 || c(13) != 0.0 {
        notes.push(format!(
            "the sensor's tilt tau = ({}, {}) has no place here and is left out",
            c(12),
            c(13)
        ));
    }
    if (5..12).all(|i| c(i) == 0.0) {
        return Ok(brown_conrady(c(0), c(1), c(2), c(3), c(4)));
    }
    if (8..12).all(|i| c(i) == 0.0) {
        let lens = Distortion::Rational { k: [c(0), c(1), c(4), c(5), c(6), c(7)], p: [c(2), c(3)] };
        return Ok(if lens.is_identity() { Distortion::None } else { lens });
    }
    let (k_up, k_down) = ([c(0), c(1), c(4)], [c(5), c(6), c(7)]);
    let radial = |k: [f64; 3], s: f64| 1.0 + s * (k[0] + s * (k[1] + s * k[2]));
    let mapping = |p: DVec2| {
        let s = p.length_squared();
        let (xy, x2, y2) = (2.0 * p.x * p.y, s + 2.0 * p.x * p.x, s + 2.0 * p.y * p.y);
        let prism = DVec2::new(c(8) * s + c(9) * s * s, c(10) * s + c(11) * s * s);
        let tangential = DVec2::new(c(2) * xy + c(3) * x2, c(2) * y2 + c(3) * xy);
        p * (radial(k_up, s) / radial(k_down, s)) + tangential + prism
    };
    let Some((lens, worst_px)) = fit_brown_conrady(k, mapping) else {
        return Err(field.unexpected("a rational polynomial that maps the picture one to one"));
    };
    notes.push(format!(
        "the thin prism s1 to s4 = {:?} has no place here: the lens was fitted anew with five coefficients ({}), at \
         most {worst_px:.3} px off in the picture",
        [c(8), c(9), c(10), c(11)],
        lens.coefficients(),
    ));
    Ok(lens)
}

/// Rectification, projection, binning, region of interest.
fn note_the_rest(top: &Field, k: &[f64; 9], notes: &mut Vec<String>) -> Result<()> {
    const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    if let Some(field) = top.get_any(&["R", "r", "rectification_matrix"]) {
        let r: [f64; 9] = field.exactly("nine numbers")?;
        if r != IDENTITY && r != [0.0; 9] {
            notes.push(format!(
                "{} is not the identity: rectification has no place here and is left out",
                field.name()
            ));
        }
    }
    if let Some(field) = top.get_any(&["P", "p", "projection_matrix"]) {
        let p: [f64; 12] = field.exactly("twelve numbers")?;
        let plain = [k[0], k[1], k[2], 0.0, k[3], k[4], k[5], 0.0, k[6], k[7], k[8], 0.0];
        if p != plain && p != [0.0; 12] {
            notes.push(format!(
                "{} differs from the camera matrix: it describes the rectified picture, which has no place here",
                field.name()
            ));
        }
    }
    for key in ["binning_x", "binning_y"] {
        if let Some(field) = top.get(key).filter(|f| f.whole(u32::MAX).is_ok_and(|n| n > 1)) {
            let factor = field.whole(u32::MAX)?;
            notes.push(format!("{key} = {factor} is left out: this is the camera before binning"));
        }
    }
    if let Some(roi) = top.get("roi") {
        let part = |key: &str| roi.get(key).map_or(Ok(0), |f| f.whole(u32::MAX));
        let (x, y, w, h) = (part("x_offset")?, part("y_offset")?, part("width")?, part("height")?);
        if [x, y, w, h] != [0; 4] {
            notes.push(format!(
                "the region of interest {w}x{h} at ({x}, {y}) is left out: this is the whole camera"
            ));
        }
    }
    Ok(())
}

/// Writes the file of `camera_info_manager`; with it, what it cannot hold.
pub(super) fn export(camera: &CameraModel) -> (String, Vec<String>) {
    const TARGET: &str = "ROS camera_info";
    let mut notes = camera.left_out(TARGET, &[]);
    if let Some(rate) = camera.rate_hz {
        notes.push(format!("the frame rate of {rate} Hz has no place in {TARGET}"));
    }
    if camera.body_from_camera.is_some() {
        notes.push(format!("the camera's place on its body has no place in {TARGET}: publish it on /tf"));
    }
    let k = &camera.intrinsics;
    let [fx, fy, cx, cy] = opencv_pinhole(k);
    let (model, d) = match camera.distortion {
        Distortion::None => ("plumb_bob", vec![0.0; 5]),
        Distortion::BrownConrady { k: [k1, k2, k3], p: [p1, p2] } => ("plumb_bob", vec![k1, k2, p1, p2, k3]),
        Distortion::Equidistant { k } => ("equidistant", k.to_vec()),
        Distortion::Rational { k: [k1, k2, k3, k4, k5, k6], p: [p1, p2] } => {
            ("rational_polynomial", vec![k1, k2, p1, p2, k3, k4, k5, k6])
        }
        Distortion::Division { .. } => {
            notes.push(lens_left_out(camera, TARGET));
            ("plumb_bob", vec![0.0; 5])
        }
    };
    let matrix = |name: &str, rows: usize, numbers: &[f64]| {
        let cols = numbers.len() / rows;
        format!("{name}:\n  rows: {rows}\n  cols: {cols}\n  data: {}\n", list(numbers))
    };
    let text = [
        comments(&["Pixel centres are at whole numbers, as in OpenCV.".to_owned()]),
        comments(&notes),
        format!(
            "image_width: {}\nimage_height: {}\ncamera_name: {}\n",
            k.width,
            k.height,
            quoted(&camera.name)
        ),
        matrix("camera_matrix", 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        format!("distortion_model: {model}\n"),
        matrix("distortion_coefficients", 1, &d),
        matrix("rectification_matrix", 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        matrix("projection_matrix", 3, &[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
    ];
    (text.concat(), notes)
}
