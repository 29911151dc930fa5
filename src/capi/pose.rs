//! Converts poses from a host's convention to this library's.

use std::ffi::c_char;

use glam::{DMat3, DQuat, DVec3};

use super::convert::explained;
use super::status::{Fault, Outcome, Status};
use super::types::*;
use crate::camera::Pose;

/// Furthest that the rows of a matrix may be from those of a rotation.
const NOT_A_ROTATION: f64 = 1e-3;

/// `shutterbug_pose_convert`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_pose_convert(
    convention: *const shutterbug_pose_convention,
    values: *const f64,
    pose: *mut shutterbug_pose,
    error_text: *mut c_char,
    error_capacity: u64,
) -> Status {
    let convert = || {
        // SAFETY: the caller's promise.
        let convention = unsafe { read(convention) }?;
        check_convention(&convention)?;
        if values.is_null() || !values.is_aligned() {
            return Err(Fault::argument("values is null or misaligned"));
        }
        if pose.is_null() || !pose.is_aligned() {
            return Err(Fault::argument("pose is null or misaligned"));
        }
        let count = if convention.form < 2 { 7 } else { 16 };
        // SAFETY: not null, aligned; so many readable by the caller's promise.
        let values = unsafe { std::slice::from_raw_parts(values, count) };
        let own = from_values(&convention, values)?;
        let (translation_m, rotation_xyzw) = (own.translation_m.to_array(), own.rotation.to_array());
        // SAFETY: not null and aligned; writable by the caller's promise.
        unsafe { pose.write(shutterbug_pose { translation_m, rotation_xyzw }) };
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { explained((error_text, error_capacity), convert) }
}

fn check_convention(c: &shutterbug_pose_convention) -> Outcome<()> {
    for (name, value, most) in [("form", c.form, 3), ("axes", c.axes, 2), ("direction", c.direction, 1)] {
        if value > most {
            return Err(Fault::argument(format!("pose convention: {name} is {value}, at most {most}")));
        }
    }
    if !(c.metres >= 0.0 && c.metres.is_finite()) {
        return Err(Fault::argument(format!("pose convention: metres is {}, not 0 or above", c.metres)));
    }
    Ok(())
}

/// Optical axes (x right, y down, z forward) in a host's camera axes.
fn own_from_optical(axes: u32) -> DQuat {
    match axes {
        1 => Pose::opengl_from_camera(),
        2 => Pose::body_from_camera(),
        _ => DQuat::IDENTITY,
    }
}

/// World from camera, by a checked convention; 7 values, or 16 of a matrix.
fn from_values(c: &shutterbug_pose_convention, values: &[f64]) -> Outcome<Pose> {
    if let Some(value) = values.iter().find(|v| !v.is_finite()) {
        return Err(Fault::argument(format!("values: {value} among them")));
    }
    let (rotation, translation) = match c.form {
        0 | 1 => {
            let [a, b, d, e] = [values[3], values[4], values[5], values[6]];
            let q = if c.form == 0 { DQuat::from_xyzw(a, b, d, e) } else { DQuat::from_xyzw(b, d, e, a) };
            if !((q.length() - 1.0).abs() <= 1e-3) {
                let text = format!("values: a quaternion of length {}, not 1 within 1e-3", q.length());
                return Err(Fault::argument(text));
            }
            (q.normalize(), DVec3::from_slice(values))
        }
        _ => of_matrix(c.form == 3, values)?,
    };
    let scale = if c.metres == 0.0 { 1.0 } else { c.metres };
    let given = Pose { rotation, translation_m: translation * scale };
    let world_from_host = if c.direction == 1 { given.inverse() } else { given };
    Ok(Pose {
        rotation: (world_from_host.rotation * own_from_optical(c.axes)).normalize(),
        ..world_from_host
    })
}

/// Rotation and translation of a 4x4 matrix, row by row or column by column.
fn of_matrix(columns: bool, values: &[f64]) -> Outcome<(DQuat, DVec3)> {
    let at = |row: usize, column: usize| values[if columns { 4 * column + row } else { 4 * row + column }];
    let column = |i: usize| DVec3::new(at(0, i), at(1, i), at(2, i));
    let last = [at(3, 0), at(3, 1), at(3, 2), at(3, 3) - 1.0];
    if last.iter().any(|v| v.abs() > 1e-6) {
        let other = if columns { "row by row (MATRIX_ROWS)" } else { "column by column (MATRIX_COLUMNS)" };
        return Err(Fault::argument(format!("values: the last row is not 0 0 0 1; does it lie {other}?")));
    }
    let rotation = DMat3::from_cols(column(0), column(1), column(2));
    let off = rotation.transpose() * rotation - DMat3::IDENTITY;
    let far = off.to_cols_array().iter().any(|v| v.abs() > NOT_A_ROTATION);
    if far || rotation.determinant() < 0.0 {
        return Err(Fault::argument("values: the matrix scales, shears or mirrors; it is no pose"));
    }
    Ok((DQuat::from_mat3(&rotation).normalize(), column(3)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn convention(form: u32, axes: u32, direction: u32) -> shutterbug_pose_convention {
        let struct_size = size_of::<shutterbug_pose_convention>() as u32;
        shutterbug_pose_convention { struct_size, form, axes, direction, metres: 0.0 }
    }

    #[test]
    fn forms_and_axes_say_the_same_camera() {
        let own = Pose {
            rotation: DQuat::from_euler(glam::EulerRot::YXZ, 0.4, -0.2, 0.9),
            translation_m: DVec3::new(1.0, -2.0, 3.0),
        };
        let near = |a: &Pose, b: &Pose| {
            a.rotation.dot(b.rotation).abs() > 1.0 - 1e-12
                && (a.translation_m - b.translation_m).length() < 1e-12
        };
        for axes in 0..3 {
            let host = Pose { rotation: own.rotation * own_from_optical(axes).conjugate(), ..own };
            for direction in 0..2 {
                let given = if direction == 1 { host.inverse() } else { host };
                let (q, t) = (given.rotation.to_array(), given.translation_m.to_array());
                let m = glam::DMat4::from_rotation_translation(given.rotation, given.translation_m);
                let forms: [Vec<f64>; 4] = [
                    [&t[..], &q].concat(),
                    [&t[..], &q[3..], &q[..3]].concat(),
                    m.transpose().to_cols_array().to_vec(),
                    m.to_cols_array().to_vec(),
                ];
                for (form, values) in forms.iter().enumerate() {
                    let of = convention(form as u32, axes, direction);
                    let got = from_values(&of, values).unwrap();
                    assert!(near(&got, &own), "form {form}, axes {axes}, direction {direction}");
                    let other = convention(form as u32, (axes + 1) % 3, direction);
                    assert!(!near(&from_values(&other, values).unwrap(), &own), "control: other axes");
                }
                let swapped = from_values(&convention(3, axes, direction), &forms[2]).unwrap_err();
                assert!(swapped.text.contains("MATRIX_ROWS"), "{}", swapped.text);
            }
        }
        let up = own_from_optical(1) * DVec3::Y;
        assert!((up + DVec3::Y).length() < 1e-12, "down is down: {up}");
        assert!((own_from_optical(2) * DVec3::Z - DVec3::X).length() < 1e-12, "forward is x");
    }
}
