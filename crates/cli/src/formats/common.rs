//! What the YAML formats share: ranges, pixel convention, matrices, comments.

use glam::{DMat3, DQuat, DVec3};

use super::yaml::Field;
use shutterbug::camera::{Distortion, Intrinsics, Pose};
use shutterbug::error::{Error, Quoted, Result, one_line};
use shutterbug::plane::MAX_SIDE_PX;

/// OpenCV, ROS, Kalibr and EuRoC count from the centre of the first pixel, this program from its upper left corner:
/// `cx_here = cx_there + 0.5`.
pub(super) const PIXEL_CENTRE: f64 = 0.5;

/// Focal lengths that a camera can have, px (as in `camera.toml`).
pub(super) const FOCAL_PX: (f64, f64) = (1e-3, 1e7);
/// Principal points, px (as in `camera.toml`).
pub(super) const CENTRE_PX: (f64, f64) = (-1e6, 1e6);
/// How far rows of a rotation may be from orthonormal: calibration files give four digits and more.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// A side of the picture, px.
pub(super) fn side_px(field: &Field) -> Result<u32> {
    let side = field.whole(MAX_SIDE_PX)?;
    if side == 0 {
        Err(field.unexpected(format!("a whole number of px, 1 to {MAX_SIDE_PX}")))
    } else {
        Ok(side)
    }
}

/// The pinhole from OpenCV's `fx, fy, cx, cy`; `field` is what errors name.
pub(super) fn pinhole(field: &Field, size: [u32; 2], [fx, fy, cx, cy]: [f64; 4]) -> Result<Intrinsics> {
    let inside = |value: f64, (min, max): (f64, f64)| (min..=max).contains(&value);
    for (name, value, range) in
        [("fx", fx, FOCAL_PX), ("fy", fy, FOCAL_PX), ("cx", cx, CENTRE_PX), ("cy", cy, CENTRE_PX)]
    {
        if !inside(value, range) {
            let uncalibrated = if value == 0.0 { " (0 is how ROS says: not calibrated)" } else { "" };
            let found = format!("{name} = {} in {}", Quoted(value), field.name());
            let expected = format!("{} to {} px{uncalibrated}", range.0, range.1);
            return Err(Error::input(field.path(), field.line(), found, expected));
        }
    }
    let [width, height] = size;
    Ok(Intrinsics { width, height, fx, fy, cx: cx + PIXEL_CENTRE, cy: cy + PIXEL_CENTRE })
}

/// Refuses a camera matrix, row by row, that is no pinhole's; notes a skew, which has no place here.
pub(super) fn no_more_than_a_pinhole(field: &Field, m: &[f64; 9], notes: &mut Vec<String>) -> Result<()> {
    if m[3..4] != [0.0] || m[6..] != [0.0, 0.0, 1.0] {
        return Err(field.unexpected("zeros below the diagonal and 1 at its end"));
    }
    if m[1] != 0.0 {
        notes.push(format!("the skew {} px of {} has no place here and is left out", m[1], field.name()));
    }
    Ok(())
}

/// `fx, fy, cx, cy` as OpenCV counts.
pub(super) fn opencv_pinhole(k: &Intrinsics) -> [f64; 4] {
    [k.fx, k.fy, k.cx - PIXEL_CENTRE, k.cy - PIXEL_CENTRE]
}

/// Brown-Conrady from OpenCV's order k1 k2 p1 p2 k3.
pub(super) fn brown_conrady(k1: f64, k2: f64, p1: f64, p2: f64, k3: f64) -> Distortion {
    let lens = Distortion::BrownConrady { k: [k1, k2, k3], p: [p1, p2] };
    if lens.is_identity() { Distortion::None } else { lens }
}

/// What is said of a lens that a format has no model for.
pub(super) fn lens_left_out(camera: &super::CameraModel, target: &str) -> String {
    format!("the lens ({}) has no place in {target}", camera.distortion.coefficients())
}

/// The error of something that concerns one line of a file.
pub(super) fn at(field: &Field, problem: Error) -> Error {
    at_with_hint(field, problem, String::new())
}

/// The same, with what the writer may have meant.
pub(super) fn at_with_hint(field: &Field, problem: Error, hint: String) -> Error {
    Error::At { path: field.path().to_owned(), line: Some(field.line()), problem: Box::new(problem), hint }
}

/// A rigid transform from a 4x4 matrix, row by row.
pub(super) fn pose(field: &Field) -> Result<Pose> {
    let m: [f64; 16] = field.exactly("a 4x4 matrix: 16 numbers, row by row")?;
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        let found = format!("{} with the last row {:?}", field.name(), &m[12..]);
        return Err(Error::input(field.path(), field.line(), found, "a rigid transform: last row 0 0 0 1"));
    }
    rigid([m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8], m[9], m[10], m[11]]).map_err(|found| {
        Error::input(
            field.path(),
            field.line(),
            format!("{} {found}", field.name()),
            "a rotation and a translation",
        )
    })
}

/// A rigid transform from the upper three rows of its matrix, or what is wrong with them.
pub(super) fn rigid(m: [f64; 12]) -> std::result::Result<Pose, String> {
    let rows = [DVec3::new(m[0], m[1], m[2]), DVec3::new(m[4], m[5], m[6]), DVec3::new(m[8], m[9], m[10])];
    let rotation = DMat3::from_cols(rows[0], rows[1], rows[2]).transpose();
    let off = (rotation * rotation.transpose() - DMat3::IDENTITY).to_cols_array();
    let worst = off.iter().fold(0.0, |worst: f64, v| worst.max(v.abs()));
    if worst > ROTATION_TOLERANCE || worst.is_nan() {
        return Err(format!("whose rows are {worst:.3} from orthonormal"));
    }
    if rotation.determinant() < 0.0 {
        return Err("that mirrors (determinant -1)".to_owned());
    }
    let rotation = DQuat::from_mat3(&rotation).normalize();
    Ok(Pose { rotation, translation_m: DVec3::new(m[3], m[7], m[11]) })
}

/// The 16 numbers of a rigid transform, row by row.
pub(super) fn rows_of(pose: &Pose) -> [f64; 16] {
    pose.matrix().transpose().to_cols_array()
}

/// Says which keys of a table were not used.
pub(super) fn unused_keys(field: &Field, used: &[&str], notes: &mut Vec<String>) {
    for key in field.keys().into_iter().filter(|key| !used.contains(key)) {
        let line = field.get(key).map_or_else(String::new, |f| format!(" (line {})", f.line()));
        notes.push(format!("`{}`{line} has no place here and is left out", super::yaml::shortened(key)));
    }
}

/// `# ...` lines that head a written file.
pub(super) fn comments(lines: &[String]) -> String {
    // A line break in a name must not end the comment, and neither TOML nor YAML takes control characters in one.
    lines.iter().map(|line| format!("# {}\n", one_line(&line.replace(['\n', '\r'], " ")))).collect()
}

/// Numbers as YAML lists them; `{:?}` keeps every bit, and a point, which Kalibr asks for.
pub(super) fn list(numbers: &[f64]) -> String {
    let items: Vec<_> = numbers.iter().map(|n| format!("{n:?}")).collect();
    format!("[{}]", items.join(", "))
}

/// A text as a YAML scalar in double quotes; JSON's escapes are YAML's too.
pub(super) fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
