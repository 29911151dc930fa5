//! EuRoC / ASL `sensor.yaml` of a camera (`mav0/cam0/sensor.yaml`). `T_BS` takes camera to body coordinates. Calibrated
//! with Kalibr, so pixel centres are at whole numbers.

use super::common::{
    at, brown_conrady, comments, lens_left_out, list, opencv_pinhole, pinhole, pose, quoted, rows_of,
    unused_keys,
};
use super::yaml::Field;
use super::{CameraModel, Imported};
use shutterbug::camera::{Distortion, Pose};
use shutterbug::error::{Error, Result};
use shutterbug::plane::MAX_SIDE_PX;

const MODELS: [&str; 4] = ["radial-tangential", "radtan", "equidistant", "none"];
const KEYS: [&str; 9] = [
    "sensor_type",
    "comment",
    "T_BS",
    "rate_hz",
    "resolution",
    "camera_model",
    "intrinsics",
    "distortion_model",
    "distortion_coefficients",
];

/// Whether a document looks like this format.
pub(super) fn recognises(top: &Field) -> bool {
    top.get("sensor_type").is_some() || (top.get("T_BS").is_some() && top.get("intrinsics").is_some())
}

/// Width and height from a list of two numbers.
pub(super) fn size_px(field: &Field, size: [f64; 2]) -> Result<[u32; 2]> {
    let fits = |n: f64| n.fract() == 0.0 && (1.0..=f64::from(MAX_SIDE_PX)).contains(&n);
    if !size.iter().all(|n| fits(*n)) {
        let found = format!("{} = {size:?}", field.name());
        let expected = format!("[width, height], whole numbers of px, 1 to {MAX_SIDE_PX}");
        return Err(Error::input(field.path(), field.line(), found, expected));
    }
    Ok(size.map(|n| n as u32))
}

/// Reads a camera.
pub(super) fn import(top: &Field) -> Result<Imported> {
    if let Some(kind) = top.get("sensor_type").filter(|f| f.text("").is_ok_and(|t| t != "camera")) {
        return Err(kind.unexpected("`camera`: the sensor.yaml of a camera, as in mav0/cam0"));
    }
    let resolution = top.require("resolution", "[width, height] in px")?;
    let size = size_px(&resolution, resolution.exactly("[width, height] in px")?)?;
    if let Some(model) = top.get("camera_model").filter(|f| f.text("").is_ok_and(|t| t != "pinhole")) {
        return Err(model.unexpected("pinhole"));
    }
    let field = top.require("intrinsics", "[fu, fv, cu, cv] in px")?;
    let intrinsics = pinhole(&field, size, field.exactly("[fu, fv, cu, cv] in px")?)?;
    let name = top.path().parent().and_then(|p| p.file_name()).map(|n| n.to_string_lossy().into_owned());
    let name = name.filter(|n| !n.is_empty()).unwrap_or_else(|| "camera".to_owned());
    let mut camera = CameraModel::new(name, intrinsics);
    camera.distortion = distortion(top)?;
    if let Some(field) = top.get("distortion_coefficients") {
        camera.check_lens().map_err(|problem| at(&field, problem))?;
    }
    if let Some(field) = top.get("rate_hz") {
        camera.rate_hz = Some(field.number_in("Hz", super::RATE_HZ)?);
    }
    camera.body_from_camera = body_from_sensor(top)?;
    let mut notes = Vec::new();
    unused_keys(top, &KEYS, &mut notes);
    Ok(Imported { camera, notes })
}

/// `T_BS` of any sensor.
pub(super) fn body_from_sensor(top: &Field) -> Result<Option<Pose>> {
    top.get("T_BS").map(|field| pose(&field)).transpose()
}

fn distortion(top: &Field) -> Result<Distortion> {
    let expected = "radial-tangential or equidistant";
    let model = top.require("distortion_model", expected)?;
    let name = model.text(expected)?;
    if !MODELS.contains(&name) {
        return Err(Error::unknown_name(top.path(), model.line(), "distortion_model", name, MODELS));
    }
    if name == "none" {
        return Ok(Distortion::None);
    }
    let field = top.require("distortion_coefficients", "four coefficients")?;
    let [a, b, c, d] = field.exactly("four coefficients")?;
    Ok(match name {
        "equidistant" => Distortion::Equidistant { k: [a, b, c, d] },
        _ => brown_conrady(a, b, c, d, 0.0),
    })
}

/// Writes a `sensor.yaml`; with it, what it cannot hold.
pub(super) fn export(camera: &CameraModel) -> (String, Vec<String>) {
    const TARGET: &str = "EuRoC's sensor.yaml";
    let mut notes = camera.left_out(TARGET, &[]);
    let (model, coefficients) = match camera.distortion {
        Distortion::None => ("radial-tangential", vec![0.0; 4]),
        Distortion::BrownConrady { k: [k1, k2, k3], p: [p1, p2] } => {
            if k3 != 0.0 {
                notes.push(format!("k3 = {k3} of the lens has no place in {TARGET}: it has k1 k2 p1 p2"));
            }
            ("radial-tangential", vec![k1, k2, p1, p2])
        }
        Distortion::Equidistant { k } => ("equidistant", k.to_vec()),
        Distortion::Rational { .. } | Distortion::Division { .. } => {
            notes.push(lens_left_out(camera, TARGET));
            ("radial-tangential", vec![0.0; 4])
        }
    };
    if camera.body_from_camera.is_none() {
        notes.push("T_BS is the identity: the camera's place on its body is not known".to_owned());
    }
    let t_bs = rows_of(&camera.body_from_camera.unwrap_or(Pose::IDENTITY));
    let k = &camera.intrinsics;
    let rate = camera.rate_hz.map_or_else(String::new, |rate| format!("rate_hz: {rate:?}\n"));
    let text = comments(&["Pixel centres are at whole numbers, as in OpenCV.".to_owned()])
        + &comments(&notes)
        + &format!(
            "sensor_type: camera\ncomment: {}\nT_BS:\n  cols: 4\n  rows: 4\n  data: {}\n{rate}resolution: [{}, {}]\n\
             camera_model: pinhole\nintrinsics: {}\ndistortion_model: {model}\ndistortion_coefficients: {}\n",
            quoted(&camera.name),
            list(&t_bs),
            k.width,
            k.height,
            list(&opencv_pinhole(k)),
            list(&coefficients),
        );
    (text, notes)
}
