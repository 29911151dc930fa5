//! What a table says of its own columns, in a comment ahead of the numbers: `#timestamp [ns],w_x [rad s^-1],...`.

use std::path::Path;

use crate::error::{Error, Result};
use crate::plane::stats::median;

/// Names and units of a table of rates and accelerations, as in EuRoC's `imu0/data.csv`.
pub const IMU_COLUMNS: [(&str, &str); 7] = [
    ("timestamp", "ns"),
    ("w_RS_S_x", "rad s^-1"),
    ("w_RS_S_y", "rad s^-1"),
    ("w_RS_S_z", "rad s^-1"),
    ("a_RS_S_x", "m s^-2"),
    ("a_RS_S_y", "m s^-2"),
    ("a_RS_S_z", "m s^-2"),
];

/// Checks the first comment of a table that names units in brackets against the columns that are read. A column of
/// another unit, or one that stands in the place of another, would be read as what it is not. Of names that are not
/// known it is asked whether they speak of a rate or of an acceleration, and of which axis.
///
/// # Errors
/// Such a column: file, line, what it says and what was expected.
pub fn check_columns(path: &Path, text: &str, expected: &[(&str, &str)]) -> Result<()> {
    let comments = text.trim_start_matches('\u{feff}').lines().enumerate();
    // A header may also stand there as it is.
    let is_said = |l: &str| l.trim().is_empty() || l.trim_start().starts_with('#') || is_header(l);
    let mut comments = comments.take_while(|(_, l)| is_said(l));
    let Some((index, line)) = comments.find(|(_, l)| l.contains(',') && (l.contains('[') || is_header(l)))
    else {
        return Ok(());
    };
    let said = line.trim().trim_start_matches('#').split(',').map(parts);
    for ((name, unit), (wanted, wanted_unit)) in said.zip(expected) {
        let known = expected.iter().any(|(other, _)| *other == name);
        let of_another = name != *wanted && (known || speaks_of_another(name, wanted));
        let other_unit = unit.is_some_and(|unit| !is_unit(unit, wanted_unit));
        if of_another || other_unit {
            let unit = unit.map(|u| format!(" [{u}]")).unwrap_or_default();
            let expected = if wanted_unit.is_empty() {
                format!("{wanted} there")
            } else {
                format!("{wanted} [{wanted_unit}] there")
            };
            return Err(Error::input(path, index + 1, format!("the column `{name}{unit}`"), expected));
        }
    }
    Ok(())
}

/// Acceleration of free fall, m/s^2: what a sensor of accelerations shows at rest.
const GRAVITY_M_S2: f64 = 9.81;

/// Checks that rates [rad/s] are no accelerations [m/s^2]: these are as long as free fall's most of the time (to within
/// 5 %, which the earth and cheap sensors differ by), and no camera turns one and a half times a second all the time.
///
/// # Errors
/// Rates that are: the file, their median length and what was expected.
pub fn check_rates(path: &Path, rates: impl IntoIterator<Item = [f64; 3]>) -> Result<()> {
    let usual = median(rates.into_iter().map(|r| r.iter().map(|v| v * v).sum::<f64>().sqrt()));
    if (usual / GRAVITY_M_S2 - 1.0).abs() > 0.05 {
        return Ok(());
    }
    let found = format!("rates of {usual:.2} rad/s (median of their lengths), which is free fall in m/s^2");
    Err(Error::input(path, None, found, "the rates about x, y, z [rad/s] ahead of the accelerations [m/s^2]"))
}

/// Whether a line of a table begins with the name of its first column, with or without the sign of a comment.
pub fn is_header(line: &str) -> bool {
    line.trim_start_matches(['#', ' ', '\t']).starts_with(IMU_COLUMNS[0].0)
}

/// What a name speaks of: a rate (true) or an acceleration, and its axis.
fn spoken_of(name: &str) -> (Option<bool>, Option<char>) {
    let name = name.to_lowercase();
    let begins = |words: &[&str]| words.iter().any(|w| name.starts_with(w));
    let rate = if begins(&["w", "gyr", "omega", "ang", "rate"]) {
        Some(true)
    } else if begins(&["a", "lin"]) {
        Some(false)
    } else {
        None
    };
    (rate, name.chars().last().filter(|c| ('x'..='z').contains(c)))
}

