//! A monotone curve per channel on linear values, as a table, both ways: what [`super::ResponseCurve`] applies and what
//! [`super::SensorColor`] takes back. Twin of `glsl/include/response.glsl`; no effect itself.

use crate::chain::{Packer, Parameters, Settings};
use crate::plane::srgb_encode;

/// The parameters' table in `camera.toml`.
pub(super) const ID: &str = "response_curve";
/// Values (encoded, equally spaced from 0 to 1) at which the steepness is given.
pub(super) const KNOTS: usize = 9;
/// Pieces of the table; piece j covers the linear values from (j / PIECES)^2 to ((j + 1) / PIECES)^2.
pub(super) const PIECES: usize = 64;

/// Names of the steepness of red, green and blue.
pub(super) const NAMES: [[&str; KNOTS]; 3] = [
    ["r0", "r1", "r2", "r3", "r4", "r5", "r6", "r7", "r8"],
    ["g0", "g1", "g2", "g3", "g4", "g5", "g6", "g7", "g8"],
    ["b0", "b1", "b2", "b3", "b4", "b5", "b6", "b7", "b8"],
];

/// The delivered linear value at which piece j begins.
fn begin(j: usize) -> f64 {
    (j as f64 / PIECES as f64).powi(2)
}

/// What the sensor's value is at the begin of each piece and at the end of the last, for red, green and blue; `None`: the
/// curve is straight.
pub(super) fn tables(settings: &Settings) -> Option<[Vec<f64>; 3]> {
    let steepness = NAMES.map(|names| names.map(|name| settings.number(ID, name, 1.0)));
    if steepness.iter().flatten().all(|s| *s == 1.0) {
        return None;
    }
    let at = |knots: &[f64; KNOTS], linear: f64| {
        let place = f64::from(srgb_encode(linear as f32)) * (KNOTS - 1) as f64;
        let before = (place as usize).min(KNOTS - 2);
        knots[before] + (knots[before + 1] - knots[before]) * (place - before as f64)
    };
    Some(steepness.map(|knots| {
        let mut values = vec![0.0];
        for j in 0..PIECES {
            let (from, to) = (begin(j), begin(j + 1));
            values.push(values[j] + (to - from) / at(&knots, 0.5 * (from + to)));
        }
        values
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

fn begin_f32(j: usize) -> f32 {
    let root = j as f32 / PIECES as f32;
    root * root
}

/// From a delivered value to the sensor's; beyond 0 and 1 the outer pieces go on.
pub(super) fn to_sensor(delivered: f32, c: usize, p: &Parameters, index: usize) -> f32 {
    let root = if delivered > 0.0 { delivered.sqrt() } else { 0.0 };
    let j = ((root * PIECES as f32) as usize).min(PIECES - 1);
    let (low, high) = (entry(p, index, c, j), entry(p, index, c, j + 1));
    let (from, to) = (begin_f32(j), begin_f32(j + 1));
    low + (delivered - from) * ((high - low) / (to - from))
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
    let (from, to) = (begin_f32(j), begin_f32(j + 1));
    from + (sensor - low) * ((to - from) / (high - low))
}
