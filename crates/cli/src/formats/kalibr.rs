//! Kalibr's camchain: one table a camera, `cam0` and on. Fields as Kalibr's wiki states them ("yaml formats"), with
//! `line_delay` in s a row for rolling shutters. Pixel centres are at whole numbers there.

use super::common::{
    at, at_with_hint, brown_conrady, comments, lens_left_out, list, opencv_pinhole, pinhole, pose, quoted,
    rows_of, unused_keys,
};
use super::yaml::Field;
use super::{CameraModel, Imported};
use shutterbug::camera::{Distortion, Intrinsics};
use shutterbug::error::{Error, Quoted, Result};

/// Distortion models that are read.
const MODELS: [&str; 4] = ["radtan", "equidistant", "equi", "none"];
/// Keys of a camera that are read or need no place.
const KEYS: [&str; 12] = [
    "camera_model",
    "intrinsics",
    "distortion_model",
    "distortion_coeffs",
    "resolution",
    "rostopic",
    "T_cam_imu",
    "T_cn_cnm1",
    "timeshift_cam_imu",
    "line_delay",
    "cam_overlaps",
    "rate_hz",
];

/// Whether a document looks like this format.
pub(super) fn recognises(top: &Field) -> bool {
    !cameras(top).is_empty()
}

/// Names of the cameras in a file, in its order.
fn cameras<'a>(top: &Field<'a>) -> Vec<&'a str> {
    let number = |key: &str| key.strip_prefix("cam").is_some_and(|n| n.bytes().all(|b| b.is_ascii_digit()));
    let is_camera = |key: &&str| number(key) && top.get(key).is_some_and(|f| !f.keys().is_empty());
    top.keys().into_iter().filter(is_camera).collect()
}

/// Reads the camera of that name, or the first.
pub(super) fn import(top: &Field, name: Option<&str>) -> Result<Imported> {
    let names = cameras(top);
    let Some(chosen) = name.or(names.first().copied()) else {
        return Err(Error::input(top.path(), None, "no camera", "a table `cam0:`"));
    };
    if !names.contains(&chosen) {
        return Err(Error::unknown_name(top.path(), None, "camera", chosen, names));
    }
    let mut notes = Vec::new();
    for other in names.iter().filter(|n| **n != chosen) {
        notes.push(format!("`{other}` is left out: {chosen} is taken"));
    }
    unused_keys(top, &names, &mut notes);
    let table = top.require(chosen, "a camera")?;
    let mut camera = CameraModel::new(chosen, intrinsics(&table)?);
    camera.distortion = distortion(&table)?;
    if let Some(field) = table.get("distortion_coeffs") {
        camera.check_lens().map_err(|problem| at(&field, problem))?;
    }
    if let Some(field) = table.get("rate_hz") {
        camera.rate_hz = Some(field.number_in("Hz", super::RATE_HZ)?);
    }
    if let Some(field) = table.get("T_cam_imu") {
        camera.body_from_camera = Some(pose(&field)?.inverse());
    }
    read_line_delay(&table, &mut camera)?;
    if table.get("T_cn_cnm1").is_some() {
        notes.push(format!("T_cn_cnm1, the place of {chosen} beside the camera before it, is left out"));
    }
    if let Some(field) = table.get("timeshift_cam_imu") {
        let shift_s = field.number("seconds")?;
        if shift_s != 0.0 {
            notes.push(format!(
                "timeshift_cam_imu = {shift_s} s belongs to the set-up: where the poses are on the IMU's clock, add \
                 it to the frames' timestamps ([time_offset] offset_s)"
            ));
        }
    }
    unused_keys(&table, &KEYS, &mut notes);
    Ok(Imported { camera, notes })
}

fn intrinsics(table: &Field) -> Result<Intrinsics> {
    let resolution = table.require("resolution", "[width, height] in px")?;
    let whole: [f64; 2] = resolution.exactly("[width, height] in px")?;
    let size = super::euroc::size_px(&resolution, whole)?;
    let model = table.require("camera_model", "pinhole")?;
    let model_name = model.text("pinhole")?;
    if model_name != "pinhole" {
        let expected = "pinhole (omni, ds and eucm project in ways that a pinhole with a lens cannot)";
        return Err(model.unexpected(expected));
    }
    let field = table.require("intrinsics", "[fu, fv, pu, pv] in px")?;
    pinhole(&field, size, field.exactly("[fu, fv, pu, pv] in px")?)
}

