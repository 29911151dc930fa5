//! A monotone curve per channel on encoded values, both ways: what [`super::ResponseCurve`] applies and what
//! [`super::SensorColor`] takes back. Twin of `glsl/include/response.glsl`; no effect itself.
//!
//! One over the steepness is the curve's density: how much of the scale ahead of it a delivered step takes. It is linear
//! between the knots, so the value ahead of the curve is a quadratic in the delivered one, and the way back a square root.

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

/// One over the steepness at the knots, for red, green and blue, so that 0 is 0 and 1 is 1; `None`: the curve is straight.
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

/// Packs them, red's first.
pub(super) fn pack(densities: &[[f64; KNOTS]; 3], packer: &mut Packer<'_>) {
    densities.iter().flatten().for_each(|v| packer.number(*v));
}

/// A piece of the curve: number, value ahead of the curve where it begins, density at both ends.
struct Piece {
    number: f32,
    start: f32,
    low: f32,
    high: f32,
}

/// The density of channel `c` at a knot; `first`: parameter with red's first.
fn density(p: &Parameters, first: usize, c: usize, knot: usize) -> f32 {
    p.number(first + c * KNOTS + knot)
}

/// The last piece that begins at or below `value`, which counts pieces or is ahead of the curve.
fn piece(value: f32, counts: bool, at: impl Fn(usize) -> f32) -> Piece {
    let mut piece = Piece { number: 0.0, start: 0.0, low: at(0), high: at(1) };
    let mut sum = 0.0;
    for k in 1..KNOTS - 1 {
        sum += (at(k - 1) + at(k)) * (0.5 / PIECES);
        if value >= if counts { k as f32 } else { sum } {
            piece = Piece { number: k as f32, start: sum, low: at(k), high: at(k + 1) };
        }
    }
    piece
}

/// From a delivered value to the one ahead of the curve; beyond 0 and 1 it goes on straight.
pub(super) fn to_sensor(delivered: f32, c: usize, p: &Parameters, first: usize) -> f32 {
    let at = |knot| density(p, first, c, knot);
    let inside = delivered.clamp(0.0, 1.0);
    let place = inside * PIECES;
    let piece = piece(place, true, at);
    let t = place - piece.number;
    let value = piece.start + t * (piece.low + 0.5 * (piece.high - piece.low) * t) * (1.0 / PIECES);
    value + (delivered - inside) * at(if delivered < 0.0 { 0 } else { KNOTS - 1 })
}

/// The inverse of [`to_sensor`].
pub(super) fn from_sensor(sensor: f32, c: usize, p: &Parameters, first: usize) -> f32 {
    let at = |knot| density(p, first, c, knot);
    let inside = sensor.clamp(0.0, 1.0);
    let piece = piece(inside, false, at);
    let rise = (inside - piece.start) * PIECES;
    let square = piece.low * piece.low + 2.0 * (piece.high - piece.low) * rise;
    let t = 2.0 * rise / (piece.low + square.max(0.0).sqrt());
    let value = (piece.number + t) * (1.0 / PIECES);
    value + (sensor - inside) / at(if sensor < 0.0 { 0 } else { KNOTS - 1 })
}
