//! A monotone curve per channel on encoded values, both ways: what [`super::ResponseCurve`] applies and what
//! [`super::SensorColor`] takes back. Twin of `glsl/include/response.glsl`; no effect itself.
//!
//! One over the steepness is the curve's density: how much of the scale ahead of it a delivered step takes. It is
//! linear between the knots, so the value ahead of the curve is a quadratic in the delivered one, and the way back a
//! square root. The kernels read a piece from a table; of the delivered one its number is known, of the other it is
//! counted how many begin below.

use crate::chain::{Packer, Parameters, Settings};

/// The parameters' table in `camera.toml`.
pub(super) const ID: &str = "response_curve";
/// Values, equally spaced from 0 to 1, at which the steepness is given.
pub(super) const KNOTS: usize = 17;
/// Pieces between them, equally long in delivered values.
const PIECES: f32 = (KNOTS - 1) as f32;

/// Names of the steepness of red, green and blue.
#[rustfmt::skip]
pub(super) const NAMES: [[&str; KNOTS]; 3] = [
    ["r0", "r1", "r2", "r3", "r4", "r5", "r6", "r7", "r8", "r9", "r10", "r11", "r12", "r13", "r14", "r15", "r16"],
    ["g0", "g1", "g2", "g3", "g4", "g5", "g6", "g7", "g8", "g9", "g10", "g11", "g12", "g13", "g14", "g15", "g16"],
    ["b0", "b1", "b2", "b3", "b4", "b5", "b6", "b7", "b8", "b9", "b10", "b11", "b12", "b13", "b14", "b15", "b16"],
];

/// One over the steepness at the knots, for red, green and blue, so that 0 is 0 and 1 is 1; `None`: the curve is
/// straight.
pub(super) fn densities(settings: &Settings) -> Option<[[f64; KNOTS]; 3]> {
    let steepness = NAMES.map(|names| names.map(|name| settings.number(ID, name, 1.0)));
    if steepness.iter().all(|knots| knots.iter().all(|s| *s == knots[0])) {
        return None;
    }
    Some(steepness.map(|knots| {
        let density = knots.map(|s| 1.0 / s);
        let all: f64 = density.windows(2).map(|d| 0.5 * (d[0] + d[1]) / (KNOTS - 1) as f64).sum();
        density.map(|d| d / all)
    }))
}

/// A row of the kernels' table: number of the piece, value ahead of the curve where it begins, density at both ends.
type Row = [f32; 4];
/// Rows of a channel: the pieces, and a straight one beyond either end.
const ROWS: usize = KNOTS + 1;

/// Values ahead of the curve at the knots: the density's integral.
fn starts(density: &[f64; KNOTS]) -> [f64; KNOTS] {
    let mut sum = 0.0;
    std::array::from_fn(|k| {
        sum += if k == 0 { 0.0 } else { 0.5 * (density[k - 1] + density[k]) / (KNOTS - 1) as f64 };
        sum
    })
}

fn rows(density: &[f64; KNOTS]) -> [Row; ROWS] {
    let (starts, last) = (starts(density), KNOTS - 1);
    std::array::from_fn(|row| {
        let at = row.saturating_sub(1);
        // Beyond the ends the density stays.
        let (low, high) = (density[at], density[if row == 0 { 0 } else { row.min(last) }]);
        [at as f64, starts[at], low, high].map(|v| v as f32)
    })
}

/// Packs the pieces as one parameter.
pub(super) fn pack(densities: &[[f64; KNOTS]; 3], packer: &mut Packer<'_>) {
    packer.rows(densities.iter().flat_map(rows));
}

/// Packs where the pieces from the second on begin, red's, green's and blue's by turns.
pub(super) fn pack_starts(densities: &[[f64; KNOTS]; 3], packer: &mut Packer<'_>) {
    let starts = densities.each_ref().map(starts);
    (1..KNOTS - 1).for_each(|k| starts.iter().for_each(|of| packer.number(of[k])));
}

/// From a delivered value to the one ahead of the curve; beyond 0 and 1 it goes on straight. `table`: parameter with
/// the pieces.
pub(super) fn to_sensor(delivered: f32, c: usize, p: &Parameters, table: usize) -> f32 {
    let place = delivered * PIECES;
    let piece = (place.floor() as i32).clamp(-1, PIECES as i32);
    let [number, start, low, high] = p.row(table, c * ROWS + (piece + 1) as usize);
    let t = place - number;
    start + t * (low + 0.5 * (high - low) * t) * (1.0 / PIECES)
}

/// The inverse of [`to_sensor`]. `first`: parameter with the first of the pieces' starts.
pub(super) fn from_sensor(sensor: f32, c: usize, p: &Parameters, (table, first): (usize, usize)) -> f32 {
    let inner = (0..KNOTS - 2).filter(|k| sensor >= p.number(first + 3 * k + c)).count();
    let piece = inner + usize::from(sensor >= 0.0) + usize::from(sensor >= 1.0);
    let [number, start, low, high] = p.row(table, c * ROWS + piece);
    let rise = (sensor - start) * PIECES;
    let square = low * low + 2.0 * (high - low) * rise;
    let t = 2.0 * rise / (low + square.max(0.0).sqrt());
    (number + t) * (1.0 / PIECES)
}
