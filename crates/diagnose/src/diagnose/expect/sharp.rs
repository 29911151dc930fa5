//! What the sharp planes of a frame tell.

use shutterbug::plane::Plane;

/// What a frame is like, whatever the effects: from the sharp planes at the middle of the frame's likely exposure.
#[derive(Clone, Debug)]
pub(crate) struct Sharp {
    /// Speed of the content, px/s, shape `[height, width, 2]`.
    pub velocity: Plane<f32>,
    /// The part of it that is not the camera's, px/s; empty where no object moves.
    pub own: Option<Plane<f32>>,
    /// Distance along the optical axis, m; infinite where nothing is.
    pub depth: Plane<f32>,
    /// 1 where geometry covers the pixel.
    pub coverage: Plane<f32>,
}
