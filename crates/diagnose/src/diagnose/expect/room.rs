//! What of the description may be taken to be wrong.

use serde::{Deserialize, Serialize};
use shutterbug::chain::Moments;
use shutterbug::effects;

/// Factors on the radiance of surfaces.
pub(crate) const SURFACES: &str = "scene_radiance";
/// Errors of poses that change from frame to frame.
pub(crate) const POSES: &str = "pose_error";
/// What may be wrong with the description, in the order in which it is tried.
pub(crate) const NAMES: [&str; 2] = [SURFACES, POSES];

/// Whether a name is one of the description's.
pub(crate) fn is_description(name: &str) -> bool {
    NAMES.contains(&name)
}

/// Whether a name is that of the surfaces' factors.
pub(crate) fn is_of_surfaces(name: &str) -> bool {
    name == SURFACES
}

/// Whether an effect is a constant factor on the radiance of each colour.
pub(crate) fn is_constant_factor(name: &str) -> bool {
    ["exposure_gain", "white_balance"].contains(&name)
}

/// Whether an effect changes each value by what it is: a surface that stays as bright is changed as by a factor of its
/// own.
pub(crate) fn bends_values(name: &str) -> bool {
    let moments = effects::by_id(name).map(|e| e.moments());
    moments.is_some_and(|m| matches!(m, Moments::Affine(_) | Moments::Curve | Moments::Colors(_)))
}

/// Whether free factors of surfaces are all that an effect could do. Beside them a constant factor cannot be told from
/// the power of the lamps, and what it seems to explain is what they have not come to yet.
pub(crate) fn is_in_surfaces(name: &str, set: &[&str]) -> bool {
    is_constant_factor(name) && set.iter().any(|n| is_of_surfaces(n))
}

/// What of the description is taken to be wrong: part of every point of a search.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Room {
    /// Whether surfaces have factors of their own.
    pub radiance: bool,
    /// By place: how far the camera is from its pose, in its own frame: rotation vector (rad), then position (m). Empty
    /// where the poses are right.
    pub poses: Vec<[f64; 6]>,
}

impl Room {
    /// The same without one of [`NAMES`].
    pub(crate) fn without(&self, name: &str) -> Self {
        let mut room = self.clone();
        match name {
            SURFACES => room.radiance = false,
            POSES => room.poses.clear(),
            _ => {}
        }
        room
    }

    /// Whether two rooms leave the same open.
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        self.radiance == other.radiance && self.poses.is_empty() == other.poses.is_empty()
    }
}
