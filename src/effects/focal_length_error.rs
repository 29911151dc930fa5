//! The lens is longer or shorter than `camera.toml` says: true fx, fy = ratio times those (CAPTURE contract). Acts where an
//! engine is given its intrinsics: [`crate::capture::Capture::true_intrinsics`].

use crate::camera::Intrinsics;
use crate::chain::{Effect, ParamSpec, Settings, Stage};

/// The effect; its values live in [`Settings`].
pub struct FocalLengthError;

const SPECS: &[ParamSpec] =
    &[ParamSpec::number("ratio", "", (0.5, 2.0), 1.0, "true focal length over that of camera.toml")];

impl FocalLengthError {
    /// The true camera's intrinsics.
    pub fn apply(settings: &Settings, intrinsics: &Intrinsics) -> Intrinsics {
        let ratio = settings.number("focal_length_error", "ratio", 1.0);
        Intrinsics { fx: ratio * intrinsics.fx, fy: ratio * intrinsics.fy, ..*intrinsics }
    }
}

impl Effect for FocalLengthError {
    fn id(&self) -> &'static str {
        "focal_length_error"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::SetUp
    }
}
