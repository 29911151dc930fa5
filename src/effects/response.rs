//! A monotone curve per channel on encoded values, as a table, both ways: what [`super::ResponseCurve`] applies and what
//! [`super::SensorColor`] takes back. Twin of `glsl/include/response.glsl`; no effect itself.

use crate::chain::{Packer, Parameters, Settings};

/// The parameters' table in `camera.toml`.
pub(super) const ID: &str = "response_curve";
/// Values, equally spaced from 0 to 1, at which the steepness is given.
pub(super) const KNOTS: usize = 17;
/// Pieces of the table, equally long in delivered values.
pub(super) const PIECES: usize = 64;

/// Names of the steepness of red, green and blue.
#[rustfmt::skip]
pub(super) const NAMES: [[&str; KNOTS]; 3] = [
    ["r0", "r1", "r2", "r3", "r4", "r5", "r6", "r7", "r8", "r9", "r10", "r11", "r12", "r13", "r14", "r15", "r16"],
    ["g0", "g1", "g2", "g3", "g4", "g5", "g6", "g7", "g8", "g9", "g10", "g11", "g12", "g13", "g14", "g15", "g16"],
    ["b0", "b1", "b2", "b3", "b4", "b5", "b6", "b7", "b8", "b9", "b10", "b11", "b12", "b13", "b14", "b15", "b16"],
];

/// The value ahead of the curve at the begin of each piece and at the end of the last, for red, green and blue, so that 0
/// is 0 and 1 is 1; `None`: the curve is straight.
pub(super) fn tables(settings: &Settings) -> Option<[Vec<f64>; 3]> {
    let steepness = NAMES.map(|names| names.map(|name| settings.number(ID, name, 1.0)));
    if steepness.iter().all(|knots| knots.iter().all(|s| *s == knots[0])) {
        return None;
    }
    let at = |knots: &[f64; KNOTS], delivered: f64| {
        let place = delivered * (KNOTS - 1) as f64;
        let before = (place as usize).min(KNOTS - 2);
        knots[before] + (knots[before + 1] - knots[before]) * (place - before as f64)
    };
    Some(steepness.map(|knots| {
        let mut values = vec![0.0];
        for j in 0..PIECES {
            values.push(values[j] + 1.0 / at(&knots, (j as f64 + 0.5) / PIECES as f64));
        }
        let all = values[PIECES];
        values.into_iter().map(|v| v / all).collect()
    }))
}

/// Packs the tables; the parameter is the place of red's first value.
pub(super) fn pack(tables: &[Vec<f64>; 3], packer: &mut Packer<'_>) {
    packer.table(tables.iter().flatten().map(|v| *v as f32));
}

/// Entry of channel `c` in the table that parameter `index` points to.
fn entry(p: &Parameters, index: usize, c: usize, j: usize) -> f32 {
    p.table(index, c * (PIECES + 1) + j)
}

/// From a delivered value to the one ahead of the curve; beyond 0 and 1 the outer pieces go on.
pub(super) fn to_sensor(delivered: f32, c: usize, p: &Parameters, index: usize) -> f32 {
    let place = delivered * PIECES as f32;
    let j = (place.max(0.0) as usize).min(PIECES - 1);
    let (low, high) = (entry(p, index, c, j), entry(p, index, c, j + 1));
    low + (place - j as f32) * (high - low)
}

/// The inverse of [`to_sensor`].
pub(super) fn from_sensor(sensor: f32, c: usize, p: &Parameters, index: usize) -> f32 {
    // The last piece that begins at or below the value: six halvings of 64.
    let (mut j, mut step) = (0, PIECES / 2);
    while step > 0 {
        j += if entry(p, index, c, j + step) <= sensor { step } else { 0 };
        step /= 2;
    }
    let (low, high) = (entry(p, index, c, j), entry(p, index, c, j + 1));
    (j as f32 + (sensor - low) / (high - low)) / PIECES as f32
}
