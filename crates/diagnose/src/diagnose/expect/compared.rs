//! A frame that is compared: as it is, and as it is simulated without the effects found and with them.

use std::sync::Arc;

use super::sharp::Sharp;
use shutterbug::plane::Plane;

/// One held-out frame: real, simulated before and after, and what is known of its pixels.
pub(crate) struct Compared<'a> {
    pub index: usize,
    pub real: &'a Plane<f32>,
    pub before: &'a Plane<f32>,
    pub after: &'a Plane<f32>,
    pub mask: Option<&'a Plane<f32>>,
    pub sharp: &'a Sharp,
}

/// One frame, before and after.
pub(crate) struct Shown {
    pub index: usize,
    pub start_s: f64,
    pub held_out: bool,
    pub scores: [f64; 2],
    pub real: Arc<Plane<f32>>,
    pub before: Arc<Plane<f32>>,
    pub after: Arc<Plane<f32>>,
}

pub(crate) fn bytes(plane: &Plane<f32>) -> Plane<u8> {
    let data = plane.data.iter().map(|v| (v + 0.5).clamp(0.0, 255.0) as u8).collect();
    Plane { width: plane.width, height: plane.height, channels: plane.channels, data }
}
