//! Frames from outside with several motion images: as [`super::paper_gather`], but what a line sees has come the way
//! that the motion says from the colour's instant on: its integral. Twin of `glsl/outside_gather.comp`.

use super::paper_gather::{Push, gather};
use crate::plane::Plane;

/// As [`super::paper_gather::paper_gather`].
///
/// # Panics
/// As there.
pub fn outside_gather(push: &Push, color: &Plane<f32>, motion: &[Plane<f32>]) -> Plane<f32> {
    gather(push, color, motion, true)
}
