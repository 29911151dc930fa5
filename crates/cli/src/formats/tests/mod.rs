mod cameras;
mod motion;
mod presets;
mod written;

use std::path::Path;

use super::{Format, Imported, parse_camera};

/// What `camera_calibration` writes.
const ROS: &str = "image_width: 640
image_height: 480
camera_name: head
camera_matrix:
  rows: 3
  cols: 3
  data: [580.5, 0., 315.25, 0., 576.75, 247.5, 0., 0., 1.]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.25, 0.08, 0.002, -0.001, 0.01]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1., 0., 0., 0., 1., 0., 0., 0., 1.]
projection_matrix:
  rows: 3
  cols: 4
  data: [580.5, 0., 315.25, 0., 0., 576.75, 247.5, 0., 0., 0., 1., 0.]
";

/// Two cameras, the first with a rolling shutter.
const KALIBR: &str = "cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.27, 0.066, 0.0008, 0.0001]
  distortion_model: radtan
  intrinsics: [461.6, 460.1, 362.6, 246.0]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: -8.1e-05
  line_delay: 2.5e-05
  T_cam_imu:
  - [0.0, 1.0, 0.0, 0.07]
  - [-1.0, 0.0, 0.0, -0.02]
  - [0.0, 0.0, 1.0, 0.004]
  - [0.0, 0.0, 0.0, 1.0]
cam1:
  camera_model: pinhole
  distortion_coeffs: [-0.01, 0.02, -0.01, 0.002]
  distortion_model: equidistant
  intrinsics: [460.0, 460.0, 370.0, 240.0]
  resolution: [752, 480]
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
";

/// As in `mav0/cam0/sensor.yaml`.
const EUROC: &str = "# General sensor definitions.
sensor_type: camera
comment: VI-Sensor cam0

T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, -0.02,
         1.0, 0.0, 0.0, -0.06,
         0.0, 0.0, 1.0, 0.01,
         0.0, 0.0, 0.0, 1.0]

rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.074, 0.00019, 1.76e-05]
";

fn read(text: &str) -> Imported {
    parse_camera(Path::new("c.yaml"), text, None, None).unwrap_or_else(|e| panic!("{e}"))
}

fn refused(text: &str) -> String {
    match parse_camera(Path::new("c.yaml"), text, None, None) {
        Ok(camera) => panic!("accepted: {camera:?}"),
        Err(e) => e.to_string(),
    }
}

fn kalibr(text: &str, name: &str) -> Imported {
    let read = parse_camera(Path::new("c.yaml"), text, Some(Format::Kalibr), Some(name));
    read.unwrap_or_else(|e| panic!("{e}"))
}