/// Whether a name speaks of something else than a column that is wanted.
fn speaks_of_another(name: &str, wanted: &str) -> bool {
    let ((rate, axis), (wanted_rate, wanted_axis)) = (spoken_of(name), spoken_of(wanted));
    let differ = rate.zip(wanted_rate).is_some_and(|(a, b)| a != b);
    // A name that speaks of neither (`t`, `max`) has no axis.
    differ || (rate.is_some() && axis.zip(wanted_axis).is_some_and(|(a, b)| a != b))
}

/// Name and unit of a column; no unit where none is given or the brackets are empty.
fn parts(column: &str) -> (&str, Option<&str>) {
    let (name, rest) = column.split_once('[').unwrap_or((column, ""));
    let unit = rest.split(']').next().map(str::trim).filter(|u| !u.is_empty());
    (name.trim(), unit)
}

/// Whether two ways to write a unit mean the same: `rad/s`, `rad s^-1`, `rad*s^-1`.
fn is_unit(said: &str, wanted: &str) -> bool {
    let plain = |unit: &str| unit.to_lowercase().replace([' ', '*', '·'], "").replace("**", "^");
    let ways = |unit: &str| match unit {
        "rad s^-1" => vec!["rads^-1", "rad/s", "rads-1", "rad/sec", "1/s"],
        "m s^-2" => vec!["ms^-2", "m/s^2", "m/s2", "ms-2", "m/s²"],
        _ => Vec::new(),
    };
    plain(said) == plain(wanted) || ways(wanted).contains(&plain(said).as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    const GYRO: [(&str, &str); 4] =
        [("timestamp", "ns"), ("w_x", "rad s^-1"), ("w_y", "rad s^-1"), ("a_x", "m s^-2")];

    fn said(text: &str) -> Option<String> {
        check_columns(Path::new("imu.csv"), text, &GYRO).err().map(|e| e.to_string())
    }

    #[test]
    fn accelerations_in_the_place_of_rates_are_seen_by_their_length() {
        let shaken = |i: i32| 0.3 * f64::from(i % 7 - 3);
        let check = |of: &dyn Fn(i32) -> [f64; 3]| check_rates(Path::new("imu.csv"), (0..99).map(of));
        let error = check(&|i| [shaken(i), 6.9 + shaken(i + 2), -6.9]).expect_err("free fall").to_string();
        assert!(error.contains("imu.csv") && error.contains("ahead of the accelerations"), "{error}");
        assert!(check(&|i| [shaken(i), shaken(i + 2), 0.1]).is_ok(), "control: a hand");
        assert!(check(&|i| [3.0 * shaken(i), 4.0, 0.1]).is_ok(), "control: a fast turn");
    }

    #[test]
    fn units_and_places_of_columns_are_those_that_are_read() {
        for right in [
            "#timestamp [ns],w_x [rad s^-1],w_y [rad/s],a_x [m/s^2],more [deg]\n1,2,3,4\n",
            "# axes of the camera\n# timestamp, gyro_x [], gyro_y [rad s^-1]\n1,2,3,4\n",
            "# t, x (deg/s), no brackets\n1,2,3,4\n",
            "1,2,3,4\n# late [deg],w_x [deg]\n",
        ] {
            assert_eq!(said(right), None, "{right}");
        }
        let unit = said("# axes\n#timestamp [ns],w_x [deg s^-1],w_y,a_x\n").unwrap();
        assert!(
            unit.contains("imu.csv:2") && unit.contains("w_x [deg s^-1]") && unit.contains("rad s^-1"),
            "{unit}"
        );
        assert!(said("timestamp [ns],ax,wy,wz\n").is_some(), "without a sign of a comment");
        let acceleration = said("#timestamp [ns],ax,wy\n").unwrap();
        assert!(acceleration.contains("the column `ax`") && acceleration.contains("w_x"), "{acceleration}");
        let axis = said("#timestamp [ns],omega_x,omega_x\n").unwrap();
        assert!(axis.contains("the column `omega_x`") && axis.contains("expected w_y"), "{axis}");
        let time = said("#timestamp [ms],w_x [rad/s]\n").unwrap();
        assert!(time.contains("timestamp [ms]"), "{time}");
        let place = said("#timestamp [ns],w_y [rad/s],w_x [rad/s]\n").unwrap();
        assert!(place.contains("the column `w_y [rad/s]`") && place.contains("expected w_x"), "{place}");
    }
}
