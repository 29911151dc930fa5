//! Places in the tables of what noise does to values of the sensor.

use crate::chain::Variances;

/// Entries of the tables of what noise does.
pub(super) const COARSE: usize = 768;
/// Roots of the sensor's values in the tables of noise (the sign goes along): from here on, a span of [`SPAN`]. Roots,
/// because encoding and clipping bend most near black.
const LOW: f32 = -0.45;
/// See [`LOW`].
const SPAN: f32 = 1.64;

/// The entry of a table at or before a place in it. By way of 32 bits: a float becomes 64 of them, unsigned, in ten
/// times as many instructions, and this is done for every value of every picture.
pub(super) fn place(at: f32) -> usize {
    at as i32 as usize
}

/// The place of a value of the sensor in the tables of noise.
#[inline]
pub(super) fn sensor_place(sensor: f32) -> f32 {
    let root = sensor.abs().sqrt().copysign(sensor);
    ((root - LOW) / SPAN).clamp(0.0, 1.0) * (COARSE - 1) as f32
}

/// The sensor's value at a place of the tables of noise.
pub(super) fn sensor_at(place: usize) -> f32 {
    let root = LOW + SPAN * place as f32 / (COARSE - 1) as f32;
    root * root.abs()
}

/// By whole DN: the place of a table at or behind whose mean that is, and how far it lies from the one ahead of it.
pub(super) fn places_by_dn(mean: impl Fn(usize) -> f32) -> impl Iterator<Item = (usize, f32)> {
    let mut at = 0;
    (0..256).map(move |dn| {
        while at + 1 < COARSE && mean(at) < dn as f32 {
            at += 1;
        }
        let (b, a) = (mean(at), mean(at.saturating_sub(1)));
        (at, if b > a { ((dn as f32 - a) / (b - a)).clamp(0.0, 1.0) } else { 1.0 })
    })
}

/// Of a sum of colours by weight: pixels' noise is each colour's own, that of a row is common to them.
pub(super) fn mixed_colors(parts: impl Iterator<Item = (f32, Variances)>) -> Variances {
    let (mut sum, mut row) = (Variances::default(), 0.0);
    for (weight, v) in parts {
        sum = sum.plus(weight * weight, &v);
        row += weight * v.row.sqrt();
    }
    Variances { row: row * row, ..sum }
}