fn distortion(table: &Field) -> Result<Distortion> {
    let model = table.require("distortion_model", "radtan, equidistant or none")?;
    let name = model.text("radtan, equidistant or none")?;
    if name == "fov" {
        return Err(model.unexpected("radtan, equidistant or none (calibrate again with one of these)"));
    }
    if !MODELS.contains(&name) {
        return Err(Error::unknown_name(table.path(), model.line(), "distortion_model", name, MODELS));
    }
    if name == "none" {
        return Ok(Distortion::None);
    }
    let expected = "four coefficients";
    let [a, b, c, d] = table.require("distortion_coeffs", expected)?.exactly(expected)?;
    Ok(match name {
        "radtan" => brown_conrady(a, b, c, d, 0.0),
        _ => Distortion::Equidistant { k: [a, b, c, d] },
    })
}

fn read_line_delay(table: &Field, camera: &mut CameraModel) -> Result<()> {
    let Some(field) = table.get("line_delay") else { return Ok(()) };
    let delay_s = field.number("seconds from row to row")?;
    camera.set_line_delay_s(delay_s).map_err(|problem| {
        let fits = |unit: f64| camera.clone().set_line_delay_s(delay_s * unit).is_ok();
        // The delay of a row is some 10 us: ns and us both give a readout below 1 s, ns is what some tools write.
        let unit = [(1e-3, "ms"), (1e-6, "us"), (1e-9, "ns")].into_iter().find(|(unit, _)| fits(*unit));
        let hint = unit.map_or_else(String::new, |(_, name)| format!("; is it in {name}?"));
        let whole = format!(" (line_delay = {} s, times {} rows)", Quoted(delay_s), camera.intrinsics.height);
        at_with_hint(&field, problem, whole + &hint)
    })
}

/// Writes a chain of one camera; with it, what it cannot hold.
pub(super) fn export(camera: &CameraModel) -> (String, Vec<String>) {
    const TARGET: &str = "Kalibr's camchain";
    let line_delay_s = camera.line_delay_s();
    let held: &[&str] = if line_delay_s.is_some() { &["rolling_shutter"] } else { &[] };
    let mut notes = camera.left_out(TARGET, held);
    if let Some(rate) = camera.rate_hz {
        notes.push(format!("the frame rate of {rate} Hz has no place in {TARGET}"));
    }
    let (model, coefficients) = match camera.distortion {
        Distortion::None => ("none", Vec::new()),
        Distortion::BrownConrady { k: [k1, k2, k3], p: [p1, p2] } => {
            if k3 != 0.0 {
                notes.push(format!("k3 = {k3} of the lens has no place in {TARGET}: radtan has k1 k2 p1 p2"));
            }
            ("radtan", vec![k1, k2, p1, p2])
        }
        Distortion::Equidistant { k } => ("equidistant", k.to_vec()),
        Distortion::Rational { .. } | Distortion::Division { .. } => {
            notes.push(lens_left_out(camera, TARGET));
            ("none", Vec::new())
        }
    };
    let k = &camera.intrinsics;
    let mut text =
        comments(&["Pixel centres are at whole numbers, as in OpenCV.".to_owned()]) + &comments(&notes);
    text += &format!(
        "cam0:\n  camera_model: pinhole\n  intrinsics: {}\n  distortion_model: {model}\n  distortion_coeffs: {}\n  \
         resolution: [{}, {}]\n  rostopic: {}\n",
        list(&opencv_pinhole(k)),
        list(&coefficients),
        k.width,
        k.height,
        quoted(&format!("/{}/image_raw", camera.name)),
    );
    if let Some(body_from_camera) = camera.body_from_camera {
        let rows = rows_of(&body_from_camera.inverse());
        text += "  T_cam_imu:\n";
        text.extend(rows.chunks(4).map(|row| format!("  - {}\n", list(row))));
    }
    if let Some(delay_s) = line_delay_s {
        text += &format!("  line_delay: {delay_s:?}  # s from row to row, top to bottom\n");
    }
    (text, notes)
}
